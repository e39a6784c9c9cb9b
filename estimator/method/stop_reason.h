// Why an experiment ends.
#pragma once

#include <cstddef>
#include <cstdint>

namespace beltgrip::estimator {

// Why a method or the daemon stops; the first reason wins. Wire values of
// BeltGripStatus.StopReason: a new one has a row in the tables of daemon/core/input/stop_cause (its
// name and words) and daemon/core/reasons (what to do), a value in can_dbc/beltgrip.dbc, a bound in
// daemon/core/guard/tx_gate and a row in tools/NO_RESULT.md.
enum class StopReason : std::uint8_t {
  kNone,
  kSlope,
  kConfidence,
  kSlip,
  kSlipRate,
  kSlipEnergy,
  kTime,
  kForceFloor,
  kEngineSpeed,
  kTorque,
  kRatio,
  kInputs,
  kPermission,
  kDriver,
  kBus,
  kShutdown,
  kTraceEnd,
  kClampNotFollowed,  // the force does not follow the request
  kInputFrozen,
  kRoom,  // slip left is too little
  kLag
};
inline constexpr std::size_t kStopReasonCount = 21;

}  // namespace beltgrip::estimator
