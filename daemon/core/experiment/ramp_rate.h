// How fast the force of a request falls: fast while the belt's peak is far, then as fast as holds
// the slip rate with which it is to cross it. Creeping over the peak costs more energy, not less.
// Pure; SI, slip as a fraction.
#pragma once

namespace beltgrip::daemon {

// Chosen: of the least friction of a belt, what no peak lies below.
inline constexpr double kBelowPeaks = 0.8;

struct RampLaw {
  double rate_max_N_per_s = 0.0;
  double rate_top_N_per_s = 0.0;  // near the peak
  double slip_rate_1_s = 0.0;     // that is held
  double mu_far = 0.0;            // below it the peak is far, while slip is slow
  double mu_top = 0.0;            // below it no peak lies: the ramp need not be slow for one
};

// Once it is not, the peak stays near.
bool peak_is_far(const RampLaw& law, double mu_star, double slip_rate_1_s) noexcept;
// Near the peak.
double ramp_near_N_per_s(const RampLaw& law, double mu_star, double slip_rate_1_s) noexcept;

}  // namespace beltgrip::daemon
