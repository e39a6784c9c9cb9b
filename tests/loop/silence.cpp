#include "tests/loop/silence.h"

#include <algorithm>
#include <stdexcept>

#include "tests/loop/closed_loop.h"

namespace beltgrip::test {

namespace {
constexpr double kBeyond_s = 0.05;  // the request has ended by then
constexpr double kAfter_s = 2.0;    // until the belt holds again
}  // namespace

SilenceResult silence_over_the_ramp(sim::VehicleScenario scenario, double step_s, double near_s,
                                    double near_for_s) {
  const daemon::Config config = vehicle_config(scenario);
  // The driver lifts the foot at once: what comes before is not looked at.
  if (scenario.driver.steps.size() > 1) scenario.driver.steps[1].at_s = 0.3;
  const LoopRun whole = run_closed(scenario, config, 1);
  if (whole.requests.size() != 1) throw std::runtime_error("not one request");
  const double begin_s = whole.requests[0].begin_s;
  SilenceResult out;
  out.ramp_s = whole.requests[0].end_s - begin_s;
  for (const sim::FaultKind kind : {sim::FaultKind::kDaemonDies, sim::FaultKind::kFrameSilent}) {
    for (double at_s = 0.0; at_s < out.ramp_s + kBeyond_s;
         at_s += at_s < out.ramp_s - near_for_s ? step_s : near_s) {
      sim::VehicleScenario silent = scenario;
      silent.duration_s = begin_s + at_s + kAfter_s;
      silent.faults.push_back({kind, "", at_s, true, 1e6, 0.0});
      const LoopRun run = run_closed(silent, config, 1);
      ++out.runs;
      for (const auto& [which, how] : run.broken) {
        out.broken.try_emplace(which, how + ", silence at " + std::to_string(at_s) + " s");
      }
      for (const sim::RequestTruth& request : run.requests) {
        out.slip_max_share = std::max(out.slip_max_share, request.slip_max_share);
        out.slip_speed_max_m_s = std::max(out.slip_speed_max_m_s, request.slip_speed_max_m_s);
        out.energy_J = std::max(out.energy_J, request.macro_energy_J);
      }
    }
  }
  return out;
}

}  // namespace beltgrip::test
