#include "daemon/core/input/bus_watch.h"

#include <algorithm>
#include <optional>

#include "daemon/core/base/bus_error.h"

namespace beltgrip::daemon {

namespace {
constexpr Duration kStillComing = 50 * kMillisecond;
}  // namespace

void BusWatch::on_error_frame(const RxFrame& frame) noexcept {
  Bus& bus = buses_[frame.bus];
  const std::optional<BusState> state = bus_state_of(frame.frame);
  if (state) bus.controller = *state;
  if (state == BusState::kOff) bus.off_since = frame.t;
}

// A controller that is off the bus hears nothing: it has come back. What it had heard before may
// still be on its way.
void BusWatch::on_input(std::uint8_t bus, MonoTime t) noexcept {
  Bus& each = buses_[bus];
  if (each.controller == BusState::kOff && t - each.off_since > kStillComing) {
    each.controller = BusState::kActive;
  }
}

void BusWatch::on_link(std::uint8_t bus, BusState state) noexcept {
  Bus& each = buses_[bus];
  // A link that comes up again begins with a fresh controller.
  if (state == BusState::kActive && each.link != BusState::kActive) {
    each.controller = BusState::kActive;
  }
  each.link = state;
}

void BusWatch::raise_faults(MonoTime t, FaultSet& faults) const noexcept {
  for (const Bus& bus : buses_) {
    if (bus.link == BusState::kDown || bus.link == BusState::kAbsent) {
      faults.raise(Fault::kBusDown, t);
    }
    if (bus.controller == BusState::kOff) faults.raise(Fault::kBusOff, t);
    if (bus.controller == BusState::kPassive) faults.raise(Fault::kBusPassive, t);
  }
}

bool BusWatch::needed_up() const noexcept {
  return std::all_of(buses_.begin(), buses_.end(),
                     [](const Bus& bus) { return !bus.needed || bus.up(); });
}

void BusWatch::go_on_from(const BusWatch& before) noexcept {
  for (std::size_t i = 0; i < buses_.size(); ++i) {
    const bool needed = buses_[i].needed;
    buses_[i] = before.buses_[i];
    buses_[i].needed = needed;
  }
}

}  // namespace beltgrip::daemon
