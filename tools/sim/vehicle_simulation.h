// The whole virtual vehicle in virtual time: driver, engine, driveline, hydraulics, controller.
// Integer nanoseconds. Keeps the truth that the invariants are judged by. Simulation only.
#pragma once

#include <cstdint>
#include <deque>
#include <optional>
#include <vector>

#include "can_dbc/frame/can_frame.h"
#include "tools/sim/clamp_effects.h"
#include "tools/sim/hydraulic_actuator.h"
#include "tools/sim/simulation.h"
#include "tools/sim/tcu_model.h"
#include "tools/sim/vehicle_driver.h"
#include "tools/sim/vehicle_engine.h"
#include "tools/sim/vehicle_plant.h"

namespace beltgrip::sim {

// What no sensor sees.
struct VehicleTruth {
  DrivelineOutput belt;
  double secondary_force_N = 0.0;
  double ratio = 0.0;
  bool obeying = false;  // the controller obeys a request
  double own_force_N = 0.0;
  bool engine_running = true;
  int stalls = 0;
  int coast_downs = 0;  // of kCoast_s and more: rolling, neither pedal pressed
  static constexpr double kCoast_s = 2.0;
};

// One request that the controller obeyed, from its begin until kAfter_s after its end.
struct RequestTruth {
  static constexpr double kAfter_s = 1.0;
  double begin_s = 0.0;
  double end_s = 0.0;
  bool over = false;
  double mu_max = 0.0;  // of the belt when it peaked, or at the end
  bool peak_passed = false;
  double peak_passed_s = 0.0;
  double slip_max_share = 0.0;  // magnitude
  double slip_speed_max_m_s = 0.0;
  double slip_at_end_share = 0.0;  // when the controller took its force back
  double macro_energy_J = 0.0;     // dissipated beyond the slip where friction begins to fall
  double mu_star_max = 0.0;        // largest coefficient in use
  double force_min_N = 0.0;
};

class VehicleSimulation final : public Simulation {
 public:
  VehicleSimulation(const VehicleScenario& scenario, std::uint64_t seed);

  void step() override;
  // A frame that reaches the transmission controller at t_ns.
  void deliver(const can::CanFrame& frame, std::int64_t t_ns);
  bool finished() const override { return now_ns_ >= end_ns_; }
  bool finite() const override { return plant_.finite(); }
  const VehicleTruth& truth() const { return truth_; }
  const std::vector<RequestTruth>& requests() const { return requests_; }
  const TcuOutput& tcu() const { return tcu_.output(); }
  const VehicleScenario& scenario() const { return scenario_; }

 private:
  void control(double t_s, const DriverOutput& driver);
  void observe(double t_s);
  void count_coast_downs(const DriverOutput& driver);

  VehicleScenario scenario_;
  VehicleDriver driver_;
  VehicleEngine engine_;
  VehiclePlant plant_;
  TcuModel tcu_;
  HydraulicActuator secondary_;
  HydraulicActuator primary_;
  ClampEffects clamping_;
  CoulombPlay play_;
  std::int64_t end_ns_;
  std::int64_t cycle_ns_;
  std::int64_t next_cycle_ns_ = 0;
  std::deque<can::StampedFrame> to_tcu_;
  VehicleTruth truth_;
  double coasting_s_ = 0.0;
  std::vector<RequestTruth> requests_;
};

}  // namespace beltgrip::sim
