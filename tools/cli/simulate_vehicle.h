// The virtual vehicle of beltgrip simulate: in virtual time with the daemon's own loop on the other
// side, or in real time on a bus, as the node that a daemon talks to. Tools only.
#pragma once

#include <cstdint>
#include <cstdio>
#include <span>
#include <string>
#include <vector>

#include "daemon/core/base/port.h"
#include "tools/cli/replay_run.h"
#include "tools/sim/bus.h"
#include "tools/sim/vehicle_parameters.h"
#include "tools/sim/vehicle_simulation.h"

namespace beltgrip::cli {

inline constexpr const char* kInterface = "vcan0";  // of what runs on no bus

// The plant's state has left the numbers: Failure with seed and time.
[[noreturn]] void fail_not_finite(double t_s, std::uint64_t seed);

// One line of JSON: what the vehicle knows and no bus tells.
std::string truth_json(const sim::VehicleSimulation& vehicle, std::uint64_t seed);
std::string truth_text(const sim::VehicleSimulation& vehicle);

struct DriveResult {
  ReplayResult daemon;
  std::string truth_json, truth_text;
};
// `believed` is what the daemon's configuration is made of, `machine` what drives. In virtual time;
// `log`, where there is one, gets the bus as the daemon saw it, its own frames
// included.
DriveResult drive_with_daemon(const sim::VehicleScenario& believed,
                              const sim::VehicleScenario& machine, std::uint64_t seed,
                              bool shows_progress, std::FILE* log);

// The vehicle as a node of a bus in real time, for play_node: sends its frames, obeys
// BeltGripClamp.
class VehicleNode {
 public:
  VehicleNode(const sim::VehicleScenario& scenario, std::uint64_t seed);
  // False at the end of the drive. Throws Failure when the plant's state is no number.
  bool advance(std::int64_t now_ns, std::span<const daemon::RxFrame> received,
               std::vector<can::CanFrame>& out);
  const sim::VehicleSimulation& vehicle() const { return vehicle_; }

 private:
  std::uint64_t seed_;
  sim::VehicleSimulation vehicle_;
  sim::Bus frames_;
  std::vector<can::StampedFrame> waiting_;
};

// What happens in the vehicle, told to a person who watches; a line for each event.
class DriveStory {
 public:
  explicit DriveStory(std::FILE* out) : out_(out) {}
  void observe(const sim::VehicleSimulation& vehicle);

 private:
  void say(const sim::VehicleSimulation& vehicle, const char* pattern, auto... arguments);

  std::FILE* out_;
  bool begun_ = false;
  bool pressed_ = false;
  bool obeying_ = false;
  bool worn_ = false;
};

// Sends the vehicle's frames, obeys BeltGripClamp from the bus, tells the story on standard error
// and prints the truth at the end.
void drive_on_bus(const sim::VehicleScenario& scenario, std::uint64_t seed, const std::string& bus,
                  double speed);

}  // namespace beltgrip::cli
