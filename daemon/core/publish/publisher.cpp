#include "daemon/core/publish/publisher.h"

#include <algorithm>

#include "can_dbc/frame/e2e.h"

namespace beltgrip::daemon {

namespace {
constexpr Duration kEstimatePeriod = 100 * kMillisecond;
constexpr Duration kSlipPeriod = 10 * kMillisecond;
constexpr Duration kSlipPeriodIdle = 100 * kMillisecond;
constexpr Duration kStatusPeriod = kSecond;
}  // namespace

Publisher::Publisher(const FrameIdentifiers& identifiers, Duration sample_period)
    : frames_(identifiers), tolerance_(sample_period / 2) {}

void Publisher::go_on_from(const Publisher& before) noexcept {
  schedules_ = before.schedules_;
  started_ = before.started_;
  last_stop_ = before.last_stop_;
  last_request_ = before.last_request_;
  last_status_ = before.last_status_;
}

bool Publisher::due(OwnMessage message, MonoTime t, Duration period, bool at_once) noexcept {
  Schedule& schedule = schedules_[static_cast<std::size_t>(message)];
  if (at_once) {
    schedule.next = t + period;
    return true;
  }
  schedule.next = std::min(schedule.next, t + period);  // the period has become shorter
  if (t < schedule.next - tolerance_) return false;
  schedule.next += period;
  if (schedule.next <= t) schedule.next = t + period;  // samples were missed: no catching up
  return true;
}

std::uint8_t Publisher::take_counter(OwnMessage message) noexcept {
  std::uint8_t& counter = schedules_[static_cast<std::size_t>(message)].counter;
  const std::uint8_t taken = counter;
  counter = can::e2e::next_counter(counter);
  return taken;
}

void Publisher::collect_clamp(MonoTime t, const ClampValues& clamp, Outbox& outbox) noexcept {
  const bool changed = clamp.request_active != last_request_;
  last_request_ = clamp.request_active;
  if (changed) inactive_left_ = limits::kInactiveFrames;
  if (!clamp.request_active && inactive_left_ == 0) return;
  if (!due(OwnMessage::kClamp, t, limits::kClampPeriod, changed)) return;
  if (!clamp.request_active) --inactive_left_;
  outbox.push(frames_.pack(clamp, take_counter(OwnMessage::kClamp)));
}

void Publisher::collect(MonoTime t, const Publication& now, Outbox& outbox) noexcept {
  const bool first = !started_;
  started_ = true;
  const bool stop_changed = now.slip.macro_slip_stop != last_stop_;
  last_stop_ = now.slip.macro_slip_stop;
  const bool status_changed = now.status != last_status_;
  last_status_ = now.status;

  // What acts on the clamp before everything else.
  if (now.command) collect_clamp(t, now.clamp, outbox);
  if (due(OwnMessage::kSlip, t, now.in_experiment ? kSlipPeriod : kSlipPeriodIdle,
          first || stop_changed)) {
    outbox.push(frames_.pack(now.slip, take_counter(OwnMessage::kSlip)));
  }
  if (due(OwnMessage::kStatus, t, kStatusPeriod, first || status_changed)) {
    outbox.push(frames_.pack(now.status, take_counter(OwnMessage::kStatus)));
  }
  if (due(OwnMessage::kEstimate, t, kEstimatePeriod, first || now.new_result)) {
    outbox.push(frames_.pack(now.estimate, take_counter(OwnMessage::kEstimate)));
  }
}

void Publisher::collect_all(MonoTime t, const Publication& now, Outbox& outbox) noexcept {
  started_ = false;
  Publication last = now;
  last.command = false;
  if (now.command) {
    for (int i = 0; i < limits::kInactiveFrames; ++i) {
      outbox.push(frames_.pack(ClampValues{}, take_counter(OwnMessage::kClamp)));
    }
    last_request_ = false;
    inactive_left_ = 0;
  }
  collect(t, last, outbox);
}

}  // namespace beltgrip::daemon
