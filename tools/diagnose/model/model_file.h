// Between the model file and what a diagnosis fits: constants of the machine and sizes of effects.
// Tools only.
#pragma once

#include <vector>

#include "daemon/core/config/options/config_model.h"
#include "tools/diagnose/model/effects/effect.h"

namespace beltgrip::diagnose {

using daemon::model_text;
using daemon::ModelEffect;
using daemon::ModelError;
using daemon::ModelFile;
using daemon::parse_model;
using daemon::read_model;

// The nominal machine without any file: [friction] and [driveline] with their defaults.
ModelFile nominal_model(const estimator::VariatorParameters& variator);

// The machine's constants of a model as nominal values of a fit, and back: once, for what the
// turning oil's force was off by goes into the value that [variator] has.
NuisanceTable nuisances_of(const ModelFile& model);
void store_machine(const Eigen::VectorXd& nuisance, ModelFile& model);
// Values of the slots that a model switches on; an effect that these data cannot carry is left out.
Eigen::VectorXd slot_values(const ModelFile& model, const std::vector<Slot>& slots);
// Adds the values of the slots to the model's effects.
void store_effects(const std::vector<Slot>& slots, const Eigen::VectorXd& value,
                   const Eigen::VectorXd& nuisance, ModelFile& model);

}  // namespace beltgrip::diagnose
