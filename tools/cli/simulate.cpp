// beltgrip simulate: the virtual rig as a candump log, with the DBC, the configuration that fits
// and the truth.
#include <filesystem>
#include <memory>
#include <optional>
#include <string>

#include "can_dbc/can_log.h"
#include "tools/cli/bus.h"
#include "tools/cli/command.h"
#include "tools/cli/output_file.h"
#include "tools/cli/scenario_options.h"
#include "tools/cli/verdict.h"
#include "tools/sim/resources.h"
#include "tools/sim/rig_source.h"

namespace beltgrip::cli {

namespace {

constexpr const char* kInterface = "vcan0";

struct Options {
  ScenarioOptions scenario;
  std::string out_dir;
  std::string log_out;
  std::string bus;
  double speed = 1.0;
};

// The next frame, with the end of a void run as Failure.
bool next_frame(sim::RigSource& source, can::StampedFrame& frame) {
  try {
    return source.next(frame);
  } catch (const sim::NonFiniteState& state) {
    throw Failure{kInternal, "the plant's state is no longer finite at " +
                                 std::to_string(state.t_s) + " s, seed " +
                                 std::to_string(state.seed)};
  }
}

// Returns the stamp of the first frame.
std::int64_t write_log(sim::RigSource& source, const std::string& path) {
  OutputFile file(path);
  can::CandumpWriter writer(file.get());
  can::StampedFrame stamped;
  std::optional<std::int64_t> first_ns;
  while (next_frame(source, stamped)) {
    if (!first_ns) first_ns = stamped.t_ns;
    writer.write(stamped.t_ns, kInterface, stamped.frame);
  }
  file.close();
  return first_ns.value_or(0);
}

void run(const Options& options) {
  if (options.out_dir.empty() + options.log_out.empty() + options.bus.empty() != 2) {
    throw Failure{kUsage, "simulate: give one of --out-dir, --log-out and --bus"};
  }
  const sim::Scenario scenario = options.scenario.load();
  sim::RigSource source(scenario, options.scenario.seed, options.scenario.start_s,
                        options.scenario.end_s());
  if (!options.bus.empty()) {
    const auto port = open_bus(options.bus, {}, stop_descriptor());
    play(*port, options.bus, options.speed,
         [&](can::StampedFrame& frame) { return next_frame(source, frame); });
    return;
  }
  if (!options.log_out.empty()) {
    write_log(source, options.log_out);
    return;
  }
  const std::filesystem::path directory = options.out_dir;
  std::error_code error;
  std::filesystem::create_directories(directory, error);
  if (error) {
    throw Failure{kCannotCreate, options.out_dir + ": cannot be created: " + error.message()};
  }
  const std::int64_t first_ns = write_log(source, (directory / "trace.log").string());
  write_file((directory / "vehicle.dbc").string(), sim::shipped("paper-rig.dbc"));
  write_file((directory / "beltgrip.toml").string(),
             sim::rig_configuration(scenario, kInterface, "vehicle.dbc"));
  write_file(
      (directory / "truth.json").string(),
      truth_json(make_truth(scenario, options.scenario.seed, first_ns, source.simulation())));
}

}  // namespace

void add_simulate(CLI::App& app) {
  CLI::App* command =
      app.add_subcommand("simulate", "Run a virtual variator and write its CAN traffic");
  auto options = std::make_shared<Options>();
  options->scenario.add_to(*command);
  command->add_option("--out-dir", options->out_dir,
                      "Write trace.log, vehicle.dbc, beltgrip.toml and truth.json there");
  command->add_option("--log-out", options->log_out, "Write the log alone, '-': standard output");
  command->add_option("--bus", options->bus, "Send the frames to this bus in real time");
  command->add_option("--speed", options->speed, "Times real time, with --bus")
      ->capture_default_str()
      ->check(CLI::Range(1e-3, 1e3));
  command->callback([options] { run(*options); });
}

}  // namespace beltgrip::cli
