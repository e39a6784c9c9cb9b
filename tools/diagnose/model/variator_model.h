// The variator as algebra on measured signals: which slip, belt torque and torque capacity the
// model sees in the data, given its parameters and the effects switched on. No integration over the
// friction curve, so it holds on both sides of the peak.
//   F_s = A p_s + F_spring + c omega_s^2          T_belt = T_p - J d(omega_p)/dt - loss
//   sigma = 1 - omega_s / (omega_p r_g)           capacity K = 2 R_p F_s mu_max / cos(theta)
//   T_belt = K g(sigma / sigma_peak)
//   balance: T_belt - r_g (T_s / (1 + gain_s) + J_s d(omega_s)/dt + loss_s)
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cmath>
#include <span>
#include <string_view>
#include <vector>

#include "estimator/physics/parameters.h"
#include "tools/diagnose/data/experiment_data.h"

namespace beltgrip::diagnose {

// Where the friction curve may depart from the nominal one: x = slip / slip at the peak; at 0 and 1
// it may not, beyond the last knot it stays.
inline constexpr int kShapeKnots = 13;
inline constexpr int kKnotsBelowPeak = 8;
inline constexpr std::array<double, kShapeKnots> kShapeKnot{0.06, 0.12, 0.2, 0.3, 0.42, 0.56, 0.72,
                                                            0.88, 1.12, 1.3, 1.6, 2.1,  3.0};

// Constants of the nominal machine that a measurement has to find before anything else can be
// judged. Each has a nominal value and a tolerance (one sigma) of what is still the nominal
// machine.
enum Nuisance : int {
  kLnMuMax,
  kLnPeakSlipOverdrive,  // ln of the slip at the peak, a share
  kLnPeakSlipLow,
  // kShapeKnots values: departure from the nominal curve, shares of mu_max; fitted along the modes
  // of curve_family.h, of which each has a tolerance of 1.
  kShapeOverdrive,
  kShapeLow = kShapeOverdrive + kShapeKnots,
  kEndOfShapes = kShapeLow + kShapeKnots - 1,
  kDeformationPerkN,
  kDeformationPerkN2,
  kDeformationLost,  // share of it that takes speed as slip does, and leaves the torques' ratio
  kLossConstant_Nm,
  kLossPerSpeed_Nms,
  kLossPerkN_Nm,
  kLnRatioOverdrive,
  kLnRatioLow,
  kSecondaryInertia_kgm2,
  kSecondaryLoss_Nm,
  kSecondaryLossPerSpeed_Nms,
  kSecondaryLossPerkN_Nm,
  kSecondaryTorqueGain,  // T_measured = (1 + gain) T_true, as far as the sensors' accuracies go
  kPressureBias_Pa,      // p_measured = p_true + bias, the same
  kCentrifugalOff_N_s2,  // F_true = F_model + off omega_s^2, as far as a maker's value goes
  kPlay_N,               // friction in the clamp force's way, with play at reversal
  kPlayFrom,          // where the force rests before it has moved: -1 raised to it, 1 lowered to it
  kCommandOffset_Pa,  // tracking residual only
  kCommandGain,
  kNuisanceCount
};

// Friction of cylinder and splines in the clamp force's way that any machine may have. Chosen: a
// fifth less than the literature's usual one (100 N; 30 to 300 N), so that this is told. Healthy
// machines of two generators of other make have 25 to 80 N. With a quarter more, in 200 of their
// campaigns, opened: 13 of 84 healthy ones alarm instead of 14, 25 of 32 names are in the class
// instead of 26; plays of 80 to 100 N have no name. A fifth more: the same in 60 of them; a fifth
// less, of 58: two healthy machines of 63 and 71 N alarm, three others of 72 to 77 N get the name.
inline constexpr double kUsualPlay_N = 80.0;

struct NuisanceRow {
  std::string_view name;
  double nominal;
  double tolerance;  // one sigma
  double step;       // for derivatives
};
using NuisanceTable = std::array<NuisanceRow, kNuisanceCount>;
NuisanceTable default_nuisances();

// What the two noisiest channels read, sample by sample: the run's own, or others in their place.
struct Readings {
  const Eigen::ArrayXd& pressure_Pa;
  const Eigen::ArrayXd& torque_Nm;
};

// Chosen (moved): no deformation leaves less; those of machines take some per cent, so that another
// one decides nothing.
constexpr double kLeastRadiusShare = 0.05;

// State of one evaluation; effects change it at their injection point.
struct Context {
  const ExperimentData& run;
  const Readings& read;
  const estimator::VariatorParameters& variator;
  int experiment = 0;                                 // its place in the order given
  Eigen::ArrayXd omega_p, omega_s, pressure, torque;  // the true ones, as the model believes
  Eigen::ArrayXd torque_share;      // of the torque's slow copy, what is believed of it; empty: all
  Eigen::ArrayXd slope_p, slope_s;  // of both speeds, slow copies
  // Before the belt, in the measure of the primary torque: what that reads too little is missing
  // of what speeding up takes as well.
  double primary_inertia_kg_m2 = 0.0;
  Eigen::ArrayXd track;        // what p_s should be by the command (tracking residual)
  Eigen::ArrayXd force_N;      // F_s
  Eigen::ArrayXd loss_Nm;      // between shaft and belt, drag positive
  Eigen::ArrayXd deformation;  // r_g = r_g0 max(1 - deformation, kLeastRadiusShare) exp(ln_ratio)
  // F d(deformation)/dF beyond the deformation itself; 0 where it grows in proportion.
  Eigen::ArrayXd deformation_bend;
  Eigen::ArrayXd ln_ratio;
  Eigen::ArrayXd slip_share, belt_torque;
  Eigen::ArrayXd secondary_loss_Nm;  // between belt and secondary torque, drag positive
  Eigen::ArrayXd ln_friction;
  std::array<double, kStops> ln_peak_slip{}, fall{};
  double play_N = 0.0;     // on either side
  double play_from = 0.0;  // where the force rests before it has moved, in plays above it
};

// The torque less a share of what its slow copy reads.
void take_torque_share(const Eigen::ArrayXd& share, Context& c);

// What the residuals are made of.
struct Quantities {
  Eigen::ArrayXd slip_share, belt_torque, capacity, force_N, deformation, ratio, balance, tracking;
  Eigen::ArrayXd omega_p, omega_s;                // the true ones
  Eigen::ArrayXd slope_s;                         // of omega_s
  Eigen::ArrayXd torque_share, deformation_bend;  // of Context
  Eigen::ArrayXd secondary_loss_Nm;               // empty without secondary torque
  std::array<double, kStops> ln_peak_slip{}, fall{};
};

struct Effects;  // values of the slots, effects/effect.h

Quantities evaluate(const ExperimentData& run, const Readings& read, int experiment,
                    const estimator::VariatorParameters& variator, const Eigen::VectorXd& nuisance,
                    const Effects& effects);
// Of the run's own readings.
Quantities evaluate(const ExperimentData& run, int experiment,
                    const estimator::VariatorParameters& variator, const Eigen::VectorXd& nuisance,
                    const Effects& effects);

// The departure's cubic in which x = slip / slip at the peak, x >= 0, lies, and where in it.
struct SplinePosition {
  std::size_t interval = 0;
  double u = 0.0;  // from the interval's left end
};
SplinePosition spline_position(double x);

// Which end of an interval of the departure a knot is: the peak stands between them.
constexpr int end_of_knot(int knot) { return knot < kKnotsBelowPeak ? knot + 1 : knot + 2; }

// g(x), x = slip / slip at the peak, odd; nominal: sin(1.3 atan(B x)), peak 1 at x = 1; departure:
// cubic through the knots; fall: beyond the peak.
// Evaluated millions of times: the nominal curve stands in a table. Many points of one curve at
// once: curve_lanes.h.
class CurveShape {
 public:
  CurveShape() = default;
  explicit CurveShape(std::span<const double, kShapeKnots> departure, double fall);
  struct Point {
    double value = 0.0;
    double slope = 0.0;
  };
  Point evaluate(double x) const {
    const double size = std::abs(x);
    Point out;
    if (size < kCellUnits) {
      const double at = size * kCellsPerUnit;
      const auto i = static_cast<std::size_t>(at);
      const Cell& cell = (*cells_)[i];
      const double v = at - static_cast<double>(i);
      const auto& n = cell.nominal;
      out.value = n[0] + v * (n[1] + v * (n[2] + v * n[3]));
      out.slope = (n[1] + v * (2.0 * n[2] + 3.0 * v * n[3])) * kCellsPerUnit;
      const std::size_t j = interval_from(cell.interval, size);
      const auto& c = cubic_[j];
      const double u = std::min(size, kEnd.back()) - kEnd[j];
      out.value += c[0] + u * (c[1] + u * (c[2] + u * c[3]));
      if (size < kEnd.back()) out.slope += c[1] + u * (2.0 * c[2] + 3.0 * u * c[3]);
    } else {
      out = far(size);
    }
    if (fall_ != 0.0 && size > 1.0) add_fall(size, out);
    out.value *= std::copysign(1.0, x);
    return out;
  }
  // Of the departure in an interval, by the power of its abscissa from the interval's left end.
  const std::array<double, 4>& cubic(std::size_t interval) const { return cubic_[interval]; }
  double departure(const SplinePosition& at) const {  // of the value, without the fall
    const auto& c = cubic_[at.interval];
    const double u = at.u;
    return c[0] + u * (c[1] + u * (c[2] + u * c[3]));
  }

