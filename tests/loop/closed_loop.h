// One run of the daemon's own loop and pipeline against the virtual vehicle, in virtual time, with
// the invariants watched and the truth kept; and the same vehicle without the daemon.
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "daemon/core/config/options/config.h"
#include "daemon/core/experiment/experiment.h"
#include "tools/sim/vehicle_simulation.h"

namespace beltgrip::test {

// A configuration that fits a scenario, as a user would load it. Settings replace its lines by key.
daemon::Config vehicle_config(const sim::VehicleScenario& scenario,
                              const std::map<std::string, std::string>& settings = {});

// The end of a request for which the received frames gave a reason.
struct Reaction {
  std::string what;
  double since_s = 0.0;    // from when on the frames showed it
  double decided_s = 0.0;  // sample without a request
  double wire_s = -1.0;    // RequestActive = 0 is on the bus; < 0: it never was
};

struct LoopRun {
  std::vector<daemon::ExperimentResult> results;
  std::vector<sim::RequestTruth> requests;
  std::map<std::string, std::string> broken;  // invariants
  std::vector<double> slip_share_bins;        // largest |slip| of each kBin_s
  std::vector<double> speed_bins;             // and slip speed, m/s
  std::vector<Reaction> reactions;
  std::uint32_t inhibits = 0;  // all that were ever set once a trigger was near
  std::uint32_t faults = 0;    // all that were ever set
  std::string frozen;          // what was first found to stand still, and when
  daemon::State last_state = daemon::State::kInhibited;
  std::uint64_t sent_hash = 1469598103934665603U;  // of every byte on the bus and its instant
  int stalls = 0;
  double finite_until_s = -1.0;  // >= 0: the plant's state was no number from there on

  static constexpr double kBin_s = 0.25;
  // Largest values from begin_s to end_s.
  double slip_max_share(double begin_s, double end_s) const;
  double slip_speed_max(double begin_s, double end_s) const;
};

LoopRun run_closed(const sim::VehicleScenario& scenario, const daemon::Config& config,
                   std::uint64_t seed);
LoopRun run_alone(const sim::VehicleScenario& scenario, std::uint64_t seed);

}  // namespace beltgrip::test
