#include "tests/support/process.h"

#include <fcntl.h>
#include <poll.h>
#include <spawn.h>
#include <sys/prctl.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <csignal>
#include <system_error>

namespace beltgrip::test {
namespace {

[[noreturn]] void fail(const char* what) {
  throw std::system_error(errno, std::generic_category(), what);
}

// Reads what is there; false at the end of the stream.
bool read_available(int fd, std::string& text) {
  std::array<char, 65536> buffer{};
  for (;;) {
    const ssize_t n = read(fd, buffer.data(), buffer.size());
    if (n == 0) return false;
    if (n < 0) return errno == EAGAIN || errno == EINTR;
    text.append(buffer.data(), static_cast<std::size_t>(n));
  }
}

struct Pipe {
  Pipe() {
    if (pipe2(ends.data(), O_CLOEXEC) != 0) fail("pipe2");
  }
  std::array<int, 2> ends{};
};

}  // namespace

Process::Process(const std::vector<std::string>& argv, const std::string& stdin_file) {
  std::vector<char*> pointers;
  for (const std::string& argument : argv) pointers.push_back(const_cast<char*>(argument.c_str()));
  pointers.push_back(nullptr);
  const Pipe out, err, started;
  pid_ = fork();
  if (pid_ < 0) fail("fork");
  if (pid_ == 0) {
    prctl(PR_SET_PDEATHSIG, SIGKILL);
    const int in = open(stdin_file.c_str(), O_RDONLY);
    if (in >= 0 && dup2(in, 0) == 0 && dup2(out.ends[1], 1) == 1 && dup2(err.ends[1], 2) == 2) {
      execvp(pointers[0], pointers.data());
    }
    const int code = errno;
    if (write(started.ends[1], &code, sizeof code) != sizeof code) _exit(126);
    _exit(127);
  }
  for (const Pipe* each : {&out, &err, &started}) close(each->ends[1]);
  out_fd_ = out.ends[0];
  err_fd_ = err.ends[0];
  int code = 0;
  const bool failed = read(started.ends[0], &code, sizeof code) == sizeof code;
  close(started.ends[0]);
  pid_fd_ = static_cast<int>(syscall(SYS_pidfd_open, pid_, 0));
  if (failed || pid_fd_ < 0) {
    waitpid(pid_, nullptr, 0);
    for (const int fd : {out_fd_, err_fd_}) close(fd);
    throw std::system_error(failed ? code : errno, std::generic_category(), argv.at(0));
  }
  for (const int fd : {out_fd_, err_fd_}) fcntl(fd, F_SETFL, O_NONBLOCK);
}

Process::~Process() {
  if (!status_) {
    kill(pid_, SIGKILL);
    waitpid(pid_, nullptr, 0);
  }
  for (const int fd : {pid_fd_, out_fd_, err_fd_}) {
    if (fd >= 0) close(fd);
  }
}

void Process::signal(int number) const {
  if (!status_ && kill(pid_, number) != 0) fail("kill");
}

void Process::drain() {
  for (auto [fd, text] : {std::pair{&out_fd_, &out_}, std::pair{&err_fd_, &err_}}) {
    if (*fd >= 0 && !read_available(*fd, *text)) {
      close(*fd);
      *fd = -1;
    }
  }
}

Process::Event Process::pump(std::chrono::steady_clock::time_point deadline) {
  if (status_) return Event::kEnd;
  const auto left = std::chrono::ceil<Milliseconds>(deadline - std::chrono::steady_clock::now());
  std::array<pollfd, 3> fds{{{out_fd_, POLLIN, 0}, {err_fd_, POLLIN, 0}, {pid_fd_, POLLIN, 0}}};
  const int ready = poll(fds.data(), fds.size(), static_cast<int>(std::max<long>(0, left.count())));
  if (ready < 0 && errno != EINTR) fail("poll");
  if (ready == 0) return Event::kLimit;
  drain();
  if (fds[2].revents == 0) return Event::kOutput;
  int status = 0;
  waitpid(pid_, &status, 0);
  drain();
  status_ = WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
  return Event::kEnd;
}

std::optional<int> Process::wait(Milliseconds limit) {
  const auto deadline = std::chrono::steady_clock::now() + limit;
  while (pump(deadline) == Event::kOutput) {
  }
  return status_;
}

bool Process::wait_until(const std::function<bool(const Process&)>& done, Milliseconds limit) {
  const auto deadline = std::chrono::steady_clock::now() + limit;
  while (!done(*this)) {
    if (pump(deadline) != Event::kOutput) return done(*this);
  }
  return true;
}

bool Process::wait_for_output(std::string_view text, Milliseconds limit) {
  return wait_until([&](const Process& p) { return p.out().find(text) != std::string::npos; },
                    limit);
}

bool Process::wait_for_error(std::string_view text, Milliseconds limit) {
  return wait_until([&](const Process& p) { return p.err().find(text) != std::string::npos; },
                    limit);
}

RunResult run(const std::vector<std::string>& argv, Milliseconds limit,
              const std::string& stdin_file) {
  Process process(argv, stdin_file);
  const std::optional<int> status = process.wait(limit);
  return {status.value_or(-1), process.out(), process.err()};
}

}  // namespace beltgrip::test
