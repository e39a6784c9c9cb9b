#include "tools/sim/vehicle_port.h"

#include <algorithm>
#include <cmath>

#include "can_dbc/frame/e2e.h"
#include "tools/sim/configuration.h"

namespace beltgrip::sim {

namespace {
constexpr std::int64_t kFrame_ns = 260'000;    // 8 bytes at 500 kbit/s, with stuffing
constexpr double kArbitration_ns = 500'000.0;  // waits up to two other frames
constexpr std::int64_t kForeignPeriod_ns = 10'000'000;
constexpr std::uint32_t kFloodIdentifier = 0x050;
constexpr std::int64_t kFlood_ns = 10'000'000;
// Error frames as in linux/can/error.h.
constexpr std::uint32_t kErrorController = 0x04;
constexpr std::uint32_t kErrorBusOff = 0x40;
constexpr std::uint32_t kErrorRestarted = 0x100;
constexpr std::uint8_t kTxPassive = 0x20;
constexpr std::uint8_t kActive = 0x40;
}  // namespace

VehiclePort::VehiclePort(const VehicleScenario& scenario, std::uint64_t seed, Observers observers)
    : vehicle_(scenario, seed),
      bus_(vehicle_database(), kVehicleBus, scenario, seed),
      observers_(std::move(observers)),
      transmission_(seed, "transmission") {}

const FaultStep* VehiclePort::active(FaultKind kind) const {
  return vehicle_.faults().active(kind, static_cast<double>(now_ns_) * 1e-9);
}

void VehiclePort::arrive(std::int64_t t_ns, const can::CanFrame& frame, bool own) {
  Arrival arrival{t_ns, order_++, {}};
  arrival.frame.t = daemon::MonoTime::of_ns(t_ns);
  arrival.frame.frame = frame;
  arrival.frame.own_echo = own;
  arrivals_.push_back(arrival);
  std::push_heap(arrivals_.begin(), arrivals_.end(), std::greater<>{});
}

void VehiclePort::report_bus_errors(double t_s) {
  const auto error = [this](std::uint32_t error_class, std::uint8_t detail) {
    can::CanFrame frame;
    frame.id = {error_class, false};
    frame.error = true;
    frame.length = 8;
    frame.data[1] = detail;
    arrive(vehicle_.now_ns() + kFrame_ns, frame, false);
  };
  const bool off = vehicle_.faults().active(FaultKind::kBusOff, t_s) != nullptr;
  const bool passive = vehicle_.faults().active(FaultKind::kBusPassive, t_s) != nullptr;
  if (off && !was_off_) error(kErrorBusOff, 0);
  if (!off && was_off_) error(kErrorRestarted, 0);
  if (passive && !was_passive_) error(kErrorController, kTxPassive);
  if (!passive && was_passive_) error(kErrorController, kActive);
  was_off_ = off;
  was_passive_ = passive;
}

void VehiclePort::send_foreign(double size) {
  next_foreign_ns_ = vehicle_.now_ns() + kForeignPeriod_ns;
  const auto force = static_cast<std::uint16_t>(size);
  can::CanFrame frame;
  frame.id = {kClampIdentifier, false};
  frame.length = 8;
  frame.data[2] = force > 0 ? 1 : 0;
  frame.data[3] = static_cast<std::uint8_t>(force & 0xFF);
  frame.data[4] = static_cast<std::uint8_t>(force >> 8);
  can::e2e::protect(frame, kClampIdentifier, foreign_counter_);
  foreign_counter_ = can::e2e::next_counter(foreign_counter_);
  fresh_.push_back({vehicle_.now_ns() + kFrame_ns, frame});
  vehicle_.deliver(frame, vehicle_.now_ns() + kFrame_ns);
}

void VehiclePort::flood(double t_s) {
  const FaultStep* fault = vehicle_.faults().active(FaultKind::kFrameFlood, t_s);
  if (fault != nullptr && !was_flooded_) {
    can::CanFrame frame;
    frame.id = {kFloodIdentifier, false};
    const auto count = static_cast<std::int64_t>(fault->size);
    for (std::int64_t i = 0; i < count; ++i) {
      arrive(vehicle_.now_ns() + i * kFlood_ns / count, frame, false);
    }
  }
  was_flooded_ = fault != nullptr;
}

void VehiclePort::advance(std::int64_t t_ns, bool stop_at_frame) {
  const auto due = [this] { return arrivals_.empty() ? INT64_MAX : arrivals_.front().t_ns; };
  while (!vehicle_.finished() && vehicle_.finite()) {
    if (!stop_at_frame && ended()) break;
    if (stop_at_frame && due() <= vehicle_.now_ns()) break;
    if (vehicle_.now_ns() >= t_ns) break;
    vehicle_.step();
    if (observers_.on_step) observers_.on_step(vehicle_);
    fresh_.clear();
    bus_.sample(vehicle_, fresh_);
    const double t_s = static_cast<double>(vehicle_.now_ns()) * 1e-9;
    if (const FaultStep* fault = vehicle_.faults().active(FaultKind::kForeignFrames, t_s)) {
      if (vehicle_.now_ns() >= next_foreign_ns_) send_foreign(fault->size);
    }
    flood(t_s);
    report_bus_errors(t_s);
    const bool deaf = vehicle_.faults().active(FaultKind::kBusOff, t_s) != nullptr ||
                      vehicle_.faults().active(FaultKind::kBusDown, t_s) != nullptr;
    for (const can::StampedFrame& frame : fresh_) {
      if (!deaf) arrive(frame.t_ns, frame.frame, false);
    }
  }
}

daemon::Wake VehiclePort::wait_until(daemon::MonoTime deadline) noexcept {
  if (daemon_is_dead() || ended()) return daemon::Wake::kClosed;
  const std::int64_t deadline_ns = deadline.ns();
  std::int64_t until_ns = deadline_ns;
  if (const FaultStep* fault = active(FaultKind::kLoopLate)) {
    until_ns = std::max<std::int64_t>(until_ns, deadline_ns + std::llround(fault->size * 1e9));
  }
  const bool late = until_ns > deadline_ns;
  advance(until_ns, !late);
  if (vehicle_.finished() || !vehicle_.finite()) return daemon::Wake::kClosed;
  if (late) {
    now_ns_ = until_ns;
    return daemon::Wake::kDeadline;
  }
  if (!arrivals_.empty() && arrivals_.front().t_ns <= std::min(deadline_ns, vehicle_.now_ns())) {
    now_ns_ = std::max(now_ns_, arrivals_.front().t_ns);
    return daemon::Wake::kFrames;
  }
  now_ns_ = std::max(now_ns_, deadline_ns);
  return daemon::Wake::kDeadline;
}

std::size_t VehiclePort::receive(std::span<daemon::RxFrame> out) noexcept {
  std::size_t count = 0;
  while (count < out.size() && !arrivals_.empty() && arrivals_.front().t_ns <= now_ns_) {
    if (observers_.on_received) observers_.on_received(arrivals_.front().frame);
    out[count] = arrivals_.front().frame;
    if (const FaultStep* fault = active(FaultKind::kStampBack)) {
      out[count].t -= daemon::Duration::of_ns(std::llround(fault->size * 1e9));
    }
    ++count;
    std::pop_heap(arrivals_.begin(), arrivals_.end(), std::greater<>{});
    arrivals_.pop_back();
  }
  return count;
}

daemon::SendResult VehiclePort::send(const can::CanFrame& frame) noexcept {
  if (daemon_is_dead()) return daemon::SendResult::kSent;
  const bool down = active(FaultKind::kBusDown) != nullptr;
  if (down || active(FaultKind::kBusOff) != nullptr || active(FaultKind::kSendFull) != nullptr) {
    if (observers_.on_unsent) observers_.on_unsent();
    return down ? daemon::SendResult::kDown : daemon::SendResult::kFull;
  }
  // Frames of one node leave one after the other.
  const std::int64_t start = std::max(now_ns_, sent_until_ns_) +
                             static_cast<std::int64_t>(kArbitration_ns * transmission_.uniform());
  sent_until_ns_ = start + kFrame_ns;
  if (observers_.on_sent) observers_.on_sent(sent_until_ns_, frame);
  if (active(FaultKind::kSendLost) != nullptr) return daemon::SendResult::kSent;
  std::int64_t delay_ns = 0;
  if (const FaultStep* fault = active(FaultKind::kTcuDelays)) {
    delay_ns = std::llround(fault->size * 1e9);
  }
  vehicle_.deliver(frame, sent_until_ns_ + delay_ns);
  if (active(FaultKind::kEchoLost) == nullptr) arrive(sent_until_ns_, frame, true);
  return daemon::SendResult::kSent;
}

daemon::BusState VehiclePort::bus_state() noexcept {
  return active(FaultKind::kBusDown) != nullptr ? daemon::BusState::kDown
                                                : daemon::BusState::kActive;
}

void VehiclePort::run_alone() { advance(INT64_MAX, false); }

}  // namespace beltgrip::sim
