// beltgripd: reads the configuration, opens the bus, starts the helper thread and runs the loop on
// the main thread until SIGTERM or SIGINT. Exit codes are those of sysexits.
#include <malloc.h>
#include <signal.h>
#include <sys/signalfd.h>
#include <unistd.h>

#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>

#include "can_dbc/text/printable.h"
#include "daemon/command_line/command_line.h"
#include "daemon/core/base/exit_code.h"
#include "daemon/core/config/load/config_fingerprint.h"
#include "daemon/core/config/load/load_config.h"
#include "daemon/core/config/options/config.h"
#include "daemon/core/loop/loop.h"
#include "daemon/core/loop/pipeline.h"
#include "daemon/core/loop/reload.h"
#include "daemon/core/observe/carried_window.h"
#include "daemon/core/observe/event.h"
#include "daemon/core/observe/observation.h"
#include "daemon/core/observe/reasons_now.h"
#include "daemon/io/bus_claim.h"
#include "daemon/io/carried_keeper.h"
#include "daemon/io/flight_recorder.h"
#include "daemon/io/history_keeper.h"
#include "daemon/io/housekeeper.h"
#include "daemon/io/inproc_bus.h"
#include "daemon/io/link_health.h"
#include "daemon/io/log_sink.h"
#include "daemon/io/reloader.h"
#include "daemon/io/rt_setup.h"
#include "daemon/io/service_notify.h"
#include "daemon/io/socket_port.h"
#include "daemon/io/status_server.h"

