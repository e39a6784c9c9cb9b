// Work of the real-time path, for callgrind (tests/instructions): a coast-down with its experiment
// is driven once, then its frames and samples are given to a second pipeline, and callgrind dumps
// the cost of each call under the name of its kind. Prints how many of each were counted.
#include <cstdio>
#include <map>
#include <string>
#include <vector>

#if __has_include(<valgrind/callgrind.h>)
#include <valgrind/callgrind.h>
#else  // counts nothing
#define CALLGRIND_START_INSTRUMENTATION
#define CALLGRIND_ZERO_STATS
#define CALLGRIND_DUMP_STATS_AT(name)
#endif

#include "daemon/core/pipeline.h"
#include "tests/loop/closed_loop.h"
#include "tests/loop/recorded_drive.h"
#include "tools/sim/vehicle_scenario.h"

namespace beltgrip::test {

using daemon::Pipeline;
using daemon::State;

namespace {

constexpr long kEach = 17;

int run(const std::string& method, const std::string& stop) {
  const sim::VehicleScenario scenario = sim::shipped_vehicle_scenario("coast-overdrive").scenario;
  daemon::Config config = vehicle_config(scenario, {{"stop", "\"" + stop + "\""}});
  if (method == "paper") config.estimator.method = estimator::Method::kPaper;
  const std::vector<DriveStep> steps = record_drive(scenario, config);
  Pipeline pipeline(config);
  std::map<std::string, long> calls;
  State state = State::kInhibited;
  bool asked = false;
  long seen = 0;
  CALLGRIND_START_INSTRUMENTATION;
  for (const DriveStep& step : steps) {
    daemon::Outbox out;
    const char* kind = "frame";
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
    const bool experiment = kind[0] == 'r' || kind[0] == 'e';
    const bool count = experiment || ++seen % kEach == 0;
    if (count) CALLGRIND_ZERO_STATS;
    if (step.is_frame) {
      pipeline.on_frame(step.frame);
    } else {
      pipeline.on_sample(step.t, out);
    }
    if (!count) continue;
    CALLGRIND_DUMP_STATS_AT(kind);
    ++calls[kind];
  }
  for (const auto& [kind, count] : calls) std::printf("%s %ld\n", kind.c_str(), count);
  return calls["ramping"] > 0 && calls["evaluating"] > 0 ? 0 : 1;
}

}  // namespace
}  // namespace beltgrip::test

int main(int argc, char** argv) {
  return beltgrip::test::run(argc > 1 ? argv[1] : "robust", argc > 2 ? argv[2] : "peak");
}
