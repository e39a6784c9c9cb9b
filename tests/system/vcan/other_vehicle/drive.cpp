#include "tests/system/vcan/other_vehicle/drive.h"

#include <pthread.h>
#include <sched.h>

#include <algorithm>
#include <fstream>

namespace beltgrip::other {

using Clock = std::chrono::steady_clock;

constexpr int kServicePriority = 60;  // CPUSchedulingPriority of systemd's unit

Drive::Drive(const std::string& folder, const Kind& kind, std::size_t seed)
    : Ride(kind, seed), folder_(folder), bus_("vcan0"), start_(Clock::now()) {
  std::ofstream(folder_ + "/other.dbc") << dbc_text();
  std::ofstream(folder_ + "/other.toml")
      << configuration_text(kind.torque_Nm < 0.0 ? "coast_down" : "steady");
}

void Drive::start_daemon() {
  daemon_.reset();
  account().another_daemon();
  // As the service starts it, where that is allowed: several cars share one processor here, and
  // with ordinary scheduling a daemon waits for all of them. It takes over what this thread has.
  const sched_param real_time{.sched_priority = kServicePriority}, ordinary{};
  pthread_setschedparam(pthread_self(), SCHED_FIFO, &real_time);
  daemon_ = std::make_unique<test::Process>(
      std::vector<std::string>{BELTGRIP_BIN_DIR "/beltgripd", "--config", folder_ + "/other.toml"});
  pthread_setschedparam(pthread_self(), SCHED_OTHER, &ordinary);
}

std::string Drive::daemon_log() {
  daemon_->wait(test::Milliseconds{0});
  return daemon_->err();
}

void Drive::exchange() {
  constexpr std::chrono::microseconds kTick{static_cast<long>(kTick_s * 1e6)};
  const auto due = start_ + ticks() * kTick;
  for (;;) {
    const auto left = std::chrono::ceil<test::Milliseconds>(due - Clock::now());
    const std::optional<test::ReceivedFrame> seen =
        bus_.receive(std::max(left, test::Milliseconds{0}));
    if (seen) hear(seen->frame.can_id, Bytes(seen->frame.data, seen->frame.data + seen->frame.len));
    if (!seen && Clock::now() >= due) break;
  }
}

}  // namespace beltgrip::other
