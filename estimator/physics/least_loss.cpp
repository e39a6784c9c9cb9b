#include "estimator/physics/least_loss.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "estimator/physics/slip.h"
#include "estimator/physics/units.h"

namespace beltgrip::estimator {

namespace {

constexpr double kPumpVolume_m3 = 19e-6;  // a turn
constexpr double kPumpEfficiency = 0.85;

// Fitted to the minimum of loss c F + T s(F) on curves that rise as a saturation to their peak; the
// slope is the share of the peak's slip that a belt has there (compared by a test).
constexpr double kShareSquared = 0.95, kPerSlipLoss = 0.44;

}  // namespace

double pump_torque_Nm(double pressure_Pa) {
  return kPumpVolume_m3 * pressure_Pa / (2.0 * std::numbers::pi * kPumpEfficiency);
}

double pump_loss_Nm_per_N(const VariatorParameters& variator) {
  return pump_torque_Nm(1.0 / variator.secondary_piston_area_m2);
}

double least_loss_share(const VariatorParameters& variator, EndStop end_stop, double mu_max,
                        double sigma_peak_percent, double loss_Nm_per_N) {
  const double torque_Nm_per_N = torque_carried_Nm(variator, end_stop, 1.0, mu_max);
  const double peak_slip_share = sigma_peak_percent / kPercent;
  return std::sqrt(kShareSquared +
                   kPerSlipLoss * torque_Nm_per_N * peak_slip_share / loss_Nm_per_N);
}

double reserve_of_least_loss_Nm(const VariatorParameters& variator, double share,
                                double torque_Nm) {
  return std::max(0.0, std::abs(torque_Nm) * (share / variator.safety_factor - 1.0));
}

}  // namespace beltgrip::estimator
