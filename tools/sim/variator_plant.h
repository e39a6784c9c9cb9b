// The simulated variator: two shafts, a belt with its own friction law, deformation of the pulleys,
// secondary drag. Knows nothing of the estimator but the geometry file. SI. Simulation only.
//
// Equations (variator-facts 2.4; directions: torque > 0 drives from primary to secondary):
//   sigma = 1 - omega_s / (r_g omega_p)            r_g = r_g0 (1 - c F), R_p on its end stop
//   F_belt = 2 mu(sigma) F / cos(theta)            T_bp = F_belt R_p,  T_bs = F_belt R_p / r_g
//   J_p d(omega_p)/dt = T_drive - T_bp             J_s d(omega_s)/dt = T_bs - drag - T_load
// Micro-slip is stiff (time constant below 2 ms at the primary): integrated with ROS2, a linearly
// implicit two-stage Rosenbrock method of order 2 that is stable for any step (L-stable).
#pragma once

#include "tools/sim/world.h"

namespace beltgrip::sim {

struct PlantState {
  double omega_p_rad_s = 0.0;
  double omega_s_rad_s = 0.0;
};

// What acts on the plant during one step.
struct PlantInput {
  double clamp_force_N = 0.0;
  double drive_torque_Nm = 0.0;          // on the primary shaft
  double drive_torque_slope_Nm_s = 0.0;  // d(drive torque)/d(omega_p), <= 0: a speed controller
  double load_torque_Nm = 0.0;           // on the secondary shaft
};

// What an ideal observer sees at an instant.
struct PlantOutput {
  double slip_share = 0.0;
  double mu = 0.0;
  double geometric_ratio = 0.0;  // r_g
  double torque_p_Nm = 0.0;      // belt torque on the primary pulley
  double torque_s_Nm = 0.0;      // belt torque on the secondary pulley
};

class VariatorPlant {
 public:
  VariatorPlant(const VariatorParameters& variator, const FrictionCurve& friction);

  // Settles both shafts on the micro-slip branch for this torque: false when friction cannot carry
  // it.
  bool settle(double omega_p_rad_s, double torque_p_Nm, double clamp_force_N);
  void step(const PlantInput& input, double step_s);

  const PlantState& state() const { return state_; }
  bool finite() const;
  PlantOutput output(double clamp_force_N) const;
  // Factors on the geometric ratio and on friction, from now on: what else acts on the machine.
  void set_factors(double ratio, double friction) {
    ratio_factor_ = ratio;
    friction_factor_ = friction;
  }
  // Secondary load that balances that belt torque on the primary pulley at the present speeds.
  double balancing_load_Nm(double torque_p_Nm, double clamp_force_N) const;
  double primary_radius_m() const { return primary_radius_m_; }

 private:
  struct Derivative {
    double p = 0.0, s = 0.0;                        // d(omega)/dt
    double pp = 0.0, ps = 0.0, sp = 0.0, ss = 0.0;  // its Jacobian
  };
  double ratio_at(double clamp_force_N) const;
  FrictionPoint friction_now(double slip_share) const;
  double constant_drag_Nm(double clamp_force_N) const;  // at any speed
  double drag_Nm(double omega_s_rad_s, double clamp_force_N) const;
  // Drive torque is linearised around omega_p of the step's start.
  Derivative derivative(const PlantState& state, const PlantInput& input,
                        double omega_p_start_rad_s) const;

  VariatorParameters variator_;
  FrictionCurve friction_;
  double cos_wedge_;
  double primary_radius_m_;
  double ratio_factor_ = 1.0, friction_factor_ = 1.0;
  PlantState state_;
};

}  // namespace beltgrip::sim
