// The messages that BeltGrip publishes: values in, protected CAN frames out. Bit layout and value
// codes come from can_dbc/beltgrip.dbc, embedded at build time, so file and program cannot differ.
// Construction parses (start-up); pack() neither allocates nor throws (real-time thread).
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string_view>

#include "can_dbc/dbc/model.h"
#include "can_dbc/dbc/signal_codec.h"
#include "can_dbc/frame/can_frame.h"
#include "daemon/core/base/faults.h"
#include "daemon/core/config/options/config.h"
#include "daemon/core/experiment/experiment.h"
#include "estimator/method/slip_curve_estimator.h"

namespace beltgrip::daemon {

enum class OwnMessage : std::uint8_t { kEstimate, kSlip, kClamp, kStatus };
inline constexpr std::size_t kOwnMessageCount = 4;
inline constexpr std::uint8_t kOwnFrameLength = 8;

// Data id of the protection: the default identifier, whatever identifier is configured.
constexpr std::uint16_t own_data_id(OwnMessage message) {
  return static_cast<std::uint16_t>(0x6A0 + static_cast<unsigned>(message));
}
std::uint32_t own_identifier(const FrameIdentifiers& identifiers, OwnMessage message) noexcept;

std::string_view beltgrip_dbc_text();  // the text of can_dbc/beltgrip.dbc
const can::Database& own_database();   // the same, parsed

struct EstimateValues {
  estimator::PeakKind kind = estimator::PeakKind::kNone;
  double mu_max = 0.0;      // value or lower bound
  double mu_max_std = 0.0;  // with kValue only
  std::uint8_t experiment_count = 0;
  std::optional<double> min_clamp_force_N;  // of the last value, or of the history
};

struct SlipValues {
  bool macro_slip_stop = false;
  estimator::Phase phase = estimator::Phase::kQuiet;
  bool available = false;  // of the three values below
  double mu_star = 0.0;
  double sigma_star_percent = 0.0;
  double friction_slope = 0.0;  // 1 / percent slip
};

struct ClampValues {
  bool request_active = false;
  double secondary_force_N = 0.0;
};

struct StatusValues {
  State state = State::kInhibited;
  Outcome outcome = Outcome::kNone;
  estimator::StopReason stop_reason = estimator::StopReason::kNone;
  std::uint32_t faults = 0;
  friend bool operator==(const StatusValues&, const StatusValues&) = default;
};

class OwnFrames {
 public:
  explicit OwnFrames(const FrameIdentifiers& identifiers);

  // A value that is not finite is sent as not available, or as kind None where there is no such
  // code; one beyond the signal's range is sent as the range's end.
  can::CanFrame pack(const EstimateValues& values, std::uint8_t counter) const noexcept;
  can::CanFrame pack(const SlipValues& values, std::uint8_t counter) const noexcept;
  can::CanFrame pack(const ClampValues& values, std::uint8_t counter) const noexcept;
  can::CanFrame pack(const StatusValues& values, std::uint8_t counter) const noexcept;

 private:
  struct Field {
    can::SignalCodec codec;
    double scale = 1.0, minimum = 0.0, maximum = 0.0;
    std::uint64_t not_available = 0;  // raw code, where the DBC has one
  };
  static Field field(OwnMessage message, std::string_view signal);
  static void put(can::CanFrame& frame, const Field& field, double value) noexcept;
  static void put_or_not_available(can::CanFrame& frame, const Field& field, bool available,
                                   double value) noexcept;
  static void put_rounded_up(can::CanFrame& frame, const Field& field, double value) noexcept;
  can::CanFrame empty(OwnMessage message) const noexcept;

  FrameIdentifiers identifiers_;
  struct {
    Field kind, valid, mu_max, mu_max_std, count, min_force;
  } estimate_;
  struct {
    Field stop, phase, mu_star, sigma_star, slope;
  } slip_;
  struct {
    Field active, force;
  } clamp_;
  struct {
    Field state, outcome, reason;
    std::array<Field, kFaultCount> faults;
  } status_;
};

}  // namespace beltgrip::daemon
