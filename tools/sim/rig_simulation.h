// The rig of the paper around the plant: drive machine with speed controller, constant load,
// clamping force that falls until the operator, who watches the slip, lets go. Virtual time in
// integer nanoseconds. Keeps the truth beside it. Simulation only.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "tools/sim/clamp_effects.h"
#include "tools/sim/scenario.h"
#include "tools/sim/variator_plant.h"

namespace beltgrip::sim {

enum class RigMode : std::uint8_t {
  kHold,
  kLowering,
  kRestoring,
  kRest
};  // wire values of RigMode

// True values of what the rig's sensors measure, SI.
struct RigSignals {
  double omega_p_rad_s = 0.0;
  double omega_s_rad_s = 0.0;
  double torque_p_Nm = 0.0;  // flange between drive machine and primary pulley
  double torque_s_Nm = 0.0;  // flange between secondary pulley and load machine
  double pressure_Pa = 0.0;
  double pressure_command_Pa = 0.0;
  double oil_degC = 0.0;
  double angle_p_rad = 0.0;  // of the shafts
  double angle_s_rad = 0.0;
  RigMode mode = RigMode::kHold;
};

// One experiment as it really was. sigma_star is eq. (3) without noise: slip plus deformation.
struct ExperimentTruth {
  double mu_max = 0.0;
  double start_s = 0.0;
  std::optional<double> peak_s;  // none: the curve has no peak, or it was not reached
  double slip_peak_percent = 0.0;
  double sigma_star_peak_percent = 0.0;
  double clamp_force_peak_N = 0.0;
  std::optional<double> let_go_s;
  double sigma_star_max_percent = 0.0;
};

class RigSimulation {
 public:
  explicit RigSimulation(const Scenario& scenario);

  void step();
  bool finished() const { return finished_; }
  // False once the plant's state has become infinite or not a number: the run is void.
  bool finite() const { return plant_.finite(); }
  std::int64_t now_ns() const { return now_ns_; }
  std::int64_t step_ns() const { return step_ns_; }
  const RigSignals& signals() const { return signals_; }
  const std::vector<ExperimentTruth>& truth() const { return truth_; }

 private:
  void operate();
  void observe(double slip_before, double sigma_star_before);
  double sigma_star() const;
  double pressure_Pa(double clamp_force_N) const;
  double loss_Nm(double acceleration_rad_s2) const;
  void act(bool begin);

  Scenario scenario_;
  VariatorPlant plant_;
  std::int64_t step_ns_;
  double step_s_;
  std::int64_t now_ns_ = 0;
  double load_torque_Nm_ = 0.0;
  double controller_torque_Nm_ = 0.0;  // integral part
  double command_force_N_;
  double clamp_force_N_;  // as the pressure tells it
  ClampEffects clamping_;
  double belt_force_N_;       // as the belt feels it
  double reference_force_N_;  // at the start, for the creep of the ratio
  double crept_ = 0.0;        // share of the ratio
  double friction_factor_ = 1.0;
  double slip_energy_kJ_ = 0.0;
  double mode_since_s_ = 0.0;
  std::optional<double> noticed_s_;
  double cycles_left_;
  RigSignals signals_;
  std::vector<ExperimentTruth> truth_;
  bool finished_ = false;
};

}  // namespace beltgrip::sim
