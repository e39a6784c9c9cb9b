#include "daemon/io/housekeeper.h"

#include <poll.h>

#include <utility>

namespace beltgrip::daemon {

namespace {
constexpr int kPeriod_ms = 20;
}

Housekeeper::Housekeeper(EventRing& events, LogSink& log, int stop_fd,
                         std::function<void()> on_stop)
    : events_(events),
      log_(log),
      stop_fd_(on_stop ? stop_fd : -1),
      on_stop_(std::move(on_stop)),
      thread_([this] { run(); }) {}

Housekeeper::~Housekeeper() { stop(); }

void Housekeeper::stop() {
  ending_.store(true);
  if (thread_.joinable()) thread_.join();
}

void Housekeeper::drain() {
  Event event;
  while (events_.pop(event)) log_.event(event);
  const std::uint64_t dropped = events_.dropped();
  if (dropped != dropped_) {
    log_.warning(std::to_string(dropped - dropped_) + " events dropped");
    dropped_ = dropped;
  }
  log_.flush();
}

void Housekeeper::run() {
  while (!ending_.load()) {
    pollfd stop{stop_fd_, POLLIN, 0};
    if (poll(&stop, 1, kPeriod_ms) > 0 && on_stop_) {
      std::exchange(on_stop_, nullptr)();
      stop_fd_ = -1;
    }
    drain();
  }
  drain();
}

}  // namespace beltgrip::daemon
