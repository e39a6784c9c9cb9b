#include "tools/diagnose/model/variator_model.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <vector>

#include "tools/diagnose/model/curve_family.h"
#include "tools/diagnose/model/effects/effect.h"
#include "tools/diagnose/model/lanes.h"
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
      // Pulleys give way by 0.5 to 2 % at 5 kN: up to 4e-3.
      {"deformation_per_kN", 1.0e-3, 1.5e-3, 1e-5},
      // That it does so in proportion is a lumped form: a tenth of what it is at 5 kN, of pulleys
      // that give way by 1 %, one of an effect's usual size.
      {"deformation_per_kN2", 0.0, 2e-5, 1e-7},
      // Chosen: from all that follows to all that stays are two of these.
      {"deformation_lost_share", 0.0, 0.5, 1e-3},
      {"loss_constant_Nm", 0.5, 0.6, 1e-2},
      {"loss_per_rad_s_Nm", 5e-3, 4e-3, 1e-4},
      // A variator loses 1 to 4 Nm, more with more clamp: beside the two above up to 3 Nm at 10 kN.
      {"loss_per_kN_Nm", 0.12, 0.08, 1e-3},
      {"ln_ratio_overdrive", 0.0, 6e-4, 1e-5},
      {"ln_ratio_low", 0.0, 6e-4, 1e-5},
      {"secondary_inertia_kg_m2", 0.1, 0.3, 1e-3},
      {"secondary_loss_constant_Nm", 0.5, 0.6, 1e-2},
      {"secondary_loss_per_rad_s_Nm", 2e-3, 4e-3, 1e-4},
      // Its bearings carry the same force; that of both shafts together is up to 3 Nm as well.
      {"secondary_loss_per_kN_Nm", 0.05, 0.08, 1e-3},
      {"secondary_torque_gain", 0.0, 0.0, 1e-4},
      {"secondary_pressure_bias_Pa", 0.0, 0.0, 10.0},
      {"secondary_centrifugal_off_N_s2", 0.0, 0.0, 1e-6},
      // Chosen: what is usual is two of these.
      {"clamp_play_N", 0.0, 0.5 * kUsualPlay_N, 5.0},
      // Chosen: as likely in between as at either end.
      {"clamp_play_from", 0.0, 1.0, 0.1},
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
// Slow, and mostly there is nothing, or the same in all of the experiment: one exponential then, as
// Eigen has it of a pair and of an odd last one.
void multiply_by_exp(const ArrayXd& ln, ArrayXd& values) {
  if (ln.size() == 0) return;
  const bool is_same = std::all_of(ln.begin(), ln.end(), [&](double v) { return v == ln[0]; });
  if (!is_same) {
    values *= ln.exp();
  } else if (ln[0] != 0.0) {
    const Eigen::Index odd = ln.size() % 2;
    const ArrayXd factor = ArrayXd::Constant(2 + odd, ln[0]).exp();
    values.head(ln.size() - odd) *= factor[0];
    values.tail(odd) *= factor[factor.size() - 1];
  }
}

// play(x) - x: follows only after the input has moved by the width on either side. Odd in the
// width. first: where it rests before the input has moved, in widths above it; what went before a
// recording is not in it.
ArrayXd play_change(const ArrayXd& in, double half_width, double first) {
  const double w = std::abs(half_width);
  ArrayXd out = ArrayXd::Zero(in.size());
  double y = std::nan("");
  for (Eigen::Index k = 0; k < in.size(); ++k) {
    const double x = in[k];
    if (!std::isfinite(x)) continue;
    if (!std::isfinite(y)) y = x + first * w;
    y = std::clamp(y, x - w, x + w);
    out[k] = std::copysign(1.0, half_width) * (y - x);
  }
  return out;
}

constexpr double kLeastForce_N = 50.0;  // chosen, of what a force is divided by

// The passes over the samples, between which the effects act. Each row by itself, in place and
// without columns between: what an array expression would say, in the same order.
class Passes {
 public:
  Passes(const ExperimentData& run, const Readings& read,
         const estimator::VariatorParameters& variator, const Eigen::VectorXd& nuisance)
      : run_(run), read_(read), variator_(variator), nuisance_(nuisance), n_(run.size()) {}

