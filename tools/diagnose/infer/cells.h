// Any function of a recorded variable at one point of the model: how much better the data are
// explained with it, the machine's constants refitted and the scatter between experiments estimated
// anew with it, so that scatter does not take what repeats. Algebra on inner products alone.
#pragma once

#include <array>
#include <string_view>
#include <vector>

#include "tools/diagnose/infer/engine.h"
#include "tools/diagnose/infer/index_variables.h"

namespace beltgrip::diagnose {

// Where a function acts.
using Injection = estimator::LearnedPoint;
struct InjectionRow {
  Injection injection;
  std::string_view acts_on;
  double unit;  // share, share, Nm, share, N: a size that is met in practice
  // As a law's size is told: behind the number, which is so many times what it is inside.
  std::string_view told_unit;
  double told_per_SI = 1.0;
};
inline constexpr std::array<InjectionRow, 5> kInjections{{
    {Injection::kFriction, "friction", 0.02, "%", 100.0},
    {Injection::kRatio, "ratio", 1e-3, "%", 100.0},
    {Injection::kTorque, "torque", 1.0, "Nm"},
    {Injection::kTorqueGain, "torque_gain", 0.02, "%", 100.0},
    {Injection::kClampForce, "clamp_force", 100.0, "N"},
}};

// A function stands as its values at equidistant knots over the abscissa, straight in between.
inline constexpr int kCellKnots = 21;
using KnotVector = Eigen::Matrix<double, kCellKnots, 1>;
using KnotSquare = Eigen::Matrix<double, kCellKnots, kCellKnots>;

// What the data say of a function, everything else taken out: information and score, at one
// assumption on the scatter between experiments.
struct CellScore {
  KnotSquare information;
  KnotVector score;
  double log_likelihood = 0.0;  // without the function
  double misfit = 0.0;          // the same: whitened sum of squares
};

struct Cell {
  const InjectionRow* injection = nullptr;
  Abscissa abscissa;
  // From the friction curve by the form that friction usually has, and by nothing else: it may
  // explain what fails a test, and fails none itself.
  bool is_told_by_form = false;
  std::vector<CellScore> scores;  // by scatter, from the fitted to the usual
  double law_gain = 0.0;          // twice the log evidence of the best family of laws over none
  double smooth_gain = 0.0;       // the same of a smooth function
  double gain() const { return law_gain > smooth_gain ? law_gain : smooth_gain; }
  // The function, in units of the row: the mean over laws and smooth functions by their evidence.
  KnotVector mean = KnotVector::Zero();
  KnotSquare covariance = KnotSquare::Zero();
  double share = 0.0;         // of the misfit that it explains
  double log_evidence = 0.0;  // over none, averaged over all that was assumed
};

// All cells at the engine's state, on top of what it has accepted; the best first.
std::vector<Cell> score_cells(const Engine& engine);

// Evidence and posterior of the function, given its scores; fills gains, mean and covariance.
void judge_cell(Cell& cell);

}  // namespace beltgrip::diagnose
