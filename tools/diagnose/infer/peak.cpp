#include "tools/diagnose/infer/peak.h"

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include "estimator/statistics/order.h"
#include "tools/diagnose/model/curve_family.h"

namespace beltgrip::diagnose {
namespace {

constexpr double kStep = 0.005;          // of the slip at the peak
constexpr std::size_t kFarSamples = 10;  // chosen, a second in all: fewer may be noise
constexpr double kLeastForce_N = 50.0;   // no ratio by less
constexpr double kLeastShare = 0.1;  // of the friction at the curve's peak: no logarithm of less

// Until the belt is seen to run away the friction that it needs grows as torque and clamp force
// move; what the curve still rises by then, its slip cannot grow so fast for.
double rise_to_peak(const Engine& engine, const ExperimentData& data, const RunAway& away, double x,
                    double peak_slip_share) {
  const estimator::VariatorParameters& variator = engine.campaign().variator;
  const int k = away.last;
  const double area_m2 = variator.secondary_piston_area_m2;
  const double force_N =
      std::max(area_m2 * data.pressure.slow[k] + variator.secondary_spring_force_N, kLeastForce_N);
  const double rate_1_s = data.torque.slow_slope[k] / data.torque.slow[k] -
                          area_m2 * data.pressure.slow_slope[k] / force_N;
  if (!(rate_1_s > 0.0)) return 0.0;
  // Parabola: half the slope there, per slip, over what is left to the peak.
  const double left_share = peak_slip_share * std::max(1.0 - x, 0.0);
  return rate_1_s * (away.gap_s + 0.5 * left_share / kSlipRateMax_1_s);
}

ReachedCurve reached_at(const Engine& engine, const ModelState& state, int stop) {
  const int slip = stop == kLowStop ? kLnPeakSlipLow : kLnPeakSlipOverdrive;
  const double peak_slip_share = std::exp(state.nuisance[slip]);
  std::vector<double> feet;
  ReachedCurve out;
  for (const int run : engine.used()) {
    const ExperimentData& data = engine.campaign().runs[static_cast<std::size_t>(run)];
    const Residuals at = residuals_of(engine.campaign(), run, state);
    for (int k = 0; k < data.size(); ++k) {
      const auto i = static_cast<std::size_t>(k);
      if (data.valid[i] && data.stop[i] == stop) feet.push_back(std::abs(at.foot[k]));
    }
    for (const RunAway& away : data.run_aways) {
      if (data.stop[static_cast<std::size_t>(away.last)] != stop) continue;
      const double x = std::abs(at.foot[away.last]);
      out.run_aways.push_back({x, rise_to_peak(engine, data, away, x, peak_slip_share)});
    }
  }
  if (feet.size() > kFarSamples) out.end = estimator::at_rank(feet, feet.size() - kFarSamples);
  return out;
}

Eigen::Index column_of(const Engine& engine, int parameter) {
  const std::vector<int>& all = engine.active_nuisances();
  return std::find(all.begin(), all.end(), parameter) - all.begin();
}

}  // namespace

CurveHeight height_beyond(const CurveShape& curve, const ReachedCurve& reached, double ln_peak,
                          double variance_of_one) {
  const auto ln_at = [&](double x) {
    return std::log(std::max(curve.evaluate(x).value, kLeastShare));
  };
  const double ln_end = ln_at(reached.end);
  const double beyond = ln_peak - ln_end;
  if (!(beyond > 0.0)) return {ln_peak, 0.0};
  // Of what lies anywhere between two bounds the variance is a twelfth of their distance's square.
  constexpr double kBetween = 12.0;
  double weight = kBetween / (beyond * beyond);
  double sum = weight * (ln_end + 0.5 * beyond);
  for (const ReachedCurve::RanAway& each : reached.run_aways) {
    const double here = 1.0 / (each.rise * each.rise / kBetween + variance_of_one);
    weight += here;
    sum += here * (ln_at(each.x) + 0.5 * each.rise);
  }
  return {std::clamp(sum / weight, ln_end, ln_peak), 1.0 / std::sqrt(weight)};
}

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
  const ReachedCurve reached = reached_at(engine, state, stop);
  const double end = reached.end;
  double x = 1.0, value = 1.0;
  for (double at = kStep; at <= end; at += kStep) {
    if (const double here = curve.evaluate(at).value; here > value) {
      x = at;
      value = here;
    }
  }
  const bool is_beyond = end < x;
  const double ln_peak = std::log(value);
  const CurveHeight told =
      is_beyond
          ? height_beyond(curve, reached, ln_peak, kMuForm * kMuForm + engine.scatter().variance[0])
          : CurveHeight{ln_peak, 0.0};
  // Its height moves with that of the curve there, or where the samples end, its place with the
  // slope.
  const double at_height = is_beyond ? end : x;
  const double height_there = std::max(curve.evaluate(at_height).value, kLeastShare);
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
      height[column] = unit * shape.departure(spline_position(at_height)) / height_there;
      const double slope = (shape.departure(spline_position(x + kStep)) -
                            shape.departure(spline_position(x - kStep))) /
                           (2.0 * kStep);
      if (is_inside) place[column] = -unit * slope / (bend * x);
    }
  }
  const auto sigma = [&](const Eigen::VectorXd& lever, double form) {
    return std::sqrt(std::max(lever.dot(covariance * lever), 0.0) + form * form);
  };
  const double ln_mu_sigma = sigma(height, std::hypot(kMuForm, told.sigma));
  return {state.nuisance[kLnMuMax] + told.ln, ln_mu_sigma, state.nuisance[slip] + std::log(x),
          sigma(place, kSlipForm), std::move(height)};
}

}  // namespace beltgrip::diagnose
