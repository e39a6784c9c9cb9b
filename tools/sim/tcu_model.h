// The transmission controller: its own clamping law, ratio and lock-up schedule, permission, and
// the reference receiver through which it obeys a BeltGripClamp request within its limits. Runs
// every cycle_s on the values of its own sensors. Simulation only.
//
//   own clamp force  F_s = (T + reserve) cos(theta) / (2 R_p mu_design), T from requested and
//   actual engine torque by beltgrip_own_torque_Nm of the reference receiver
// It withdraws its permission when its own force has risen by a sixth since a request began: more
// torque than it agreed to.
//   primary force    F_s e^(a ln r_g) e^(controller), more than that at the overdrive stop, less at
//   LOW
#pragma once

#include <cstdint>

#include "can_dbc/frame/can_frame.h"
#include "tools/sim/fault_script.h"
#include "tools/sim/reference_receiver.h"
#include "tools/sim/vehicle_parameters.h"

namespace beltgrip::sim {

inline constexpr std::uint32_t kClampIdentifier = 0x6A2;  // of the contract

struct TcuInput {
  double omega_e_rad_s = 0.0;
  double omega_p_rad_s = 0.0;
  double omega_s_rad_s = 0.0;
  double speed_m_s = 0.0;
  double torque_e_Nm = 0.0;
  double torque_requested_Nm = 0.0;
  double ratio = 0.0;
  double accelerator = 0.0;
  double brake_m_s2 = 0.0;
  double oil_degC = 0.0;
  bool engine_running = true;
  bool wheel_slip = false;
  double primary_radius_m = 0.0;
};

struct TcuOutput {
  double secondary_pressure_Pa = 0.0;  // commands
  double primary_pressure_Pa = 0.0;
  double own_force_N = 0.0;
  double force_N = 0.0;  // applied: own, or what is asked
  double lockup_capacity_Nm = 0.0;
  bool lockup_closed = false;
  bool permitted = false;
  bool obeying = false;
  int requests = 0;  // obeyed so far
};

class TcuModel {
 public:
  TcuModel(const VehicleScenario& scenario, FaultScript& faults);

  // A frame that has arrived on the controller's bus.
  void receive(const can::CanFrame& frame, double t_s);
  // Once per cycle.
  void cycle(double t_s, const TcuInput& input);
  const TcuOutput& output() const { return out_; }

 private:
  double ratio_target(const TcuInput& input, double t_s) const;
  void decide_lockup(const TcuInput& input, double t_s);
  void decide_permission(const TcuInput& input, double t_s);
  double own_force_N(const TcuInput& input, double t_s);
  double secondary_force_N(double t_s);

  VariatorParameters variator_;
  EngineParameters engine_;
  TcuParameters parameters_;
  double pressure_floor_Pa_;
  FaultScript& faults_;
  beltgrip_receiver receiver_;
  beltgrip_own_torque own_torque_{};
  double ratio_integral_ = 0.0;
  double ratio_target_ = 0.0;
  double settled_since_s_ = 0.0;
  double latched_N_ = 0.0;
  double agreed_N_ = 0.0;  // own force when the request began
  TcuOutput out_;
};

}  // namespace beltgrip::sim
