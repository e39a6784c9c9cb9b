// beltgrip status: what a running beltgripd says of itself, once or as it goes on. Open to every
// user.
#include "tools/cli/status.h"

#include <poll.h>

#include <array>
#include <cstdio>
#include <ctime>
#include <memory>
#include <optional>
#include <string>

#include "tools/cli/failure.h"
#include "tools/cli/output_file.h"
#include "tools/cli/status_client.h"
#include "tools/cli/status_text.h"
#include "tools/cli/stop_signals.h"
#include "tools/text/terminal.h"

namespace beltgrip::cli {

namespace {

struct StatusOptions {
  std::string interface;
  std::string socket;
  bool json = false;
  bool follow = false;
  double interval_s = 1.0;
  std::string prometheus;
};

std::string socket_of(const StatusOptions& options) {
  return options.socket.empty() ? status_socket(options.interface) : options.socket;
}

// What `text` makes of the values; Failure 65 where they are not those of a daemon.
template <typename Text>
std::string in_words(const std::string& path, const Status& status, Text text) {
  try {
    return text(status.values);
  } catch (const nlohmann::json::exception& error) {
    throw Failure{kBadInput, path + ": found an answer that is not beltgripd's (" + error.what() +
                                 "), expected its state as JSON"};
  }
}

void show(const StatusOptions& options) {
  const std::string path = socket_of(options);
  const Status status = ask_status(path);
  text::print(stdout, options.json ? status.text : in_words(path, status, status_text));
}

// The file is written in any case: who reads it learns that nobody answers.
void write_metrics(const StatusOptions& options) {
  std::optional<Failure> unanswered;
  std::string text;
  try {
    const std::string path = socket_of(options);
    const Status status = ask_status(path);
    text = in_words(path, status, [](const nlohmann::ordered_json& values) {
      return status_metrics(values, values.at("interface").get<std::string>());
    });
  } catch (const Failure& failure) {
    if (failure.exit_code == kUsage) throw;
    unanswered = failure;
    text = status_metrics(nullptr, options.interface);
  }
  write_file(options.prometheus, {}, text);
  if (unanswered) throw Failure(*unanswered);
}

std::string wall_clock() {
  const std::time_t now = std::time(nullptr);
  std::tm local{};
  localtime_r(&now, &local);
  std::array<char, 32> text{};
  std::strftime(text.data(), text.size(), "%Y-%m-%d %H:%M:%S", &local);
  return text.data();
}

// False: asked to stop.
bool waited(double interval_s) {
  constexpr double kMillisecond_s = 1e-3;
  pollfd stopped{.fd = stop_descriptor(), .events = POLLIN, .revents = 0};
  poll(&stopped, 1, static_cast<int>(interval_s / kMillisecond_s));
  return !stop_asked();
}

// JSON: a line at each turn. Words: a line at each change. A daemon that is not there is waited
// for.
void follow(const StatusOptions& options) {
  end_in_good_order();
  std::string before;
  do {
    std::string line;
    try {
      const std::string path = socket_of(options);
      const Status status = ask_status(path);
      line = options.json ? status.text : in_words(path, status, status_line) + "\n";
    } catch (const Failure& failure) {
      if (failure.exit_code != kUnavailable) throw;
      if (before != failure.text) text::warn(failure.text + "; waiting");
      before = failure.text;
      continue;
    }
    if (options.json || line != before) {
      text::print(stdout, options.json ? line : wall_clock() + "  " + line);
      if (std::fflush(stdout) != 0) throw Failure{kCannotWrite, "standard output: cannot write"};
    }
    before = line;
  } while (waited(options.interval_s));
}

void run_status(const StatusOptions& options) {
  if (!options.prometheus.empty() && (options.follow || options.json)) {
    throw Failure{kUsage, "--prometheus writes once, expected neither --follow nor --json"};
  }
  if (!options.prometheus.empty()) return write_metrics(options);
  return options.follow ? follow(options) : show(options);
}

}  // namespace

void add_status(command_line::Command app) {
  const command_line::Command command =
      app.add_subcommand("status", "What a running beltgripd sees and measures");
  auto options = std::make_shared<StatusOptions>();
  command.add_option("INTERFACE", options->interface, "Its interface, where several run")
      .type_name("");
  command.add_option("--socket", options->socket, "Its socket, where it is not a service")
      .type_name("PATH");
  command.add_flag("--json", options->json, "As one JSON object, on one line");
  command.add_flag("--follow", options->follow,
                   "Go on until stopped: a line for each change, with --json one each second");
  command.add_option("--interval", options->interval_s, "Seconds from one look to the next")
      .type_name("SECONDS")
      .capture_default_str()
      .range(0.1, 3600.0);
  command
      .add_option("--prometheus", options->prometheus,
                  "Write metrics to this file for node-exporter's textfile collector")
      .type_name("FILE");
  command.example("beltgrip status");
  command.example("beltgrip status can0 --follow");
  command.example("beltgrip status can0 --follow --json | mosquitto_pub -l -t car/beltgrip");
  command.example(
      "beltgrip status can0 --prometheus /var/lib/prometheus/node-exporter/beltgrip.prom");
  command.callback([options] { run_status(*options); });
}

}  // namespace beltgrip::cli