  void force(Context& c) const {
    const double area_m2 = variator_.secondary_piston_area_m2;
    const BesidePressure beside(variator_);
    c.force_N.resize(n_);
    for_rows(n_, [=, pressure_Pa = c.pressure.data(), omega_s = c.omega_s.data(),
                  out_N = c.force_N.data()](Row k) BELTGRIP_INLINE {
      out_N[k] = area_m2 * pressure_Pa[k] + beside.at_N(omega_s[k]);
    });
  }
  void loss(Context& c) const {
    const double constant_Nm = nuisance_[kLossConstant_Nm];
    const double per_speed_Nms = nuisance_[kLossPerSpeed_Nms];
    const double per_N_Nm = nuisance_[kLossPerkN_Nm] * 1e-3;
    c.loss_Nm.resize(n_);
    for_rows(n_, [=, omega_p = c.omega_p.data(), force_N = c.force_N.data(),
                  out_Nm = c.loss_Nm.data()](Row k) BELTGRIP_INLINE {
      out_Nm[k] = constant_Nm + per_speed_Nms * omega_p[k] + per_N_Nm * force_N[k];
    });
    if (!run_.torque_is_engine) return;
    for_rows(n_, [inertia_kg_m2 = c.primary_inertia_kg_m2, slope = run_.omega_p.slope.data(),
                  slow_slope = run_.omega_p.slow_slope.data(), slope_p = c.slope_p.data(),
                  out_Nm = c.loss_Nm.data()](Row k) BELTGRIP_INLINE {
      out_Nm[k] += inertia_kg_m2 * (slope[k] + slope_p[k] - slow_slope[k]);
    });
  }
  void belt(Context& c) const {
    c.belt_torque.resize(n_);
    c.deformation.resize(n_);
    for_rows(n_,
             [per_N = nuisance_[kDeformationPerkN] * 1e-3, torque_Nm = c.torque.data(),
              loss_Nm = c.loss_Nm.data(), force_N = c.force_N.data(), out_Nm = c.belt_torque.data(),
              out_share = c.deformation.data()](Row k) BELTGRIP_INLINE {
               out_Nm[k] = torque_Nm[k] - loss_Nm[k];
               out_share[k] = per_N * force_N[k];
             });
    c.deformation_bend = nuisance_[kDeformationPerkN2] * 1e-6 * c.force_N.square();
    c.deformation += c.deformation_bend;
  }
  ArrayXd ratio(const Context& c) const {
    const double low = variator_.ratio_low * std::exp(nuisance_[kLnRatioLow]);
    const double overdrive = variator_.ratio_overdrive * std::exp(nuisance_[kLnRatioOverdrive]);
    ArrayXd out(n_);
    for_rows(n_, [=, stop = run_.stop.data(), deformation = c.deformation.data(),
                  to = out.data()](Row k) BELTGRIP_INLINE {
      const double unloaded = stop[k] == kLowStop ? low : overdrive;
      to[k] = unloaded * std::max(1.0 - deformation[k], kLeastRadiusShare);
    });
    multiply_by_exp(c.ln_ratio, out);
    return out;
  }
  void slip(const ArrayXd& ratio, Context& c) const {
    c.slip_share.resize(n_);
    for_rows(n_, [omega_p = c.omega_p.data(), omega_s = c.omega_s.data(), at = ratio.data(),
                  out_share = c.slip_share.data()](Row k)
                     BELTGRIP_INLINE { out_share[k] = 1.0 - omega_s[k] / (omega_p[k] * at[k]); });
  }
  // What effects change of the clamp force counts as a share of it, without the pressure's noise:
  // else a hypothesis with more force would divide that noise by more, and fit better for that
  // alone.
  ArrayXd capacity(const Context& c) const {
    const double gain =
        2.0 / std::cos(variator_.half_wedge_angle_rad) * std::exp(nuisance_[kLnMuMax]);
    const double low_m = gain * variator_.primary_radius_low_m;
    const double overdrive_m = gain * variator_.primary_radius_overdrive_m;
    const double area_m2 = variator_.secondary_piston_area_m2;
    const BesidePressure beside(variator_);
    ArrayXd out(n_);
    for_rows(n_, [=, stop = run_.stop.data(), pressure_Pa = read_.pressure_Pa.data(),
                  sharp_Pa = run_.pressure.sharp.data(), omega_s = c.omega_s.data(),
                  force_N = c.force_N.data(), to = out.data()](Row k) BELTGRIP_INLINE {
      const double lever_m = stop[k] == kLowStop ? low_m : overdrive_m;
      const double beside_N = beside.at_N(omega_s[k]);
      const double read_N = area_m2 * pressure_Pa[k] + beside_N;
      const double calm_N = area_m2 * sharp_Pa[k] + beside_N;
      const double counts_N =
          read_N * (1.0 + (force_N[k] - read_N) / std::max(calm_N, kLeastForce_N));
      to[k] = lever_m * std::max(counts_N, kLeastForce_N);
    });
    multiply_by_exp(c.ln_friction, out);
    return out;
  }
  void secondary_loss(Context& c) const {
    c.secondary_loss_Nm = nuisance_[kSecondaryLoss_Nm] +
                          nuisance_[kSecondaryLossPerSpeed_Nms] * c.omega_s +
                          nuisance_[kSecondaryLossPerkN_Nm] * 1e-3 * c.force_N;
  }
  // From the slow copies of all channels, the inertia's share of the engine's torque among them: by
  // the fast slope it would stand against a torque that no longer has what is fast, and what stands
  // behind the belt would be fitted to the noise of the speed's slope.
  ArrayXd balance(const Context& c, const ArrayXd& ratio) const {
    const double inertia_kg_m2 = nuisance_[kSecondaryInertia_kgm2];
    const double gain = 1.0 + nuisance_[kSecondaryTorqueGain];
    const double lost = nuisance_[kDeformationLost];
    ArrayXd out(n_);
    for_rows(n_, [=, belt_Nm = c.belt_torque.data(), slow_Nm = run_.torque.slow.data(),
                  read_Nm = read_.torque_Nm.data(), slow_s_Nm = run_.torque_s.slow.data(),
                  slope_s = c.slope_s.data(), loss_s_Nm = c.secondary_loss_Nm.data(),
                  deformation = c.deformation.data(), at = ratio.data(),
                  to = out.data()](Row k) BELTGRIP_INLINE {
      const double behind_Nm = slow_s_Nm[k] / gain + inertia_kg_m2 * slope_s[k] + loss_s_Nm[k];
      to[k] =
          belt_Nm[k] + slow_Nm[k] - read_Nm[k] - at[k] * (1.0 + lost * deformation[k]) * behind_Nm;
    });
    if (run_.torque_is_engine) {
      out += c.primary_inertia_kg_m2 * (run_.omega_p.slope - run_.omega_p.slow_slope);
    }
    return out;
  }
  ArrayXd tracking(const Context& c) const {
    ArrayXd out(n_);
    for_rows(n_, [gain = 1.0 + nuisance_[kCommandGain], offset_Pa = nuisance_[kCommandOffset_Pa],
                  pressure_Pa = read_.pressure_Pa.data(), track_Pa = c.track.data(),
                  to = out.data()](Row k)
                     BELTGRIP_INLINE { to[k] = pressure_Pa[k] - gain * track_Pa[k] - offset_Pa; });
    return out;
  }