namespace {

using namespace beltgrip;
using namespace beltgrip::daemon;

constexpr std::string_view kInproc = "inproc:";

struct Arguments {
  std::string config = "/etc/beltgrip/beltgripd.toml";
  std::string log_level = "info";
  std::string record;  // folder; empty: nothing is recorded
  bool print_default_config = false;
  bool check = false;
};

MonoTime steady_now() {
  return MonoTime::of_ns(std::chrono::steady_clock::now().time_since_epoch() /
                         std::chrono::nanoseconds(1));
}

void complain(const std::string& line) {
  std::fprintf(stderr, "%s\n", can::printable(line).c_str());
}

// A descriptor that is readable once one of these signals has come; they reach no thread otherwise.
int signal_descriptor(std::initializer_list<int> numbers) {
  sigset_t signals;
  sigemptyset(&signals);
  for (const int number : numbers) sigaddset(&signals, number);
  pthread_sigmask(SIG_BLOCK, &signals, nullptr);
  return signalfd(-1, &signals, SFD_CLOEXEC | SFD_NONBLOCK);
}

// The next signal that has come, 0: none. Several of a kind are one.
int next_signal(int descriptor) {
  signalfd_siginfo info{};
  if (read(descriptor, &info, sizeof info) != sizeof info) return 0;
  return static_cast<int>(info.ssi_signo);
}

// The configuration alone: nothing is opened. What the bus says of it, beltgrip check tells.
int check(const Arguments& arguments) {
  const ConfigResult loaded = load_config(arguments.config);
  for (const std::string& warning : loaded.warnings) complain(warning);
  for (const ConfigError& error : loaded.errors) complain(error.text);
  if (!loaded.config) return loaded.exit_code();
  const Config& config = *loaded.config;
  std::string text = arguments.config + ": right; bus " + config.interface + ", " +
                     std::to_string(config.roles.size()) + " roles, control \"" +
                     (config.control == Control::kCommand ? "command" : "observe") + "\"\n";
  if (!config.assumed.empty()) text += assumed_text(config) + "\n";
  std::fputs(can::printable_lines(text).c_str(), stdout);
  return kDone;
}

// The port, and the bus behind it where it is the embedded one.
struct Bus {
  std::unique_ptr<Port> port;
  std::shared_ptr<InprocBus> inproc;
};

Result<Bus> open_bus(const Config& config, int stop_fd) {
  Bus bus;
  if (config.interface.starts_with(kInproc)) {
    bus.inproc = InprocBus::named(config.interface.substr(kInproc.size()));
    bus.port = bus.inproc->connect();
    return bus;
  }
  std::vector<BusToOpen> buses{{config.interface, "bus.interface"}};
  if (config.further_bus) {
    const FurtherBus& further = *config.further_bus;
    buses.push_back({further.interface, "bus." + further.name + ".interface"});
  }
  auto opened = SocketPort::open(buses, wanted_frames(config), stop_fd);
  if (!opened) return opened.error();
  bus.port = *std::move(opened);
  return bus;
}

// Empty: nothing is kept.
std::string state_folder(const Config& config, const std::string& config_path) {
  if (!config.state_dir.empty()) {
    return (std::filesystem::path(config_path).parent_path() / config.state_dir).string();
  }
  const char* given = std::getenv("STATE_DIRECTORY");  // systemd: one or several, with colons
  const std::string folders = given == nullptr ? "" : given;
  return folders.substr(0, folders.find(':'));
}

// Empty: nobody asks.
std::string runtime_folder() {
  const char* given = std::getenv("RUNTIME_DIRECTORY");
  const std::string folders = given == nullptr ? "" : given;
  return folders.substr(0, folders.find(':'));
}

// "wake-up p50 61 us, p99 140 us, worst 900 us (12000)"
std::string latency_text(const std::string& name, const LatencyHistogram& histogram) {
  const auto us = [](Duration duration) { return std::to_string(duration / kMicrosecond) + " us"; };
  return name + " p50 " + us(histogram.quantile(0.5)) + ", p99 " + us(histogram.quantile(0.99)) +
         ", worst " + us(histogram.maximum()) + " (" + std::to_string(histogram.count()) + ")";
}

double unix_time_s() {
  return std::chrono::duration<double>(std::chrono::system_clock::now().time_since_epoch()).count();
}

// What an operator asks of a running daemon: SIGHUP reads the configuration again, SIGUSR1 and
// SIGUSR2 log more and less. The manager waits for a reload, but not for a long experiment.
class Requests {
 public:
  Requests(int descriptor, Reloader& reloader, LogSink& log, ServiceNotify& service)
      : descriptor_(descriptor), reloader_(reloader), log_(log), service_(service) {}
  ~Requests() { close(descriptor_); }
  Requests(const Requests&) = delete;
  Requests& operator=(const Requests&) = delete;

  // True: another configuration is in force.
  bool turn(MonoTime now) {
    const bool changed = reloader_.turn();
    for (int number; (number = next_signal(descriptor_)) != 0;) {
      if (number == SIGUSR1) log_.more();
      if (number == SIGUSR2) log_.less();
      if (number != SIGHUP) continue;
      service_.reloading(now);
      manager_waits_ = true;
      patience_ends_ = now + kPatience;
      reloader_.request();
    }
    if (!manager_waits_) return changed;
    const bool late = now >= patience_ends_;
    if (reloader_.waiting() && !late) return changed;
    if (reloader_.waiting()) log_.info("reload: waits for the end of the experiment");
    service_.reloaded();
    manager_waits_ = false;
    return changed;
  }

 private:
  static constexpr Duration kPatience = 2 * kSecond;
  int descriptor_;
  Reloader& reloader_;
  LogSink& log_;
  ServiceNotify& service_;
  bool manager_waits_ = false;
  MonoTime patience_ends_;
};

// At level debug, once a second.
std::string pulse(const Observation& seen) {
  return status_line(seen) + ", " + std::to_string(seen.pipeline.samples) + " samples, " +
         std::to_string(seen.pipeline.frames_decoded) + " frames taken";
}

// All who look at each sample.
class Sinks final : public SampleSink {
 public:
  Sinks(EventSink& events, ObservationSink& observations, bool commands, CarriedRing& carried)
      : events_(events), observations_(observations), watch_(commands), carried_(carried) {}
  void on_report(const SampleReport& report) noexcept override {
    events_.on_report(report);
    observations_.on_report(report);
    if (const CarriedWindow* window = watch_.step(report)) carried_.push(*window);
  }

