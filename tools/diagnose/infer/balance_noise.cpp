#include "tools/diagnose/infer/balance_noise.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "tools/diagnose/infer/noise_probe.h"

namespace beltgrip::diagnose {
using Eigen::ArrayXd;

namespace {
// Chosen, in the channel's unit: keeps a divisor from 0 where no channel has any noise. Ten times
// as much: the same bytes in eight campaigns.
constexpr double kLeast = 1e-6;
}  // namespace

std::array<BalanceNoise, kStops> parts_of_balance_noise(
    const Campaign& campaign, const ModelState& state,
    const std::array<double, kStops>& balance_Nm) {
  const double inertia_kg_m2 = state.nuisance[kSecondaryInertia_kgm2];
  std::array<BalanceNoise, kStops> out;
  for (std::size_t stop = 0; stop < kStops; ++stop) {
    std::vector<double> torque, torque_s, slope_s;
    double rounding2 = 0.0, rounding_s2 = 0.0, runs = 0.0;
    for (const ExperimentData& data : campaign.runs) {
      if (data.valid_count == 0 || !data.torque_s.present) continue;
      ArrayXd before = data.torque.slow;
      if (data.torque_is_engine) {
        before -= campaign.variator.primary_inertia_kg_m2 * data.omega_p.slow_slope;
      }
      constexpr int kReach = kSlowProbe.reach();
      for (const auto& [begin, end] : data.stretches) {
        for (int k = begin + kReach; k + kReach < end; k += 2) {
          if (data.stop[static_cast<std::size_t>(k)] != static_cast<int>(stop)) continue;
          torque.push_back(kSlowProbe.at(before, k));
          torque_s.push_back(kSlowProbe.at(data.torque_s.slow, k));
          slope_s.push_back(kSlowProbe.at(data.omega_s.slow_slope, k));
        }
      }
      rounding2 += data.rounding_torque_Nm * data.rounding_torque_Nm;
      rounding_s2 += data.rounding_torque_s_Nm * data.rounding_torque_s_Nm;
      runs += 1.0;
    }
    const double ratio =
        stop == kLowStop ? campaign.variator.ratio_low : campaign.variator.ratio_overdrive;
    const auto at_least = [&](double square, double sigma) {
      return std::max({sigma, std::sqrt(square / std::max(runs, 1.0)), kLeast});
    };
    const BalanceNoise seen{at_least(rounding2, robust_sigma(torque)),
                            at_least(rounding_s2, robust_sigma(torque_s)),
                            at_least(0.0, robust_sigma(slope_s))};
    const double behind_Nm = std::hypot(seen.torque_s_Nm, inertia_kg_m2 * seen.slope_s_rad_s2);
    out[stop] = seen.times(balance_Nm[stop] / std::hypot(seen.torque_Nm, ratio * behind_Nm));
  }
  return out;
}

BalanceVariance balance_variance(const Campaign& campaign, const ExperimentData& data,
                                 const Quantities& q, const ModelState& state) {
  const int n = data.size();
  BalanceVariance out{ArrayXd::Zero(n), ArrayXd::Zero(n), ArrayXd::Zero(n)};
  const double gain = 1.0 + state.nuisance[kSecondaryTorqueGain];
  const double inertia_kg_m2 = state.nuisance[kSecondaryInertia_kgm2];
  struct Variances {
    double before_Nm2, behind_Nm2, slope2;
  };
  std::array<Variances, kStops> of{};
  for (std::size_t stop = 0; stop < kStops; ++stop) {
    const BalanceNoise& noise = campaign.noise.balance[stop];
    const double slope2 = noise.slope_s_rad_s2 * noise.slope_s_rad_s2;
    of[stop] = {noise.torque_Nm * noise.torque_Nm,
                std::pow(noise.torque_s_Nm / gain, 2.0) + inertia_kg_m2 * inertia_kg_m2 * slope2,
                slope2};
  }
  for (int k = 0; k < n; k += kBalanceStep) {
    const auto i = static_cast<std::size_t>(k);
    if (!data.valid[i]) continue;
    const Variances& here = of[static_cast<std::size_t>(data.stop[i])];
    const double share = q.torque_share.size() > 0 ? q.torque_share[k] : 1.0;
    const double ratio2 = q.ratio[k] * q.ratio[k];
    out.behind[k] = ratio2 * here.behind_Nm2;
    out.total[k] = share * share * here.before_Nm2 + out.behind[k];
    out.per_inertia_kg_m2[k] = 2.0 * ratio2 * inertia_kg_m2 * here.slope2;
  }
  return out;
}

ArrayXd BalanceVariance::per_Nm() const { return (total > 0.0).select(total.rsqrt(), 0.0); }

ArrayXd BalanceVariance::ln_sigma_over(const BalanceVariance& other) const {
  return (total > 0.0).select(0.5 * (total / other.total).log(), 0.0);
}

}  // namespace beltgrip::diagnose