 private:
  friend SplinePosition spline_position(double x);
  template <typename Lanes>
  friend class CurveLanes;
  // Ends of the intervals of the cubic: 0, the knots below the peak, the peak, the knots beyond it.
  static constexpr int kEnds = kShapeKnots + 2;
  static constexpr int kPeakEnd = kKnotsBelowPeak + 1;
  static constexpr std::array<double, kEnds> kEnd = [] {
    std::array<double, kEnds> ends{};
    for (int i = 0; i < kShapeKnots; ++i) {
      ends[static_cast<std::size_t>(end_of_knot(i))] = kShapeKnot[static_cast<std::size_t>(i)];
    }
    ends[kPeakEnd] = 1.0;
    return ends;
  }();
  // The nominal curve as cubics between points of a table (error below 1e-7), beside each the
  // interval of the departure that it begins in.
  static constexpr std::size_t kCellsPerUnit = 64, kCellUnits = 4;
  static_assert(kShapeKnot.back() < kCellUnits);
  struct Cell {
    std::array<double, 4> nominal;  // of the cell's own abscissa, 0 to 1
    std::size_t interval;
  };
  using Cells = std::array<Cell, kCellsPerUnit * kCellUnits>;
  static const Cells& cells();
  static std::size_t interval_from(std::size_t first, double x) {
    while (first + 2 < kEnds && kEnd[first + 1] < x) ++first;
    return first;
  }
  using Cubics = std::array<std::array<double, 4>, kShapeKnots + 1>;
  static Cubics cubics(const std::array<double, kEnds>& y);
  Point far(double size) const;  // beyond the table
  void add_fall(double size, Point& point) const;

  const Cells* cells_ = nullptr;  // at hand: a look-up behind a guard costs as much as the cubics
  Cubics cubic_{};                // per interval, from its left end
  double fall_ = 0.0;
};
// Where the nominal curve, before its peak, has this value; NaN beyond. Against the root of what
// the peak is away by it is smooth, also at the peak: cubics.
class NominalInverse {
 public:
  static constexpr int kRoots = 64;
  struct Point {
    double x, step;  // change of x over one step of the table
  };
  using Points = std::array<Point, kRoots + 1>;
  static const Points& points();
};
double nominal_inverse(double value);
double fall_function(double x);  // d g / d fall, x >= 0

}  // namespace beltgrip::diagnose