 private:
  EventSink& events_;
  ObservationSink& observations_;
  CarriedWatch watch_;
  CarriedRing& carried_;
};

// The last lines of the log.
void say_what_was(LogSink& log, const PipelineCounters& counters, const LoopCounters& loop,
                  const LoopMeters& meters) {
  log.info("stopped: " + std::to_string(counters.frames) + " frames, " +
           std::to_string(counters.frames_decoded) + " taken, " +
           std::to_string(counters.frames_bad) + " bad, " + std::to_string(counters.samples) +
           " samples, " + std::to_string(loop.samples_late) + " late, " +
           std::to_string(loop.sends_failed) + " sends failed, " +
           std::to_string(counters.frames_refused) + " refused");
  if (const UdsCounters& uds = counters.diagnostics;
      uds.requests + uds.answers + uds.refusals > 0) {
    log.info("diagnostics: " + std::to_string(uds.requests) + " requests, " +
             std::to_string(uds.answers) + " answers, " + std::to_string(uds.refusals) +
             " refusals, " + std::to_string(uds.timeouts) + " without answer, " +
             std::to_string(uds.broken) + " broken, " + std::to_string(uds.foreign) +
             " frames of another tester");
  }
  log.info("latency: " + latency_text("wake-up", meters.wake_up) + "; " +
           latency_text("sample to frame", meters.sample_to_frame) + "; " +
           latency_text("frame age", meters.frame_age));
}

// Opens the bus and takes it for this process. A status: it cannot be used, or a signal came before
// the first frame.
std::optional<int> take_bus(const Arguments& arguments, const Config& config, int stop_fd, Bus& bus,
                            std::optional<BusClaim>& claim) {
  const auto refuse = [&arguments](const std::string& why) {
    complain(arguments.config + ": " + why);
    return kUnavailable;
  };
  Result<Bus> opened = open_bus(config, stop_fd);
  if (!opened) return refuse(opened.error());
  bus = *std::move(opened);
  if (bus.inproc != nullptr) return std::nullopt;  // nobody but this process is on it
  claim.emplace(config.interface, config.identifiers);
  if (!claim->refused().empty()) return refuse(claim->refused());
  const Listened listened = listen_before_talk(*bus.port, config.identifiers);
  if (listened.closed) return kDone;
  if (listened.heard) {
    return refuse("another node sends " + identifier_text(*listened.heard) + " on " +
                  config.interface +
                  ": a second beltgripd? Stop it, or give one of them other [bus] identifiers");
  }
  return std::nullopt;
}

// What is known before the first line of work.
void say_what_is(LogSink& log, const Arguments& arguments, const Config& config, bool inproc) {
  log.info("version " BELTGRIP_VERSION ", " + arguments.config + ", bus " + config.interface);
  if (const std::string assumed = assumed_text(config); !assumed.empty()) log.info(assumed);
  if (!inproc) log.info(link_health(config.interface));
  if (config.further_bus) log.info(link_health(config.further_bus->interface));
}

std::unique_ptr<FlightRecorder> start_recorder(const Arguments& arguments, const Config& config,
                                               RecordRings& rings) {
  const auto wall_ns = static_cast<std::int64_t>(unix_time_s() * 1e9);
  std::vector<std::string> interfaces{config.interface};
  if (config.further_bus) interfaces.push_back(config.further_bus->interface);
  return std::make_unique<FlightRecorder>(arguments.record, std::move(interfaces), rings,
                                          wall_ns - steady_now().ns());
}

// What the helper thread does at each of its turns.
class Turns {
 public:
  struct Parts {
    LogSink& log;
    Requests& requests;
    Reloader& reloader;
    LatestSlot<Observation>& slot;
    CarriedRing& carried_ring;
    CarriedKeeper& carried;
    HistoryRings& rings;
    HistoryKeeper* history;    // none: results are not kept
    FlightRecorder* recorder;  // none: not asked for
    ServiceNotify& service;
    StatusServer& status;
  };
  explicit Turns(const Parts& parts) : parts_(parts) {}

