// Why something is as it is, in words: what each inhibit, stop reason and fault means, and what to
// do about it. One table for the journal, `status`, `monitor`, `replay` and tools/NO_RESULT.md,
// which is generated from it. Allocates: not on the real-time thread.
#pragma once

#include <string>
#include <string_view>

#include "daemon/core/base/faults.h"
#include "daemon/core/experiment/arming.h"
#include "daemon/core/experiment/experiment.h"

namespace beltgrip::daemon {

struct Words {
  std::string_view means, remedy;  // remedy empty: there is nothing to do
};
const Words& words_of(Inhibit inhibit);
const Words& words_of(Fault fault);
// bound: of an experiment that gave a lower bound.
Words words_of(estimator::StopReason reason, bool bound = false);

// As it is told: with the figure beside its limit where there is one.
struct Reason {
  std::string name, means, figure, remedy;  // figure, remedy: empty where there is none
  friend bool operator==(const Reason&, const Reason&) = default;
};
Reason reason_of(Inhibit inhibit, std::string figure);
Reason reason_of(Fault fault, std::string figure);
// "speed (92.1 rad/s, limit 100 rad/s): the primary shaft turns ...; to do: begin at a higher
// speed"
std::string reason_text(const Reason& reason);

// Of an experiment that gave no value and no bound. lost: the roles that were lost as it ended,
// where they are known.
std::string why_no_value(const ExperimentResult& result, const std::string& lost = "");
// Why it ended; where nothing is known of mu_max for another reason, that first.
std::string why(const ExperimentResult& result, const std::string& lost = "");
// What to do about it; empty: nothing.
std::string_view remedy_of(const ExperimentResult& result);
bool has_bound(const ExperimentResult& result);  // a lower bound of mu_max, no value

}  // namespace beltgrip::daemon
