#include "tools/diagnose/model/variator_model.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <vector>

#include "tools/diagnose/model/curve_family.h"
#include "tools/diagnose/model/effects/effect.h"
#include "tools/diagnose/model/learned.h"

namespace beltgrip::diagnose {

using Eigen::ArrayXd;

// Tolerances: what differs between two healthy machines of one type (ranges of the literature for
// pushbelt variators), so that only what lies beyond is called wrong.
NuisanceTable default_nuisances() {
  NuisanceTable table{{
      {"ln_mu_max", std::log(0.1), 0.4, 1e-3},
      {"ln_peak_slip_overdrive", std::log(0.02), 0.5, 1e-3},
      {"ln_peak_slip_low", std::log(0.03), 0.5, 1e-3},
      {"shape_1_overdrive", 0.0, 1.0, 1e-3},
      {"shape_2_overdrive", 0.0, 1.0, 1e-3},
      {"shape_3_overdrive", 0.0, 1.0, 1e-3},
      {"shape_4_overdrive", 0.0, 1.0, 1e-3},
      {"shape_5_overdrive", 0.0, 1.0, 1e-3},
      {"shape_6_overdrive", 0.0, 1.0, 1e-3},
      {"shape_7_overdrive", 0.0, 1.0, 1e-3},
      {"shape_8_overdrive", 0.0, 1.0, 1e-3},
      {"shape_9_overdrive", 0.0, 1.0, 1e-3},
      {"shape_10_overdrive", 0.0, 1.0, 1e-3},
      {"shape_11_overdrive", 0.0, 1.0, 1e-3},
      {"shape_12_overdrive", 0.0, 1.0, 1e-3},
      {"shape_13_overdrive", 0.0, 1.0, 1e-3},
      {"shape_1_low", 0.0, 1.0, 1e-3},
      {"shape_2_low", 0.0, 1.0, 1e-3},
      {"shape_3_low", 0.0, 1.0, 1e-3},
      {"shape_4_low", 0.0, 1.0, 1e-3},
      {"shape_5_low", 0.0, 1.0, 1e-3},
      {"shape_6_low", 0.0, 1.0, 1e-3},
      {"shape_7_low", 0.0, 1.0, 1e-3},
      {"shape_8_low", 0.0, 1.0, 1e-3},
      {"shape_9_low", 0.0, 1.0, 1e-3},
      {"shape_10_low", 0.0, 1.0, 1e-3},
      {"shape_11_low", 0.0, 1.0, 1e-3},
      {"shape_12_low", 0.0, 1.0, 1e-3},
      {"shape_13_low", 0.0, 1.0, 1e-3},
      {"deformation_per_kN", 1.0e-3, 0.7e-3, 1e-5},
      {"loss_constant_Nm", 0.5, 0.6, 1e-2},
      {"loss_per_rad_s_Nm", 5e-3, 4e-3, 1e-4},
      {"loss_per_kN_Nm", 0.05, 0.04, 1e-3},
      {"ln_ratio_overdrive", 0.0, 6e-4, 1e-5},
      {"ln_ratio_low", 0.0, 6e-4, 1e-5},
      {"secondary_inertia_kg_m2", 0.1, 0.3, 1e-3},
      {"secondary_loss_constant_Nm", 0.5, 0.6, 1e-2},
      {"secondary_loss_per_rad_s_Nm", 2e-3, 4e-3, 1e-4},
      {"secondary_torque_gain", 0.0, 0.0, 1e-4},
      {"command_offset_Pa", 0.0, 1e5, 10.0},
      {"command_gain", 0.0, 0.1, 1e-4},
  }};
  for (int i = 0; i < kShapeKnots; ++i) {
    for (const int first : {kShapeOverdrive, kShapeLow}) {
      const int knot = first + i;
      table[static_cast<std::size_t>(knot)].nominal = usual_departure()[i];
    }
  }
  return table;
}

namespace {

constexpr double kBend = 1.3;

CurveShape::Point nominal_formula(double size) {
  static const double kStiffness = std::tan(std::numbers::pi / (2.0 * kBend));
  const double angle = kBend * std::atan(kStiffness * size);
  return {std::sin(angle),
          std::cos(angle) * kBend * kStiffness / (1.0 + kStiffness * kStiffness * size * size)};
}

}  // namespace

double fall_function(double x) {
  const double beyond = x - 1.0;
  return beyond <= 0.0 ? 0.0 : -beyond * beyond / (0.3 + beyond);
}

const NominalInverse::Points& NominalInverse::points() {
  static const Points kPoints = [] {
    const double stiffness = std::tan(std::numbers::pi / (2.0 * kBend));
    Points table{};
    for (std::size_t i = 0; i < table.size(); ++i) {
      const double root = static_cast<double>(i) / kRoots;
      const double x = std::tan(std::asin(1.0 - root * root) / kBend) / stiffness;
      const double per_root =
          i == 0 ? -std::numbers::sqrt2 * (1.0 + stiffness * stiffness) / (kBend * stiffness)
                 : -2.0 * root / nominal_formula(x).slope;
      table[i] = {x, per_root / kRoots};
    }
    return table;
  }();
  return kPoints;
}

double nominal_inverse(double value) {
  constexpr int kRoots = NominalInverse::kRoots;
  const NominalInverse::Points& points = NominalInverse::points();
  const double size = std::abs(value);
  if (!(size < 1.0)) return std::numeric_limits<double>::quiet_NaN();
  const double at = std::sqrt(1.0 - size) * kRoots;
  const auto i = std::min(static_cast<std::size_t>(at), std::size_t{kRoots - 1});
  const double u = at - static_cast<double>(i);
  const NominalInverse::Point &a = points[i], &b = points[i + 1];
  const double rise = b.x - a.x;
  const double x =
      a.x +
      u * (a.step + u * (3.0 * rise - 2.0 * a.step - b.step + u * (a.step + b.step - 2.0 * rise)));
  return std::copysign(x, value);
}

// Hermite cubics through y with the slopes of finite differences, flat at the last end.
CurveShape::Cubics CurveShape::cubics(const std::array<double, kEnds>& y) {
  std::array<double, kEnds> slope{};
  for (std::size_t j = 0; j + 1 < kEnds; ++j) {
    slope[j] = j == 0 ? (y[1] - y[0]) / (kEnd[1] - kEnd[0])
                      : (y[j + 1] - y[j - 1]) / (kEnd[j + 1] - kEnd[j - 1]);
  }
  Cubics out{};
  for (std::size_t j = 0; j + 1 < kEnds; ++j) {
    const double h = kEnd[j + 1] - kEnd[j];
    const double secant = (y[j + 1] - y[j]) / h;
    out[j] = {y[j], slope[j], (3.0 * secant - 2.0 * slope[j] - slope[j + 1]) / h,
              (slope[j] + slope[j + 1] - 2.0 * secant) / (h * h)};
  }
  return out;
}

const CurveShape::Cells& CurveShape::cells() {
  static const Cells kCells = [] {
    Cells out{};
    std::size_t interval = 0;
    for (std::size_t i = 0; i < out.size(); ++i) {
      const double x = static_cast<double>(i) / kCellsPerUnit;
      const CurveShape::Point a = nominal_formula(x), b = nominal_formula(x + 1.0 / kCellsPerUnit);
      const double rise = b.value - a.value;
      const double begins = a.slope / kCellsPerUnit, ends = b.slope / kCellsPerUnit;
      while (interval + 2 < kEnds && kEnd[interval + 1] < x) ++interval;
      out[i] = {{a.value, begins, 3.0 * rise - 2.0 * begins - ends, begins + ends - 2.0 * rise},
                interval};
    }
    return out;
  }();
  return kCells;
}

CurveShape::CurveShape(std::span<const double, kShapeKnots> departure, double fall)
    : cells_(&cells()), fall_(fall) {
  std::array<double, kEnds> y{};
  for (int i = 0; i < kShapeKnots; ++i) {
    y[static_cast<std::size_t>(end_of_knot(i))] = departure[static_cast<std::size_t>(i)];
  }
  cubic_ = cubics(y);
}

SplinePosition spline_position(double x) {
  using Curve = CurveShape;
  if (!(x < Curve::kEnd.back())) {
    return {Curve::kEnds - 2, Curve::kEnd.back() - Curve::kEnd[Curve::kEnds - 2]};
  }
  const std::size_t first =
      Curve::cells()[static_cast<std::size_t>(x * Curve::kCellsPerUnit)].interval;
  const std::size_t j = Curve::interval_from(first, x);
  return {j, x - Curve::kEnd[j]};
}

CurveShape::Point CurveShape::far(double size) const {
  Point out = nominal_formula(size);
  out.value += departure(spline_position(size));
  return out;
}

void CurveShape::add_fall(double size, Point& point) const {
  const double beyond = size - 1.0;
  point.value += fall_ * fall_function(size);
  point.slope -= fall_ * (beyond * beyond + 0.6 * beyond) / ((0.3 + beyond) * (0.3 + beyond));
}

namespace {
bool is_zero(const ArrayXd& values) {
  return std::all_of(values.begin(), values.end(), [](double v) { return v == 0.0; });
}

// Ratio without load, and capacity per clamp force but for what changes the friction.
struct Unloaded {
  ArrayXd ratio, lever_m;
};

Unloaded unloaded_of(const ExperimentData& run, const estimator::VariatorParameters& variator,
                     const Eigen::VectorXd& nuisance) {
  const int n = run.size();
  Unloaded out{ArrayXd(n), ArrayXd(n)};
  const double ratio_low = variator.ratio_low * std::exp(nuisance[kLnRatioLow]);
  const double ratio_overdrive = variator.ratio_overdrive * std::exp(nuisance[kLnRatioOverdrive]);
  const double gain = 2.0 / std::cos(variator.half_wedge_angle_rad) * std::exp(nuisance[kLnMuMax]);
  const double lever_low_m = gain * variator.primary_radius_low_m;
  const double lever_overdrive_m = gain * variator.primary_radius_overdrive_m;
  for (int k = 0; k < n; ++k) {
    const bool low = run.stop[static_cast<std::size_t>(k)] == kLowStop;
    out.ratio[k] = low ? ratio_low : ratio_overdrive;
    out.lever_m[k] = low ? lever_low_m : lever_overdrive_m;
  }
  return out;
}

// From the slow copies of all channels, the inertia's share of the engine's torque among them: by
// the fast slope it would stand against a torque that no longer has what is fast, and what stands
// behind the belt would be fitted to the noise of the speed's slope.
ArrayXd balance_of(const ExperimentData& run, const Readings& read, const Context& c,
                   const ArrayXd& ratio, double inertia_kg_m2, double gain) {
  ArrayXd out =
      c.belt_torque + run.torque.slow - read.torque_Nm -
      ratio * (run.torque_s.slow / (1.0 + gain) + inertia_kg_m2 * c.slope_s + c.secondary_loss_Nm);
  if (run.torque_is_engine) {
    out += c.variator.primary_inertia_kg_m2 * (run.omega_p.slope - run.omega_p.slow_slope);
  }
  return out;
}
}  // namespace

Quantities evaluate(const ExperimentData& run, int experiment,
                    const estimator::VariatorParameters& variator, const Eigen::VectorXd& nuisance,
                    const Effects& effects) {
  return evaluate(run, {run.pressure.value, run.torque.value}, experiment, variator, nuisance,
                  effects);
}

Quantities evaluate(const ExperimentData& run, const Readings& read, int experiment,
                    const estimator::VariatorParameters& variator, const Eigen::VectorXd& nuisance,
                    const Effects& effects) {
  const int n = run.size();
  Context c{run,
            read,
            variator,
            experiment,
            run.omega_p.value,
            run.omega_s.value,
            read.pressure_Pa,
            read.torque_Nm,
            run.omega_p.slow_slope,
            run.omega_s.slow_slope,
            run.command.present ? run.command.value : ArrayXd(),
            {},
            {},
            {},
            ArrayXd::Zero(n),
            {},
            {},
            {},
            ArrayXd::Zero(n),
            {nuisance[kLnPeakSlipOverdrive], nuisance[kLnPeakSlipLow]},
            {}};
  const auto apply = [&](Stage stage) {
    for (std::size_t i = 0; i < effects.slots->size(); ++i) {
      const Slot& slot = (*effects.slots)[i];
      const double value = effects.value[static_cast<Eigen::Index>(i)];
      if (slot.row->stage == stage && value != 0.0) slot.row->apply(c, slot, value);
    }
    for (const estimator::LearnedTerm& each : effects.learned) apply_learned(c, each, stage);
    for (const estimator::LearnedTerm& each : effects.learned_too) apply_learned(c, each, stage);
  };
  apply(Stage::kMeasurement);
  const ArrayXd beside_pressure_N =
      variator.secondary_spring_force_N + variator.secondary_centrifugal_N_s2 * c.omega_s.square();
  c.force_N = variator.secondary_piston_area_m2 * c.pressure + beside_pressure_N;
  apply(Stage::kForce);
  c.loss_Nm = nuisance[kLossConstant_Nm] + nuisance[kLossPerSpeed_Nms] * c.omega_p +
              nuisance[kLossPerkN_Nm] * 1e-3 * c.force_N;
  if (run.torque_is_engine) {
    c.loss_Nm +=
        variator.primary_inertia_kg_m2 * (run.omega_p.slope + c.slope_p - run.omega_p.slow_slope);
  }
  apply(Stage::kDriveline);
  c.belt_torque = c.torque - c.loss_Nm;
  c.deformation = nuisance[kDeformationPerkN] * 1e-3 * c.force_N;
  auto [ratio, lever_m] = unloaded_of(run, variator, nuisance);
  apply(Stage::kRatio);
  ratio *= (1.0 - c.deformation).max(0.05);
  if (!is_zero(c.ln_ratio)) ratio *= c.ln_ratio.exp();  // hardly ever there, and slow
  c.slip_share = 1.0 - c.omega_s / (c.omega_p * ratio);
  apply(Stage::kFriction);

  Quantities q;
  q.slip_share = std::move(c.slip_share);
  // What effects change of the clamp force counts as a share of it, without the pressure's noise:
  // else a hypothesis with more force would divide that noise by more, and fit better for that
  // alone.
  const double area_m2 = variator.secondary_piston_area_m2;
  const ArrayXd read_N = area_m2 * read.pressure_Pa + beside_pressure_N;
  const ArrayXd calm_N = area_m2 * run.pressure.sharp + beside_pressure_N;
  q.capacity = lever_m * (read_N * (1.0 + (c.force_N - read_N) / calm_N.max(50.0))).max(50.0);
  if (!is_zero(c.ln_friction)) q.capacity *= c.ln_friction.exp();
  if (run.torque_s.present) {
    c.secondary_loss_Nm =
        nuisance[kSecondaryLoss_Nm] + nuisance[kSecondaryLossPerSpeed_Nms] * c.omega_s;
    apply(Stage::kSecondaryShaft);
    q.balance = balance_of(run, read, c, ratio, nuisance[kSecondaryInertia_kgm2],
                           nuisance[kSecondaryTorqueGain]);
    q.secondary_loss_Nm = std::move(c.secondary_loss_Nm);
  }
  if (run.command.present) {
    q.tracking =
        read.pressure_Pa - (1.0 + nuisance[kCommandGain]) * c.track - nuisance[kCommandOffset_Pa];
  }
  q.ratio = std::move(ratio);
  q.deformation = std::move(c.deformation);
  q.force_N = std::move(c.force_N);
  q.belt_torque = std::move(c.belt_torque);
  q.omega_p = std::move(c.omega_p);
  q.omega_s = std::move(c.omega_s);
  q.slope_s = std::move(c.slope_s);
  q.ln_peak_slip = c.ln_peak_slip;
  q.fall = c.fall;
  return q;
}

}  // namespace beltgrip::diagnose
