// What a sabotaged request did, as the bus and the belt show it, and whether that is harm. Nothing
// of the guards is used to say so.
#pragma once

#include <string>
#include <vector>

#include "tests/loop/guards/sabotage.h"

namespace beltgrip::test {

// One frame with the identifier of BeltGripClamp.
struct ClampFrame {
  double t_s = 0.0;
  double force_N = 0.0;     // 0: inactive
  double acting_N = 0.0;    // the force that really acts then
  double slip_share = 0.0;  // and the belt's slip, fraction
  double slip_speed_m_s = 0.0;
  double floor_N = 0.0;  // with the centrifugal force of that speed
};

struct GuardedRun {
  std::vector<ClampFrame> frames;
  double slip_max_share = 0.0;  // over the whole drive
  double floor_N = 0.0;         // spring and piston area times the floor of the pressure
  double cooldown_s = 0.0;
  double silent_from_s = 0.0;
};

// The first layer that must stop it where all before are sabotaged, and the last that can.
enum class Layer { kMonitor, kGate };

struct GuardCase {
  std::string name;
  Sabotage sabotage;
  std::vector<std::string> settings;       // of the scenario cruise-drive-torque
  std::string (*harm)(const GuardedRun&);  // empty: none
  Layer last = Layer::kGate;
  double silent_from_s = 0.0;  // > 0: every input is silent from there on
};

const std::vector<GuardCase>& guard_cases();
GuardedRun run_guarded(const GuardCase& which);

}  // namespace beltgrip::test
