// Causes without a name in the algebra on measured signals.
#pragma once

#include <Eigen/Core>

#include "estimator/physics/learned_term.h"
#include "estimator/physics/machine_effects.h"
#include "tools/diagnose/model/variator_model.h"

namespace beltgrip::diagnose {

// Mean over a window about each sample, of what is finite: a variable's own noise is no regressor.
Eigen::ArrayXd low_passed(const Eigen::ArrayXd& in, double dt_s);

// What a function depends on, sample by sample, not yet low-passed; empty: not recorded.
Eigen::ArrayXd recorded(const ExperimentData& run, estimator::LearnedVariable variable);

// The same as the function sees it. Torque and oil temperature low-passed; the slow copies of speed
// and primary pressure are not: their noise is far below what they cover, and a sweep of 9 s would
// lose a sixth of its amplitude.
Eigen::ArrayXd regressor(const ExperimentData& run, estimator::LearnedVariable variable);

// Does what the term does at this stage; nothing where its variable is not recorded.
void apply_learned(Context& context, const estimator::LearnedTerm& term, estimator::Stage stage);

}  // namespace beltgrip::diagnose
