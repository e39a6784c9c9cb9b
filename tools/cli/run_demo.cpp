// beltgrip run-demo: the whole main job in one process. A simulated car, with the daemon's loop as
// the other node of its bus; or the paper's rig, which sends its frames in real time onto the
// embedded bus, where the loop listens: three threads, one for each port. What the daemon publishes
// is shown as it comes.
#include <array>
#include <chrono>
#include <cstdio>
#include <exception>
#include <functional>
#include <limits>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "daemon/core/loop/loop.h"
#include "daemon/core/loop/pipeline.h"
#include "daemon/io/inproc_bus.h"
#include "tools/cli/bus.h"
#include "tools/cli/command.h"
#include "tools/cli/configuration.h"
#include "tools/cli/scenario_options.h"
#include "tools/cli/simulate_vehicle.h"
#include "tools/cli/verdict.h"
#include "tools/monitor/own_frame_view.h"
#include "tools/sim/configuration.h"
#include "tools/sim/resources.h"
#include "tools/sim/rig_source.h"
#include "tools/sim/vehicle_port.h"

namespace beltgrip::cli {

using monitor::BusTable;
using monitor::OwnFrameDecoder;
using monitor::OwnFrameView;

namespace {

constexpr const char* kBus = "inproc:demo";
constexpr double kLateStart_s = 80.0;  // ten seconds before the peak
constexpr double kRig_s = 20.0;
constexpr std::int64_t kPace_ns = 10'000'000;

struct RunDemoOptions {
  ScenarioOptions scenario;
  std::string method;
};

// The results that the frames tell, each with the instant of its first frame.
struct Result {
  double t_s = 0.0;
  double mu_max = 0.0;
  double std = 0.0;
};

class Results {
 public:
  void on_frame(std::int64_t t_ns, const OwnFrameView& view) {
    if (!view.good() || view.message->name != "BeltGripEstimate") return;
    const double count = view.value("ExperimentCount");
    if (view.value("MuMaxValid") < 0.5 || count == count_) return;
    count_ = count;
    all_.push_back({static_cast<double>(t_ns) * 1e-9, view.value("MuMax"), view.value("MuMaxStd")});
  }
  // Each request of the vehicle beside the result that came of it.
  void print(std::FILE* out, const sim::VehicleSimulation& vehicle) const {
    std::fprintf(out, "\n  %-22s %-24s %-24s %s\n", "coast-down", "mu_max by BeltGrip", "truth",
                 "what the belt went through");
    for (const sim::RequestTruth& request : vehicle.requests()) {
      char found[40] = "no result";
      char error[24] = "";
      for (const Result& result : all_) {
        if (result.t_s < request.begin_s || result.t_s > request.end_s + kSoon_s) continue;
        std::snprintf(found, sizeof found, "%.4f, std %.4f", result.mu_max, result.std);
        std::snprintf(error, sizeof error, " (error %+.1f %%)",
                      100.0 * (result.mu_max / request.mu_max - 1.0));
      }
      char when[32], truth[40];
      std::snprintf(when, sizeof when, "from %.1f to %.1f s", request.begin_s, request.end_s);
      std::snprintf(truth, sizeof truth, "%.4f%s", request.mu_max, error);
      std::fprintf(out, "  %-22s %-24s %-24s slip up to %.1f %%, %.0f J\n", when, found, truth,
                   100.0 * request.slip_max_share, request.macro_energy_J);
    }
  }

