// Work of the real-time path, for callgrind (tests/instructions): a coast-down with its experiment
// is driven once, then its frames and samples are given to a second pipeline, and callgrind dumps
// the cost of each call under the name of its kind. Prints how many of each were counted.
#include <valgrind/callgrind.h>

#include <cstdio>
#include <map>
#include <string>
#include <vector>

#include "daemon/core/loop/pipeline.h"
#include "tests/loop/closed_loop.h"
#include "tests/loop/recorded_drive.h"
#include "tools/sim/vehicle_scenario.h"

namespace beltgrip::test {

using daemon::Pipeline;
using daemon::State;

namespace {

constexpr long kEach = 17;

// assumed: nobody has stated a constant of the variator, nor the accuracy of a sensor.
int run(const std::string& method, const std::string& stop, bool assumed) {
  const sim::VehicleScenario scenario = sim::shipped_vehicle_scenario("coast-overdrive").scenario;
  daemon::Config config = vehicle_config(scenario, {{"stop", "\"" + stop + "\""}});
  if (method == "paper") config.estimator.method = estimator::Method::kPaper;
  config.friction_is_assumed = assumed;
  if (assumed) config.assumed_constants.set();
  const std::vector<DriveStep> steps = record_drive(scenario, config);
  Pipeline pipeline(config);
  std::map<std::string, long> calls;
  State state = State::kInhibited;
  bool asked = false;
  long seen = 0;
  CALLGRIND_START_INSTRUMENTATION;
  for (const DriveStep& step : steps) {
    daemon::Outbox out;
    std::string kind = "frame";
    if (!step.is_frame) {
      const bool evaluating = step.state == State::kEvaluating || state == State::kEvaluating;
      kind = step.state == State::kRamping ? "ramping"
             : evaluating                  ? "evaluating"
             : asked                       ? "after"
                                           : "before";
      asked = asked || step.state == State::kRamping;
      state = step.state;
    }
    // A dump takes a millisecond: of frames and of samples without an experiment each kEach-th.
    const bool experiment = kind == "ramping" || kind == "evaluating";
    if (assumed) kind += "-assumed";
    const bool count = experiment || ++seen % kEach == 0;
    if (count) CALLGRIND_ZERO_STATS;
    if (step.is_frame) {
      pipeline.on_frame(step.frame);
    } else {
      pipeline.on_sample(step.t, out);
    }
    if (!count) continue;
    CALLGRIND_DUMP_STATS_AT(kind.c_str());
    ++calls[kind];
  }
  CALLGRIND_STOP_INSTRUMENTATION;
  for (const auto& [kind, count] : calls) std::printf("%s %ld\n", kind.c_str(), count);
  const std::string suffix = assumed ? "-assumed" : "";
  // The paper's mean stands in the sample of the stop; only what is assumed takes more of them.
  const bool evaluates = config.estimator.method != estimator::Method::kPaper || assumed;
  const bool evaluated = calls["evaluating" + suffix] > 0;
  return calls["ramping" + suffix] > 0 && evaluated == evaluates ? 0 : 1;
}

}  // namespace
}  // namespace beltgrip::test

int main(int argc, char** argv) {
  const std::string method = argc > 1 ? argv[1] : "robust", stop = argc > 2 ? argv[2] : "peak";
  for (const bool assumed : {false, true}) {
    if (beltgrip::test::run(method, stop, assumed) != 0) return 1;
  }
  return 0;
}
