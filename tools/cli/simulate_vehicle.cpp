#include "tools/cli/simulate_vehicle.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <memory>
#include <optional>
#include <vector>

#include "can_dbc/log/candump_writer.h"
#include "tools/cli/bus.h"
#include "tools/cli/configuration.h"
#include "tools/cli/failure.h"
#include "tools/cli/progress.h"
#include "tools/cli/stop_signals.h"
#include "tools/sim/configuration.h"
#include "tools/sim/resources.h"
#include "tools/sim/vehicle_port.h"
#include "tools/text/json_writer.h"
#include "tools/text/seconds.h"

namespace beltgrip::cli {

namespace {

// Where a request has done harm, whatever the fault.
constexpr double kSlipLimit_share = 0.10;
constexpr double kSlipSpeedLimit_m_s = 0.8;
constexpr double kSlipEnergyLimit_J = 100.0;

bool inside_limits(const sim::RequestTruth& request) {
  return request.slip_max_share <= kSlipLimit_share &&
         request.slip_speed_max_m_s <= kSlipSpeedLimit_m_s &&
         request.macro_energy_J <= kSlipEnergyLimit_J;
}

double seconds(const sim::VehicleSimulation& vehicle) {
  return static_cast<double>(vehicle.now_ns()) * 1e-9;
}

void write_request(text::JsonWriter& json, const sim::RequestTruth& request) {
  json.begin_object()
      .field("begin_s", request.begin_s)
      .field("end_s", request.end_s)
      .field("mu_max", request.mu_max)
      .field("peak_passed", request.peak_passed)
      .field("peak_s", request.peak_passed ? request.peak_passed_s : text::kJsonNull)
      .field("mu_star_max", request.mu_star_max)
      .field("slip_stop_percent", 100.0 * request.slip_at_end_share)
      .field("slip_max_percent", 100.0 * request.slip_max_share)
      .field("slip_speed_max_m_s", request.slip_speed_max_m_s)
      .field("slip_energy_J", request.macro_energy_J)
      .field("clamp_force_min_N", request.force_min_N)
      .field("inside_limits", inside_limits(request))
      .end_object();
}

}  // namespace

void fail_not_finite(double t_s, std::uint64_t seed) {
  throw Failure{kInternal, "the plant's state is no longer finite at " + std::to_string(t_s) +
                               " s, seed " + std::to_string(seed)};
}

std::string truth_json(const sim::VehicleSimulation& vehicle, std::uint64_t seed) {
  double slip_max_share = 0.0, slip_speed_max_m_s = 0.0, energy_J = 0.0;
  std::int64_t outside = 0;
  for (const sim::RequestTruth& request : vehicle.requests()) {
    slip_max_share = std::max(slip_max_share, request.slip_max_share);
    slip_speed_max_m_s = std::max(slip_speed_max_m_s, request.slip_speed_max_m_s);
    energy_J = std::max(energy_J, request.macro_energy_J);
    outside += inside_limits(request) ? 0 : 1;
  }
  text::JsonWriter json;
  json.begin_object()
      .field("type", "truth")
      .field("scenario", vehicle.scenario().name)
      .field("seed", seed)
      .key("duration_s")
      .raw(text::seconds_text(vehicle.now_ns()))
      .field("mu_max", vehicle.truth().belt.mu_max)
      .field("coast_downs", vehicle.truth().coast_downs)
      .field("stalls", vehicle.truth().stalls)
      .field("slip_max_percent", 100.0 * slip_max_share)
      .field("slip_speed_max_m_s", slip_speed_max_m_s)
      .field("slip_energy_max_J", energy_J)
      .field("requests_outside_limits", outside)
      .key("requests")
      .begin_array();
  for (const sim::RequestTruth& request : vehicle.requests()) write_request(json, request);
  json.end_array().end_object();
  return json.text() + "\n";
}

std::string truth_text(const sim::VehicleSimulation& vehicle) {
  char line[200];
  std::snprintf(line, sizeof line, "  truth: %d coast-downs of %.0f s and more, %zu requests%s\n",
                vehicle.truth().coast_downs, sim::VehicleTruth::kCoast_s, vehicle.requests().size(),
                vehicle.truth().stalls > 0 ? ", the engine stalled" : "");
  std::string text = line;
  for (const sim::RequestTruth& r : vehicle.requests()) {
    std::snprintf(line, sizeof line,
                  "    %.2f to %.2f s: mu_max %.4f, %s; slip up to %.2f %%, %.2f m/s, %.0f J "
                  "beyond the peak%s\n",
                  r.begin_s, r.end_s, r.mu_max, r.peak_passed ? "passed" : "not reached",
                  100.0 * r.slip_max_share, r.slip_speed_max_m_s, r.macro_energy_J,
                  inside_limits(r) ? "" : ": OUTSIDE THE LIMITS");
    text += line;
  }
  return text;
}

DriveResult drive_with_daemon(const sim::VehicleScenario& believed,
                              const sim::VehicleScenario& machine, std::uint64_t seed,
                              bool shows_progress, std::FILE* log) {
  const daemon::Config config =
      load_configuration_text(sim::vehicle_configuration(believed, kInterface, "vehicle.dbc"),
                              sim::shipped("vehicle.dbc"), "");
  DriveResult result;
  result.daemon.log = machine.name;
  std::optional<can::CandumpWriter> writer;
  if (log != nullptr) writer.emplace(log);
  sim::VehiclePort::Observers observers;
  Progress progress(shows_progress);
  observers.on_received = [&](const daemon::RxFrame& frame) {
    if (progress.steps()) {
      const double t_s = static_cast<double>(frame.t.ns()) * 1e-9;
      progress.tell(t_s, "s of the drive", "times real time", t_s / machine.duration_s);
    }
    if (writer) writer->write(frame.t.ns(), kInterface, frame.frame);
    ++result.daemon.frames;
  };
  observers.ends = stop_asked;
  sim::VehiclePort port(machine, seed, observers);
  run_daemon(port, config, result.daemon);
  port.run_alone();  // where the script ended the daemon before the drive
  if (!port.finite()) fail_not_finite(seconds(port.vehicle()), seed);
  result.daemon.duration_ns = port.vehicle().now_ns();
  result.truth_json = truth_json(port.vehicle(), seed);
  result.truth_text = truth_text(port.vehicle());
  return result;
}

VehicleNode::VehicleNode(const sim::VehicleScenario& scenario, std::uint64_t seed)
    : seed_(seed),
      vehicle_(scenario, seed),
      frames_(sim::vehicle_database(), sim::kVehicleBus, scenario, seed) {}

bool VehicleNode::advance(std::int64_t now_ns, std::span<const daemon::RxFrame> received,
                          std::vector<can::CanFrame>& out) {
  for (const daemon::RxFrame& each : received) {
    if (!each.own_echo) vehicle_.deliver(each.frame, now_ns);
  }
  while (vehicle_.now_ns() < now_ns && !vehicle_.finished()) {
    vehicle_.step();
    if (!vehicle_.finite()) fail_not_finite(seconds(vehicle_), seed_);
    frames_.sample(vehicle_, waiting_);
  }
  std::stable_sort(
      waiting_.begin(), waiting_.end(),
      [](const can::StampedFrame& a, const can::StampedFrame& b) { return a.t_ns < b.t_ns; });
  const auto later =
      std::find_if(waiting_.begin(), waiting_.end(),
                   [now_ns](const can::StampedFrame& frame) { return frame.t_ns > now_ns; });
  for (auto due = waiting_.begin(); due != later; ++due) out.push_back(due->frame);
  waiting_.erase(waiting_.begin(), later);
  return !vehicle_.finished();
}

void DriveStory::say(const sim::VehicleSimulation& vehicle, const char* pattern,
                     auto... arguments) {
  std::fprintf(out_, "%9.3f s  ** ", seconds(vehicle));
  std::fprintf(out_, pattern, arguments...);
  std::fputc('\n', out_);
  std::fflush(out_);
}

void DriveStory::observe(const sim::VehicleSimulation& vehicle) {
  const sim::VehicleTruth& truth = vehicle.truth();
  const sim::VehicleScenario& scenario = vehicle.scenario();
  const double speed_km_h = 3.6 * vehicle.signals().speed_m_s;
  const bool pressed = vehicle.signals().accelerator > 0.0;
  if (begun_ && pressed_ && !pressed) {
    say(vehicle, "foot off the pedal at %.0f km/h: the car coasts down", speed_km_h);
  } else if (pressed && (!begun_ || !pressed_)) {
    say(vehicle, "the driver presses the pedal at %.0f km/h", speed_km_h);
  }
  if (!worn_ && scenario.belt.wear_step > 0.0 && seconds(vehicle) >= scenario.belt.wear_at_s) {
    worn_ = true;
    say(vehicle, "the belt is worn from here on: %.0f %% of its friction is gone",
        100.0 * scenario.belt.wear_step);
  }
  if (truth.obeying && !obeying_) {
    say(vehicle, "the transmission obeys: its clamping force falls from %.0f N",
        truth.secondary_force_N);
  } else if (!truth.obeying && obeying_) {
    say(vehicle, "the transmission takes its force back; the belt slips by %.1f %%",
        100.0 * std::abs(truth.belt.slip_share));
  }
  begun_ = true;
  pressed_ = pressed;
  obeying_ = truth.obeying;
}

void drive_on_bus(const sim::VehicleScenario& scenario, std::uint64_t seed, const std::string& bus,
                  double speed) {
  constexpr std::uint32_t kClamp = 0x6A2;
  const std::unique_ptr<daemon::Port> port = open_bus(bus, {{kClamp, false}}, stop_descriptor());
  VehicleNode node(scenario, seed);
  DriveStory story(stderr);
  play_node(*port, speed,
            [&](std::int64_t now_ns, std::span<const daemon::RxFrame> received,
                std::vector<can::CanFrame>& out) {
              const bool goes_on = node.advance(now_ns, received, out);
              story.observe(node.vehicle());
              return goes_on;
            });
  std::fputs(truth_text(node.vehicle()).c_str(), stderr);
  std::fputs(truth_json(node.vehicle(), seed).c_str(), stdout);
}

}  // namespace beltgrip::cli
