#include "tools/sim/replay_port.h"

#include <algorithm>
#include <utility>

namespace beltgrip::sim {

ReplayPort::ReplayPort(LogTimeline& log, Receiver receiver)
    : log_(log), receiver_(std::move(receiver)), has_next_(log_.next(next_)) {
  if (has_next_) now_ = next_.t_ns;
  limit_ = now_;
}

daemon::Wake ReplayPort::wait_until(daemon::MonoTime deadline) noexcept {
  if (!has_next_) return daemon::Wake::kClosed;
  if (next_.t_ns <= deadline) {
    // Everything that is due before the deadline may be taken in one go; receive() moves the clock.
    now_ = std::max(now_, next_.t_ns);
    limit_ = deadline;
    return daemon::Wake::kFrames;
  }
  now_ = std::max(now_, deadline);
  return daemon::Wake::kDeadline;
}

std::size_t ReplayPort::receive(std::span<daemon::RxFrame> out) noexcept {
  std::size_t count = 0;
  while (count < out.size() && has_next_ && next_.t_ns <= limit_) {
    daemon::RxFrame& frame = out[count++];
    frame.t = next_.t_ns;
    frame.frame = next_.frame;
    frame.own_echo = false;
    frame.dropped_before = 0;
    now_ = std::max(now_, next_.t_ns);
    has_next_ = log_.next(next_);
  }
  return count;
}

daemon::SendResult ReplayPort::send(const can::CanFrame& frame) noexcept {
  if (receiver_) receiver_(now_, frame);
  return daemon::SendResult::kSent;
}

}  // namespace beltgrip::sim
