// beltgrip monitor: BeltGrip's frames on a SocketCAN interface, decoded as they come.
#include <unistd.h>

#include <array>
#include <limits>
#include <memory>
#include <optional>
#include <string>

#include "daemon/core/publish/own_frames.h"
#include "tools/cli/bus.h"
#include "tools/cli/command.h"
#include "tools/cli/own_frame_view.h"
#include "tools/cli/stop_signals.h"
#include "tools/cli/verdict.h"
#include "tools/sim/configuration.h"

namespace beltgrip::cli {

namespace {

struct Options {
  std::string bus;
  bool json = false;
  double duration_s = 0.0;
  std::string truth;
};

void run(const Options& options) {
  if (options.bus.starts_with("inproc:")) {
    throw Failure{kUnavailable, "monitor: found " + options.bus +
                                    ", a bus that no other process can be on, expected a "
                                    "SocketCAN interface such as can0"};
  }
  std::optional<Truth> truth;
  if (!options.truth.empty()) truth = read_truth(options.truth);
  const daemon::FrameIdentifiers own;
  std::vector<can::CanId> identifiers;
  identifiers.reserve(daemon::kOwnMessageCount);
  for (std::size_t i = 0; i < daemon::kOwnMessageCount; ++i) {
    identifiers.push_back({daemon::own_identifier(own, static_cast<daemon::OwnMessage>(i)), false});
  }
  if (truth) {  // the rig's first frame says when its clock began to run on this bus
    for (const can::MessageDef& message : sim::rig_database().messages) {
      identifiers.push_back(message.id);
    }
  }
  const std::unique_ptr<daemon::Port> port = open_bus(options.bus, identifiers, stop_descriptor());
  OwnFrameDecoder decoder(own);
  BusTable table(stdout);
  Verdict verdict;
  const daemon::MonoTime begin = port->now();
  const daemon::MonoTime end = options.duration_s > 0.0
                                   ? begin + static_cast<daemon::Duration>(options.duration_s * 1e9)
                                   : std::numeric_limits<daemon::MonoTime>::max();
  // Time shown = monotonic time - origin: from the start of the monitor, or the clock of the truth.
  std::optional<daemon::MonoTime> origin;
  if (!truth) origin = begin;

  std::array<daemon::RxFrame, 64> frames;
  while (port->now() < end) {
    const daemon::Wake wake = port->wait_until(end);
    if (wake == daemon::Wake::kClosed) break;
    if (wake != daemon::Wake::kFrames) continue;
    const std::size_t count = port->receive(frames);
    for (std::size_t i = 0; i < count; ++i) {
      const auto view = decoder.decode(frames[i].frame);
      if (!view) {
        if (!origin && truth) origin = frames[i].t - truth->first_frame_ns;
        continue;
      }
      if (!origin) continue;
      const std::int64_t t_ns = frames[i].t - *origin;
      if (options.json) {
        std::fputs(json_line(t_ns, *view).c_str(), stdout);
        std::fflush(stdout);
      } else {
        table.on_frame(t_ns, *view);
      }
      verdict.on_frame(t_ns, *view);
    }
  }
  if (truth && !options.json) verdict.print(stdout, *truth);
}

}  // namespace

void add_monitor(command_line::Command app) {
  const command_line::Command command =
      app.add_subcommand("monitor", "Show BeltGrip's frames on a bus, decoded");
  auto options = std::make_shared<Options>();
  command.add_option("BUS", options->bus, "A SocketCAN interface").type_name("").required();
  command.add_flag("--json", options->json, "A JSON line for each frame");
  command.add_option("--duration", options->duration_s, "Seconds to watch (default: until stopped)")
      .type_name("SECONDS")
      .range(1e-3, 1e9);
  command
      .add_option("--truth", options->truth,
                  "truth.json of the simulation that is played onto the bus: shows its times, "
                  "and its truth beside the result at the end")
      .type_name("FILE");
  command.example("beltgrip monitor can0");
  command.example("beltgrip monitor can0 --json --duration 60");
  command.callback([options] { run(*options); });
}

}  // namespace beltgrip::cli
