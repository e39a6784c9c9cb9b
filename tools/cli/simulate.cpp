// beltgrip simulate: the virtual rig or the virtual vehicle. In virtual time with the daemon's own
// objects on the other side, as log, DBC, fitting configuration, truth and results; or in real time
// on a bus.
#include <algorithm>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>

#include "can_dbc/log/can_log.h"
#include "can_dbc/log/candump_writer.h"
#include "tools/cli/bus.h"
#include "tools/cli/command.h"
#include "tools/cli/configuration.h"
#include "tools/cli/machine_model.h"
#include "tools/cli/output_file.h"
#include "tools/cli/progress.h"
#include "tools/cli/replay_run.h"
#include "tools/cli/scenario_options.h"
#include "tools/cli/simulate_vehicle.h"
#include "tools/cli/stop_signals.h"
#include "tools/cli/verdict.h"
#include "tools/ports/replay_port.h"
#include "tools/sim/configuration.h"
#include "tools/sim/resources.h"
#include "tools/sim/rig_source.h"
#include "tools/text/terminal.h"

namespace beltgrip::cli {

namespace {

struct SimulateOptions {
  ScenarioOptions scenario;
  std::string out_dir;
  std::string log_out;
  std::string json;
  std::string bus;
  std::string model;
  int experiment = 0;
  double speed = 1.0;
  bool force = false;
  bool quiet = false;

  // The machine that runs: the scenario with the model on it.
  template <typename Scenario>
  Scenario machine(Scenario given) const {
    if (!model.empty()) apply_model(model, given);
    given.experiment = experiment;
    return given;
  }
};

// What a run leaves behind beside its log.
struct Run {
  std::string configuration;
  std::string dbc;
  std::string truth_json, truth_text;
  ReplayResult daemon;
};

// The next frame, with the end of a void run as Failure.
bool next_frame(sim::RigSource& source, can::StampedFrame& frame) {
  try {
    return source.next(frame);
  } catch (const sim::NonFiniteState& state) {
    fail_not_finite(state.t_s, state.seed);
  }
}

// The rig's frames as a log, written into a file as they are read.
class RigLog final : public can::LogReader {
 public:
  RigLog(sim::RigSource& source, double duration_s, bool shows_progress, std::FILE* copy)
      : source_(source), duration_s_(duration_s), progress_(shows_progress) {
    if (copy != nullptr) copy_.emplace(copy);
  }
  bool next(can::LogRecord& record) override {
    can::StampedFrame stamped;
    if (stop_asked() || !next_frame(source_, stamped)) return false;
    if (copy_) copy_->write(stamped.t_ns, kInterface, stamped.frame);
    if (stats_.frames++ == 0) first_ns_ = stamped.t_ns;
    if (progress_.steps()) {
      const double t_s = static_cast<double>(stamped.t_ns - first_ns_) * 1e-9;
      progress_.tell(t_s, "s of the run", "times real time", t_s / duration_s_);
    }
    record = {stamped.t_ns, stamped.frame, kInterface, false, {}};
    return true;
  }
  const can::LogStats& stats() const override { return stats_; }
  std::int64_t first_ns() const { return first_ns_; }

