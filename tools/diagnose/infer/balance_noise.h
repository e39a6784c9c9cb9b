// The noise of the balance, by the channels it comes from: a hypothesis that changes what one of
// them counts changes its noise as well. A gain of the torque divides that of the torque, a lower
// ratio takes off that of the secondary torque: by the noise of the machine as it was they would
// fit better for that alone.
#pragma once

#include <Eigen/Core>
#include <array>

#include "tools/diagnose/data/experiment_data.h"

namespace beltgrip::diagnose {

struct Campaign;
struct ModelState;
struct Quantities;

// Samples of the slow copies, chosen: nearly independent, two so far apart share e^-1 of their
// noise (kSlowProbe). It decides: of eight narrow campaigns of tests/rounds, the probe's
// correlation with it, 4 loses one name (5007) and gives two classes further members; 6 loses two
// names (5007, 8144) and what is there from two classes (8240, 8242).
inline constexpr int kBalanceStep = 5;

// One sigma of one sample of the slow copies, so that all together make what the balance of the
// nominal machine was seen to have.
struct BalanceNoise {
  double torque_Nm = 0.1;  // before the belt, what the inertia there takes counted in
  double torque_s_Nm = 0.0;
  double slope_s_rad_s2 = 0.0;
  BalanceNoise times(double factor) const {
    return {torque_Nm * factor, torque_s_Nm * factor, slope_s_rad_s2 * factor};
  }
};

// balance_Nm: of each end stop, one sigma of the balance at that state, from differences of
// neighbours. The parts are told in the same way.
std::array<BalanceNoise, kStops> parts_of_balance_noise(
    const Campaign& campaign, const ModelState& state,
    const std::array<double, kStops>& balance_Nm);

// Nm^2, of one sample in kBalanceStep; 0 in all others and in those that are not valid.
struct BalanceVariance {
  Eigen::ArrayXd total;
  Eigen::ArrayXd behind;             // the part that counts by the square of the ratio
  Eigen::ArrayXd per_inertia_kg_m2;  // d(total) / d(secondary inertia)

  Eigen::ArrayXd per_Nm() const;  // 1 / sigma
  // ln(sigma) less that of another one.
  Eigen::ArrayXd ln_sigma_over(const BalanceVariance& other) const;
};
BalanceVariance balance_variance(const Campaign& campaign, const ExperimentData& data,
                                 const Quantities& q, const ModelState& state);

}  // namespace beltgrip::diagnose
