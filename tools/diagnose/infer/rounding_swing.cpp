#include "tools/diagnose/infer/rounding_swing.h"

#include <numbers>

namespace beltgrip::diagnose {

using Eigen::ArrayXd;

std::vector<ResidualColumns> rounding_swings(const Campaign& campaign, int run,
                                             const Residuals& at) {
  const ExperimentData& data = campaign.runs[static_cast<std::size_t>(run)];
  // Of a swing over its one sigma.
  constexpr double kSwing = std::numbers::sqrt2;
  const ArrayXd ones = ArrayXd::Constant(at.foot.size(), kSwing);
  std::vector<ResidualColumns> out;
  const auto add = [&](double sigma, const QuantityChange& change) {
    if (sigma > 0.0) out.push_back(propagate(campaign, at, change));
  };
  QuantityChange slip;
  slip.slip_share = ones * data.rounding_slip_share;
  if (campaign.has_balance) slip.balance = at.clean_Nm * slip.slip_share;
  add(data.rounding_slip_share, slip);
  QuantityChange force;
  force.ln_capacity = ones * data.left_of_rounding_Pa * campaign.variator.secondary_piston_area_m2 /
                      at.measured.force_N.max(50.0);
  add(data.left_of_rounding_Pa, force);
  QuantityChange torque;
  torque.torque = ones * data.rounding_torque_Nm;
  torque.balance = torque.torque;
  add(data.rounding_torque_Nm, torque);
  QuantityChange torque_s;
  torque_s.balance =
      ones * data.rounding_torque_s_Nm * data.omega_s.slow / data.omega_p.slow.max(1.0);
  add(data.rounding_torque_s_Nm, torque_s);
  return out;
}

}  // namespace beltgrip::diagnose