  std::string figure(const Event& event) {
    const Observation* seen = newest();
    if (seen == nullptr) return {};
    return figure_of(event, parts_.reloader.running(), seen->report, seen->signals);
  }
  void turn() {
    const MonoTime now = steady_now();
    take_carried();
    if (parts_.requests.turn(now)) take_configuration();
    say_of_recorder();
    const Observation* seen = newest();
    parts_.service.turn(now, seen);
    parts_.status.turn(parts_.reloader.running(), now, seen, parts_.carried.bounds());
    if (seen == nullptr || now < pulse_at_) return;
    parts_.log.debug(pulse(*seen));
    pulse_at_ = now + kSecond;
  }
  // After the last sample.
  void end() {
    take_carried();
    if (parts_.recorder != nullptr) parts_.recorder->stop();
    say_of_recorder();
    parts_.service.stopping();
  }

 private:
  const Observation* newest() {
    observed_ = parts_.slot.take() || observed_;
    return observed_ ? &parts_.slot.latest() : nullptr;
  }
  void take_carried() {
    CarriedWindow window;
    while (parts_.carried_ring.pop(window)) parts_.carried.take(window, unix_time_s());
    parts_.carried.turn(unix_time_s());
  }
  void take_configuration() {
    const Config& running = parts_.reloader.running();
    parts_.carried.change(running);
    if (parts_.history == nullptr) return;
    parts_.rings.learned.push(parts_.history->change_fingerprint(config_fingerprint(running)));
  }
  void say_of_recorder() {
    if (parts_.recorder == nullptr) return;
    for (const auto& [warning, line] : parts_.recorder->take_messages()) {
      warning ? parts_.log.warning(line) : parts_.log.info(line);
    }
  }

