// Where the gain of one fit over another lies: in the course of the residuals, or in single
// samples. The noise of a sample counts by what the hypothesis makes of it in torque, so that one
// with more torque at the belt may fit a little better all along without any other course.
#pragma once

#include "tools/diagnose/infer/engine.h"

namespace beltgrip::diagnose {

struct ResidualEnergy {
  double whole = 0.0;
  double slow = 0.0;  // of the means over blocks, by their samples
};
// Samples that are exactly zero are not there. from, to: of one stretch.
ResidualEnergy energy_of(const Eigen::VectorXd& white, Eigen::Index from, Eigen::Index to,
                         Eigen::Index block);

// Of twice the log likelihood that `with` gains over `without`: what no course of the residuals
// shows.
double gain_of_noise(const Engine& engine, const Hypothesis& without, const Hypothesis& with);

// `without` has a curve or a scatter between experiments that no machine has, `with` has none: that
// is a course, and two fits of which one is no machine compare nothing by their residuals.
bool mends_machine(const Hypothesis& without, const Hypothesis& with);

}  // namespace beltgrip::diagnose