 private:
  sim::RigSource& source_;
  double duration_s_;
  Progress progress_;
  std::optional<can::CandumpWriter> copy_;
  can::LogStats stats_;
  std::int64_t first_ns_ = 0;
};

// With results: the daemon's loop runs over the frames; else they are only written.
Run run_rig(const SimulateOptions& options, std::FILE* log, bool results) {
  const sim::RigScenario scenario = options.scenario.load();
  const sim::RigScenario machine = options.machine(scenario);
  sim::RigSource source(machine, options.scenario.seed, options.scenario.start_s,
                        options.scenario.end_s());
  Run run;
  run.configuration = sim::rig_configuration(scenario, kInterface, "vehicle.dbc");
  run.dbc = sim::rig_dbc(machine);
  const double end_s = std::min(machine.duration_s * machine.cycles, options.scenario.end_s());
  auto reader =
      std::make_unique<RigLog>(source, end_s - options.scenario.start_s, !options.quiet, log);
  const RigLog& frames = *reader;
  if (results) {
    std::vector<std::unique_ptr<can::LogReader>> logs;
    logs.push_back(std::move(reader));
    ports::LogTimeline timeline(std::move(logs), {});
    ports::ReplayPort port(timeline, {});
    run_daemon(port, load_configuration_text(run.configuration, run.dbc, ""), run.daemon);
    run.daemon.log = scenario.name;
    run.daemon.frames = timeline.stats().frames;
    run.daemon.duration_ns = timeline.counters().last_ns - timeline.counters().first_ns;
    run.truth_json = truth_json(make_truth(machine, options.scenario.seed,
                                           timeline.counters().first_ns, source.simulation()));
  } else {
    can::LogRecord record;
    while (reader->next(record)) {
    }
    run.truth_json = truth_json(
        make_truth(machine, options.scenario.seed, frames.first_ns(), source.simulation()));
  }
  return run;
}

Run run_vehicle(const SimulateOptions& options, std::FILE* log) {
  const sim::VehicleScenario scenario = options.scenario.load_vehicle();
  const sim::VehicleScenario machine = options.machine(scenario);
  DriveResult drive =
      drive_with_daemon(scenario, machine, options.scenario.seed, !options.quiet, log);
  Run run;
  run.configuration = sim::vehicle_configuration(scenario, kInterface, "vehicle.dbc");
  run.dbc = sim::shipped("vehicle.dbc");
  run.truth_json = std::move(drive.truth_json);
  run.truth_text = std::move(drive.truth_text);
  run.daemon = std::move(drive.daemon);
  return run;
}

void run_on_bus(const SimulateOptions& options) {
  if (options.scenario.is_vehicle()) {
    return drive_on_bus(options.machine(options.scenario.load_vehicle()), options.scenario.seed,
                        options.bus, options.speed);
  }
  sim::RigSource source(options.machine(options.scenario.load()), options.scenario.seed,
                        options.scenario.start_s, options.scenario.end_s());
  const auto port = open_bus(options.bus, {}, stop_descriptor());
  play(*port, options.bus, options.speed,
       [&](can::StampedFrame& frame) { return next_frame(source, frame); });
}

void run_simulate(const SimulateOptions& options) {
  const int places = !options.out_dir.empty() + !options.log_out.empty() + !options.bus.empty();
  const bool to_stdout = options.log_out == "-" || options.json == "-";
  if (places > 1 || (options.log_out == "-" && options.json == "-")) {
    throw Failure{kUsage, "simulate: give one of --out-dir, --log-out and --bus"};
  }
  if (!options.bus.empty()) {
    if (!options.json.empty()) {
      throw Failure{kUsage, "simulate: with --bus the results are those of the daemon there"};
    }
    return run_on_bus(options);
  }
  const std::filesystem::path directory = options.out_dir;
  if (!options.out_dir.empty()) {
    std::error_code error;
    std::filesystem::create_directories(directory, error);
    if (error) {
      throw Failure{kCannotCreate, options.out_dir + ": cannot be created: " + error.message()};
    }
  }
  end_drives_when_stopped();
  const Inputs inputs{options.scenario.scenario, options.model};
  std::optional<OutputFile> log, json, dbc, configuration, truth;
  if (!options.out_dir.empty()) {
    const auto open = [&](std::optional<OutputFile>& file, const char* name) {
      file.emplace((directory / name).string(), inputs, unless_forced(options.force));
    };
    open(log, "trace.log");
    open(dbc, "vehicle.dbc");
    open(configuration, "beltgrip.toml");
    open(truth, "truth.json");
  }
  if (!options.log_out.empty()) log.emplace(options.log_out, inputs);
  if (!options.json.empty()) json.emplace(options.json, inputs);
  std::FILE* const log_file = log ? log->get() : nullptr;
  // A log of the rig alone does not need the daemon, which would double its time.
  const bool results = json || places == 0;
  const Run run = options.scenario.is_vehicle() ? run_vehicle(options, log_file)
                                                : run_rig(options, log_file, results);
  if (log) log->close();
  const auto finish = [](std::optional<OutputFile>& file, std::string_view text) {
    if (!file) return;
    file->write(text);
    file->close();
  };
  finish(dbc, run.dbc);
  finish(configuration, run.configuration);
  finish(truth, run.truth_json);
  if (json) {
    json->write(experiment_lines(run.daemon) + run.truth_json + summary_line(run.daemon));
    json->close();
  }
  if (results && !to_stdout)
    text::print(stdout, experiment_text(run.daemon) + end_text(run.daemon) + run.truth_text);
}

}  // namespace

void add_simulate(command_line::Command app) {
  const command_line::Command command = app.add_subcommand(
      "simulate",
      "Drive a virtual vehicle, or a rig, with the daemon on the other side of its bus");
  auto options = std::make_shared<SimulateOptions>();
  options->scenario.add_to(command);
  command
      .add_option("--out-dir", options->out_dir,
                  "Write trace.log, vehicle.dbc, beltgrip.toml and truth.json there")
      .type_name("FOLDER");
  command.add_flag("--force", options->force, "Replace files of --out-dir that exist");
  command.add_flag("--quiet", options->quiet, kNoProgress);
  command.add_option("--log-out", options->log_out, "Write the log alone, '-': standard output")
      .type_name("FILE");
  command
      .add_option("--json", options->json, "Results and truth as JSON lines, '-': standard output")
      .type_name("FILE");
  command
      .add_option("--bus", options->bus,
                  "In real time on this bus, for a daemon there; prints the truth at the end")
      .type_name("BUS");
  command
      .add_option("--model", options->model,
                  "What the machine really is: a model file, on top of the scenario")
      .type_name("FILE");
  command
      .add_option("--experiment", options->experiment,
                  "Its place among several experiments, for the wear of --model")
      .capture_default_str()
      .range(0, 100000);
  command.add_option("--speed", options->speed, "Times real time, with --bus")
      .capture_default_str()
      .range(1e-3, 1e3);
  command.example("beltgrip simulate --scenario coast-overdrive --out-dir drive");
  command.example("beltgrip simulate --scenario coast-overdrive --bus vcan0");
  command.callback([options] { run_simulate(*options); });
}

}  // namespace beltgrip::cli
