// What a finding is worth where it matters: the daemon's estimator once more over what was
// measured, told the model before and the model after.
#pragma once

#include <optional>

#include "daemon/core/config/options/config.h"
#include "daemon/core/experiment/experiment.h"
#include "tools/diagnose/data/diagnosis.h"
#include "tools/diagnose/data/signal_table.h"

namespace beltgrip::diagnose {

// A table as one experiment from its first sample to its stop, as with trigger "always"; nothing
// without both speeds, the secondary pressure and a torque. Of the configuration [variator],
// [sensors], [estimator] and the corrections of a model count.
std::optional<daemon::ExperimentResult> estimate(const SignalTable& table, daemon::Config config);

// Of an experiment with a value.
std::optional<Measured> measured(const daemon::ExperimentResult& experiment,
                                 const estimator::VariatorParameters& variator);

}  // namespace beltgrip::diagnose
