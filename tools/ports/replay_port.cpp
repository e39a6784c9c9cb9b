#include "tools/ports/replay_port.h"

#include <algorithm>
#include <utility>

namespace beltgrip::ports {

using daemon::MonoTime;

namespace {
// A longer silence is a pause of the recording: what the daemon would say in it tells nobody
// anything, and a night of it would be two million frames (chosen).
constexpr daemon::Duration kPause = 600 * daemon::kSecond;
}  // namespace

ReplayPort::ReplayPort(LogTimeline& log, Receiver receiver)
    : log_(log), receiver_(std::move(receiver)), has_next_(log_.next(next_)) {
  if (has_next_) now_ = next_t();
  limit_ = now_;
}

daemon::Wake ReplayPort::wait_until(daemon::MonoTime deadline) noexcept {
  if (!has_next_) return daemon::Wake::kClosed;
  if (echo_count_ > 0) {
    limit_ = now_;
    return daemon::Wake::kFrames;
  }
  if (next_t() <= deadline) {
    // Everything that is due before the deadline may be taken in one go; receive() moves the clock.
    now_ = std::max(now_, next_t());
    limit_ = deadline;
    return daemon::Wake::kFrames;
  }
  now_ = std::max(now_, deadline);
  return daemon::Wake::kDeadline;
}

daemon::MonoTime ReplayPort::silent_until() noexcept {
  const bool is_pause = next_t() - now_ > kPause;
  const bool heard = (receiver_ != nullptr && !is_pause) || echo_count_ > 0 || !has_next_;
  return heard ? Port::silent_until() : next_t();
}

std::size_t ReplayPort::receive(std::span<daemon::RxFrame> out) noexcept {
  std::size_t count = 0;
  for (std::size_t i = 0; i < echo_count_ && count < out.size(); ++i) {
    out[count++] = {now_, echoes_[i].frame, true, 0, echoes_[i].bus};
  }
  echo_count_ = 0;
  while (count < out.size() && has_next_ && next_t() <= limit_) {
    daemon::RxFrame& frame = out[count++];
    frame.t = next_t();
    frame.frame = next_.frame;
    frame.own_echo = take_sent(next_);
    frame.dropped_before = 0;
    frame.bus = next_.bus;
    now_ = std::max(now_, next_t());
    has_next_ = log_.next(next_);
  }
  return count;
}

void ReplayPort::remember(std::uint8_t bus, const can::CanFrame& frame) noexcept {
  const auto end = sent_.begin() + static_cast<std::ptrdiff_t>(sent_count_);
  const auto same = std::find_if(sent_.begin(), end, [&](const Sent& each) {
    return each.bus == bus && each.frame.id == frame.id;
  });
  if (same == sent_.end()) return;
  if (same == end) ++sent_count_;
  *same = {frame, bus, now_};
}

bool ReplayPort::take_sent(const can::StampedFrame& frame) noexcept {
  constexpr daemon::Duration kEchoWithin = daemon::kSecond;
  for (std::size_t i = 0; i < sent_count_; ++i) {
    Sent& each = sent_[i];
    if (each.bus != frame.bus || each.frame != frame.frame ||
        MonoTime::of_ns(frame.t_ns) - each.t > kEchoWithin) {
      continue;
    }
    each = sent_[--sent_count_];
    return true;
  }
  return false;
}

daemon::SendResult ReplayPort::send(const can::CanFrame& frame) noexcept {
  return send_on(0, frame);
}

daemon::SendResult ReplayPort::send_on(std::uint8_t bus, const can::CanFrame& frame) noexcept {
  if (receiver_) receiver_(now_, frame, bus);
  remember(bus, frame);
  if (echo_count_ < kEchoes) echoes_[echo_count_++] = {frame, bus};
  return daemon::SendResult::kSent;
}

}  // namespace beltgrip::ports
