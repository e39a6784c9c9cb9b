#include "daemon/io/housekeeper.h"

#include <poll.h>

#include <utility>

namespace beltgrip::daemon {

Housekeeper::Housekeeper(EventRing& events, HistoryRings& rings, HistoryKeeper* history,
                         LogSink& log, std::function<std::string(const Event&)> figure, int stop_fd,
                         std::function<void()> on_stop, std::function<void()> on_turn)
    : events_(events),
      rings_(rings),
      history_(history),
      log_(log),
      figure_(std::move(figure)),
      stop_fd_(on_stop ? stop_fd : -1),
      on_stop_(std::move(on_stop)),
      on_turn_(std::move(on_turn)),
      thread_([this] { run(); }) {}

Housekeeper::~Housekeeper() { stop(); }

void Housekeeper::stop() {
  ending_.store(true);
  if (thread_.joinable()) thread_.join();
}

void Housekeeper::drain() {
  Event event;
  while (events_.pop(event)) {
    if (lines_.take(event)) log_.event(event, figure_(event));
    if (const unsigned more = lines_.left_out(event.t)) {
      log_.warning(std::to_string(more) + " more events within a second");
    }
  }
  const std::uint64_t dropped = events_.dropped();
  if (dropped != dropped_) {
    log_.warning(std::to_string(dropped - dropped_) + " events dropped");
    dropped_ = dropped;
  }
  keep_history();
  log_.flush();
}

void Housekeeper::keep_history() {
  ExperimentResult result;
  while (rings_.results.pop(result)) {
    if (history_ != nullptr) rings_.learned.push(history_->take(result));
  }
  if (history_ == nullptr) return;
  if (const auto learned = history_->retry()) rings_.learned.push(*learned);
}

void Housekeeper::run() {
  while (!ending_.load()) {
    pollfd stop{stop_fd_, POLLIN, 0};
    if (poll(&stop, 1, kTurn_ms) > 0 && on_stop_) {
      std::exchange(on_stop_, nullptr)();
      stop_fd_ = -1;
    }
    drain();
    on_turn_();
  }
  drain();
}

}  // namespace beltgrip::daemon
