// What a model file says that a machine and its measuring chain have beyond the nominal ones: plain
// values, SI unless the name says otherwise, zero is off. Equations: one line each; `true` is what
// the machine has, `measured` what the bus says. Any thread.
#pragma once

namespace beltgrip::estimator {

struct MachineEffects {
  // The measuring chain.
  double torque_bias_Nm = 0.0;       // T_measured = T_true + bias
  double torque_gain = 0.0;          // T_measured = (1 + gain) T_true
  double torque_delay_s = 0.0;       // T_measured(t) = T_true(t - delay)
  double pressure_offset_Pa = 0.0;   // p_measured = p_true + offset
  double pressure_gain = 0.0;        // p_measured = (1 + gain) p_true
  double primary_speed_scale = 0.0;  // omega_measured = (1 + x) omega_true
  double secondary_speed_scale = 0.0;
  double primary_ripple = 0.0;  // omega_measured = omega_true (1 + a sin(phi))
  double secondary_ripple = 0.0;
  double primary_speed_delay_s = 0.0;  // x_measured(t) = x_true(t - delay)
  double secondary_speed_delay_s = 0.0;
  double pressure_delay_s = 0.0;
  // Between the measured pressure and the force on the belt.
  double lag_time_constant_s = 0.0;  // tau dp/dt + p = p_measured(t - delay)
  double lag_delay_s = 0.0;
  double centrifugal_N_s2 = 0.0;  // F_true = F_model + c omega_s^2
  double spring_N = 0.0;          // F_true = F_model + force
  double hysteresis_N = 0.0;      // F_true = F_model - force sgn(dF/dt), with play
  // Between the driving shaft and the belt: T_belt = T - constant - per_kN F - per_rad_s omega_p.
  double inertia_kg_m2 = 0.0;  // T_belt = T - J d(omega_p)/dt
  double loss_constant_Nm = 0.0;
  double loss_per_kN_Nm = 0.0;
  double loss_per_rad_s_Nm = 0.0;
  // r_g = r_g0 (1 + end stop) (1 - per_kN F - per_kN2 F^2 - per_Nm T_p)
  double deformation_per_kN = 0.0;
  double deformation_per_kN2 = 0.0;
  double tilt_per_Nm = 0.0;
  double end_stop_low = 0.0;
  double end_stop_overdrive = 0.0;
  double creep_rate = 0.0;  // d(ln r_g)/dt = rate omega_p (fall of ln(F_p / F_s))
  // Friction, all factors on mu.
  double friction_per_K = 0.0;          // 1 + a (theta - 80 degC)
  double friction_per_ln_speed = 0.0;   // 1 + a ln(omega_p / 105)
  double friction_load_exponent = 0.0;  // (F / 3 kN)^-n
  double friction_low_relative = 0.0;   // 1 + a at the low end stop
  double peak_slip_percent = 0.0;       // slip at the peak, overdrive; 0: as nominal
  double fall_per_percent = 0.0;        // of mu beyond the peak, more than nominal
  double wear_step = 0.0;               // 1 - step from one experiment on
  double wear_from = 0.0;
  double wear_per_experiment = 0.0;  // 1 - a i
  double warm_up_per_kJ = 0.0;       // 1 + a E, E slip energy within the experiment
  double warm_up_per_start = 0.0;    // 1 + b (1 - exp(-t / 30 s))
};

}  // namespace beltgrip::estimator
