#include "tools/diagnose/variator_model.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <vector>

#include "tools/diagnose/curve_family.h"
#include "tools/diagnose/effects/effect.h"

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
      {"ln_ratio_overdrive", 0.0, 6e-4, 1e-5},
      {"ln_ratio_low", 0.0, 6e-4, 1e-5},
      {"secondary_inertia_kg_m2", 0.1, 0.3, 1e-3},
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

// Ends of the intervals of the cubic: 0, the knots below the peak, the peak, the knots beyond it.
constexpr int kEnds = kShapeKnots + 2;
constexpr int kPeakEnd = kKnotsBelowPeak + 1;
constexpr int end_of_knot(int knot) { return knot < kKnotsBelowPeak ? knot + 1 : knot + 2; }
constexpr std::array<double, kEnds> kEnd = [] {
  std::array<double, kEnds> ends{};
  for (int i = 0; i < kShapeKnots; ++i) {
    ends[static_cast<std::size_t>(end_of_knot(i))] = kShapeKnot[static_cast<std::size_t>(i)];
  }
  ends[kPeakEnd] = 1.0;
  return ends;
}();

using Cubics = std::array<std::array<double, 4>, kShapeKnots + 1>;

// Hermite cubics through y with the slopes of finite differences, flat at the last end.
Cubics cubics(const std::array<double, kEnds>& y) {
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

std::size_t interval_of(double x) {
  // Where to begin, per step of x no longer than the shortest interval.
  constexpr double kPerUnit = 16.0;
  static const std::vector<std::size_t> kFirst = [] {
    std::vector<std::size_t> first;
    for (int i = 0; i <= static_cast<int>(kEnd.back() * kPerUnit); ++i) {
      std::size_t j = 0;
      while (j + 2 < kEnds && kEnd[j + 1] < i / kPerUnit) ++j;
      first.push_back(j);
    }
    return first;
  }();
  if (!(x < kEnd.back())) return kEnds - 2;
  std::size_t j = kFirst[static_cast<std::size_t>(x * kPerUnit)];
  while (j + 2 < kEnds && kEnd[j + 1] < x) ++j;
  return j;
}

double cubic_at(const Cubics& c, double x) {
  const std::size_t j = interval_of(x);
  const double u = std::min(x, kEnd.back()) - kEnd[j];
  return c[j][0] + u * (c[j][1] + u * (c[j][2] + u * c[j][3]));
}

}  // namespace

double fall_function(double x) {
  const double beyond = x - 1.0;
  return beyond <= 0.0 ? 0.0 : -beyond * beyond / (0.3 + beyond);
}

namespace {

CurveShape::Point nominal_formula(double size) {
  static const double kStiffness = std::tan(std::numbers::pi / (2.0 * kBend));
  const double angle = kBend * std::atan(kStiffness * size);
  return {std::sin(angle),
          std::cos(angle) * kBend * kStiffness / (1.0 + kStiffness * kStiffness * size * size)};
}

// The same from a table, cubic between its points (error below 1e-7): it is evaluated millions of
// times.
CurveShape::Point nominal_curve(double size) {
  constexpr int kPerUnit = 64, kUnits = 4;
  static const std::vector<CurveShape::Point> kTable = [] {
    std::vector<CurveShape::Point> table;
    for (int i = 0; i <= kPerUnit * kUnits; ++i) {
      table.push_back(nominal_formula(static_cast<double>(i) / kPerUnit));
    }
    return table;
  }();
  if (!(size < kUnits)) return nominal_formula(size);
  const double at = size * kPerUnit;
  const auto i = static_cast<std::size_t>(at);
  const double u = at - static_cast<double>(i), v = 1.0 - u;
  const CurveShape::Point &a = kTable[i], &b = kTable[i + 1];
  constexpr double h = 1.0 / kPerUnit;
  const double rise = b.value - a.value;
  return {v * v * (1.0 + 2.0 * u) * a.value + u * u * (1.0 + 2.0 * v) * b.value +
              u * v * h * (v * a.slope - u * b.slope),
          6.0 * u * v * rise * kPerUnit + v * (1.0 - 3.0 * u) * a.slope +
              u * (1.0 - 3.0 * v) * b.slope};
}

}  // namespace

double nominal_inverse(double value) {
  static const double kStiffness = std::tan(std::numbers::pi / (2.0 * kBend));
  if (!(std::abs(value) < 1.0)) return std::numeric_limits<double>::quiet_NaN();
  return std::tan(std::asin(value) / kBend) / kStiffness;
}

