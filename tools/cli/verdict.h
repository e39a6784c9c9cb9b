// What BeltGrip found in a simulated experiment, beside the truth that the simulation knows. Tools
// only.
#pragma once

#include <cstdint>
#include <cstdio>
#include <optional>
#include <string>

#include "tools/monitor/own_frame_view.h"
#include "tools/sim/rig_scenario.h"
#include "tools/sim/rig_simulation.h"

namespace beltgrip::cli {

struct Truth {
  std::string scenario, belt;
  std::uint64_t seed = 0;
  std::int64_t first_frame_ns = 0;  // stamp of the first frame of the log
  double mu_max = 0.0;
  std::vector<sim::ExperimentTruth> experiments;
};

Truth make_truth(const sim::RigScenario& scenario, std::uint64_t seed, std::int64_t first_frame_ns,
                 const sim::RigSimulation& simulation);
std::string truth_json(const Truth& truth);
// Throws Failure: 66 missing, 65 not the truth of a simulation.
Truth read_truth(const std::string& path);

// Collects from published frames, whose times are those of the log.
class Verdict {
 public:
  void on_frame(std::int64_t t_ns, const monitor::OwnFrameView& view);
  void print(std::FILE* out, const Truth& truth) const;

 private:
  bool stop_flag_ = false;
  std::optional<double> stop_s_;
  std::optional<double> stop_slip_percent_;  // where the stop came with a slip
  std::optional<double> mu_max_;
  double mu_max_std_ = 0.0;
  std::string kind_;
};

}  // namespace beltgrip::cli
