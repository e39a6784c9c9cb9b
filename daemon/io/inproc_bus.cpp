#include "daemon/io/inproc_bus.h"

#include <algorithm>
#include <chrono>
#include <map>

namespace beltgrip::daemon {

namespace {
using SteadyClock = std::chrono::steady_clock;
constexpr std::size_t kRingSize = 4096;

MonoTime steady_now() {
  return MonoTime::of_ns(SteadyClock::now().time_since_epoch() / std::chrono::nanoseconds(1));
}
}  // namespace

struct InprocBus::Slot {
  std::vector<RxFrame> ring = std::vector<RxFrame>(kRingSize);
  std::size_t first = 0;
  std::size_t count = 0;
  std::uint32_t dropped = 0;
  bool waiting = false;
  bool granted = false;  // virtual time: may run
  MonoTime deadline = MonoTime::origin();
  std::condition_variable wake;

  void put(const can::CanFrame& frame, MonoTime t, bool own) noexcept {
    if (count == ring.size()) {
      ++dropped;
      return;
    }
    RxFrame& entry = ring[(first + count++) % ring.size()];
    entry = {};
    entry.t = t;
    entry.frame = frame;
    entry.own_echo = own;
    entry.dropped_before = dropped;
    dropped = 0;
  }
};

class InprocBus::InprocPort final : public Port {
 public:
  InprocPort(std::shared_ptr<InprocBus> bus, Slot& slot) : bus_(std::move(bus)), slot_(slot) {}
  ~InprocPort() override {
    const std::lock_guard lock(bus_->mutex_);
    if (bus_->running_ == &slot_) bus_->running_ = nullptr;
    for (auto& each : bus_->slots_) {
      if (each.get() == &slot_) each.reset();
    }
    bus_->schedule();
  }

  MonoTime now() noexcept override {
    if (bus_->clock_ == Clock::kMonotonic) return steady_now();
    const std::lock_guard lock(bus_->mutex_);
    return bus_->virtual_now_;
  }

  Wake wait_until(MonoTime deadline) noexcept override {
    std::unique_lock lock(bus_->mutex_);
    const auto outcome = [&] {
      return slot_.count != 0 ? Wake::kFrames : bus_->closed_ ? Wake::kClosed : Wake::kDeadline;
    };
    if (slot_.count != 0 || bus_->closed_ || deadline <= bus_->time_now()) return outcome();
    if (bus_->clock_ == Clock::kMonotonic) {
      const auto ready = [&] { return slot_.count != 0 || bus_->closed_; };
      if (deadline == kNever) {
        slot_.wake.wait(lock, ready);
      } else {
        slot_.wake.wait_until(
            lock, SteadyClock::time_point(std::chrono::nanoseconds(deadline.ns())), ready);
      }
      return outcome();
    }
    slot_.waiting = true;
    slot_.deadline = deadline;
    if (bus_->running_ == &slot_) bus_->running_ = nullptr;
    bus_->schedule();
    slot_.wake.wait(lock, [&] { return slot_.granted; });
    slot_.granted = false;
    slot_.waiting = false;
    return outcome();
  }

  std::size_t receive(std::span<RxFrame> out) noexcept override {
    const std::lock_guard lock(bus_->mutex_);
    const std::size_t count = std::min(out.size(), slot_.count);
    for (std::size_t i = 0; i < count; ++i) {
      out[i] = slot_.ring[(slot_.first + i) % slot_.ring.size()];
    }
    slot_.first = (slot_.first + count) % slot_.ring.size();
    slot_.count -= count;
    return count;
  }

  SendResult send(const can::CanFrame& frame) noexcept override {
    const std::lock_guard lock(bus_->mutex_);
    if (bus_->closed_) return SendResult::kDown;
    const MonoTime t = bus_->time_now();
    for (auto& each : bus_->slots_) {
      if (each == nullptr) continue;
      each->put(frame, t, each.get() == &slot_);
      if (bus_->clock_ == Clock::kMonotonic) each->wake.notify_one();
    }
    return SendResult::kSent;
  }

  BusState bus_state() noexcept override {
    const std::lock_guard lock(bus_->mutex_);
    return bus_->closed_ ? BusState::kDown : BusState::kActive;
  }

 private:
  std::shared_ptr<InprocBus> bus_;
  Slot& slot_;
};

InprocBus::InprocBus(Clock clock) : clock_(clock) {}
InprocBus::~InprocBus() = default;

std::shared_ptr<InprocBus> InprocBus::create(Clock clock) {
  return std::shared_ptr<InprocBus>(new InprocBus(clock));
}

std::shared_ptr<InprocBus> InprocBus::named(const std::string& name) {
  static std::mutex mutex;
  static std::map<std::string, std::weak_ptr<InprocBus>> buses;
  const std::lock_guard lock(mutex);
  std::shared_ptr<InprocBus> bus = buses[name].lock();
  if (bus == nullptr) {
    bus = create(Clock::kMonotonic);
    buses[name] = bus;
  }
  return bus;
}

MonoTime InprocBus::time_now() const {
  return clock_ == Clock::kMonotonic ? steady_now() : virtual_now_;
}

std::unique_ptr<Port> InprocBus::connect() {
  const std::lock_guard lock(mutex_);
  slots_.push_back(std::make_unique<Slot>());
  return std::make_unique<InprocPort>(shared_from_this(), *slots_.back());
}

void InprocBus::close() {
  const std::lock_guard lock(mutex_);
  closed_ = true;
  for (auto& each : slots_) {
    if (each != nullptr && clock_ == Clock::kMonotonic) each->wake.notify_one();
  }
  schedule();
}

void InprocBus::schedule() {
  if (clock_ == Clock::kMonotonic || running_ != nullptr) return;
  Slot* with_frames = nullptr;
  Slot* earliest = nullptr;
  for (auto& each : slots_) {
    if (each == nullptr) continue;
    if (!each->waiting) return;  // it has not come to its wait yet
    if (each->count != 0) with_frames = each.get();
    if (earliest == nullptr || each->deadline <= earliest->deadline) earliest = each.get();
  }
  if (earliest == nullptr) return;
  running_ = with_frames != nullptr ? with_frames : earliest;
  if (with_frames == nullptr && !closed_) {
    if (earliest->deadline == kNever) {
      closed_ = true;  // everybody waits for a frame that nobody will send
    } else {
      virtual_now_ = std::max(virtual_now_, earliest->deadline);
    }
  }
  running_->granted = true;
  running_->wake.notify_one();
}

}  // namespace beltgrip::daemon
