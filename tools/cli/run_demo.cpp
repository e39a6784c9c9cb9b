// beltgrip run-demo: the whole main job in one process. A simulated experiment sends its frames in
// real time onto the embedded bus, the daemon's loop listens there, and what it publishes is shown
// as it comes. Three threads, one for each port.
#include <unistd.h>

#include <array>
#include <cstdio>
#include <exception>
#include <filesystem>
#include <limits>
#include <memory>
#include <string>
#include <thread>

#include "daemon/core/loop.h"
#include "daemon/core/pipeline.h"
#include "daemon/io/inproc_bus.h"
#include "tools/cli/bus.h"
#include "tools/cli/command.h"
#include "tools/cli/configuration.h"
#include "tools/cli/output_file.h"
#include "tools/cli/own_frame_view.h"
#include "tools/cli/scenario_options.h"
#include "tools/cli/verdict.h"
#include "tools/sim/resources.h"
#include "tools/sim/rig_source.h"

namespace beltgrip::cli {

namespace {

constexpr const char* kBus = "inproc:demo";
constexpr double kLateStart_s = 80.0;  // ten seconds before the peak
constexpr double kDemo_s = 20.0;

struct Options {
  ScenarioOptions scenario;
  std::string method;
};

// The configuration as a user's: a file and a DBC, in a directory that lives as long as it is read.
daemon::Config rig_config(const sim::Scenario& scenario, const std::string& method) {
  std::string pattern = (std::filesystem::temp_directory_path() / "beltgrip.XXXXXX").string();
  if (mkdtemp(pattern.data()) == nullptr) {
    throw Failure{kCannotCreate, pattern + ": no temporary directory can be made"};
  }
  const std::filesystem::path directory = pattern;
  try {
    write_file((directory / "vehicle.dbc").string(), sim::shipped("paper-rig.dbc"));
    write_file((directory / "beltgrip.toml").string(),
               sim::rig_configuration(scenario, kBus, "vehicle.dbc"));
    daemon::Config config = load_configuration((directory / "beltgrip.toml").string(), method);
    std::filesystem::remove_all(directory);
    return config;
  } catch (...) {
    std::filesystem::remove_all(directory);
    throw;
  }
}

void show(daemon::Port& port, const daemon::Config& config, daemon::MonoTime origin,
          Verdict& verdict) {
  OwnFrameDecoder decoder(config.identifiers);
  BusTable table(stdout);
  std::array<daemon::RxFrame, 64> frames;
  for (;;) {
    const daemon::Wake wake = port.wait_until(std::numeric_limits<daemon::MonoTime>::max());
    if (wake == daemon::Wake::kClosed) return;
    const std::size_t count = port.receive(frames);
    for (std::size_t i = 0; i < count; ++i) {
      const auto view = decoder.decode(frames[i].frame);
      if (!view) continue;
      table.on_frame(frames[i].t - origin, *view);
      verdict.on_frame(frames[i].t - origin, *view);
    }
  }
}

void run(const Options& options) {
  const sim::Scenario scenario = options.scenario.load();
  const daemon::Config config = rig_config(scenario, options.method);
  sim::RigSource source(scenario, options.scenario.seed, options.scenario.start_s,
                        options.scenario.end_s());
  can::StampedFrame first;
  if (!source.next(first)) throw Failure{kUsage, "run-demo: the scenario ends before --start"};

  const auto bus = daemon::InprocBus::create(daemon::InprocBus::Clock::kMonotonic);
  const std::unique_ptr<daemon::Port> daemon_port = bus->connect();
  const std::unique_ptr<daemon::Port> view_port = bus->connect();
  const std::unique_ptr<daemon::Port> rig_port = bus->connect();
  daemon::Pipeline pipeline(config);

  std::printf(
      "The paper's experiment on a simulated rig, belt \"%s\", from %.0f s on, in real time:\n"
      "primary shaft at %.0f rad/s and %.0f Nm, the clamping force falls by %.0f N/s.\n"
      "CAN frames pass through the daemon's loop; below is what it publishes, decoded.\n\n",
      scenario.belt.c_str(), options.scenario.start_s, scenario.primary_speed_rad_s,
      scenario.primary_torque_Nm, scenario.ramp_N_per_s);
  const daemon::MonoTime origin = rig_port->now() - first.t_ns;
  std::exception_ptr rig_failure;
  Verdict verdict;
  {
    std::jthread daemon_thread([&] {
      daemon::run_loop(*daemon_port, pipeline, config.estimator.sample_rate_hz,
                       estimator::StopReason::kTraceEnd, nullptr);
    });
    std::jthread rig_thread([&] {
      bool first_taken = false;
      try {
        play(*rig_port, kBus, 1.0, [&](can::StampedFrame& frame) {
          if (first_taken) return source.next(frame);
          frame = first;
          return first_taken = true;
        });
      } catch (...) {
        rig_failure = std::current_exception();
      }
      bus->close();
    });
    show(*view_port, config, origin, verdict);
  }
  if (rig_failure) std::rethrow_exception(rig_failure);
  verdict.print(stdout,
                make_truth(scenario, options.scenario.seed, first.t_ns, source.simulation()));
}

}  // namespace

void add_run_demo(CLI::App& app) {
  CLI::App* command = app.add_subcommand(
      "run-demo",
      "A simulated experiment through the daemon's loop, in this process, in real time");
  auto options = std::make_shared<Options>();
  options->scenario.start_s = kLateStart_s;
  options->scenario.duration_s = kDemo_s;
  options->scenario.add_to(*command);
  command->add_option("--method", options->method, "robust (default) or paper")
      ->check(CLI::IsMember({"robust", "paper"}));
  command->callback([options] { run(*options); });
}

}  // namespace beltgrip::cli
