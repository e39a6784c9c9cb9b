#include "tests/loop/freeze.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "daemon/core/base/faults.h"
#include "daemon/core/publish/names.h"
#include "tests/loop/closed_loop.h"

namespace beltgrip::test {

namespace {

constexpr double kAfter_s = 2.5;  // until the belt holds again, and the force is back

bool names_frozen(const LoopRun& run) {
  return (run.faults & daemon::fault_bit(daemon::Fault::kInputFrozen)) != 0;
}

}  // namespace

std::vector<std::vector<std::string>> frozen_inputs() {
  const std::vector<std::string> signals{"PrimarySpeed", "SecondarySpeed", "SecondaryPressure",
                                         "EngineTorque", "EngineSpeed"};
  std::vector<std::vector<std::string>> out;
  for (std::size_t i = 0; i < signals.size(); ++i) {
    out.push_back({signals[i]});
    for (std::size_t j = i + 1; j < signals.size(); ++j) out.push_back({signals[i], signals[j]});
  }
  return out;
}

void make_coarse(sim::VehicleScenario& scenario) {
  constexpr double kRpm_rad_s = 2.0 * std::numbers::pi / 60.0;
  scenario.sensors.primary_speed.resolution = kRpm_rad_s;
  scenario.sensors.secondary_speed.resolution = kRpm_rad_s;
  scenario.sensors.engine_speed.resolution = kRpm_rad_s;
  scenario.sensors.pressure.resolution = 10e3;
  scenario.sensors.torque.resolution = 1.0;
}

FreezeBench::FreezeBench(sim::VehicleScenario scenario,
                         const std::map<std::string, std::string>& settings, bool engine_speed,
                         std::uint64_t seed)
    : scenario_(std::move(scenario)), config_(vehicle_config(scenario_, settings)), seed_(seed) {
  if (!engine_speed) {
    std::erase_if(config_.roles, [](const daemon::RoleBinding& binding) {
      return binding.role == daemon::Role::kEngineSpeed;
    });
  }
  const LoopRun whole = run_closed(scenario_, config_, seed_);
  if (names_frozen(whole)) {
    false_alarm_ = whole.frozen;
    for (const daemon::ExperimentResult& result : whole.results) {
      false_alarm_ += "; " + daemon::cause_text(result.stop_reason, result.cause);
    }
  }
  if (whole.requests.empty()) return;
  begin_s_ = whole.requests[0].begin_s;
  ramp_s_ = whole.requests[0].end_s - begin_s_;
}

FreezeRun FreezeBench::run(const Freeze& freeze) const {
  sim::VehicleScenario scenario = scenario_;
  for (const std::string& signal : freeze.signals) {
    const bool creeps = freeze.creep_per_s != 0.0;
    scenario.faults.push_back({creeps ? sim::FaultKind::kSignalRamp : sim::FaultKind::kSignalFrozen,
                               signal, freeze.at_s, true, 1e6, freeze.creep_per_s});
  }
  // A request may outlast the one without a freeze, but not limits::kRequestLongest.
  scenario.duration_s = std::min(scenario.duration_s, begin_s_ + ramp_s_ + kAfter_s + 6.0);
  const LoopRun run = run_closed(scenario, config_, seed_);
  FreezeRun out;
  out.broken = run.broken;
  out.named = names_frozen(run);
  out.stuck = run.last_state == daemon::State::kFault;
  for (const sim::RequestTruth& request : run.requests) {
    out.slip_max_share = std::max(out.slip_max_share, request.slip_max_share);
    out.slip_speed_max_m_s = std::max(out.slip_speed_max_m_s, request.slip_speed_max_m_s);
    out.energy_J = std::max(out.energy_J, request.macro_energy_J);
    out.lasted_s = std::max(out.lasted_s, request.end_s - request.begin_s - freeze.at_s);
  }
  for (const daemon::ExperimentResult& result : run.results) {
    if (result.outcome == daemon::Outcome::kNone || run.requests.empty()) continue;
    if (out.reason.empty()) {
      out.reason = std::string(daemon::outcome_name(result.outcome)) + " " +
                   std::string(daemon::stop_reason_name(result.stop_reason)) + " (" +
                   daemon::cause_text(result.stop_reason, result.cause) + ")";
    }
    if (result.stop_reason == estimator::StopReason::kInputFrozen) out.named = true;
  }
  return out;
}

}  // namespace beltgrip::test
