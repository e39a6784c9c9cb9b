#include "tools/sim/vehicle_engine.h"

#include <algorithm>
#include <cmath>

#include "tools/sim/tanh.h"

namespace beltgrip::sim {

namespace {
constexpr double kDragSpeed_rad_s = 150.0;  // where overrun_torque_Nm is given
constexpr double kPedalReleased = 0.01;
constexpr double kFuelCutHysteresis_rad_s = 15.0;
constexpr double kIdleGain_Nm_s = 1.5;  // torque per rad/s below idle
constexpr double kIdleTorqueMax_Nm = 60.0;
constexpr double kRestart_s = 2.0;  // from a stall to the next start
constexpr double kEngineCoulombWidth_rad_s = 5.0;
}  // namespace

double VehicleEngine::step(double accelerator, double omega_rad_s, double extra_Nm, double step_s) {
  const double coulomb = tanh_of(omega_rad_s / kEngineCoulombWidth_rad_s);
  const double drag_Nm =
      std::max(0.0, parameters_.overrun_torque_Nm +
                        parameters_.overrun_slope_Nm_s * (omega_rad_s - kDragSpeed_rad_s)) *
      coulomb;

  if (running_ && omega_rad_s < parameters_.stall_rad_s) {
    running_ = false;
    stopped_s_ = 0.0;
    ++stalls_;
  } else if (!running_) {
    stopped_s_ += step_s;
    running_ = stopped_s_ >= kRestart_s;
  }

  const double cut_speed =
      parameters_.fuel_cut_above_rad_s - (fuel_cut_ ? kFuelCutHysteresis_rad_s : 0.0);
  fuel_cut_ = accelerator < kPedalReleased && omega_rad_s > cut_speed;

  double wanted_Nm = 0.0;
  if (running_ && !fuel_cut_) {
    wanted_Nm = accelerator * (parameters_.torque_max_Nm + drag_Nm);
    const double starter_Nm = omega_rad_s < 1.2 * parameters_.stall_rad_s ? kIdleTorqueMax_Nm : 0.0;
    const double idle_Nm = drag_Nm + kIdleGain_Nm_s * (parameters_.idle_rad_s - omega_rad_s);
    wanted_Nm = std::max({wanted_Nm, starter_Nm, std::clamp(idle_Nm, 0.0, kIdleTorqueMax_Nm)});
  }
  requested_Nm_ = wanted_Nm - drag_Nm;
  demand_Nm_ = std::min(wanted_Nm, demand_Nm_ + parameters_.torque_rise_Nm_s * step_s);
  if (step_s != lag_step_s_) {
    lag_step_s_ = step_s;
    lag_share_ = -std::expm1(-step_s / parameters_.torque_lag_s);
  }
  torque_Nm_ += lag_share_ * (demand_Nm_ - torque_Nm_);
  reported_Nm_ = torque_Nm_ - drag_Nm + extra_Nm;
  return reported_Nm_ - parameters_.accessories_Nm * coulomb;
}

}  // namespace beltgrip::sim