  Parts parts_;
  bool observed_ = false;
  MonoTime pulse_at_;
};

int run(const Arguments& arguments) {
  const ConfigResult loaded = load_config(arguments.config);
  for (const std::string& warning : loaded.warnings) complain(warning);
  for (const ConfigError& error : loaded.errors) complain(error.text);
  if (!loaded.config) return loaded.exit_code();
  const Config& config = *loaded.config;

  // The helper thread's allocations come from the one heap: its own arena would count as 64 MB
  // against the limit of locked memory.
  mallopt(M_ARENA_MAX, 1);
  const int stop_fd = signal_descriptor({SIGTERM, SIGINT});
  const int request_fd = signal_descriptor({SIGHUP, SIGUSR1, SIGUSR2});
  signal(SIGPIPE, SIG_IGN);
  Bus bus;
  std::optional<BusClaim> claim;
  if (const std::optional<int> status = take_bus(arguments, config, stop_fd, bus, claim)) {
    return *status;
  }

  Pipeline pipeline(config);
  EventRing events;
  EventSink event_sink(events);
  LoopMeters meters;
  LatestSlot<Observation> slot;
  ObservationSink observation_sink(pipeline, meters, slot);
  CarriedRing carried_ring;
  Sinks sinks(event_sink, observation_sink, config.control == Control::kCommand, carried_ring);
  std::unique_ptr<RecordRings> record_rings;
  std::unique_ptr<RecordTap> tap;
  if (!arguments.record.empty()) {
    record_rings = std::make_unique<RecordRings>();
    tap = std::make_unique<RecordTap>(*record_rings);
  }
  LogSink log(arguments.log_level);
  say_what_is(log, arguments, config, bus.inproc != nullptr);
  const auto say = [&log](bool warning, const std::string& line) {
    warning ? log.warning(line) : log.info(line);
  };
  std::unique_ptr<HistoryKeeper> history;
  const std::string folder = state_folder(config, arguments.config);
  if (!folder.empty()) {
    history = std::make_unique<HistoryKeeper>(folder, config_fingerprint(config), say, unix_time_s);
    const estimator::LearnedFriction learned = history->open();
    if (tap != nullptr) tap->learned(bus.port->now(), learned);
    pipeline.learn(learned);
  } else {
    log.info("no state directory: results are not kept");
  }
  CarriedKeeper carried(folder, config, say);
  HistoryRings rings;
  ReloadSlot reload_slot;
  log.info(prepare_real_time());
  ServiceNotify service;
  StatusServer status(runtime_folder());
  if (!status.error().empty()) log.warning(status.error());
  Reloader reloader(arguments.config, config, reload_slot, claim ? &*claim : nullptr, say);
  Requests requests(request_fd, reloader, log, service);
  std::unique_ptr<FlightRecorder> recorder;
  if (record_rings != nullptr) recorder = start_recorder(arguments, config, *record_rings);
  Turns turns({log, requests, reloader, slot, carried_ring, carried, rings, history.get(),
               recorder.get(), service, status});
  std::function<void()> on_stop;
  if (bus.inproc != nullptr) on_stop = [&] { bus.inproc->close(); };
  Housekeeper housekeeper(
      events, rings, history.get(), log, [&](const Event& event) { return turns.figure(event); },
      stop_fd, on_stop, [&] { turns.turn(); });

  const LoopCounters loop = run_loop(*bus.port, pipeline, config.estimator.sample_rate_hz,
                                     estimator::StopReason::kShutdown, &sinks, &meters, tap.get(),
                                     {.history = &rings, .reload = &reload_slot});

  housekeeper.stop();
  turns.end();
  say_what_was(log, pipeline.counters(), loop, meters);
  close(stop_fd);
  return kDone;
}

// What was printed has come out.
int printed() {
  if (std::fflush(stdout) == 0 && std::ferror(stdout) == 0) return kDone;
  complain("beltgripd: standard output: cannot write");
  return kCannotWrite;
}

}  // namespace

int main(int argc, char** argv) {
  Arguments arguments;
  command_line::Program app(
      "beltgripd: estimates the belt-pulley friction of a pushbelt variator from CAN signals and "
      "publishes it on the same bus.");
  app.set_version("beltgripd " BELTGRIP_VERSION);
  app.add_option("--config", arguments.config, "configuration file")
      .type_name("FILE")
      .capture_default_str();
  app.add_option("--log-level", arguments.log_level, "what is logged on standard error")
      .type_name("LEVEL")
      .one_of(LogSink::level_names())
      .capture_default_str();
  app.add_option("--record", arguments.record,
                 "keep the frames around every experiment and every fault in this folder, at most "
                 "256 MiB of them; beltgrip replay reads them")
      .type_name("DIR");
  app.add_flag("--print-default-config", arguments.print_default_config,
               "print every key with default, unit and range, and exit");
  app.add_flag("--check", arguments.check,
               "say whether the configuration is right, and exit; beltgrip check says whether it "
               "fits a car");
  switch (app.parse(argc, argv)) {
    case command_line::Parsed::kGoOn:
      break;
    case command_line::Parsed::kShown:
      return printed();
    case command_line::Parsed::kWrong:
      complain(app.error() + " (see beltgripd --help)");
      return kUsage;
  }
  if (arguments.print_default_config) {
    std::fputs(default_config_text().c_str(), stdout);
    return printed();
  }
  try {
    return arguments.check ? check(arguments) : run(arguments);
  } catch (const std::exception& error) {
    complain(std::string("beltgripd: found an internal error: ") + error.what());
    return kInternal;
  }
}
