#include "tests/loop/closed_loop.h"

#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <stdexcept>

#include "daemon/core/loop.h"
#include "tests/support/invariants.h"
#include "tools/sim/resources.h"
#include "tools/sim/vehicle_port.h"

namespace beltgrip::test {

namespace {

void note_slip(const sim::VehicleSimulation& vehicle, LoopRun& run) {
  const auto bin = static_cast<std::size_t>(
      std::max(0.0, static_cast<double>(vehicle.now_ns()) * 1e-9 / LoopRun::kBin_s));
  if (run.slip_bins.size() <= bin) {
    run.slip_bins.resize(bin + 1, 0.0);
    run.speed_bins.resize(bin + 1, 0.0);
  }
  const sim::DrivelineOutput& belt = vehicle.truth().belt;
  run.slip_bins[bin] = std::max(run.slip_bins[bin], std::abs(belt.slip));
  run.speed_bins[bin] = std::max(run.speed_bins[bin], belt.slip_speed_m_s);
}

double largest(const std::vector<double>& bins, double begin_s, double end_s) {
  double out = 0.0;
  for (std::size_t i = 0; i < bins.size(); ++i) {
    const double bin_s = static_cast<double>(i) * LoopRun::kBin_s;
    if (bin_s + LoopRun::kBin_s > begin_s && bin_s <= end_s) out = std::max(out, bins[i]);
  }
  return out;
}

// Passes reports on to the invariants and keeps what a test asks for.
class Recorder final : public daemon::SampleSink {
 public:
  Recorder(const sim::VehiclePort& port, Invariants& invariants, LoopRun& run)
      : port_(port), invariants_(invariants), run_(run) {}
  void on_report(const daemon::SampleReport& report) noexcept override {
    if (port_.daemon_is_dead()) return;
    invariants_.on_report(report);
    if (report.new_result) run_.results.push_back(report.result);
    if (asked_ && report.request_force_N <= 0.0) {
      run_.request_end_s.push_back(static_cast<double>(report.t) * 1e-9);
    }
    asked_ = report.request_force_N > 0.0;
    if (report.state == daemon::State::kSettling) run_.inhibits |= report.inhibits;
    run_.faults |= report.faults;
    run_.last_state = report.state;
  }

 private:
  const sim::VehiclePort& port_;
  Invariants& invariants_;
  LoopRun& run_;
  bool asked_ = false;
};

void finish(const sim::VehicleSimulation& vehicle, LoopRun& run) {
  run.requests = vehicle.requests();
  run.stalls = vehicle.truth().stalls;
  if (!vehicle.finite()) run.finite_until_s = static_cast<double>(vehicle.now_ns()) * 1e-9;
}

}  // namespace

double LoopRun::slip_max(double begin_s, double end_s) const {
  return largest(slip_bins, begin_s, end_s);
}
double LoopRun::slip_speed_max(double begin_s, double end_s) const {
  return largest(speed_bins, begin_s, end_s);
}

daemon::Config vehicle_config(const sim::VehicleScenario& scenario,
                              const std::map<std::string, std::string>& settings) {
  std::string text = sim::vehicle_configuration(scenario, "inproc:test", "vehicle.dbc");
  for (const auto& [key, value] : settings) {
    const std::size_t at = text.find("\n" + key + " ");
    if (at == std::string::npos) {
      text += key + " = " + value + "\n";  // [experiment] is the last section
      continue;
    }
    text.replace(at + 1, text.find('\n', at + 1) - at - 1, key + " = " + value);
  }
  std::string pattern = (std::filesystem::temp_directory_path() / "beltgrip.XXXXXX").string();
  if (mkdtemp(pattern.data()) == nullptr) throw std::runtime_error("no temporary directory");
  std::ofstream(pattern + "/vehicle.dbc") << *sim::resource("vehicle.dbc");
  std::ofstream(pattern + "/beltgrip.toml") << text;
  const daemon::ConfigResult result = daemon::load_config(pattern + "/beltgrip.toml");
  std::filesystem::remove_all(pattern);
  if (!result.config) throw std::runtime_error(result.errors.at(0).text);
  return *result.config;
}

LoopRun run_closed(const sim::VehicleScenario& scenario, const daemon::Config& config,
                   std::uint64_t seed) {
  LoopRun run;
  Invariants invariants(config);
  sim::VehiclePort port(
      scenario, seed,
      {[&run](const sim::VehicleSimulation& vehicle) { note_slip(vehicle, run); },
       [&invariants](std::int64_t, const can::CanFrame& frame) { invariants.on_sent(frame); }});
  Recorder recorder(port, invariants, run);
  daemon::Pipeline pipeline(config);
  daemon::run_loop(port, pipeline, config.estimator.sample_rate_hz,
                   estimator::StopReason::kShutdown, &recorder);
  port.run_alone();
  run.broken = invariants.problems();
  finish(port.vehicle(), run);
  return run;
}

LoopRun run_alone(const sim::VehicleScenario& scenario, std::uint64_t seed) {
  LoopRun run;
  sim::VehicleSimulation vehicle(scenario, seed);
  while (!vehicle.finished() && vehicle.finite()) {
    vehicle.step();
    note_slip(vehicle, run);
  }
  finish(vehicle, run);
  return run;
}

}  // namespace beltgrip::test