CurveShape::CurveShape(std::span<const double, kShapeKnots> departure, double fall) : fall_(fall) {
  std::array<double, kEnds> y{};
  for (int i = 0; i < kShapeKnots; ++i) {
    y[static_cast<std::size_t>(end_of_knot(i))] = departure[static_cast<std::size_t>(i)];
  }
  cubic_ = cubics(y);
}

double CurveShape::departure(double x) const { return cubic_at(cubic_, x); }

CurveShape::Point CurveShape::evaluate(double x) const {
  const double size = std::abs(x);
  Point out = nominal_curve(size);
  const std::size_t j = interval_of(size);
  const double u = std::min(size, kEnd.back()) - kEnd[j];
  const auto& c = cubic_[j];
  out.value += c[0] + u * (c[1] + u * (c[2] + u * c[3]));
  if (size < kEnd.back()) out.slope += c[1] + u * (2.0 * c[2] + 3.0 * u * c[3]);
  if (fall_ != 0.0 && size > 1.0) {
    const double beyond = size - 1.0;
    out.value += fall_ * fall_function(size);
    out.slope -= fall_ * (beyond * beyond + 0.6 * beyond) / ((0.3 + beyond) * (0.3 + beyond));
  }
  out.value *= std::copysign(1.0, x);
  return out;
}

Quantities evaluate(const ExperimentData& run, int experiment,
                    const estimator::VariatorParameters& variator, const Eigen::VectorXd& nuisance,
                    const Effects& effects) {
  const int n = run.size();
  Context c{run,
            variator,
            experiment,
            run.omega_p.value,
            run.omega_s.value,
            run.pressure.value,
            run.torque.value,
            run.omega_p.slow_slope,
            run.omega_s.slow_slope,
            run.command.present ? run.command.value : ArrayXd(),
            {},
            {},
            {},
            ArrayXd::Zero(n),
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
  };
  apply(Stage::kMeasurement);
  c.force_N = variator.secondary_piston_area_m2 * c.pressure + variator.secondary_spring_force_N +
              variator.secondary_centrifugal_N_s2 * c.omega_s.square();
  apply(Stage::kForce);
  c.loss_Nm = nuisance[kLossConstant_Nm] + nuisance[kLossPerSpeed_Nms] * c.omega_p;
  if (run.torque_is_engine) {
    c.loss_Nm +=
        variator.primary_inertia_kg_m2 * (run.omega_p.slope + c.slope_p - run.omega_p.slow_slope);
  }
  apply(Stage::kDriveline);
  c.belt_torque = c.torque - c.loss_Nm;
  c.deformation = nuisance[kDeformationPerkN] * 1e-3 * c.force_N;
  ArrayXd ln_ratio_0(n), radius(n);
  const double ln_low = std::log(variator.ratio_low) + nuisance[kLnRatioLow];
  const double ln_overdrive = std::log(variator.ratio_overdrive) + nuisance[kLnRatioOverdrive];
  for (int k = 0; k < n; ++k) {
    const bool low = run.stop[static_cast<std::size_t>(k)] == kLowStop;
    ln_ratio_0[k] = low ? ln_low : ln_overdrive;
    radius[k] = low ? variator.primary_radius_low_m : variator.primary_radius_overdrive_m;
  }
  apply(Stage::kRatio);
  const ArrayXd ratio = (1.0 - c.deformation).max(0.05) * (ln_ratio_0 + c.ln_ratio).exp();
  c.slip = 1.0 - c.omega_s / (c.omega_p * ratio);
  apply(Stage::kFriction);

  Quantities q;
  q.slip = std::move(c.slip);
  q.ratio = ratio;
  q.capacity = (2.0 / std::cos(variator.half_wedge_angle_rad)) * radius * c.force_N.max(50.0) *
               (nuisance[kLnMuMax] + c.ln_friction).exp();
  if (run.torque_s.present) {
    // From the slow copies of all three channels: the inertia's share would else be fitted to the
    // noise of the speed's slope.
    q.balance = c.belt_torque + run.torque.slow - run.torque.value -
                ratio * (run.torque_s.slow + nuisance[kSecondaryInertia_kgm2] * c.slope_s);
  }
  if (run.command.present) {
    q.tracking =
        run.pressure.value - (1.0 + nuisance[kCommandGain]) * c.track - nuisance[kCommandOffset_Pa];
  }
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
