// What the frames of a bus say, as they come: BeltGrip's own decoded and checked, all others
// counted. Frames and time in, a part of the View out; no clock, no I/O. Tools only.
#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "daemon/core/base/port.h"
#include "daemon/core/config/options/config.h"
#include "tools/monitor/own_frame_view.h"
#include "tools/monitor/view.h"

namespace beltgrip::monitor {

// Events of the last second, in tenths.
class Rate {
 public:
  void add(daemon::MonoTime t, double amount);
  double per_second(daemon::MonoTime now) const;

 private:
  static constexpr daemon::Duration kCell = 100 * daemon::kMillisecond;
  static constexpr std::int64_t kCells = 10;
  std::array<double, kCells + 1> sums_{};
  std::int64_t newest_ = 0;  // number of its cell
  bool any_ = false;
  daemon::MonoTime first_;
};

// Bits of a frame on the wire with the pause behind it, without stuff bits.
int frame_bits(const can::CanFrame& frame);

class BusModel {
 public:
  explicit BusModel(const daemon::FrameIdentifiers& identifiers);

  void on_frame(daemon::MonoTime t, const can::CanFrame& frame);
  void on_lost(std::uint32_t frames) { traffic_.lost += frames; }
  // Of BeltGrip, wherever it comes from.
  void on_own_frame(daemon::MonoTime t, const can::CanFrame& frame);
  bool is_own(const can::CanFrame& frame) const;
  bool heard() const { return heard_.has_value(); }
  void show(View& view, daemon::MonoTime now) const;

 private:
  void take_slip(const OwnFrameView& frame);
  void take_estimate(daemon::MonoTime t, const OwnFrameView& frame);
  void take_status(daemon::MonoTime t, const OwnFrameView& frame);
  void take_clamp(const OwnFrameView& frame);
  void distrust(const can::CanFrame& frame, std::uint64_t Distrust::*count, const std::string& why);
  void add_point(double sigma_percent, double mu);

  daemon::FrameIdentifiers identifiers_;
  OwnFrameDecoder decoder_;
  Traffic traffic_;
  Rate frames_, bits_;
  std::optional<daemon::MonoTime> begun_, heard_first_, heard_;
  Distrust distrust_;
  View said_;  // its fields of BeltGrip's own frames
  estimator::Phase phase_ = estimator::Phase::kQuiet;
  std::optional<double> count_;
  double sigma_most_percent_ = 0.0;
  std::optional<daemon::MonoTime> result_since_;  // its status may still come
};

}  // namespace beltgrip::monitor
