#include "daemon/core/publish/names.h"

#include <array>
#include <cstddef>

namespace beltgrip::daemon {

namespace {

constexpr std::array<std::string_view, kStateCount> kStates{
    "Inhibited", "Idle", "Settling", "Ramping", "Releasing", "Evaluating", "Cooldown", "Fault"};
constexpr std::array<std::string_view, 4> kOutcomes{"None", "Completed", "Inconclusive", "Aborted"};
constexpr std::array<std::string_view, estimator::kStopReasonCount> kReasons{
    "None",        "Slope",      "Confidence",  "Slip",     "SlipRate", "SlipEnergy",
    "Time",        "ForceFloor", "EngineSpeed", "Torque",   "Ratio",    "Inputs",
    "Permission",  "Driver",     "Bus",         "Shutdown", "TraceEnd", "ClampNotFollowed",
    "InputFrozen", "Room",       "Lag"};
constexpr std::array<std::string_view, 4> kPhases{"Quiet", "Excited", "Peak", "MacroSlip"};
constexpr std::array<std::string_view, 3> kKinds{"None", "Value", "LowerBound"};

template <std::size_t kCount, typename Enum>
std::string_view at(const std::array<std::string_view, kCount>& names, Enum value) {
  return names[static_cast<std::size_t>(value)];
}

}  // namespace

std::string_view state_name(State state) { return at(kStates, state); }
std::string_view outcome_name(Outcome outcome) { return at(kOutcomes, outcome); }
std::string_view stop_reason_name(estimator::StopReason reason) { return at(kReasons, reason); }
std::string_view phase_name(estimator::Phase phase) { return at(kPhases, phase); }
std::string_view kind_name(estimator::PeakKind kind) { return at(kKinds, kind); }
std::string_view direction_name(estimator::Direction direction) {
  return direction == estimator::Direction::kDrive ? "Drive" : "Overrun";
}
std::string_view end_stop_name(estimator::EndStop end_stop) {
  return end_stop == estimator::EndStop::kLow ? "Low" : "Overdrive";
}

}  // namespace beltgrip::daemon
