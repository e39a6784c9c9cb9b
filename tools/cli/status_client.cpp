#include "tools/cli/status_client.h"

#include <sys/socket.h>
#include <sys/time.h>
#include <sys/un.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <filesystem>
#include <memory>
#include <utility>
#include <vector>

#include "daemon/io/json_text.h"
#include "tools/cli/failure.h"

namespace beltgrip::cli {

namespace {

namespace fs = std::filesystem;
constexpr const char* kRuntimeFolder = "/run/beltgrip";
constexpr timeval kPatience{5, 0};
constexpr std::size_t kAnswerMost = std::size_t{1} << 20;

}  // namespace

std::string status_socket(const std::string& interface) {
  if (!interface.empty()) return std::string(kRuntimeFolder) + "/" + interface + "/status.sock";
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

Status ask_status(const std::string& path) {
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
    const int error = errno;
    throw Failure{kUnavailable,
                  path + ": no beltgripd answers (" + std::strerror(error) + ")" +
                      (error == ENOENT ? "; one that is no service answers where it was started "
                                         "with RUNTIME_DIRECTORY=" +
                                             fs::path(path).parent_path().string()
                                       : "")};
  }
  std::string text;
  char buffer[4096];
  for (ssize_t size; (size = read(*fd, buffer, sizeof buffer)) > 0;) {
    text.append(buffer, static_cast<std::size_t>(size));
    if (text.size() > kAnswerMost) throw Failure{kBadInput, path + ": an answer without end"};
  }
  if (text.empty()) throw Failure{kUnavailable, path + ": beltgripd did not answer within 5 s"};
  auto values = daemon::json_if_any(text);
  if (values.is_discarded()) throw Failure{kBadInput, path + ": the answer is not whole"};
  return {text, std::move(values)};
}

}  // namespace beltgrip::cli
