// The daemon's own pipeline beside what is watched: it says what no frame says, the inputs and why
// no experiment begins; and of a log without frames of BeltGrip everything. Nothing it would send
// reaches a bus. Tools only.
#pragma once

#include <array>
#include <functional>

#include "daemon/core/base/outbox.h"
#include "daemon/core/base/port.h"
#include "daemon/core/config/options/config.h"
#include "daemon/core/loop/pipeline.h"
#include "daemon/core/observe/carried_record.h"
#include "daemon/core/observe/carried_window.h"
#include "tools/monitor/bus_model.h"
#include "tools/monitor/view.h"

namespace beltgrip::monitor {

class Shadow {
 public:
  using Sent = std::function<void(daemon::MonoTime, const can::CanFrame&)>;

  // sent: what the daemon would put on the first bus.
  Shadow(const daemon::Config& config, Sent sent);

  // In order; no frame of BeltGrip's own.
  void on_frame(const daemon::RxFrame& frame);
  // Takes every sample up to this instant.
  void advance(daemon::MonoTime now);
  void on_link(daemon::BusState state) { link_ = state; }
  void show(View& view, daemon::MonoTime now) const;

 private:
  void count_values(daemon::MonoTime t);
  void begin(daemon::MonoTime t);
  void sample();

  daemon::Config config_;
  daemon::Pipeline pipeline_;
  Sent sent_;
  daemon::Duration period_;
  bool begun_ = false;
  daemon::MonoTime next_;  // sample
  daemon::BusState link_ = daemon::BusState::kActive, link_said_ = daemon::BusState::kActive;
  daemon::Outbox outbox_;
  daemon::CarriedWatch carried_watch_;
  daemon::CarriedRecord carried_;
  std::uint64_t decoded_ = 0;
  std::array<daemon::MonoTime, daemon::kRoleCount> newest_{};
  std::array<Rate, daemon::kRoleCount> rates_;
};

}  // namespace beltgrip::monitor