 private:
  static constexpr double kSoon_s = 1.0;
  double count_ = 0.0;
  std::vector<Result> all_;
};

// Shows what is published until the bus closes.
void show(daemon::Port& port, const daemon::Config& config, daemon::MonoTime origin,
          const std::function<void(std::int64_t, const OwnFrameView&)>& also) {
  OwnFrameDecoder decoder(config.identifiers);
  BusTable table(stdout);
  std::array<daemon::RxFrame, 64> frames;
  for (;;) {
    const daemon::Wake wake = port.wait_until(daemon::MonoTime::max());
    if (wake == daemon::Wake::kClosed) return;
    const std::size_t count = port.receive(frames);
    for (std::size_t i = 0; i < count; ++i) {
      const auto view = decoder.decode(frames[i].frame);
      if (!view) continue;
      table.on_frame((frames[i].t - origin).ns(), *view);
      also((frames[i].t - origin).ns(), *view);
    }
  }
}

// The embedded bus with the daemon's loop on it, and beside it what drives: `feed` runs until its
// end, then the bus closes. The table is printed meanwhile.
void stage(const daemon::Config& config, daemon::Duration shift,
           const std::function<void(daemon::Port&)>& feed,
           const std::function<void(std::int64_t, const OwnFrameView&)>& also) {
  const auto bus = daemon::InprocBus::create(daemon::InprocBus::Clock::kMonotonic);
  const std::unique_ptr<daemon::Port> daemon_port = bus->connect();
  const std::unique_ptr<daemon::Port> view_port = bus->connect();
  const std::unique_ptr<daemon::Port> feed_port = bus->connect();
  daemon::Pipeline pipeline(config);
  const daemon::MonoTime origin = feed_port->now() - shift;
  std::exception_ptr failure;
  {
    std::jthread daemon_thread([&] {
      daemon::run_loop(*daemon_port, pipeline, config.estimator.sample_rate_hz,
                       estimator::StopReason::kTraceEnd, nullptr);
    });
    std::jthread feed_thread([&] {
      try {
        feed(*feed_port);
      } catch (...) {
        failure = std::current_exception();
      }
      bus->close();
    });
    show(*view_port, config, origin, also);
  }
  if (failure) std::rethrow_exception(failure);
}

// Virtual time, held back to real time: what is shown does not depend on how busy the machine is.
void run_vehicle(const RunDemoOptions& options) {
  const sim::VehicleScenario scenario = options.scenario.load_vehicle();
  const daemon::Config config =
      load_configuration_text(sim::vehicle_configuration(scenario, kBus, "vehicle.dbc"),
                              sim::shipped("vehicle.dbc"), options.method);
  std::printf(
      "A simulated car and the daemon's own loop on one bus, in one process, for %.0f s.\n"
      "When the driver lifts the foot, the daemon asks the transmission for less clamping force,\n"
      "until the belt's friction peaks; then the force comes back, and mu_max is known.\n"
      "** is what happens in the car; the rest is what BeltGrip publishes on the bus, decoded.\n\n",
      scenario.duration_s);
  DriveStory story(stdout);
  OwnFrameDecoder decoder(config.identifiers);
  BusTable table(stdout);
  Results results;
  const auto begin = std::chrono::steady_clock::now();
  std::int64_t shown_ns = 0;
  sim::VehiclePort::Observers observers;
  observers.on_step = [&](const sim::VehicleSimulation& vehicle) {
    story.observe(vehicle);
    if (vehicle.now_ns() < shown_ns + kPace_ns) return;
    shown_ns = vehicle.now_ns();
    std::this_thread::sleep_until(begin + std::chrono::nanoseconds(shown_ns));
  };
  observers.on_sent = [&](std::int64_t t_ns, const can::CanFrame& frame) {
    const auto view = decoder.decode(frame);
    if (!view) return;
    table.on_frame(t_ns, *view);
    results.on_frame(t_ns, *view);
  };
  sim::VehiclePort port(scenario, options.scenario.seed, observers);
  ReplayResult result;
  run_daemon(port, config, result);
  if (!port.finite()) {
    fail_not_finite(static_cast<double>(port.now().ns()) * 1e-9, options.scenario.seed);
  }
  results.print(stdout, port.vehicle());
}

void run_rig(const RunDemoOptions& options) {
  const double start_s = options.scenario.start_s > 0.0 ? options.scenario.start_s : kLateStart_s;
  const double end_s =
      start_s + (options.scenario.duration_s > 0.0 ? options.scenario.duration_s : kRig_s);
  const sim::RigScenario scenario = options.scenario.load();
  const daemon::Config config =
      load_configuration_text(sim::rig_configuration(scenario, kBus, "vehicle.dbc"),
                              sim::rig_dbc(scenario), options.method);
  sim::RigSource source(scenario, options.scenario.seed, start_s, end_s);
  can::StampedFrame first;
  if (!source.next(first)) throw Failure{kUsage, "run-demo: the scenario ends before --start"};
  std::printf(
      "The paper's experiment on a simulated rig, belt \"%s\", from %.0f s on, in real time:\n"
      "primary shaft at %.0f rad/s and %.0f Nm, the clamping force falls by %.0f N/s.\n"
      "CAN frames pass through the daemon's loop; below is what it publishes, decoded.\n\n",
      scenario.belt.c_str(), start_s, scenario.primary_speed_rad_s, scenario.primary_torque_Nm,
      scenario.ramp_N_per_s);
  Verdict verdict;
  bool first_taken = false;
  stage(
      config, daemon::Duration::of_ns(first.t_ns),
      [&](daemon::Port& port) {
        play(port, kBus, 1.0, [&](can::StampedFrame& frame) {
          if (first_taken) return source.next(frame);
          frame = first;
          return first_taken = true;
        });
      },
      [&](std::int64_t t_ns, const OwnFrameView& view) { verdict.on_frame(t_ns, view); });
  verdict.print(stdout,
                make_truth(scenario, options.scenario.seed, first.t_ns, source.simulation()));
}

void run_run_demo(const RunDemoOptions& options) {
  return options.scenario.is_vehicle() ? run_vehicle(options) : run_rig(options);
}

}  // namespace

void add_run_demo(command_line::Command app) {
  const command_line::Command command = app.add_subcommand(
      "run-demo",
      "A simulated car, or rig, with the daemon's loop on one bus, in this process, in real time");
  auto options = std::make_shared<RunDemoOptions>();
  options->scenario.scenario = "demo";
  options->scenario.add_to(command);
  command.add_option("--method", options->method, "robust (default) or paper")
      .type_name("METHOD")
      .one_of({"robust", "paper"});
  command.example("beltgrip run-demo");
  command.example("beltgrip run-demo --scenario paper-rig --belt worn");
  command.callback([options] { run_run_demo(*options); });
}

}  // namespace beltgrip::cli