 private:
  using Row = std::ptrdiff_t;
  struct BesidePressure {
    explicit BesidePressure(const estimator::VariatorParameters& variator)
        : spring_N(variator.secondary_spring_force_N),
          per_speed2_N_s2(variator.secondary_centrifugal_N_s2) {}
    double spring_N, per_speed2_N_s2;
    BELTGRIP_LANES double at_N(double omega_s) const {
      return spring_N + per_speed2_N_s2 * (omega_s * omega_s);
    }
  };

  const ExperimentData& run_;
  const Readings& read_;
  const estimator::VariatorParameters& variator_;
  const Eigen::VectorXd& nuisance_;
  Row n_;
};
}  // namespace

void take_torque_share(const ArrayXd& share, Context& c) {
  c.torque -= c.run.torque.slow * share;
  if (c.torque_share.size() == 0) c.torque_share = ArrayXd::Ones(share.size());
  c.torque_share -= share;
}

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
            {},
            run.omega_p.slow_slope,
            run.omega_s.slow_slope,
            variator.primary_inertia_kg_m2 *
                (1.0 - effects.primary_share_of_gain * nuisance[kSecondaryTorqueGain]),
            run.command.present ? run.command.value : ArrayXd(),
            {},
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
  const Passes pass(run, read, variator, nuisance);
  c.pressure -= nuisance[kPressureBias_Pa];
  apply(Stage::kMeasurement);
  pass.force(c);
  if (const double off_N_s2 = nuisance[kCentrifugalOff_N_s2]; off_N_s2 != 0.0) {
    c.force_N += off_N_s2 * c.omega_s.square();
  }
  c.play_N = nuisance[kPlay_N];
  c.play_from = nuisance[kPlayFrom];
  apply(Stage::kForce);
  if (c.play_N != 0.0) {
    c.force_N +=
        play_change(variator.secondary_piston_area_m2 * run.pressure.sharp, c.play_N, c.play_from);
  }
  pass.loss(c);
  apply(Stage::kDriveline);
  pass.belt(c);
  apply(Stage::kRatio);
  ArrayXd ratio = pass.ratio(c);
  pass.slip(ratio, c);
  apply(Stage::kFriction);

  Quantities q;
  q.capacity = pass.capacity(c);
  if (run.torque_s.present) {
    pass.secondary_loss(c);
    apply(Stage::kSecondaryShaft);
    q.balance = pass.balance(c, ratio);
    q.secondary_loss_Nm = std::move(c.secondary_loss_Nm);
  }
  if (run.command.present) q.tracking = pass.tracking(c);
  q.slip_share = std::move(c.slip_share);
  q.ratio = std::move(ratio);
  q.deformation = std::move(c.deformation);
  q.force_N = std::move(c.force_N);
  q.belt_torque = std::move(c.belt_torque);
  q.omega_p = std::move(c.omega_p);
  q.omega_s = std::move(c.omega_s);
  q.slope_s = std::move(c.slope_s);
  q.torque_share = std::move(c.torque_share);
  q.deformation_bend = std::move(c.deformation_bend);
  q.ln_peak_slip = c.ln_peak_slip;
  q.fall = c.fall;
  return q;
}

}  // namespace beltgrip::diagnose
