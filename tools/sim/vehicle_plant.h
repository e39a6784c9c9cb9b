// The simulated driveline: engine, lock-up clutch with converter, variator with its own friction
// law, wheels and road. Knows nothing of the estimator but the geometry file. SI. Simulation only.
//
// Equations (variator-facts 2.4, 3.1 to 3.5; torque > 0 drives from primary to secondary):
//   J_e d(omega_e)/dt = T_engine - T_c             T_c = C tanh(d/0.5) + k d |d|,  d = omega_e -
//   omega_p J_p d(omega_p)/dt = T_c - T_loss,p - T_bp      T_bp = 2 mu(sigma) F_s R_p / cos(theta)
//   J_s d(omega_s)/dt = T_bp / r_g - T_loss,s - T_road
//   r_g = x (1 - c_F F_s - c_T T_bp)               sigma = 1 - omega_s / (r_g omega_p)
//   dx/dt = omega_p Delta 5.24 x [ln(F_p / F_s) - a ln x - b tau],  between the end stops,
//                                                  tau = T_bp / torque capacity
// The belt and the clutch are stiff (time constants of 0.1 to 5 ms): ROS2, a linearly implicit
// two-stage Rosenbrock method of order 2, stable for any step (L-stable). Near standstill slip is
// taken relative to a least speed, so that nothing divides by zero.
#pragma once

#include <array>
#include <cmath>
#include <limits>

#include "estimator/physics/learned_effects.h"
#include "tools/sim/friction_curve.h"
#include "tools/sim/vehicle_parameters.h"

namespace beltgrip::sim {

struct DrivelineState {
  double omega_e_rad_s = 0.0;
  double omega_p_rad_s = 0.0;
  double omega_s_rad_s = 0.0;
  double ratio = 0.0;  // x: geometric ratio without deformation
};

struct DrivelineInput {
  double engine_torque_Nm = 0.0;  // at the crankshaft, drag included
  double lockup_capacity_Nm = 0.0;
  double secondary_force_N = 0.0;
  double primary_force_N = 0.0;
  double brake_Nm = 0.0;        // at the secondary shaft, against the motion
  double disturbance_Nm = 0.0;  // at the secondary shaft, > 0 brakes
  double oil_degC = 80.0;
  double wear = 0.0;  // share of the friction that is gone
  double time_s = 0.0, slip_energy_kJ = 0.0;
  estimator::LearnedConditions conditions;
};

struct DrivelineOutput {
  double slip_share =
      0.0;  // the paper's sigma with the deformed ratio, fraction; negative in overrun
  double slip_speed_m_s = 0.0;
  double mu = 0.0;      // coefficient in use, signed
  double mu_max = 0.0;  // of the present curve
  double peak_slip_share = 0.0;
  double fall_slip_share = 0.0;  // where friction begins to fall: the peak, or a plateau's end
  double geometric_ratio = 0.0;  // r_g, deformed
  double primary_radius_m = 0.0;
  double belt_torque_Nm = 0.0;  // T_bp
  double slip_power_W = 0.0;
};

class VehiclePlant {
 public:
  explicit VehiclePlant(const VehicleScenario& scenario);

  // Rolling at this speed and ratio without torque, the engine turning with it or idling.
  void settle(double speed_m_s, double ratio, double idle_rad_s);
  void step(const DrivelineInput& input, double step_s);

  const DrivelineState& state() const { return state_; }
  const DrivelineOutput& output() const { return output_; }
  double speed_m_s() const;
  bool finite() const;
  double primary_radius_m(double ratio) const;

 private:
  struct Rates {
    std::array<double, 3> value{};                    // d(omega)/dt
    std::array<std::array<double, 3>, 3> jacobian{};  // and by omega
  };
  struct Slip {
    double value, per_p, per_s;
  };
  // What stays fixed during one step.
  struct StepConstants {
    FrictionCurve curve;
    double ratio = 0.0;  // deformed
    double radius_m = 0.0;
    double torque_per_mu = 0.0;
  };

  // What follows from the ratio alone.
  struct RatioGeometry {
    double ratio = std::numeric_limits<double>::quiet_NaN();  // at which
    double low_share = 0.0;                                   // of the way to the low end stop
    double radius_m = 0.0;                                    // of the primary pulley
    double ln_ratio = 0.0;
  };
  // The logarithm of what is often asked twice.
  class Logarithm {
   public:
    double of(double x) {
      if (x != x_) {
        x_ = x;
        ln_ = std::log(x);
      }
      return ln_;
    }

   private:
    double x_ = 1.0, ln_ = 0.0;
  };
  // Torques that stay fixed during one step, and factors of the others.
  struct Loads {
    double primary_Nm, learned_Nm, speed_per_omega, coulomb_Nm, air, grade_Nm;
  };
  const RatioGeometry&
  ratio_geometry();                    // at the present ratio; kept, since it stands for most steps
  double radius_at(double way) const;  // of the primary pulley; way: 0 at low, 1 at overdrive
  double load_factor(double secondary_force_N);  // of friction; kept, since it is asked twice
  StepConstants step_constants(const DrivelineInput& input);
  static Slip slip_of(double ratio, double omega_p_rad_s, double omega_s_rad_s);
  Loads loads(const DrivelineInput& input) const;
  template <bool kWithJacobian>
  Rates rates(const std::array<double, 3>& omega, const DrivelineInput& input,
              const StepConstants& held, const Loads& loads) const;
  void shift(const DrivelineInput& input, double step_s);
  void creep(double ln_force_ratio, double step_s);
  void observe(const DrivelineInput& input);

  static constexpr int kRadii = 128;
  VariatorParameters variator_;
  BeltParameters belt_;
  estimator::MachineEffects effects_;
  std::vector<estimator::LearnedTerm> learned_;
  int experiment_;
  VehicleBody body_;
  double engine_inertia_kg_m2_;
  double secondary_inertia_kg_m2_;  // with the vehicle
  double cos_wedge_;
  double wedge_factor_;
  RatioGeometry place_;
  Logarithm ln_speed_;
  double ln_ratio_low_;
  double ln_span_;  // of the ratios
  double loaded_N_ = std::numeric_limits<double>::quiet_NaN();
  double load_factor_ = 1.0;
  std::array<double, kRadii> radius_m_;  // over ln(ratio) between the end stops
  DrivelineState state_;
  DrivelineOutput output_;
  double crept_ = 0.0;         // share of the ratio, away from the end stop
  double reference_ln_ = 0.0;  // ln(F_p / F_s) when it came to the stop
  bool on_stop_ = false;
};

}  // namespace beltgrip::sim
