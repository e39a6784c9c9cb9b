#include "tools/sim/tcu_model.h"

#include <algorithm>
#include <cmath>

namespace beltgrip::sim {

namespace {

constexpr double kLockupCapacity_Nm = 400.0;
constexpr double kLockupRamp_Nm_s = 150.0;   // while it closes
constexpr double kLockupStart_rad_s = 20.0;  // in overrun it begins to close below this only
constexpr double kLockupSlip_rad_s = 3.0;    // closed below this
constexpr double kLockupHysteresis_m_s = 1.5;
constexpr double kLockupBrake_m_s2 = 4.0;  // hard braking opens it
constexpr double kStopShare = 0.02;        // of the ratio: at its end stop
constexpr double kPushAtOverdrive = 1.3;   // force ratio over that of equilibrium
constexpr double kPushAtLow = 0.7;
constexpr double kRatioGain = 3.0;  // ln(force ratio) per ln(ratio error)
constexpr double kRatioIntegral_1_s = 1.5;
constexpr double kRatioRate_1_s = 0.6;  // ln(ratio target) per second
constexpr double kPermitSettle_s = 0.5;
constexpr double kRiseMax = 1.15;  // of the own force while a request stands
constexpr double kPermitEngine_rad_s = 85.0;

std::uint32_t microseconds(double t_s) {
  return static_cast<std::uint32_t>(static_cast<std::int64_t>(t_s * 1e6));
}

}  // namespace

TcuModel::TcuModel(const VehicleScenario& scenario, FaultScript& faults)
    : variator_(scenario.variator),
      engine_(scenario.engine),
      parameters_(scenario.tcu),
      pressure_floor_Pa_(scenario.hydraulics.pressure_floor_Pa),
      faults_(faults),
      ratio_target_(scenario.variator.ratio_overdrive) {
  beltgrip_receiver_init(&receiver_);
}

void TcuModel::receive(const can::CanFrame& frame, double t_s) {
  if (frame.id.extended || frame.remote || frame.error || frame.id.value != kClampIdentifier) {
    return;
  }
  beltgrip_receiver_frame(&receiver_, frame.data.data(), frame.length, microseconds(t_s));
}

double TcuModel::ratio_target(const TcuInput& input, double t_s) const {
  const double engine_rad_s = parameters_.coast_engine_speed_rad_s +
                              input.accelerator * (parameters_.full_engine_speed_rad_s -
                                                   parameters_.coast_engine_speed_rad_s);
  double target = std::clamp(input.omega_s_rad_s / engine_rad_s, variator_.ratio_low,
                             variator_.ratio_overdrive);
  if (const FaultStep* step = faults_.active(FaultKind::kShift, t_s)) target *= step->size;
  return std::clamp(target, variator_.ratio_low, variator_.ratio_overdrive);
}

void TcuModel::decide_lockup(const TcuInput& input, double t_s) {
  const double threshold =
      parameters_.lockup_above_m_s - (out_.lockup_capacity_Nm > 0.0 ? kLockupHysteresis_m_s : 0.0);
  const bool wanted = input.speed_m_s > threshold && input.oil_degC > 40.0 &&
                      input.brake_m_s2 < kLockupBrake_m_s2 && input.engine_running &&
                      !input.wheel_slip && input.omega_p_rad_s > engine_.stall_rad_s + 20.0 &&
                      (out_.lockup_capacity_Nm > 0.0 ||
                       input.omega_p_rad_s - input.omega_e_rad_s < kLockupStart_rad_s) &&
                      faults_.active(FaultKind::kLockupOpen, t_s) == nullptr;
  const double slip_rad_s = std::abs(input.omega_e_rad_s - input.omega_p_rad_s);
  if (!wanted) {
    out_.lockup_capacity_Nm = 0.0;
  } else if (slip_rad_s < kLockupSlip_rad_s) {
    out_.lockup_capacity_Nm = kLockupCapacity_Nm;
  } else {
    out_.lockup_capacity_Nm = std::min(
        kLockupCapacity_Nm, out_.lockup_capacity_Nm + kLockupRamp_Nm_s * parameters_.cycle_s);
  }
  out_.lockup_closed =
      out_.lockup_capacity_Nm >= kLockupCapacity_Nm && slip_rad_s < kLockupSlip_rad_s;
}

void TcuModel::decide_permission(const TcuInput& input, double t_s) {
  const bool at_overdrive = input.ratio > variator_.ratio_overdrive * (1.0 - kStopShare) &&
                            ratio_target_ > variator_.ratio_overdrive * (1.0 - kStopShare);
  const bool at_low = input.ratio < variator_.ratio_low * (1.0 + kStopShare) &&
                      ratio_target_ < variator_.ratio_low * (1.0 + kStopShare);
  const bool settled = (at_overdrive || at_low) && out_.lockup_closed && !input.wheel_slip &&
                       input.engine_running && input.omega_e_rad_s > kPermitEngine_rad_s &&
                       input.oil_degC >= parameters_.oil_permit_degC && input.brake_m_s2 <= 0.0 &&
                       (!out_.obeying || out_.own_force_N <= kRiseMax * agreed_N_) &&
                       faults_.active(FaultKind::kTcuWithdraws, t_s) == nullptr;
  if (!settled) settled_since_s_ = t_s;
  out_.permitted = settled && t_s - settled_since_s_ >= kPermitSettle_s;
}

double TcuModel::own_force_N(const TcuInput& input, double t_s) {
  const double wedge = std::cos(variator_.half_wedge_angle_rad);
  // A clutch that slips carries what it can, whatever the engine gives.
  const double clutch_Nm = out_.lockup_closed ? 0.0 : out_.lockup_capacity_Nm;
  const double held_Nm = beltgrip_own_torque_Nm(&own_torque_, input.torque_requested_Nm,
                                                input.torque_e_Nm, microseconds(t_s));
  const double torque_Nm =
      std::max({held_Nm, clutch_Nm, input.accelerator * engine_.torque_max_Nm}) +
      parameters_.torque_reserve_Nm;
  const double centrifugal_N =
      variator_.secondary_centrifugal_N_s2 * input.omega_s_rad_s * input.omega_s_rad_s;
  const double least_N = variator_.secondary_spring_force_N + centrifugal_N +
                         variator_.secondary_piston_area_m2 * pressure_floor_Pa_;
  return std::max(least_N,
                  torque_Nm * wedge / (2.0 * input.primary_radius_m * parameters_.design_friction));
}

double TcuModel::secondary_force_N(double t_s) {
  const bool was_obeying = out_.obeying;
  const beltgrip_limits limits{parameters_.force_floor_N, parameters_.force_fall_max_N_per_s};
  double force_N = beltgrip_receiver_force(&receiver_, &limits, out_.own_force_N, out_.permitted,
                                           microseconds(t_s));
  out_.obeying = receiver_.active;
  if (out_.obeying && !was_obeying) {
    ++out_.requests;
    agreed_N_ = out_.own_force_N;
    faults_.request_began(t_s);
  }
  if (faults_.active(FaultKind::kTcuIgnores, t_s) != nullptr) force_N = out_.own_force_N;
  if (out_.obeying) {
    if (const FaultStep* step = faults_.active(FaultKind::kTcuUndershoots, t_s)) {
      force_N *= step->size;
    }
    if (const FaultStep* step = faults_.active(FaultKind::kTcuQuantises, t_s)) {
      force_N = step->size * std::floor(force_N / step->size);
    }
    latched_N_ = force_N;
  } else if (latched_N_ > 0.0 && faults_.active(FaultKind::kTcuLatches, t_s) != nullptr) {
    force_N = std::min(force_N, latched_N_);
  }
  return std::max(force_N, 0.0);
}

void TcuModel::cycle(double t_s, const TcuInput& input) {
  const double limit = std::exp(kRatioRate_1_s * parameters_.cycle_s);
  ratio_target_ =
      std::clamp(ratio_target(input, t_s), ratio_target_ / limit, ratio_target_ * limit);
  decide_lockup(input, t_s);
  out_.own_force_N =
      std::max(own_force_N(input, t_s),
               out_.own_force_N - parameters_.own_fall_max_N_per_s * parameters_.cycle_s);
  decide_permission(input, t_s);
  out_.force_N = secondary_force_N(t_s);

  const double omega_s2 = input.omega_s_rad_s * input.omega_s_rad_s;
  const double omega_p2 = input.omega_p_rad_s * input.omega_p_rad_s;
  out_.secondary_pressure_Pa = (out_.force_N - variator_.secondary_spring_force_N -
                                variator_.secondary_centrifugal_N_s2 * omega_s2) /
                               variator_.secondary_piston_area_m2;

  // At an end stop the force ratio holds the ratio there; the primary force follows the secondary
  // one down in LOW only, where it would shift the ratio up.
  const double error = std::log(ratio_target_ / input.ratio);
  ratio_integral_ =
      std::clamp(ratio_integral_ + kRatioIntegral_1_s * error * parameters_.cycle_s, -0.5, 0.5);
  double controller = kRatioGain * error + ratio_integral_;
  double clamp_N = out_.force_N;
  if (ratio_target_ > variator_.ratio_overdrive * (1.0 - 0.25 * kStopShare)) {
    controller = std::max(controller, std::log(kPushAtOverdrive));
    clamp_N = out_.own_force_N;
  } else if (ratio_target_ < variator_.ratio_low * (1.0 + 0.25 * kStopShare)) {
    controller = std::min(controller, std::log(kPushAtLow));
  }
  const double primary_N =
      clamp_N * std::exp(variator_.force_ratio_slope * std::log(input.ratio) + controller);
  out_.primary_pressure_Pa = (primary_N - variator_.primary_centrifugal_N_s2 * omega_p2) /
                             variator_.primary_piston_area_m2;
}

}  // namespace beltgrip::sim
