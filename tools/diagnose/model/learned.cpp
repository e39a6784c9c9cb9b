#include "tools/diagnose/model/learned.h"

#include <algorithm>
#include <cmath>

namespace beltgrip::diagnose {
namespace {

using Eigen::ArrayXd;
using Eigen::Index;
using estimator::LearnedPoint;
using estimator::LearnedVariable;
using estimator::Stage;

constexpr double kLowPass_s = 3.0;
constexpr double kLeast = 0.05;  // of a factor

Stage stage_of(LearnedPoint point) {
  switch (point) {
    case LearnedPoint::kTorque:
    case LearnedPoint::kTorqueGain:
      return Stage::kMeasurement;
    case LearnedPoint::kClampForce:
      return Stage::kForce;
    case LearnedPoint::kRatio:
      return Stage::kRatio;
    case LearnedPoint::kFriction:
      break;
  }
  return Stage::kFriction;
}

}  // namespace

ArrayXd low_passed(const ArrayXd& in, double dt_s) {
  const auto half = static_cast<Index>(0.5 * kLowPass_s / dt_s);
  ArrayXd out = in;
  double sum = 0.0, count = 0.0;
  Index first = 0, behind = 0;
  const auto add = [&](double value, double sign) {
    if (!std::isfinite(value)) return;
    sum += sign * value;
    count += sign;
  };
  for (Index k = 0; k < in.size(); ++k) {
    for (; behind < std::min(in.size(), k + half + 1); ++behind) add(in[behind], 1.0);
    for (; first < k - half; ++first) add(in[first], -1.0);
    if (count > 0.5) out[k] = sum / count;
  }
  return out;
}

ArrayXd recorded(const ExperimentData& run, LearnedVariable variable) {
  switch (variable) {
    case LearnedVariable::kOilTemperature:
      return run.temperature.present ? run.temperature.value : ArrayXd();
    case LearnedVariable::kPrimarySpeed:
      return run.omega_p.slow;
    case LearnedVariable::kPrimaryPressure:
      return run.pressure_p.present ? run.pressure_p.slow : ArrayXd();
    case LearnedVariable::kSecondaryPressure:
      return run.pressure.slow;
    case LearnedVariable::kTorque:
      break;
  }
  if (run.valid_count == 0) return run.torque.slow;
  // One that is held gives way where the belt slips, and follows the friction then.
  const Spread torque_Nm = spread_of(run, run.torque);
  return torque_Nm.moves() ? run.torque.slow : ArrayXd::Constant(run.size(), torque_Nm.middle);
}

ArrayXd regressor(const ExperimentData& run, LearnedVariable variable) {
  const ArrayXd value = recorded(run, variable);
  // Of these it is the slow copy already.
  const bool is_slow = variable == LearnedVariable::kPrimarySpeed ||
                       variable == LearnedVariable::kPrimaryPressure ||
                       variable == LearnedVariable::kSecondaryPressure;
  return is_slow || value.size() == 0 ? value : low_passed(value, run.dt_s);
}

void apply_learned(Context& c, const estimator::LearnedTerm& term, Stage stage) {
  if (stage_of(term.point) != stage || term.count == 0) return;
  const ArrayXd variable = regressor(c.run, term.variable);
  if (variable.size() == 0) return;
  const ArrayXd by = variable.unaryExpr([&](double x) { return term.at(x); });
  switch (term.point) {
    case LearnedPoint::kTorque:
      c.torque -= by;
      break;
    case LearnedPoint::kTorqueGain:  // of the slow copy, as of torque_gain
      take_torque_share(by / (1.0 + by).max(kLeast), c);
      break;
    case LearnedPoint::kClampForce:
      c.force_N += by;
      break;
    case LearnedPoint::kRatio:
      c.ln_ratio += (1.0 + by).max(kLeast).log();
      break;
    case LearnedPoint::kFriction:
      c.ln_friction += (1.0 + by).max(kLeast).log();
      break;
  }
}

}  // namespace beltgrip::diagnose
