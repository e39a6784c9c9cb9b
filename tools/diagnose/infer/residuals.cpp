#include "tools/diagnose/infer/residuals.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include "estimator/statistics/order.h"
#include "tools/diagnose/infer/foot_points.h"
#include "tools/diagnose/infer/noise_probe.h"
#include "tools/diagnose/model/curve_family.h"
#include "tools/diagnose/model/lanes.h"

namespace beltgrip::diagnose {
using Eigen::ArrayXd;

double robust_sigma(std::vector<double>& values) {
  if (values.size() < 20) return 0.0;
  for (double& v : values) v = std::abs(v);
  return estimator::kSigmaPerMedian * estimator::median(values);
}

Quantities quantities(const Campaign& campaign, const ExperimentData& data, int run,
                      const ModelState& state) {
  return quantities(campaign, data, {data.pressure.value, data.torque.value}, run, state);
}

Quantities quantities(const Campaign& campaign, const ExperimentData& data, const Readings& read,
                      int run, const ModelState& state) {
  return evaluate(data, read, run, campaign.variator, state.nuisance,
                  Effects{&campaign.slots, campaign.switched_on + state.effects, campaign.learned,
                          state.learned, campaign.primary_share_of_gain});
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

namespace {
using Row = std::ptrdiff_t;
constexpr double kLeast_N = 50.0;  // chosen, of what a noise of the force is divided by

// One sigma of the clamp force as a share of it: as configured, so that it is the same in every
// hypothesis (evaluate()), and one with less force is not forgiven more else.
ArrayXd force_noise_share(const Campaign& campaign, const ExperimentData& data) {
  const estimator::VariatorParameters& variator = campaign.variator;
  ArrayXd out(data.size());
  for_rows(data.size(),
           [noise_N = campaign.noise.force_N, area_m2 = variator.secondary_piston_area_m2,
            spring_N = variator.secondary_spring_force_N,
            per_speed2_N_s2 = variator.secondary_centrifugal_N_s2,
            pressure_Pa = data.pressure.value.data(), omega_s = data.omega_s.value.data(),
            to = out.data()](Row k) BELTGRIP_INLINE {
             const double force_N =
                 area_m2 * pressure_Pa[k] + spring_N + per_speed2_N_s2 * omega_s[k] * omega_s[k];
             to[k] = noise_N / std::max(force_N, kLeast_N);
           });
  return out;
}

// What it comes to in the slip, by the pulleys that give way.
ArrayXd slip_noise_of_force(const Campaign& campaign, const Quantities& q) {
  ArrayXd out = q.deformation + q.deformation_bend;
  for_rows(out.size(), [noise_N = campaign.noise.force_N, slip = q.slip_share.data(),
                        force_N = q.force_N.data(), to = out.data()](Row k) BELTGRIP_INLINE {
    to[k] *= noise_N * (1.0 - slip[k]) / std::max(force_N[k], kLeast_N);
  });
  return out;
}
}  // namespace

double least_size(const Campaign& campaign, int slot) {
  const EffectRow& row = *campaign.slots[static_cast<std::size_t>(slot)].row;
  const estimator::VariatorParameters& variator = campaign.variator;
  if (row.id == "inertia_torque") return std::max(row.low, -variator.primary_inertia_kg_m2);
  if (row.id == "centrifugal_force") return std::max(row.low, -variator.secondary_centrifugal_N_s2);
  return row.low;
}

Residuals residuals_of(const Campaign& campaign, int run, const ModelState& state) {
  const ExperimentData& data = campaign.runs[static_cast<std::size_t>(run)];
  Residuals out;
  out.measured = quantities(campaign, data, run, state);
  const Quantities& q = out.measured;
  const auto curve = shapes(state.nuisance, q);
  const int n = data.size();
  out.value[kFrictionResidual] = ArrayXd::Zero(n);
  out.foot = ArrayXd::Zero(n);
  out.slope = ArrayXd::Zero(n);
  out.model_Nm = ArrayXd::Zero(n);
  out.weight = ArrayXd::Zero(n);
  const double slip_variance =
      campaign.slip_noise_share_of(run) * campaign.slip_noise_share_of(run);
  const double sensor_variance = campaign.noise.torque_Nm * campaign.noise.torque_Nm;
  out.of_force_Nm = ArrayXd::Zero(n);
  out.calm_capacity_Nm = q.capacity;
  const ArrayXd force_share = force_noise_share(campaign, data);
  const ArrayXd slip_of_force = slip_noise_of_force(campaign, q);
  std::array<std::vector<int>, kStops> at_stop;  // samples
  for (std::vector<int>& each : at_stop) each.reserve(static_cast<std::size_t>(data.valid_count));
  for (const auto& [begin, end] : data.stretches) {
    for (int k = begin; k < end; ++k) {
      at_stop[static_cast<std::size_t>(data.stop[static_cast<std::size_t>(k)])].push_back(k);
    }
  }
  for (std::size_t stop = 0; stop < kStops; ++stop) {
    const std::vector<int>& all = at_stop[stop];
    for (std::size_t first = 0; first < all.size(); first += FootBatch::kMost) {
      const auto samples =
          std::span(all).subspan(first, std::min(FootBatch::kMost, all.size() - first));
      FootBatch batch(curve[stop], std::exp(q.ln_peak_slip[stop]),
                      campaign.noise.force_reading_share);
      for (const int k : samples) {
        batch.add(q.slip_share[k], q.belt_torque[k], q.capacity[k], data.slip_spread_share2[k],
                  {slip_variance, sensor_variance, force_share[k], slip_of_force[k]});
      }
      batch.find();
      for (std::size_t i = 0; i < samples.size(); ++i) {
        const int k = samples[i];
        out.foot[k] = batch.x(i);
        out.slope[k] = batch.slope(i);
        out.model_Nm[k] = batch.model_Nm(i);
        out.weight[k] = batch.weight(i);
        out.of_force_Nm[k] = batch.of_force_Nm(i);
        out.calm_capacity_Nm[k] = q.capacity[k] * batch.calm(i);
        out.value[kFrictionResidual][k] = batch.value(i);
      }
    }
  }
  out.balance_variance = balance_variance(campaign, data, q, state);
  out.balance_weight = out.balance_variance.per_Nm();
  const auto masked = [&](const ArrayXd& values, const ArrayXd& scale) -> ArrayXd {
    if (values.size() == 0) return ArrayXd::Zero(n);
    return (out.weight > 0.0).select(values * scale, 0.0);
  };
  if (campaign.has_balance) out.value[kBalanceResidual] = masked(q.balance, out.balance_weight);
  if (campaign.has_tracking) {
    out.value[kTrackingResidual] =
        masked(q.tracking, ArrayXd::Constant(n, 1.0 / campaign.noise.tracking_Pa));
  }
  return out;
}

// What stands in the regressors, without what of the misfit is the noise of the torque and of the
// clamp force: of each what is most probable by the noises of all three.
void move_to_foot(const Campaign& campaign, int run, Residuals& at) {
  if (at.clean_Nm.size() > 0) return;
  const ExperimentData& data = campaign.runs[static_cast<std::size_t>(run)];
  const Quantities& q = at.measured;
  at.clean_Nm = q.belt_torque;
  at.clean_pressure_Pa = data.pressure.value;
  at.clean_reading_Nm = data.torque.value;
  for (const auto& [begin, end] : data.stretches) {
    for_rows(
        end - begin,
        [sensor_Nm2 = campaign.noise.torque_Nm * campaign.noise.torque_Nm,
         noise_N = campaign.noise.force_N, area_m2 = campaign.variator.secondary_piston_area_m2,
         value = at.value[kFrictionResidual].data() + begin, weight = at.weight.data() + begin,
         of_force_Nm = at.of_force_Nm.data() + begin, force_N = q.force_N.data() + begin,
         clean_Pa = at.clean_pressure_Pa.data() + begin, clean_Nm = at.clean_Nm.data() + begin,
         reading_Nm = at.clean_reading_Nm.data() + begin](Row k) BELTGRIP_INLINE {
          const double misfit_per_Nm = value[k] * weight[k];
          const double off_Nm = sensor_Nm2 * misfit_per_Nm;
          const double off_N = noise_N * of_force_Nm[k] * misfit_per_Nm;
          const double most_N = FootBatch::kMoveMost * force_N[k];
          clean_Pa[k] += (off_N < -most_N ? -most_N : off_N > most_N ? most_N : off_N) / area_m2;
          clean_Nm[k] -= off_Nm;
          reading_Nm[k] -= off_Nm;
        });
  }
  if (q.balance.size() > 0) at.output_torque = at.clean_Nm / q.ratio;
}

namespace {
// A valid sample as the departure of its friction curve sees it.
struct CurveSample {
  SplinePosition position;  // of |foot|
  double capacity_Nm = 0.0;
  double weight = 0.0;  // of a change of the curve in the residual, with its sign
};

// One row of the modes: all at once.
BELTGRIP_LANES void fill_row(const CurveSample& sample, const ModeCubics& cubics, double* row,
                             Row to_next_mode) {
  const auto& c = cubics[sample.position.interval];
  const double u = sample.position.u;
  std::array<double, kModesAbreast> of_mode;
  for (std::size_t i = 0; i < kModesAbreast; ++i) {
    const double departure = c[0][i] + u * (c[1][i] + u * (c[2][i] + u * c[3][i]));
    of_mode[i] = sample.capacity_Nm * departure * sample.weight;
  }
  for (std::size_t i = 0; i < kShapeKnots; ++i, row += to_next_mode) *row = of_mode[i];
}

void fill_modes(const ExperimentData& data, Residuals& at) {
  const int rows = data.valid_count;
  at.modes.resize(rows, kShapeKnots);
  at.is_low.resize(rows);
  std::vector<CurveSample> samples;
  samples.reserve(static_cast<std::size_t>(rows));
  for (const auto& [begin, end] : data.stretches) {
    for (int k = begin; k < end; ++k) {
      const int stop = data.stop[static_cast<std::size_t>(k)];
      const bool counts = at.weight[k] > 0.0;
      at.is_low[static_cast<Row>(samples.size())] = stop == kLowStop ? 1.0 : 0.0;
      if (counts) at.has_stop[static_cast<std::size_t>(stop)] = true;
      samples.push_back({spline_position(std::abs(at.foot[k])), at.calm_capacity_Nm[k],
                         counts ? -std::copysign(at.weight[k], at.foot[k]) : 0.0});
    }
  }
  for_rows(rows, [rows, from = samples.data(), to = at.modes.data(), &cubics = mode_cubics()](
                     Row row) BELTGRIP_INLINE { fill_row(from[row], cubics, to + row, rows); });
}
}  // namespace

void prepare_derivatives(const Campaign& campaign, int run, const ModelState& state,
                         Residuals& at) {
  if (at.there.slip_share.size() > 0) return;
  move_to_foot(campaign, run, at);
  const ExperimentData& data = campaign.runs[static_cast<std::size_t>(run)];
  at.there = quantities(campaign, data, {at.clean_pressure_Pa, at.clean_reading_Nm}, run, state);
  fill_modes(data, at);
}

namespace {
// The samples of some stretches, one behind the other.
ResidualColumns propagated(const Campaign& campaign, const Residuals& at,
                           const QuantityChange& change, std::span<const Stretch> stretches,
                           double scale) {
  int rows = 0;
  for (const Stretch& each : stretches) rows += each.end - each.begin;
  const auto column = [&](const auto& fill) {
    ArrayXd out(rows);
    Row row = 0;
    for (const auto& [begin, end] : stretches) {
      fill(begin, end - begin, out.data() + row);
      row += end - begin;
    }
    return out;
  };
  // Of a change that there may be none of.
  const auto from = [](const ArrayXd& values, int begin) {
    return values.size() > 0 ? values.data() + begin : nullptr;
  };
  ResidualColumns out;
  if (change.torque.size() + change.slip_share.size() + change.ln_capacity.size() > 0) {
    out[kFrictionResidual] = column([&](int begin, Row count, double* to) {
      for_rows(count,
               [=, torque = from(change.torque, begin), slip_share = from(change.slip_share, begin),
                ln_capacity = from(change.ln_capacity, begin), slope = at.slope.data() + begin,
                clean_Nm = at.clean_Nm.data() + begin, weight = at.weight.data() + begin](Row k)
                   BELTGRIP_INLINE {
                     double friction = 0.0;
                     if (torque != nullptr) friction += torque[k];
                     if (slip_share != nullptr) friction -= slope[k] * slip_share[k];
                     if (ln_capacity != nullptr) friction -= clean_Nm[k] * ln_capacity[k];
                     to[k] = (weight[k] > 0.0 ? friction * weight[k] : 0.0) * scale;
                   });
    });
  }
  if (campaign.has_balance && change.balance.size() > 0) {
    out[kBalanceResidual] = column([&](int begin, Row count, double* to) {
      for_rows(count, [=, balance = change.balance.data() + begin,
                       ln_noise = from(change.ln_balance_noise, begin),
                       value = at.value[kBalanceResidual].data() + begin,
                       balance_weight = at.balance_weight.data() + begin,
                       weight = at.weight.data() + begin](Row k) BELTGRIP_INLINE {
        double by = balance[k] * balance_weight[k];
        if (ln_noise != nullptr) by -= value[k] * ln_noise[k];
        to[k] = (weight[k] > 0.0 ? by : 0.0) * scale;
      });
    });
  }
  if (campaign.has_tracking && change.tracking.size() > 0) {
    out[kTrackingResidual] = column([&](int begin, Row count, double* to) {
      for_rows(count, [=, per_Pa = 1.0 / campaign.noise.tracking_Pa,
                       tracking = change.tracking.data() + begin,
                       weight = at.weight.data() + begin](Row k) BELTGRIP_INLINE {
        to[k] = (weight[k] > 0.0 ? tracking[k] * per_Pa : 0.0) * scale;
      });
    });
  }
  return out;
}
}  // namespace

ResidualColumns propagate(const Campaign& campaign, const Residuals& at,
                          const QuantityChange& change) {
  const Stretch all{0, static_cast<int>(at.foot.size())};
  return propagated(campaign, at, change, {&all, 1}, 1.0);
}

namespace {
// The form in overdrive is that of both end stops; the other is what the low one differs by.
ArrayXd mode_rows(const Residuals& at, int parameter, double scale) {
  const int first = first_knot(parameter);
  const bool is_of_both = first == kShapeOverdrive;
  if (!at.has_stop[kLowStop] && !(is_of_both && at.has_stop[kOverdriveStop])) return {};
  const auto mode = at.modes.col(parameter - first);
  if (is_of_both) return mode * scale;
  return mode * scale * at.is_low;
}

bool energy_acts(const Campaign& campaign, const ModelState& state) {
  for (std::size_t i = 0; i < campaign.slots.size(); ++i) {
    const auto j = static_cast<Eigen::Index>(i);
    if (campaign.slots[i].row->parameter == "per_kJ" &&
        state.effects[j] + campaign.switched_on[j] != 0.0) {
      return true;
    }
  }
  return false;
}
}  // namespace

namespace {

// Of the slip at the peak of one stop; none where the stop is never used.
QuantityChange peak_change(const ExperimentData& data, const Residuals& at, int stop, double peak) {
  if (std::find(data.stop.begin(), data.stop.end(), stop) == data.stop.end()) return {};
  QuantityChange change;
  change.torque.resize(data.size());
  for_rows(data.size(), [=, stops = data.stop.data(), slope = at.slope.data(),
                         foot = at.foot.data(), to = change.torque.data()](Row k) BELTGRIP_INLINE {
    to[k] = stops[k] == stop ? slope[k] * foot[k] * peak : 0.0;
  });
  return change;
}

QuantityChange torque_change(const ArrayXd& torque) {
  QuantityChange change;
  change.torque = torque;
  change.balance = torque;
  return change;
}

QuantityChange balance_change(const ArrayXd& balance) {
  QuantityChange change;
  change.balance = balance;
  return change;
}

// A change of ln(r_g): slip and, through the torque out, balance.
QuantityChange ratio_change(const Residuals& at, const ArrayXd& ln_ratio) {
  QuantityChange change;
  change.slip_share = (1.0 - at.measured.slip_share) * ln_ratio;
  if (at.output_torque.size() > 0) {
    change.balance = -at.measured.ratio * at.output_torque * ln_ratio;
  }
  return change;
}

QuantityChange deformation_change(const ExperimentData& data, const Residuals& at,
                                  double lost_share, const ArrayXd& by) {
  const Quantities& q = at.there;
  const ArrayXd ln_ratio = -by / (1.0 - q.deformation).max(kLeastRadiusShare);
  QuantityChange change;
  change.slip_share = (1.0 - q.slip_share) * ln_ratio;
  if (q.balance.size() > 0) {
    change.balance = (q.balance - q.belt_torque - data.torque.slow + at.clean_reading_Nm) *
                     (ln_ratio + lost_share * by);
    const BalanceVariance& noise = at.balance_variance;
    change.ln_balance_noise =
        (noise.total > 0.0).select(noise.behind / noise.total * ln_ratio, 0.0);
  }
  return change;
}

// In closed form; nothing: there is none for this parameter.
std::optional<QuantityChange> known_change(const Campaign& campaign, const ExperimentData& data,
                                           const ModelState& state, const Residuals& at,
                                           int parameter) {
  const int n = data.size();
  switch (parameter) {
    case kLossConstant_Nm:
      return torque_change(ArrayXd::Constant(n, -1.0));
    case kLossPerSpeed_Nms:
      return torque_change(-data.omega_p.value);
    case kLossPerkN_Nm:
      return torque_change(-1e-3 * at.there.force_N);
    case kLnRatioOverdrive:
    case kLnRatioLow: {
      const int stop = parameter == kLnRatioLow ? kLowStop : kOverdriveStop;
      ArrayXd here(n);
      for (int k = 0; k < n; ++k) here[k] = data.stop[static_cast<std::size_t>(k)] == stop;
      return ratio_change(at, here);
    }
    case kDeformationPerkN:
      return deformation_change(data, at, state.nuisance[kDeformationLost],
                                1e-3 * at.there.force_N);
    case kDeformationPerkN2:
      return deformation_change(data, at, state.nuisance[kDeformationLost],
                                1e-6 * at.there.force_N.square());
    case kDeformationLost:
      return balance_change(-at.clean_Nm * at.there.deformation);
    case kCommandOffset_Pa: {
      QuantityChange change;
      change.tracking = ArrayXd::Constant(n, -1.0);
      return change;
    }
    case kSecondaryInertia_kgm2: {
      QuantityChange change = balance_change(-at.measured.ratio * at.measured.slope_s);
      const BalanceVariance& noise = at.balance_variance;
      change.ln_balance_noise =
          (noise.total > 0.0).select(0.5 * noise.per_inertia_kg_m2 / noise.total, 0.0);
      return change;
    }
    case kSecondaryLoss_Nm:
      return balance_change(-at.measured.ratio);
    case kSecondaryLossPerSpeed_Nms:
      return balance_change(-at.measured.ratio * at.measured.omega_s);
    case kSecondaryLossPerkN_Nm:
      return balance_change(-1e-3 * at.there.ratio * at.there.force_N);
    case kSecondaryTorqueGain: {  // by the torque of the foot point: no noise in a regressor
      QuantityChange change = balance_change(at.clean_Nm);
      const double inertia_kg_m2 =
          data.torque_is_engine
              ? campaign.primary_share_of_gain * campaign.variator.primary_inertia_kg_m2
              : 0.0;
      if (inertia_kg_m2 != 0.0) {
        change.torque = inertia_kg_m2 * data.omega_p.slow_slope;
        change.balance += change.torque;
      }
      return change;
    }
    default:
      return std::nullopt;
  }
}

// By central differences of the quantities.
QuantityChange difference(const Campaign& campaign, int run, const ModelState& state,
                          const Residuals& at, int parameter) {
  const ExperimentData& data = campaign.runs[static_cast<std::size_t>(run)];
  const bool slot = parameter >= kNuisanceCount;
  const int index = slot ? parameter - kNuisanceCount : parameter;
  const double step = slot ? campaign.slots[static_cast<std::size_t>(index)].step()
                           : campaign.nuisances[static_cast<std::size_t>(index)].step;
  ModelState moved = state;
  double& value = slot ? moved.effects[index] : moved.nuisance[index];
  value += step;
  const Readings clean{at.clean_pressure_Pa, at.clean_reading_Nm};
  const Quantities above = quantities(campaign, data, clean, run, moved);
  const BalanceVariance noise_above = balance_variance(campaign, data, above, moved);
  value -= 2.0 * step;
  const Quantities below = quantities(campaign, data, clean, run, moved);
  const BalanceVariance noise_below = balance_variance(campaign, data, below, moved);
  const double scale = 0.5 / step;
  QuantityChange change;
  change.slip_share = (above.slip_share - below.slip_share) * scale;
  change.torque = (above.belt_torque - below.belt_torque) * scale;
  change.ln_capacity = (above.capacity / below.capacity).log() * scale;
  if (above.balance.size() > 0) {
    change.balance = (above.balance - below.balance) * scale;
    change.ln_balance_noise = noise_above.ln_sigma_over(noise_below) * scale;
  }
  if (above.tracking.size() > 0) change.tracking = (above.tracking - below.tracking) * scale;
  for (int stop = 0; stop < kStops; ++stop) {  // friction_shape acts on the curve itself
    const auto s = static_cast<std::size_t>(stop);
    const double d_ln_peak = (above.ln_peak_slip[s] - below.ln_peak_slip[s]) * scale;
    const double d_fall = (above.fall[s] - below.fall[s]) * scale;
    if (d_ln_peak == 0.0 && d_fall == 0.0) continue;
    const double peak = std::exp(above.ln_peak_slip[s]);
    for (int k = 0; k < data.size(); ++k) {
      if (data.stop[static_cast<std::size_t>(k)] == stop && at.weight[k] > 0.0) {
        change.torque[k] += at.slope[k] * at.foot[k] * peak * d_ln_peak -
                            at.measured.capacity[k] * fall_function(std::abs(at.foot[k])) *
                                std::copysign(1.0, at.foot[k]) * d_fall;
      }
    }
  }
  return change;
}

}  // namespace

namespace {
// Of all but the modes of the friction curve.
QuantityChange change_by(const Campaign& campaign, int run, const ModelState& state,
                         const Residuals& at, int parameter) {
  const ExperimentData& data = campaign.runs[static_cast<std::size_t>(run)];
  if (parameter == kLnMuMax) {
    QuantityChange change;
    change.ln_capacity = ArrayXd::Ones(data.size());
    return change;
  }
  if (parameter == kLnPeakSlipOverdrive || parameter == kLnPeakSlipLow) {
    const int stop = parameter == kLnPeakSlipLow ? kLowStop : kOverdriveStop;
    return peak_change(data, at, stop, std::exp(state.nuisance[parameter]));
  }
  // With slip energy at work, whatever moves the slip moves the friction: by differences, below.
  if (!energy_acts(campaign, state)) {
    if (auto change = known_change(campaign, data, state, at, parameter)) return std::move(*change);
  }
  return difference(campaign, run, state, at, parameter);
}
}  // namespace

ResidualColumns derivative_rows(const Campaign& campaign, int run, const ModelState& state,
                                const Residuals& at, int parameter, double scale) {
  const ExperimentData& data = campaign.runs[static_cast<std::size_t>(run)];
  if (first_knot(parameter) < 0) {
    return propagated(campaign, at, change_by(campaign, run, state, at, parameter), data.stretches,
                      scale);
  }
  ResidualColumns out;
  out[kFrictionResidual] = mode_rows(at, parameter, scale);
  return out;
}

ResidualColumns secant(const Campaign& campaign, int run, const ModelState& state,
                       const Residuals& at, int slot, double size) {
  const ExperimentData& data = campaign.runs[static_cast<std::size_t>(run)];
  const double step = size - state.effects[slot];
  if (step == 0.0) {
    return propagate(campaign, at, change_by(campaign, run, state, at, kNuisanceCount + slot));
  }
  ModelState moved = state;
  moved.effects[slot] = size;
  const Quantities there =
      quantities(campaign, data, {at.clean_pressure_Pa, at.clean_reading_Nm}, run, moved);
  const Quantities& here = at.there;
  QuantityChange change;
  change.slip_share = (there.slip_share - here.slip_share) / step;
  change.torque = (there.belt_torque - here.belt_torque) / step;
  change.ln_capacity = (there.capacity / here.capacity).log() / step;
  if (there.balance.size() > 0) {
    change.balance = (there.balance - here.balance) / step;
    const BalanceVariance noise = balance_variance(campaign, data, there, moved);
    change.ln_balance_noise = noise.ln_sigma_over(at.balance_variance) / step;
  }
  if (there.tracking.size() > 0) change.tracking = (there.tracking - here.tracking) / step;
  return propagate(campaign, at, change);
}

namespace {
// The slip's noise is that of the speeds: what the clamp force's comes to in it, by pulleys that
// give way, counts by itself, whoever says that they do.
ArrayXd slip_by_stiff_pulleys(const Quantities& q) {
  return 1.0 - (1.0 - q.slip_share) * (1.0 - q.deformation).max(kLeastRadiusShare);
}
}  // namespace

NoiseLevels estimate_noise_levels(const Campaign& campaign, const ModelState& state) {
  std::vector<double> slip_share, torque, tracking, force;
  std::array<std::vector<double>, kStops> balance;
  for (int run = 0; run < static_cast<int>(campaign.runs.size()); ++run) {
    const ExperimentData& data = campaign.runs[static_cast<std::size_t>(run)];
    const Quantities q = quantities(campaign, data, run, state);
    const auto collect = [&](const ArrayXd& y, std::vector<double>& into, int stop = kNoStop) {
      if (y.size() == 0) return;
      const NoiseProbe& probe = stop == kNoStop ? kFastProbe : kSlowProbe;
      const int reach = probe.reach();
      for (int k = reach; k + reach < data.size(); k += 2) {
        const auto before = static_cast<std::size_t>(k - reach);
        const auto after = static_cast<std::size_t>(k) + static_cast<std::size_t>(reach);
        if (!data.valid[before] || !data.valid[after]) continue;
        if (stop != kNoStop && data.stop[before] != stop) continue;
        into.push_back(probe.at(y, k));
      }
    };
    collect(slip_by_stiff_pulleys(q), slip_share);
    collect(q.belt_torque, torque);
    for (const int stop : {kOverdriveStop, kLowStop}) {
      collect(q.balance, balance[static_cast<std::size_t>(stop)], stop);
    }
    collect(q.tracking, tracking);
    collect(q.force_N, force);
  }
  // What rests on a step differs from its neighbours by nothing, and from the truth by the
  // rounding.
  const auto rounding = [&](double ExperimentData::*of) {
    double squares = 0.0, runs = 0.0;
    for (const ExperimentData& data : campaign.runs) {
      if (data.valid_count == 0) continue;
      squares += data.*of * data.*of;
      runs += 1.0;
    }
    return std::sqrt(squares / std::max(runs, 1.0));
  };
  const double torque_Nm = rounding(&ExperimentData::rounding_torque_Nm);
  const double torque_s_Nm = rounding(&ExperimentData::rounding_torque_s_Nm);
  const std::array<double, kStops> ratio{campaign.variator.ratio_overdrive,
                                         campaign.variator.ratio_low};
  static_assert(kOverdriveStop == 0 && kLowStop == 1);
  NoiseLevels out;
  out.slip_share = std::max(robust_sigma(slip_share), 2e-6);
  out.torque_Nm = std::max({robust_sigma(torque), 2e-3, torque_Nm});
  std::array<double, kStops> balance_Nm{};
  for (std::size_t stop = 0; stop < kStops; ++stop) {
    balance_Nm[stop] = std::max(
        {robust_sigma(balance[stop]), 2e-3, std::hypot(torque_Nm, ratio[stop] * torque_s_Nm)});
  }
  out.balance = parts_of_balance_noise(campaign, state, balance_Nm);
  const double reading_N = std::max(robust_sigma(force), 0.2);
  out.force_N = std::max(reading_N, campaign.variator.secondary_piston_area_m2 *
                                        rounding(&ExperimentData::left_of_rounding_Pa));
  out.force_reading_share = reading_N * reading_N / (out.force_N * out.force_N);
  out.tracking_Pa = std::max(robust_sigma(tracking), 20.0);
  return out;
}

std::vector<double> estimate_slip_noise_shares(const Campaign& campaign, const ModelState& state) {
  constexpr double kLeast = 0.3, kMost = 5.0;
  std::vector<double> sigma;
  for (int run = 0; run < static_cast<int>(campaign.runs.size()); ++run) {
    const ExperimentData& data = campaign.runs[static_cast<std::size_t>(run)];
    const ArrayXd slip = slip_by_stiff_pulleys(quantities(campaign, data, run, state));
    std::vector<double> slip_share;
    constexpr int kReach = kFastProbe.reach();
    for (int k = kReach; k + kReach < data.size(); ++k) {
      if (!data.valid[static_cast<std::size_t>(k - kReach)] ||
          !data.valid[static_cast<std::size_t>(k) + kReach]) {
        continue;
      }
      slip_share.push_back(kFastProbe.at(slip, k));
    }
    const double here = robust_sigma(slip_share);
    const double share =
        here > 0.0 ? std::clamp(here / campaign.noise.slip_share, kLeast, kMost) : 1.0;
    sigma.push_back(std::max(share, data.rounding_slip_share / campaign.noise.slip_share));
  }
  return sigma;
}

}  // namespace beltgrip::diagnose
