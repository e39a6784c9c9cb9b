#include "tools/cli/stop_signals.h"

#include <signal.h>
#include <sys/eventfd.h>
#include <sys/stat.h>
#include <sys/time.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cerrno>
#include <climits>
#include <cstdint>
#include <initializer_list>

#include "can_dbc/log/byte_source.h"
#include "tools/text/terminal.h"

namespace beltgrip::cli {

namespace {

constexpr timeval kAfterTerm{0, 400'000};
constexpr timeval kAfterInterrupt{5, 0};

struct Slot {
  std::atomic<bool> taken{false};
  std::atomic<bool> removable{false};
  std::array<char, PATH_MAX> path{};
};
std::array<Slot, 16> slots;

std::atomic<bool> in_good_order{false};
std::atomic<bool> of_files{false};  // their end is not this signal
std::atomic<bool> of_drive{false};
std::atomic<int> asked{0};  // the signal
std::atomic<int> descriptor{-1};
std::atomic<void (*)()> before_end{nullptr};

static_assert(std::atomic<bool>::is_always_lock_free && std::atomic<int>::is_always_lock_free &&
              std::atomic<void (*)()>::is_always_lock_free);

[[noreturn]] void end(int number) {
  for (const Slot& slot : slots) {
    if (slot.removable.load()) unlink(slot.path.data());
  }
  if (const auto last = before_end.load(); last != nullptr) last();
  // As if there had been no handler: the shell sees what ended the program.
  signal(number, SIG_DFL);
  sigset_t only;
  sigemptyset(&only);
  sigaddset(&only, number);
  pthread_sigmask(SIG_UNBLOCK, &only, nullptr);
  raise(number);
  _exit(128 + number);
}

void on_signal(int number) {
  const int error = errno;
  if (!in_good_order.load() || number == SIGHUP || number == SIGPIPE) end(number);
  if (number == SIGTERM && of_files.load()) end(number);
  if (number == SIGINT && asked.load() == SIGINT) end(number);
  asked.store(number);
  const itimerval limit{{0, 0}, number == SIGTERM ? kAfterTerm : kAfterInterrupt};
  setitimer(ITIMER_REAL, &limit, nullptr);
  const std::uint64_t one = 1;
  if (const int fd = descriptor.load(); fd >= 0) static_cast<void>(!write(fd, &one, sizeof one));
  errno = error;
}

void on_limit(int) { end(asked.load() == 0 ? SIGALRM : asked.load()); }

void handle(int number, void (*handler)(int)) {
  struct sigaction before {};
  sigaction(number, nullptr, &before);
  if (before.sa_handler == SIG_IGN) return;
  struct sigaction action {};
  action.sa_handler = handler;
  sigfillset(&action.sa_mask);
  sigaction(number, &action, nullptr);
}

}  // namespace

void take_stop_signals() {
  sigset_t signals;
  sigemptyset(&signals);
  for (const int number : {SIGTERM, SIGINT, SIGHUP, SIGPIPE}) {
    handle(number, on_signal);
    sigaddset(&signals, number);
  }
  handle(SIGALRM, on_limit);
  sigaddset(&signals, SIGALRM);
  pthread_sigmask(SIG_UNBLOCK, &signals, nullptr);
}

void end_in_good_order() { in_good_order.store(true); }

bool stop_asked() { return asked.load() != 0; }

int stop_descriptor() {
  if (descriptor.load() < 0) descriptor.store(eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK));
  end_in_good_order();
  return descriptor.load();
}

namespace {

bool is_stream(const std::string& log) {
  struct stat found {};
  const int error = log == "-" ? fstat(STDIN_FILENO, &found) : stat(log.c_str(), &found);
  return error == 0 && !S_ISREG(found.st_mode) && !S_ISDIR(found.st_mode);
}

}  // namespace

void end_streams_when_stopped(const std::vector<std::string>& logs) {
  if (std::any_of(logs.begin(), logs.end(), is_stream))
    can::ByteSource::end_with(stop_descriptor());
}

void end_logs_when_stopped(const std::vector<std::string>& logs) {
  of_files.store(!logs.empty() && std::none_of(logs.begin(), logs.end(), is_stream));
  can::ByteSource::end_with(stop_descriptor());
}

void end_drives_when_stopped() {
  of_files.store(true);
  of_drive.store(true);
  end_in_good_order();
}

void end_if_cut() {
  if (!of_files.load() || !stop_asked()) return;
  text::complain(of_drive.load()
                     ? "stopped: the drive ends there"
                     : "stopped: what was read until then is used, what follows is not");
  end(asked.load());
}

void call_when_stopped(void (*last)()) { before_end.store(last); }

std::size_t remove_when_stopped(const std::string& path) {
  for (std::size_t i = 0; i < slots.size() && path.size() < slots[i].path.size(); ++i) {
    if (slots[i].taken.exchange(true)) continue;
    slots[i].path.fill('\0');
    path.copy(slots[i].path.data(), path.size());
    slots[i].removable.store(true);
    return i;
  }
  return kNoSlot;
}

void keep_when_stopped(std::size_t slot) {
  if (slot >= slots.size()) return;
  slots[slot].removable.store(false);
  slots[slot].taken.store(false);
}

}  // namespace beltgrip::cli
