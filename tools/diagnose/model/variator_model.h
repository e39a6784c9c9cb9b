// The variator as algebra on measured signals: which slip, belt torque and torque capacity the
// model sees in the data, given its parameters and the effects switched on. No integration over the
// friction curve, so it holds on both sides of the peak.
//   F_s = A p_s + F_spring + c omega_s^2          T_belt = T_p - J d(omega_p)/dt - loss
//   sigma = 1 - omega_s / (omega_p r_g)           capacity K = 2 R_p F_s mu_max / cos(theta)
//   T_belt = K g(sigma / sigma_peak)
//   balance: T_belt - r_g (T_s + J_s d(omega_s)/dt + loss_s)
#pragma once

#include <Eigen/Core>
#include <array>
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
  kLossConstant_Nm,
  kLossPerSpeed_Nms,
  kLnRatioOverdrive,
  kLnRatioLow,
  kSecondaryInertia_kgm2,
  kSecondaryLoss_Nm,
  kSecondaryLossPerSpeed_Nms,
  kCommandOffset_Pa,  // tracking residual only
  kCommandGain,
  kNuisanceCount
};

struct NuisanceRow {
  std::string_view name;
  double nominal;
  double tolerance;  // one sigma
  double step;       // for derivatives
};
using NuisanceTable = std::array<NuisanceRow, kNuisanceCount>;
NuisanceTable default_nuisances();

// State of one evaluation; effects change it at their injection point.
struct Context {
  const ExperimentData& run;
  const estimator::VariatorParameters& variator;
  int experiment = 0;                                 // its place in the order given
  Eigen::ArrayXd omega_p, omega_s, pressure, torque;  // the true ones, as the model believes
  Eigen::ArrayXd slope_p, slope_s;                    // of both speeds, slow copies
  Eigen::ArrayXd track;        // what p_s should be by the command (tracking residual)
  Eigen::ArrayXd force_N;      // F_s
  Eigen::ArrayXd loss_Nm;      // between shaft and belt, drag positive
  Eigen::ArrayXd deformation;  // r_g = r_g0 (1 - deformation) exp(ln_ratio)
  Eigen::ArrayXd ln_ratio;
  Eigen::ArrayXd slip, belt_torque;
  Eigen::ArrayXd secondary_loss_Nm;  // between belt and secondary torque, drag positive
  Eigen::ArrayXd ln_friction;
  std::array<double, kStops> ln_peak_slip{}, fall{};
};

// What the residuals are made of.
struct Quantities {
  Eigen::ArrayXd slip, belt_torque, capacity, force_N, deformation, ratio, balance, tracking;
  Eigen::ArrayXd omega_p, omega_s;   // the true ones
  Eigen::ArrayXd slope_s;            // of omega_s
  Eigen::ArrayXd secondary_loss_Nm;  // empty without secondary torque
  std::array<double, kStops> ln_peak_slip{}, fall{};
};

struct Effects;  // values of the slots, effects/effect.h

Quantities evaluate(const ExperimentData& run, int experiment,
                    const estimator::VariatorParameters& variator, const Eigen::VectorXd& nuisance,
                    const Effects& effects);

// Where on the departure's cubics x = slip / slip at the peak, x >= 0, lies.
struct CurvePlace {
  std::size_t interval = 0;
  double u = 0.0;  // from the interval's left end
};
CurvePlace place_on_curve(double x);

// g(x), x = slip / slip at the peak, odd; nominal: sin(1.3 atan(B x)), peak 1 at x = 1; departure:
// cubic through the knots; fall: beyond the peak.
class CurveShape {
 public:
  CurveShape() = default;
  explicit CurveShape(std::span<const double, kShapeKnots> departure, double fall);
  struct Point {
    double value = 0.0;
    double slope = 0.0;
  };
  Point evaluate(double x) const;
  double departure(const CurvePlace& place) const;  // of the value, without the fall

 private:
  std::array<std::array<double, 4>, kShapeKnots + 1> cubic_{};  // per interval, from its left end
  double fall_ = 0.0;
};
// Where the nominal curve, before its peak, has this value; NaN beyond.
double nominal_inverse(double value);
double fall_function(double x);  // d g / d fall, x >= 0

}  // namespace beltgrip::diagnose
