#include "tests/loop/closed_loop.h"

#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <stdexcept>

#include "daemon/core/config/load/load_config.h"
#include "daemon/core/loop/loop.h"
#include "tests/loop/detectable.h"
#include "tests/support/invariants.h"
#include "tools/sim/configuration.h"
#include "tools/sim/resources.h"
#include "tools/sim/vehicle_port.h"

namespace beltgrip::test {

namespace {

void note_slip(const sim::VehicleSimulation& vehicle, LoopRun& run) {
  const auto bin = static_cast<std::size_t>(
      std::max(0.0, static_cast<double>(vehicle.now_ns()) * 1e-9 / LoopRun::kBin_s));
  if (run.slip_share_bins.size() <= bin) {
    run.slip_share_bins.resize(bin + 1, 0.0);
    run.speed_bins.resize(bin + 1, 0.0);
  }
  const sim::DrivelineOutput& belt = vehicle.truth().belt;
  run.slip_share_bins[bin] = std::max(run.slip_share_bins[bin], std::abs(belt.slip_share));
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

constexpr std::uint32_t kClamp = 0x6A2;

constexpr double kRounding_s = 1e-6;

void mix(std::uint64_t& hash, std::uint64_t value) { hash = (hash ^ value) * 1099511628211U; }

bool has_fault(const sim::VehicleScenario& scenario, sim::FaultKind kind) {
  return std::any_of(scenario.faults.begin(), scenario.faults.end(),
                     [kind](const sim::FaultStep& fault) { return fault.kind == kind; });
}

// Passes reports on to the invariants and keeps what a test asks for.
class Recorder final : public daemon::SampleSink {
 public:
  Recorder(const sim::VehiclePort& port, daemon::Pipeline& pipeline, double sample_s,
           const Detectable& detectable, const double& inactive_s, Invariants& invariants,
           LoopRun& run)
      : port_(port),
        pipeline_(pipeline),
        sample_s_(sample_s),
        // A loop that is not run, or stamps that lie, cannot be held to the clock of the frames.
        on_time_(!has_fault(port.vehicle().scenario(), sim::FaultKind::kLoopLate) &&
                 !has_fault(port.vehicle().scenario(), sim::FaultKind::kStampBack)),
        detectable_(detectable),
        inactive_s_(inactive_s),
        invariants_(invariants),
        run_(run) {}
  void on_report(const daemon::SampleReport& report) noexcept override {
    if (port_.daemon_is_dead()) return;
    invariants_.on_report(report);
    check_counters();
    if (report.new_result) {
      run_.results.push_back(report.result);
      learn(report);
    }
    check_reaction(static_cast<double>(report.t.ns()) * 1e-9, report.request_force_N > 0.0);
    if (report.state == daemon::State::kSettling) run_.inhibits |= report.inhibits;
    run_.faults |= report.faults;
    if (report.frozen && run_.frozen.empty()) {
      run_.frozen = std::string(daemon::role_name(*report.frozen)) + " at " +
                    std::to_string(static_cast<double>(report.t.ns()) * 1e-9) + " s";
    }
    run_.last_state = report.state;
  }

 private:
  // As the daemon's history, which keeps every result.
  void learn(const daemon::SampleReport& report) {
    constexpr double kEpoch_s = 1.7e9;
    const daemon::ExperimentResult& result = report.result;
    if (result.outcome == daemon::Outcome::kAborted) return;
    estimator::BeltExperiment row;
    row.time_s = kEpoch_s + static_cast<double>(report.t.ns()) * 1e-9;
    row.kind = result.peak.kind;
    row.mu_max = result.peak.mu_max;
    row.mu_max_std = result.peak.mu_max_std;
    row.ci95_low = result.peak.ci95_low;
    row.ci95_high = result.peak.ci95_high;
    row.sensor_std = result.sensor_std;
    row.direction = result.direction;
    row.end_stop = result.end_stop;
    row.omega_p_rad_s = result.omega_p_rad_s;
    row.torque_Nm = result.torque_Nm;
    row.oil_degC = result.oil_degC;
    row.slipped = result.slipped;
    if (result.clamp_force_N > 0.0) {
      row.carried_Nm_per_N = std::abs(result.torque_Nm) / result.clamp_force_N;
    }
    rows_.push_back(row);
    const estimator::LearnedFriction learned = estimator::learn(rows_, row.time_s);
    pipeline_.learn(learned);
    invariants_.on_learned(learned);
  }

  void check_counters() {
    const daemon::PipelineCounters& now = pipeline_.counters();
    if (now.frames < counters_.frames || now.frames_decoded < counters_.frames_decoded ||
        now.frames_bad < counters_.frames_bad || now.samples < counters_.samples ||
        now.frames_refused < counters_.frames_refused ||
        now.frames_decoded + now.frames_bad > now.frames) {
      run_.broken["I10"] = "a counter fell";
    }
    counters_ = now;
  }

  void check_reaction(double t_s, bool asks) {
    if ((asks || asked_) && on_time_) {
      if (const auto reason = detectable_.at(t_s)) {
        if (asks && !asked_) run_.broken["I1"] = "a request begins in spite of: " + reason->what;
        // One sample (G4).
        if (asks && t_s - reason->since_s > sample_s_ + kRounding_s) {
          run_.broken["G4"] = "a request stands " + std::to_string(t_s - reason->since_s) +
                              " s after: " + reason->what;
        }
        if (!asks) run_.reactions.push_back({reason->what, reason->since_s, t_s, inactive_s_});
      }
    }
    asked_ = asks;
  }

  const sim::VehiclePort& port_;
  daemon::Pipeline& pipeline_;
  std::vector<estimator::BeltExperiment> rows_;
  double sample_s_;
  daemon::PipelineCounters counters_;
  bool on_time_;
  const Detectable& detectable_;
  const double& inactive_s_;
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

double LoopRun::slip_max_share(double begin_s, double end_s) const {
  return largest(slip_share_bins, begin_s, end_s);
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
  double inactive_s = -1.0;  // the first inactive clamp frame since the last active one
  Invariants invariants(config);
  sim::VehiclePort::Observers observers;
  observers.on_step = [&run](const sim::VehicleSimulation& vehicle) { note_slip(vehicle, run); };
  Detectable detectable(config);
  observers.on_sent = [&](std::int64_t t_ns, const can::CanFrame& frame) {
    const double t_s = static_cast<double>(t_ns) * 1e-9;
    invariants.on_sent(frame);
    detectable.on_sent(t_s, frame);
    mix(run.sent_hash, static_cast<std::uint64_t>(t_ns));
    for (const std::uint8_t byte : frame.payload()) mix(run.sent_hash, byte);
    if (frame.id.value == kClamp && frame.data[2] == 0 && inactive_s < 0.0) inactive_s = t_s;
    if (frame.id.value == kClamp && frame.data[2] == 1) inactive_s = -1.0;
  };
  observers.on_received = [&](const daemon::RxFrame& frame) { detectable.on_received(frame); };
  observers.on_unsent = [&invariants] { invariants.on_unsent(); };
  sim::VehiclePort port(scenario, seed, observers);
  daemon::Pipeline pipeline(config);
  Recorder recorder(port, pipeline, 1.0 / config.estimator.sample_rate_hz, detectable, inactive_s,
                    invariants, run);
  daemon::run_loop(port, pipeline, config.estimator.sample_rate_hz,
                   estimator::StopReason::kShutdown, &recorder);
  port.run_alone();
  run.broken.insert(invariants.problems().begin(), invariants.problems().end());
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
