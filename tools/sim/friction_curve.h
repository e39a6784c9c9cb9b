// The simulated belt's own friction law: coefficient over slip, odd in slip. It shares nothing with
// the estimator. Slip as a fraction (0.02 = 2 %). Pure functions.
//
//   tanh_fall      mu_pk tanh(2.2 s / s_pk) / tanh(2.2) up to the peak, then a linear fall that
//                  ends at half the peak. A kink at the peak: the hard case for a local fit. With a
//                  plateau the fall begins so much later.
//   magic_formula  D sin(C atan(B s)), smooth at the peak; C = 1.3, B puts the peak at s_pk.
//                  fall_at_once drops by that share within 0.1 % of slip beyond the peak.
//   two_peaks      as tanh_fall to the peak, a dip of 3 % and a second peak 1 % lower at twice its
//                  slip, then the linear fall.
//   saturating     mu_pk tanh(2.2 s / s_pk): rises for ever, has no peak.
//   broad_top      a tanh(2.2 s / s_knee) + rise s up to the peak, a so that the peak is mu_pk;
//   then
//                  the linear fall of tanh_fall. Most of the rise is over at the knee, and slip
//                  runs along the top at a rate that can be seen.
#pragma once

namespace beltgrip::sim {

enum class CurveShape { kTanhFall, kMagicFormula, kSaturating, kTwoPeaks, kBroadTop };

struct FrictionCurve {
  CurveShape shape = CurveShape::kTanhFall;
  double mu_max = 0.105;
  double peak_slip_percent = 2.0;
  double fall_per_percent = 1.5e-3;  // linear fall: mu lost per percent beyond the peak
  double fall_at_once = 0.0;         // tanh_fall only: share
  double plateau_percent = 0.0;      // tanh_fall only: of slip
  double knee_slip_percent = 1.5;    // broad_top only: end of the steep foot
  double rise_per_percent = 1e-3;    // broad_top only: mu gained per percent along the top

  // Where the friction begins to fall, as a fraction.
  double fall_slip_share() const { return (peak_slip_percent + plateau_percent) / 100.0; }
};

struct FrictionPoint {
  double mu = 0.0;
  double slope = 0.0;  // d mu / d slip, per unit slip
};

FrictionPoint friction_at(const FrictionCurve& curve, double slip_share);

}  // namespace beltgrip::sim
