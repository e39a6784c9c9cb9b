// The engine's torque at the crankshaft: pedal, drag, fuel cut in overrun, idle, stall and start.
// SI. Simulation only.
#pragma once

#include "tools/sim/vehicle_parameters.h"

namespace beltgrip::sim {

class VehicleEngine {
 public:
  explicit VehicleEngine(const EngineParameters& parameters) : parameters_(parameters) {}

  // accelerator 0 to 1. Returns the torque that the crankshaft gives, accessories taken off.
  double step(double accelerator, double omega_rad_s, double extra_Nm, double step_s);
  double reported_torque_Nm() const { return reported_Nm_; }  // without the accessories
  // What pedal, idle control and fuel cut ask for: the torque follows it late.
  double requested_torque_Nm() const { return requested_Nm_; }
  bool fuel_cut() const { return fuel_cut_; }
  bool running() const { return running_; }
  int stalls() const { return stalls_; }

 private:
  EngineParameters parameters_;
  double lag_step_s_ = 0.0;  // of the step that lag_share_ was computed for
  double lag_share_ = 0.0;
  double demand_Nm_ = 0.0;  // combustion as asked for, shaped
  double torque_Nm_ = 0.0;  // as it is, lagged
  double reported_Nm_ = 0.0;
  double requested_Nm_ = 0.0;
  double stopped_s_ = 0.0;
  bool fuel_cut_ = false;
  bool running_ = true;
  int stalls_ = 0;
};

}  // namespace beltgrip::sim
