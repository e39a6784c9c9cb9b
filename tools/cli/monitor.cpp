// beltgrip monitor: what BeltGrip does, and why, on a bus or in a log: as a live view, as lines, as
// JSON.
#include "tools/cli/monitor.h"

#include <cctype>
#include <filesystem>
#include <memory>
#include <string>

#include "tools/cli/command.h"
#include "tools/cli/configuration.h"
#include "tools/cli/failure.h"
#include "tools/monitor/screen.h"

namespace beltgrip::cli {

namespace {

struct MonitorOptions {
  std::string source, config, interface, truth;
  bool plain = false, once = false, json = false, table = false;
  double speed = 1.0, from_s = 0.0, duration_s = 0.0;
};

// A file by that name, a path, or a name that ends as those of files do ("drive.log", unlike the
// "can0.100" of an interface), is a log; else it is an interface.
bool is_log(const std::string& source) {
  std::error_code none;
  const std::string ending = std::filesystem::path(source).extension().string();
  return source == "-" || source.find('/') != std::string::npos ||
         (ending.size() > 1 && std::isalpha(static_cast<unsigned char>(ending[1])) != 0) ||
         std::filesystem::exists(source, none);
}

MonitorOutput output_of(const MonitorOptions& options) {
  if (options.plain + options.once + options.table > 1) {
    throw Failure{kUsage, "monitor: only one of --plain, --once, --table"};
  }
  if (options.json && (options.plain || options.table)) {
    throw Failure{kUsage, "monitor: --json goes alone or with --once"};
  }
  if (options.once) return MonitorOutput::kOnce;
  if (options.json) return MonitorOutput::kFrames;
  if (options.table || !options.truth.empty()) return MonitorOutput::kTable;
  if (options.plain || !monitor::Screen::possible()) return MonitorOutput::kPlain;
  return MonitorOutput::kScreen;
}

void run_monitor(const MonitorOptions& options) {
  if (options.source.starts_with("inproc:")) {
    throw Failure{kUnavailable, "monitor: found " + options.source +
                                    ", a bus that no other process can be on, expected a "
                                    "SocketCAN interface such as can0"};
  }
  MonitorRequest request;
  request.source = options.source;
  request.interface = options.interface;
  request.json = options.json;
  request.speed = options.speed;
  request.from_s = options.from_s;
  request.duration_s = options.duration_s;
  request.output = output_of(options);
  if (!options.truth.empty()) request.truth = read_truth(options.truth);
  if (!options.config.empty()) request.config = load_configuration(options.config, "");
  if (is_log(options.source)) return monitor_log(request);
  if (options.from_s > 0.0 || options.speed != 1.0 || !options.interface.empty()) {
    throw Failure{kUsage, "monitor: --from, --speed and --interface are for a log; " +
                              options.source + " is no file"};
  }
  monitor_bus(request);
}

}  // namespace

FrameLister::FrameLister(const MonitorRequest& request)
    : request_(request), decoder_(request.identifiers()) {}

void FrameLister::on_frame(std::int64_t t_ns, const can::CanFrame& frame) {
  const auto view = decoder_.decode(frame);
  if (!view) return;
  if (request_.output == MonitorOutput::kFrames) {
    std::fputs(monitor::json_line(t_ns, *view).c_str(), stdout);
    std::fflush(stdout);
  } else {
    table_.on_frame(t_ns, *view);
  }
  verdict_.on_frame(t_ns, *view);
}

void FrameLister::end() const {
  if (request_.truth && request_.output == MonitorOutput::kTable) {
    verdict_.print(stdout, *request_.truth);
  }
}

void add_monitor(command_line::Command app) {
  const command_line::Command command =
      app.add_subcommand("monitor", "What BeltGrip does, and why: a view of a bus or a log");
  auto options = std::make_shared<MonitorOptions>();
  command.add_option("SOURCE", options->source, "A SocketCAN interface, or a CAN log")
      .type_name("")
      .required();
  command
      .add_option("--config", options->config,
                  "BeltGrip's configuration: shows the inputs, and why no experiment begins")
      .type_name("FILE");
  command.add_flag("--plain", options->plain,
                   "A line for each change, with candump's stamps (default without a terminal)");
  command.add_flag("--once", options->once,
                   "One view and the end; of a log the view at its end, or at --from");
  command.add_flag("--json", options->json,
                   "A JSON line for each frame of BeltGrip; with --once: the view as JSON");
  command.add_flag("--table", options->table, "A row every half second and for each change");
  command.add_option("--speed", options->speed, "A log's, times real time; the view's keys too")
      .capture_default_str()
      .range(1e-2, 1e3);
  command.add_option("--from", options->from_s, "Seconds of the log before the view begins")
      .type_name("SECONDS")
      .range(0.0, 1e9);
  command.add_option("--interface", options->interface, "Frames of this interface of the log only")
      .type_name("INTERFACE");
  command.add_option("--duration", options->duration_s, "Seconds to watch (default: until stopped)")
      .type_name("SECONDS")
      .range(1e-3, 1e9);
  command
      .add_option("--truth", options->truth,
                  "truth.json of the simulation that is played onto the bus: --table with its "
                  "times, and its truth beside the result at the end")
      .type_name("FILE");
  command.example("beltgrip monitor can0");
  command.example("beltgrip monitor can0 --config mycar.toml");
  command.example("beltgrip monitor drive/trace.log --config drive/beltgrip.toml --once");
  command.example("beltgrip monitor can0 --json --duration 60");
  command.callback([options] { run_monitor(*options); });
}

}  // namespace beltgrip::cli
