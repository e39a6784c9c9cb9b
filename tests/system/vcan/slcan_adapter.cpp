#include "tests/system/vcan/slcan_adapter.h"

#include <fcntl.h>
#include <net/if.h>
#include <poll.h>
#include <sys/ioctl.h>
#include <termios.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstdlib>
#include <string_view>
#include <system_error>

namespace beltgrip::test {

namespace {

constexpr int kLineDiscipline = 17;  // N_SLCAN
constexpr int kTurn_ms = 5;

[[noreturn]] void fail(const char* what) {
  throw std::system_error(errno, std::generic_category(), what);
}

void make_raw(int fd) {
  termios settings{};
  if (tcgetattr(fd, &settings) != 0) fail("tcgetattr");
  cfmakeraw(&settings);
  if (tcsetattr(fd, TCSANOW, &settings) != 0) fail("tcsetattr");
}

}  // namespace

SlcanAdapter::SlcanAdapter() : master_(posix_openpt(O_RDWR | O_NOCTTY | O_CLOEXEC)) {
  if (master_ < 0 || grantpt(master_) != 0 || unlockpt(master_) != 0) fail("posix_openpt");
  slave_ = open(ptsname(master_), O_RDWR | O_NOCTTY | O_CLOEXEC);
  if (slave_ < 0) fail("pty");
  make_raw(slave_);
  if (ioctl(slave_, TIOCSETD, &kLineDiscipline) != 0) fail("line discipline slcan");
  std::array<char, IFNAMSIZ> name{};
  if (ioctl(slave_, SIOCGIFNAME, name.data()) != 0) fail("name of the interface");
  interface_ = name.data();
  thread_ = std::thread([this] { pump(); });
}

SlcanAdapter::~SlcanAdapter() {
  if (SlcanAdapter* const other = other_) {
    const std::lock_guard lock(other->mutex_);  // its thread may be passing something on to here
    other->other_ = nullptr;
  }
  ending_ = true;
  thread_.join();
  close(slave_);
  close(master_);
}

void SlcanAdapter::say(const std::string& line) {
  const std::string text = line + "\r";
  if (write(master_, text.data(), text.size()) != static_cast<ssize_t>(text.size())) fail("write");
}

void SlcanAdapter::join(SlcanAdapter& one, SlcanAdapter& other) {
  one.other_ = &other;
  other.other_ = &one;
}

void SlcanAdapter::pass_on(const std::string& line) {
  SlcanAdapter* const other = other_;
  const bool is_frame =
      !line.empty() && std::string_view("tTrR").find(line[0]) != std::string::npos;
  if (is_frame && other != nullptr && !cut_off_ && !other->cut_off_) other->say(line);
}

void SlcanAdapter::pump() {
  std::string rest;
  std::array<char, 4096> buffer{};
  while (!ending_) {
    pollfd waiting{stuck_ ? -1 : master_, POLLIN, 0};
    if (poll(&waiting, 1, kTurn_ms) <= 0) continue;
    const ssize_t size = read(master_, buffer.data(), buffer.size());
    if (size <= 0) continue;
    rest.append(buffer.data(), static_cast<std::size_t>(size));
    const std::lock_guard lock(mutex_);
    for (std::size_t end; (end = rest.find('\r')) != std::string::npos; rest.erase(0, end + 1)) {
      lines_.push_back(rest.substr(0, end));
      pass_on(lines_.back());
    }
    came_.notify_all();
  }
}

bool SlcanAdapter::wait(const std::function<bool(const std::vector<std::string>&)>& done,
                        std::chrono::milliseconds limit) {
  std::unique_lock lock(mutex_);
  return came_.wait_for(lock, limit, [&] { return done(lines_); });
}

void SlcanAdapter::forget() {
  const std::lock_guard lock(mutex_);
  lines_.clear();
}

}  // namespace beltgrip::test
