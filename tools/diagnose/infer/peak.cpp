#include "tools/diagnose/infer/peak.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "estimator/statistics/order.h"
#include "tools/diagnose/model/curve_family.h"

namespace beltgrip::diagnose {
namespace {

constexpr double kStep = 0.005;          // of the slip at the peak
constexpr std::size_t kFarSamples = 10;  // chosen, a second in all: fewer may be noise

// How far the samples of a stop go, in units of the curve's abscissa.
double reached(const Engine& engine, const ModelState& state, int stop) {
  std::vector<double> feet;
  for (const int run : engine.used()) {
    const ExperimentData& data = engine.campaign().runs[static_cast<std::size_t>(run)];
    const Residuals at = residuals_of(engine.campaign(), run, state);
    for (int k = 0; k < data.size(); ++k) {
      const auto i = static_cast<std::size_t>(k);
      if (data.valid[i] && data.stop[i] == stop) feet.push_back(std::abs(at.foot[k]));
    }
  }
  if (feet.size() <= kFarSamples) return 0.0;
  return estimator::at_rank(feet, feet.size() - kFarSamples);
}

Eigen::Index column_of(const Engine& engine, int parameter) {
  const std::vector<int>& all = engine.active_nuisances();
  return std::find(all.begin(), all.end(), parameter) - all.begin();
}

}  // namespace

bool uses_stop(const Engine& engine, int stop) {
  const int slip = stop == kLowStop ? kLnPeakSlipLow : kLnPeakSlipOverdrive;
  const std::vector<int>& all = engine.active_nuisances();
  return std::find(all.begin(), all.end(), slip) != all.end();
}

FittedPeak fitted_peak(const Engine& engine, const Hypothesis& hypothesis, int stop) {
  const ModelState& state = hypothesis.state;
  const bool low = stop == kLowStop;
  const int first = low ? kShapeLow : kShapeOverdrive;
  const int slip = low ? kLnPeakSlipLow : kLnPeakSlipOverdrive;
  const CurveShape curve(
      std::span<const double, kShapeKnots>(state.nuisance.data() + first, kShapeKnots), 0.0);
  const double end = reached(engine, state, stop);
  double x = 1.0, value = 1.0;
  for (double at = kStep; at <= end; at += kStep) {
    if (const double here = curve.evaluate(at).value; here > value) {
      x = at;
      value = here;
    }
  }
  // Its height moves with that of the curve there, its place with the slope.
  const double bend =
      (curve.evaluate(x + kStep).slope - curve.evaluate(x - kStep).slope) / (2.0 * kStep);
  const bool is_inside = x + kStep < std::max(end, 1.0) && bend < 0.0;
  const Eigen::MatrixXd& covariance = hypothesis.fit.covariance;
  Eigen::VectorXd height = Eigen::VectorXd::Zero(covariance.rows());
  Eigen::VectorXd place = Eigen::VectorXd::Zero(covariance.rows());
  height[column_of(engine, kLnMuMax)] = engine.scale(kLnMuMax);
  place[column_of(engine, slip)] = engine.scale(slip);
  // The form at the low end stop is that in overdrive, where that is used, and what it differs by.
  for (const int of : {kShapeOverdrive, kShapeLow}) {
    if (of != first && !(low && uses_stop(engine, kOverdriveStop))) continue;
    for (int mode = 0; mode < kShapeKnots; ++mode) {
      const Eigen::Index column = column_of(engine, of + mode);
      const CurveShape& shape = mode_shape(mode);
      const double unit = engine.scale(of + mode);
      height[column] = unit * shape.departure(spline_position(x)) / value;
      const double slope = (shape.departure(spline_position(x + kStep)) -
                            shape.departure(spline_position(x - kStep))) /
                           (2.0 * kStep);
      if (is_inside) place[column] = -unit * slope / (bend * x);
    }
  }
  const auto sigma = [&](const Eigen::VectorXd& lever, double form) {
    return std::sqrt(std::max(lever.dot(covariance * lever), 0.0) + form * form);
  };
  // Of what lies above the last samples the form alone tells.
  const double beyond =
      end < x ? std::log(value / std::max(curve.evaluate(end).value, 0.1 * value)) : 0.0;
  return {state.nuisance[kLnMuMax] + std::log(value),
          sigma(height, std::hypot(kMuForm, kBeyondForm * beyond)),
          state.nuisance[slip] + std::log(x), sigma(place, kSlipForm)};
}

}  // namespace beltgrip::diagnose
