// Inputs that stand still, or creep away, from some instant of a request on (frames fresh, counter
// and CRC right), one or two at a time, judged by the plant's truth.
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "daemon/core/config/options/config.h"
#include "tools/sim/vehicle_parameters.h"

namespace beltgrip::test {

struct Freeze {
  std::vector<std::string> signals;  // of the vehicle's DBC
  double at_s = 0.0;                 // from the begin of the request
  double creep_per_s = 0.0;          // SI; 0: it stands still
};

struct FreezeRun {
  double slip_max_share = 0.0, slip_speed_max_m_s = 0.0, energy_J = 0.0;
  double lasted_s = 0.0;  // the request, from the freeze on
  bool stuck = false;     // it ended in state Fault
  bool named = false;     // FaultInputFrozen, or stop reason InputFrozen
  std::string reason;
  std::map<std::string, std::string> broken;  // invariants
};

// Every speed, pressure and torque, and every pair of them.
std::vector<std::vector<std::string>> frozen_inputs();
// Steps as a coarse car tells them: 1 rpm, 10 kPa, 1 Nm. On top of what sensors are noisy by.
void make_coarse(sim::VehicleScenario& scenario);

class FreezeBench {
 public:
  FreezeBench(sim::VehicleScenario scenario, const std::map<std::string, std::string>& settings,
              bool engine_speed, std::uint64_t seed);
  double ramp_s() const { return ramp_s_; }  // of the request without a freeze
  bool asked() const { return ramp_s_ > 0.0; }
  // In the run without a freeze; empty: none.
  const std::string& false_alarm() const { return false_alarm_; }
  FreezeRun run(const Freeze& freeze) const;

 private:
  sim::VehicleScenario scenario_;
  daemon::Config config_;
  std::uint64_t seed_;
  double begin_s_ = 0.0;
  double ramp_s_ = 0.0;
  std::string false_alarm_;
};

}  // namespace beltgrip::test
