// beltgrip status: what a running beltgripd says of itself, over the socket in its runtime
// directory. Open to every user.
#include "tools/cli/status.h"

#include <sys/socket.h>
#include <sys/time.h>
#include <sys/un.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "tools/cli/failure.h"
#include "tools/text/terminal.h"

namespace beltgrip::cli {

namespace {

namespace fs = std::filesystem;
constexpr const char* kRuntimeFolder = "/run/beltgrip";
constexpr timeval kPatience{5, 0};
constexpr std::size_t kAnswerMost = std::size_t{1} << 20;

struct Options {
  std::string interface;
  std::string socket;
  bool json = false;
};

std::string socket_path(const Options& options) {
  if (!options.socket.empty()) return options.socket;
  if (!options.interface.empty()) {
    return std::string(kRuntimeFolder) + "/" + options.interface + "/status.sock";
  }
  std::vector<std::string> found;
  std::error_code error;
  for (const auto& each : fs::directory_iterator(kRuntimeFolder, error)) {
    if (fs::exists(each.path() / "status.sock", error)) found.push_back(each.path().filename());
  }
  if (found.empty()) {
    throw Failure{kUnavailable, std::string(kRuntimeFolder) +
                                    ": found no running beltgripd, expected a folder for each "
                                    "(systemctl start beltgripd@INTERFACE)"};
  }
  if (found.size() > 1) {
    std::sort(found.begin(), found.end());
    std::string which;
    for (const std::string& each : found) which += (which.empty() ? "" : ", ") + each;
    throw Failure{kUsage, "several run (" + which + "): say which interface"};
  }
  return std::string(kRuntimeFolder) + "/" + found.front() + "/status.sock";
}

std::string ask(const std::string& path) {
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  if (path.size() >= sizeof address.sun_path) throw Failure{kUsage, path + ": too long a path"};
  path.copy(address.sun_path, path.size());
  const std::unique_ptr<int, void (*)(int*)> fd(
      new int(socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0)), [](int* open) {
        close(*open);
        delete open;
      });
  setsockopt(*fd, SOL_SOCKET, SO_RCVTIMEO, &kPatience, sizeof kPatience);
  if (connect(*fd, reinterpret_cast<const sockaddr*>(&address), sizeof address) != 0) {
    throw Failure{kUnavailable, path + ": no beltgripd answers (" + std::strerror(errno) + ")"};
  }
  std::string text;
  char buffer[4096];
  for (ssize_t size; (size = read(*fd, buffer, sizeof buffer)) > 0;) {
    text.append(buffer, static_cast<std::size_t>(size));
    if (text.size() > kAnswerMost) throw Failure{kBadInput, path + ": an answer without end"};
  }
  if (text.empty()) throw Failure{kUnavailable, path + ": beltgripd did not answer within 5 s"};
  return text;
}

void show(const nlohmann::ordered_json& status) {
  const auto line = [](const std::string& name, const std::string& text) {
    text::print(stdout, can::printable(name) +
                            std::string(name.size() < 16 ? 16 - name.size() : 0, ' ') + " " +
                            can::printable(text) + "\n");
  };
  const auto list = [](const nlohmann::ordered_json& names) {
    std::string text;
    for (const auto& each : names) text += (text.empty() ? "" : ", ") + each.get<std::string>();
    return text.empty() ? std::string("none") : text;
  };
  const auto number = [](const nlohmann::ordered_json& value, const char* format) {
    if (!value.is_number()) return std::string("-");
    char text[64];
    std::snprintf(text, sizeof text, format, value.get<double>());
    return std::string(text);
  };
  line("interface",
       status.at("interface").get<std::string>() + ", " + status.at("control").get<std::string>());
  line("state", status.at("state").get<std::string>() + ", " +
                    status.at("phase").get<std::string>() +
                    (status.at("macro_slip_stop").get<bool>() ? ", STOP" : ""));
  line("faults", list(status.at("faults")));
  line("inhibits", list(status.at("inhibits")));
  const auto& result = status.at("result");
  if (result.is_null()) {
    line("last result", "none yet");
  } else {
    line("last result", result.at("outcome").get<std::string>() + ", " +
                            result.at("stop_reason").get<std::string>() + ", mu_max " +
                            number(result.at("mu_max"), "%.4f") + " +- " +
                            number(result.at("mu_max_std"), "%.4f") + ", " +
                            number(result.at("age_s"), "%.0f s ago"));
  }
  for (const auto& [role, signal] : status.at("signals").items()) {
    line(role, number(signal.at("value"), "%.6g") + " " + signal.at("unit").get<std::string>() +
                   ", " + signal.at("quality").get<std::string>() + ", " +
                   number(signal.at("age_s"), "%.3f s old"));
  }
  for (const auto& [name, latency] : status.at("latency").items()) {
    line(name, "p50 " + number(latency.at("p50_us"), "%.0f us") + ", p99 " +
                   number(latency.at("p99_us"), "%.0f us") + ", p99.9 " +
                   number(latency.at("p999_us"), "%.0f us") + ", worst " +
                   number(latency.at("max_us"), "%.0f us"));
  }
  for (const auto& [name, count] : status.at("counters").items()) {
    line(name, std::to_string(count.get<std::uint64_t>()));
  }
}

}  // namespace

void add_status(command_line::Command app) {
  const command_line::Command command =
      app.add_subcommand("status", "What a running beltgripd sees and measures");
  auto options = std::make_shared<Options>();
  command.add_option("INTERFACE", options->interface, "Its interface, where several run")
      .type_name("");
  command.add_option("--socket", options->socket, "Its socket, where it is not a service")
      .type_name("PATH");
  command.add_flag("--json", options->json, "As one JSON object");
  command.example("beltgrip status");
  command.example("beltgrip status can0 --json");
  command.callback([options] {
    const std::string path = socket_path(*options);
    const std::string text = ask(path);
    const auto status = nlohmann::ordered_json::parse(text, nullptr, false);
    if (status.is_discarded()) throw Failure{kBadInput, path + ": the answer is not whole"};
    if (options->json) {
      text::print(stdout, text);
    } else {
      try {
        show(status);
      } catch (const nlohmann::json::exception& error) {
        throw Failure{kBadInput, path + ": found an answer that is not beltgripd's (" +
                                     error.what() + "), expected its state as JSON"};
      }
    }
  });
}

}  // namespace beltgrip::cli
