#include "daemon/core/experiment/ramp_rate.h"

#include <algorithm>

namespace beltgrip::daemon {

namespace {
// Chosen: a belt whose peak lies at 2 % slips so fast at 85 % of its friction. A fifth less or
// more: not run.
constexpr double kNearRateShare = 0.25;
constexpr double kHoldShare = 0.7;  // of the slip rate: the ramp slows down over this much
constexpr double kHoldRate_N_per_s = 600.0;
}  // namespace

bool peak_is_far(const RampLaw& law, double mu_star, double slip_rate_1_s) noexcept {
  return mu_star < law.mu_far && slip_rate_1_s < kNearRateShare * law.slip_rate_1_s;
}

double ramp_near_N_per_s(const RampLaw& law, double mu_star, double slip_rate_1_s) noexcept {
  const double left = (law.slip_rate_1_s - slip_rate_1_s) / (kHoldShare * law.slip_rate_1_s);
  const double most_N_per_s = mu_star < law.mu_top
                                  ? law.rate_max_N_per_s
                                  : std::min(law.rate_top_N_per_s, law.rate_max_N_per_s);
  return std::clamp(kHoldRate_N_per_s * left, 0.0, most_N_per_s);
}

}  // namespace beltgrip::daemon
