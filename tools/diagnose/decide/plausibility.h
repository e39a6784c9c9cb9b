// What no belt drive does, whatever it is like: wrong units and signs, channels that stand still,
// logs of two machines, the same log twice. Where something of the kind is there, no name is given.
#pragma once

#include <map>
#include <optional>
#include <string>
#include <vector>

#include "tools/diagnose/data/diagnosis.h"
#include "tools/diagnose/data/experiment_data.h"

namespace beltgrip::diagnose {

struct Implausible {
  std::vector<std::string> notes;
  std::optional<Unexplained> impossible;
  // Experiments whose two torques cannot be of one variator; with a cause between them they may.
  std::vector<std::string> torques;
};

// The same data under two names would count as two experiments that agree in everything.
void drop_copies(std::vector<SignalTable>& tables, Implausible& doubts);
// The same of experiments that are held out of the fit: what it has seen is none of them.
void drop_copies_of(const std::vector<SignalTable>& fitted, std::vector<SignalTable>& held_out,
                    Implausible& doubts);

// An optional channel that some experiments have and others have not would make of the others what
// it is not: left out of all.
void drop_uneven_channels(std::vector<ExperimentData>& runs, Implausible& doubts);

void check_same_machine(const std::vector<ExperimentData>& runs,
                        const estimator::VariatorParameters& variator, Implausible& doubts);
void check_torques(const std::vector<ExperimentData>& runs, Implausible& doubts);
// Where nothing that was named makes them those of one variator.
void torques_are_impossible(Implausible& doubts);
// By what was measured alone: the fitted mu_max may lie far beyond what the data reached.
void check_friction(const std::vector<ExperimentData>& runs,
                    const estimator::VariatorParameters& variator, Implausible& doubts);
// Friction at its peak that is less than any belt has.
bool is_no_belts(double mu_max);
// By the fit of the machine's constants.
void check_fitted_friction(const std::map<std::string, Interval>& machine, Implausible& doubts);

}  // namespace beltgrip::diagnose
