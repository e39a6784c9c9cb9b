#include "daemon/core/publish/names.h"

#include <array>
#include <cstddef>

#include "daemon/core/base/named.h"

namespace beltgrip::daemon {

namespace {

using estimator::PeakKind;
using estimator::Phase;

constexpr std::array<Named<State>, kStateCount> kStates{{{State::kInhibited, "Inhibited"},
                                                         {State::kIdle, "Idle"},
                                                         {State::kSettling, "Settling"},
                                                         {State::kRamping, "Ramping"},
                                                         {State::kReleasing, "Releasing"},
                                                         {State::kEvaluating, "Evaluating"},
                                                         {State::kCooldown, "Cooldown"},
                                                         {State::kFault, "Fault"}}};
constexpr std::array<Named<Outcome>, 4> kOutcomes{{{Outcome::kNone, "None"},
                                                   {Outcome::kCompleted, "Completed"},
                                                   {Outcome::kInconclusive, "Inconclusive"},
                                                   {Outcome::kAborted, "Aborted"}}};
constexpr std::array<Named<Phase>, 4> kPhases{{{Phase::kQuiet, "Quiet"},
                                               {Phase::kExcited, "Excited"},
                                               {Phase::kPeak, "Peak"},
                                               {Phase::kMacroSlip, "MacroSlip"}}};
constexpr std::array<Named<PeakKind>, 3> kKinds{{{PeakKind::kNone, "None"},
                                                 {PeakKind::kValue, "Value"},
                                                 {PeakKind::kLowerBound, "LowerBound"}}};
static_assert(in_wire_order(kStates) && in_wire_order(kOutcomes) && in_wire_order(kPhases) &&
              in_wire_order(kKinds));

template <std::size_t kCount, typename Enum>
std::string_view at(const std::array<Named<Enum>, kCount>& names, Enum value) {
  return names[static_cast<std::size_t>(value)].name;
}

}  // namespace

std::string_view state_name(State state) { return at(kStates, state); }
std::string_view outcome_name(Outcome outcome) { return at(kOutcomes, outcome); }
std::string_view phase_name(estimator::Phase phase) { return at(kPhases, phase); }
std::string_view kind_name(estimator::PeakKind kind) { return at(kKinds, kind); }
std::string_view direction_name(estimator::Direction direction) {
  return direction == estimator::Direction::kDrive ? "Drive" : "Overrun";
}
std::string_view end_stop_name(estimator::EndStop end_stop) {
  return end_stop == estimator::EndStop::kLow ? "Low" : "Overdrive";
}

}  // namespace beltgrip::daemon
