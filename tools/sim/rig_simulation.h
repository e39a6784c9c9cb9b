// The rig of the paper around the plant: drive machine with speed controller, constant load,
// clamping force that falls until the operator, who watches the slip, lets go. Virtual time in
// integer nanoseconds. Keeps the truth beside it. Simulation only.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "tools/sim/clamp_effects.h"
#include "tools/sim/rig_parameters.h"
#include "tools/sim/simulation.h"
#include "tools/sim/variator_plant.h"

namespace beltgrip::sim {

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

class RigSimulation final : public Simulation {
 public:
  explicit RigSimulation(const RigScenario& scenario);

  void step() override;
  bool finished() const override { return finished_; }
  bool finite() const override { return plant_.finite(); }
  const std::vector<ExperimentTruth>& truth() const { return truth_; }

 private:
  void operate();
  void observe(double slip_before_share, double sigma_star_before);
  double sigma_star() const;
  double pressure_Pa(double clamp_force_N) const;
  double loss_Nm(double acceleration_rad_s2) const;
  void act(bool begin);

  RigScenario scenario_;
  VariatorPlant plant_;
  double load_torque_Nm_ = 0.0;
  double controller_torque_Nm_ = 0.0;  // integral part
  double command_force_N_;
  double clamp_force_N_;  // as the pressure tells it
  ClampEffects clamping_;
  double belt_force_N_;       // as the belt feels it
  double reference_force_N_;  // at the start, for the creep of the ratio
  double crept_ = 0.0;        // share of the ratio
  double friction_factor_ = 1.0;
  double mode_since_s_ = 0.0;
  std::optional<double> noticed_s_;
  bool was_below_peak_ = false;  // in this ramp
  double cycles_left_;
  std::vector<ExperimentTruth> truth_;
  bool finished_ = false;
};

}  // namespace beltgrip::sim
