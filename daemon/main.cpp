// beltgripd: reads the configuration, opens the bus, starts the helper thread and runs the loop on
// the main thread until SIGTERM or SIGINT. Exit codes are those of sysexits.
#include <signal.h>
#include <sys/signalfd.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <cstdio>
#include <exception>
#include <memory>
#include <string>
#include <variant>

#include "daemon/core/config.h"
#include "daemon/core/event.h"
#include "daemon/core/loop.h"
#include "daemon/core/own_frames.h"
#include "daemon/core/pipeline.h"
#include "daemon/io/housekeeper.h"
#include "daemon/io/inproc_bus.h"
#include "daemon/io/link_health.h"
#include "daemon/io/log_sink.h"
#include "daemon/io/rt_setup.h"
#include "daemon/io/socket_port.h"

namespace {

using namespace beltgrip;
using namespace beltgrip::daemon;

enum ExitCode { kDone = 0, kUsage = 64, kUnavailable = 69, kInternal = 70 };
constexpr std::string_view kInproc = "inproc:";

struct Arguments {
  std::string config = "/etc/beltgrip/beltgripd.toml";
  std::string log_level = "info";
  bool print_default_config = false;
};

void complain(const std::string& line) { std::fprintf(stderr, "%s\n", line.c_str()); }

// A descriptor that is readable once SIGTERM or SIGINT has come; they reach no thread otherwise.
int stop_descriptor() {
  sigset_t signals;
  sigemptyset(&signals);
  sigaddset(&signals, SIGTERM);
  sigaddset(&signals, SIGINT);
  pthread_sigmask(SIG_BLOCK, &signals, nullptr);
  signal(SIGPIPE, SIG_IGN);
  return signalfd(-1, &signals, SFD_CLOEXEC | SFD_NONBLOCK);
}

std::vector<can::CanId> wanted_identifiers(const Config& config) {
  std::vector<can::CanId> identifiers;
  identifiers.reserve(config.roles.size() + kOwnMessageCount);
  for (const RoleBinding& role : config.roles) identifiers.push_back(role.id);
  // Our own: an echo says that a frame has left, another node's is a fault.
  for (std::size_t i = 0; i < kOwnMessageCount; ++i) {
    identifiers.push_back({own_identifier(config.identifiers, static_cast<OwnMessage>(i)), false});
  }
  return identifiers;
}

// The port, and the bus behind it where it is the embedded one.
struct Bus {
  std::unique_ptr<Port> port;
  std::shared_ptr<InprocBus> inproc;
  std::string error;
};

Bus open_bus(const Config& config, int stop_fd) {
  Bus bus;
  if (config.interface.starts_with(kInproc)) {
    bus.inproc = InprocBus::named(config.interface.substr(kInproc.size()));
    bus.port = bus.inproc->connect();
    return bus;
  }
  auto opened = SocketPort::open(config.interface, wanted_identifiers(config), stop_fd);
  if (const auto* error = std::get_if<BusError>(&opened)) {
    bus.error = error->text;
  } else {
    bus.port = std::move(std::get<std::unique_ptr<SocketPort>>(opened));
  }
  return bus;
}

int run(const Arguments& arguments) {
  const ConfigResult loaded = load_config(arguments.config);
  for (const std::string& warning : loaded.warnings) complain(warning);
  for (const ConfigError& error : loaded.errors) complain(error.text);
  if (!loaded.config) return loaded.exit_code();
  const Config& config = *loaded.config;

  const int stop_fd = stop_descriptor();
  Bus bus = open_bus(config, stop_fd);
  if (bus.port == nullptr) {
    complain(arguments.config + ": " + bus.error);
    return kUnavailable;
  }

  Pipeline pipeline(config);
  EventRing events;
  EventSink sink(events);
  LogSink log(arguments.log_level);
  log.info("version " BELTGRIP_VERSION ", " + arguments.config + ", bus " + config.interface);
  if (bus.inproc == nullptr) log.info(link_health(config.interface));
  std::function<void()> on_stop;
  if (bus.inproc != nullptr) on_stop = [&] { bus.inproc->close(); };
  log.info(prepare_real_time());
  Housekeeper housekeeper(events, log, stop_fd, on_stop);

  const LoopCounters loop = run_loop(*bus.port, pipeline, config.estimator.sample_rate_hz,
                                     estimator::StopReason::kShutdown, &sink);

  housekeeper.stop();
  const PipelineCounters& counters = pipeline.counters();
  log.info("stopped: " + std::to_string(counters.frames) + " frames, " +
           std::to_string(counters.frames_decoded) + " taken, " +
           std::to_string(counters.frames_bad) + " bad, " + std::to_string(counters.samples) +
           " samples, " + std::to_string(loop.samples_late) + " late, " +
           std::to_string(loop.sends_failed) + " sends failed, " +
           std::to_string(counters.frames_refused) + " refused");
  close(stop_fd);
  return kDone;
}

}  // namespace

int main(int argc, char** argv) {
  Arguments arguments;
  CLI::App app(
      "beltgripd: estimates the belt-pulley friction of a pushbelt variator from CAN signals and "
      "publishes it on the same bus.");
  app.set_version_flag("--version", "beltgripd " BELTGRIP_VERSION);
  app.add_option("--config", arguments.config, "configuration file")
      ->type_name("FILE")
      ->capture_default_str();
  app.add_option("--log-level", arguments.log_level, "what is logged on standard error")
      ->type_name("LEVEL")
      ->check(CLI::IsMember(LogSink::level_names()))
      ->capture_default_str();
  app.add_flag("--print-default-config", arguments.print_default_config,
               "print every key with default, unit and range, and exit");
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? kDone : kUsage;
  }
  if (arguments.print_default_config) {
    std::fputs(default_config_text().c_str(), stdout);
    return kDone;
  }
  try {
    return run(arguments);
  } catch (const std::exception& error) {
    complain(std::string("beltgripd: found an internal error: ") + error.what());
    return kInternal;
  }
}
