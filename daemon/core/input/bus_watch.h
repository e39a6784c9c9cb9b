// How each bus is: its link as the port sees it, its controller as its error frames tell it.
// Real-time thread.
#pragma once

#include <array>
#include <cstdint>

#include "daemon/core/base/faults.h"
#include "daemon/core/base/port.h"

namespace beltgrip::daemon {

class BusWatch {
 public:
  void need(std::uint8_t bus) noexcept { buses_[bus].needed = true; }
  void on_error_frame(const RxFrame& frame) noexcept;
  // A frame of this bus that carries an input.
  void on_input(std::uint8_t bus, MonoTime t) noexcept;
  void on_link(std::uint8_t bus, BusState state) noexcept;
  void raise_faults(MonoTime t, FaultSet& faults) const noexcept;
  bool up(std::uint8_t bus) const noexcept { return buses_[bus].up(); }
  bool needed_up() const noexcept;
  // Under another configuration: what is needed stays this one's.
  void go_on_from(const BusWatch& before) noexcept;

 private:
  struct Bus {
    bool needed = false;                      // an experiment cannot go on without it
    BusState link = BusState::kActive;        // as the port sees it
    BusState controller = BusState::kActive;  // as error frames tell it
    MonoTime off_since = MonoTime::origin();  // with kOff
    bool up() const noexcept {
      return link != BusState::kDown && link != BusState::kAbsent && link != BusState::kOff &&
             controller != BusState::kOff;
    }
  };
  std::array<Bus, kBusMax> buses_;
};

}  // namespace beltgrip::daemon
