#include "tools/diagnose/residuals.h"

#include <algorithm>
#include <cmath>

namespace beltgrip::diagnose {
namespace {

using Eigen::ArrayXd;

Quantities quantities(const Campaign& campaign, const ExperimentData& data, int run,
                      const ModelState& state) {
  return evaluate(data, run, campaign.variator, state.nuisance,
                  Effects{&campaign.slots, campaign.switched_on + state.effects});
}

std::array<CurveShape, kStops> shapes(const Eigen::VectorXd& nuisance, const Quantities& q) {
  std::array<CurveShape, kStops> out;
  const double* values = nuisance.data();
  out[kOverdriveStop] =
      CurveShape(std::span<const double, kShapeKnots>(values + kShapeOverdrive, kShapeKnots),
                 q.fall[kOverdriveStop]);
  out[kLowStop] = CurveShape(std::span<const double, kShapeKnots>(values + kShapeLow, kShapeKnots),
                             q.fall[kLowStop]);
  return out;
}

double robust_sigma(std::vector<double>& values) {
  if (values.size() < 20) return 0.0;
  for (double& v : values) v = std::abs(v);
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return 1.4826 * *middle;
}

}  // namespace

Residuals residuals_of(const Campaign& campaign, int run, const ModelState& state) {
  const ExperimentData& data = campaign.runs[static_cast<std::size_t>(run)];
  const Quantities q = quantities(campaign, data, run, state);
  const auto curve = shapes(state.nuisance, q);
  const int n = data.size();
  Residuals out;
  out.value[kFrictionResidual] = ArrayXd::Zero(n);
  out.foot = ArrayXd::Zero(n);
  out.slope = ArrayXd::Zero(n);
  out.model_Nm = ArrayXd::Zero(n);
  out.weight = ArrayXd::Zero(n);
  const double slip_variance = campaign.noise.slip * campaign.noise.slip;
  const double torque_variance = campaign.noise.torque_Nm * campaign.noise.torque_Nm;
  for (int k = 0; k < n; ++k) {
    if (!data.valid[static_cast<std::size_t>(k)]) continue;
    const auto stop = static_cast<std::size_t>(data.stop[static_cast<std::size_t>(k)]);
    const double peak = std::exp(q.ln_peak_slip[stop]);
    const double capacity = q.capacity[k];
    double x = q.slip[k] / peak;
    double model = 0.0, slope = 0.0;
    // Foot point: Gauss-Newton, halved while the distance would grow.
    const auto at = [&](double where) {
      const CurveShape::Point point = curve[stop].evaluate(where);
      model = capacity * point.value;
      slope = capacity * point.slope / peak;
      const double gap_slip = q.slip[k] - where * peak;
      const double gap_torque = q.belt_torque[k] - model;
      return gap_slip * gap_slip / slip_variance + gap_torque * gap_torque / torque_variance;
    };
    double distance = at(x);
    for (int i = 0; i < 12; ++i) {
      const double gap_slip = q.slip[k] - x * peak;
      const double gap_torque = q.belt_torque[k] - model;
      double step = (gap_slip / slip_variance + slope * gap_torque / torque_variance) /
                    (1.0 / slip_variance + slope * slope / torque_variance) / peak;
      step = std::clamp(step, -0.5, 0.5);
      const double before = x;
      for (int halving = 0; halving < 6; ++halving, step *= 0.4) {
        x = before + step;
        if (const double there = at(x); there <= distance) {
          distance = there;
          break;
        }
        x = before;
      }
      if (x == before) {
        at(x);
        break;
      }
      if (std::abs(x - before) < 1e-7) break;
    }
    out.foot[k] = x;
    out.slope[k] = slope;
    out.model_Nm[k] = model;
    out.weight[k] = 1.0 / std::sqrt(torque_variance + slope * slope * slip_variance);
    out.value[kFrictionResidual][k] =
        (q.belt_torque[k] - model - slope * (q.slip[k] - x * peak)) * out.weight[k];
  }
  out.capacity = q.capacity;
  out.clean = data;
  for (int k = 0; k < n; ++k) {
    if (!data.valid[static_cast<std::size_t>(k)]) continue;
    const double off_Nm = q.belt_torque[k] - out.model_Nm[k];
    out.clean.torque.value[k] -= off_Nm;
    if (q.balance.size() > 0) {
      out.clean.torque_s.value[k] += (q.balance[k] - off_Nm) / q.ratio[k];
    }
  }
  const auto masked = [&](const ArrayXd& values, double scale) {
    ArrayXd r = ArrayXd::Zero(n);
    for (int k = 0; k < n; ++k) {
      if (data.valid[static_cast<std::size_t>(k)]) r[k] = values[k] * scale;
    }
    return r;
  };
  if (campaign.has_balance) {
    out.value[kBalanceResidual] = q.balance.size() > 0
                                      ? masked(q.balance, 1.0 / campaign.noise.balance_Nm)
                                      : ArrayXd::Zero(n);
  }
  if (campaign.has_tracking) {
    out.value[kTrackingResidual] = q.tracking.size() > 0
                                       ? masked(q.tracking, 1.0 / campaign.noise.tracking_Pa)
                                       : ArrayXd::Zero(n);
  }
  return out;
}

ResidualColumns propagate(const Campaign& campaign, const Residuals& at,
                          const QuantityChange& change) {
  ResidualColumns out;
  const auto n = at.foot.size();
  ArrayXd friction = ArrayXd::Zero(n);
  if (change.torque.size() > 0) friction += change.torque;
  if (change.slip.size() > 0) friction -= at.slope * change.slip;
  if (change.ln_capacity.size() > 0) friction -= at.model_Nm * change.ln_capacity;
  out[kFrictionResidual] = (at.weight > 0.0).select(friction * at.weight, 0.0);
  const auto other = [&](const ArrayXd& values, double sigma) -> ArrayXd {
    if (values.size() == 0) return ArrayXd::Zero(n);
    return (at.weight > 0.0).select(values / sigma, 0.0);
  };
  if (campaign.has_balance) {
    out[kBalanceResidual] = other(change.balance, campaign.noise.balance_Nm);
  }
  if (campaign.has_tracking) {
    out[kTrackingResidual] = other(change.tracking, campaign.noise.tracking_Pa);
  }
  return out;
}

ResidualColumns derivative(const Campaign& campaign, int run, const ModelState& state,
                           const Residuals& at, int parameter) {
  const ExperimentData& data = campaign.runs[static_cast<std::size_t>(run)];
  const int n = data.size();
  QuantityChange change;
  const auto per_stop = [&](int stop, auto&& f) {
    change.torque = ArrayXd::Zero(n);
    for (int k = 0; k < n; ++k) {
      if (data.stop[static_cast<std::size_t>(k)] == stop && at.weight[k] > 0.0) {
        change.torque[k] = -f(k);
      }
    }
    return propagate(campaign, at, change);
  };
  const auto bump = [&](int k, int i) {
    const double size = std::abs(at.foot[k]);
    const double f = i < kShapeKnots ? shape_function(i, size) : fall_function(size);
    return at.capacity[k] * f * std::copysign(1.0, at.foot[k]);
  };
  switch (parameter) {
    case kLnMuMax:
      change.ln_capacity = ArrayXd::Ones(n);
      return propagate(campaign, at, change);
    case kLnPeakSlipOverdrive:
    case kLnPeakSlipLow: {
      const int stop = parameter == kLnPeakSlipLow ? kLowStop : kOverdriveStop;
      const double peak = std::exp(state.nuisance[parameter]);
      return per_stop(stop, [&](int k) { return -at.slope[k] * at.foot[k] * peak; });
    }
    default:
      break;
  }
  if (parameter >= kShapeOverdrive && parameter < kShapeLow) {
    return per_stop(kOverdriveStop, [&](int k) { return bump(k, parameter - kShapeOverdrive); });
  }
  if (parameter >= kShapeLow && parameter <= kEndOfShapes) {
    return per_stop(kLowStop, [&](int k) { return bump(k, parameter - kShapeLow); });
  }
  // The rest by central differences of the quantities.
  const bool slot = parameter >= kNuisanceCount;
  const int index = slot ? parameter - kNuisanceCount : parameter;
  const double step = slot ? campaign.slots[static_cast<std::size_t>(index)].step()
                           : campaign.nuisances[static_cast<std::size_t>(index)].step;
  ModelState moved = state;
  double& value = slot ? moved.effects[index] : moved.nuisance[index];
  value += step;
  const Quantities above = quantities(campaign, at.clean, run, moved);
  value -= 2.0 * step;
  const Quantities below = quantities(campaign, at.clean, run, moved);
  const double scale = 0.5 / step;
  change.slip = (above.slip - below.slip) * scale;
  change.torque = (above.belt_torque - below.belt_torque) * scale;
  change.ln_capacity = (above.capacity / below.capacity).log() * scale;
  if (above.balance.size() > 0) change.balance = (above.balance - below.balance) * scale;
  if (above.tracking.size() > 0) change.tracking = (above.tracking - below.tracking) * scale;
  for (int stop = 0; stop < kStops; ++stop) {  // friction_shape acts on the curve itself
    const auto s = static_cast<std::size_t>(stop);
    const double d_ln_peak = (above.ln_peak_slip[s] - below.ln_peak_slip[s]) * scale;
    const double d_fall = (above.fall[s] - below.fall[s]) * scale;
    if (d_ln_peak == 0.0 && d_fall == 0.0) continue;
    const double peak = std::exp(above.ln_peak_slip[s]);
    for (int k = 0; k < n; ++k) {
      if (data.stop[static_cast<std::size_t>(k)] == stop && at.weight[k] > 0.0) {
        change.torque[k] +=
            at.slope[k] * at.foot[k] * peak * d_ln_peak - bump(k, kShapeKnots) * d_fall;
      }
    }
  }
  return propagate(campaign, at, change);
}

NoiseLevels estimate_noise_levels(const Campaign& campaign, const ModelState& state) {
  std::vector<double> slip, torque, balance, tracking;
  for (int run = 0; run < static_cast<int>(campaign.runs.size()); ++run) {
    const ExperimentData& data = campaign.runs[static_cast<std::size_t>(run)];
    const Quantities q = quantities(campaign, data, run, state);
    const auto collect = [&](const ArrayXd& y, std::vector<double>& into) {
      if (y.size() == 0) return;
      // Second differences over two samples: neighbours share samples of the local fit.
      for (int k = 4; k + 4 < data.size(); k += 2) {
        const auto at = static_cast<std::size_t>(k);
        if (!data.valid[at - 4] || !data.valid[at + 4]) {
          continue;
        }
        into.push_back((y[k - 4] - 2.0 * y[k] + y[k + 4]) / std::sqrt(6.0));
      }
    };
    collect(q.slip, slip);
    collect(q.belt_torque, torque);
    collect(q.balance, balance);
    collect(q.tracking, tracking);
  }
  NoiseLevels out;
  out.slip = std::max(robust_sigma(slip), 2e-6);
  out.torque_Nm = std::max(robust_sigma(torque), 2e-3);
  out.balance_Nm = std::max(robust_sigma(balance), 2e-3);
  out.tracking_Pa = std::max(robust_sigma(tracking), 20.0);
  return out;
}

}  // namespace beltgrip::diagnose
