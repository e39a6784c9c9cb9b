// The rig as a stream of frames: simulation, sensors and bus in one, pulled frame by frame. The
// same scenario and seed give the same frames; a late start leaves out the head and changes nothing
// after it. Simulation only.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "can_dbc/frame/can_frame.h"
#include "tools/sim/bus.h"
#include "tools/sim/rig_simulation.h"

namespace beltgrip::sim {

// The plant's state has left the numbers: the run ends.
struct NonFiniteState {
  std::uint64_t seed = 0;
  double t_s = 0.0;
};

class RigSource {
 public:
  // Frames from start_s to end_s of the scenario's time.
  RigSource(const RigScenario& scenario, std::uint64_t seed, double start_s, double end_s);

  // False at the end. Throws NonFiniteState.
  bool next(can::StampedFrame& frame);
  const RigSimulation& simulation() const { return simulation_; }

 private:
  std::uint64_t seed_;
  RigSimulation simulation_;
  Bus bus_;
  std::int64_t start_ns_;
  std::int64_t end_ns_;
  std::vector<can::StampedFrame> waiting_;
  std::size_t taken_ = 0;
};

}  // namespace beltgrip::sim
