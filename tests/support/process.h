// Child processes for tests: started, fed, listened to, signalled, waited for with a time limit.
// Nothing here sleeps: waiting is a poll on the child's pipes and on its end.
#pragma once

#include <sys/types.h>

#include <chrono>
#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace beltgrip::test {

using Milliseconds = std::chrono::milliseconds;

class Process {
 public:
  // argv[0] is looked up in PATH. Throws std::system_error when it cannot be started.
  explicit Process(const std::vector<std::string>& argv,
                   const std::string& stdin_file = "/dev/null");
  ~Process();  // kills what is still running
  Process(const Process&) = delete;
  Process& operator=(const Process&) = delete;

  pid_t pid() const { return pid_; }
  void signal(int number) const;
  // Exit status, or 128 + signal; nothing when it still runs after `limit`.
  std::optional<int> wait(Milliseconds limit);
  // True as soon as `done` says so; asked again after each piece of output. False at the limit, or
  // at the end of the process without it.
  bool wait_until(const std::function<bool(const Process&)>& done, Milliseconds limit);
  bool wait_for_output(std::string_view text, Milliseconds limit);
  bool wait_for_error(std::string_view text, Milliseconds limit);
  // What it has written so far.
  const std::string& out() const { return out_; }
  const std::string& err() const { return err_; }

 private:
  enum class Event { kOutput, kEnd, kLimit };
  Event pump(std::chrono::steady_clock::time_point deadline);
  void drain();

  pid_t pid_ = -1;
  int pid_fd_ = -1;
  int out_fd_ = -1;
  int err_fd_ = -1;
  std::optional<int> status_;
  std::string out_, err_;
};

struct RunResult {
  int status = -1;  // -1: not finished within the limit, and killed
  std::string out, err;
};
RunResult run(const std::vector<std::string>& argv, Milliseconds limit,
              const std::string& stdin_file = "/dev/null");

}  // namespace beltgrip::test
