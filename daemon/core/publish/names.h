// The text of every enumeration that leaves the daemon: in BeltGrip's frames as the value tables of
// beltgrip.dbc, in the journal, the history, `status` and `replay`. That of a stop reason stands
// with its cause (input/stop_cause.h).
#pragma once

#include <string_view>

#include "daemon/core/experiment/experiment.h"
#include "daemon/core/input/stop_cause.h"
#include "estimator/method/slip_curve_estimator.h"

namespace beltgrip::daemon {

std::string_view state_name(State state);
std::string_view outcome_name(Outcome outcome);
std::string_view phase_name(estimator::Phase phase);
std::string_view kind_name(estimator::PeakKind kind);
std::string_view direction_name(estimator::Direction direction);
std::string_view end_stop_name(estimator::EndStop end_stop);

}  // namespace beltgrip::daemon
