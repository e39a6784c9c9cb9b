// The one seam to the world: waiting, time passing, frames arriving and leaving. SocketCAN, the
// embedded bus, replay and simulation implement it; everything above is the same object code.
// Real-time thread.
#pragma once

#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>

#include "can_dbc/frame/can_frame.h"
#include "daemon/core/base/mono_time.h"

namespace beltgrip::daemon {

// Bus 0 is [bus] of the configuration, where BeltGrip's own frames go; 1 is the further one.
inline constexpr std::size_t kBusMax = 2;

struct RxFrame {
  MonoTime t = MonoTime::origin();  // arrival, monotonic; never later than now()
  can::CanFrame frame;
  bool own_echo = false;             // our own frame, confirmed as sent (a log's port leaves our
                                     // identifiers out: elsewhere they mean a foreign sender)
  std::uint32_t dropped_before = 0;  // frames the kernel lost since the previous RxFrame
  std::uint8_t bus = 0;              // that it came from, < kBusMax
};

// Frames that are wanted: those of one identifier, or of its J1939 parameter group, or all.
struct WantedFrames {
  can::CanId id;
  bool by_group = false;
  std::uint8_t bus = 0;
  bool every = false;
};

enum class Wake : std::uint8_t {
  kDeadline,  // the deadline has come
  kFrames,    // receive() has frames
  kClosed     // the end: stop requested, end of the log; nothing more will come
};

enum class SendResult : std::uint8_t { kSent, kFull, kDown, kFailed };
enum class BusState : std::uint8_t { kActive, kWarning, kPassive, kOff, kDown, kAbsent };

class Port {
 public:
  virtual ~Port() = default;
  virtual MonoTime now() noexcept = 0;
  // Returns at the deadline or earlier. Frames due before the deadline are offered first.
  virtual Wake wait_until(MonoTime deadline) noexcept = 0;
  // Takes at most out.size() frames of all buses, in order of arrival; 0 when there are none.
  virtual std::size_t receive(std::span<RxFrame> out) noexcept = 0;
  virtual SendResult send(const can::CanFrame& frame) noexcept = 0;  // on bus 0
  virtual BusState bus_state() noexcept = 0;                         // of bus 0
  // The same for any bus. A port with one bus has no other.
  virtual SendResult send_on(std::uint8_t bus, const can::CanFrame& frame) noexcept {
    return bus == 0 ? send(frame) : SendResult::kDown;
  }
  virtual BusState bus_state_of(std::uint8_t bus) noexcept {
    return bus == 0 ? bus_state() : BusState::kAbsent;
  }
  // Nothing comes before this instant, and nobody hears what is sent until then (the gap of a log):
  // the loop may leave out samples that change nothing. In the past: not known.
  virtual MonoTime silent_until() noexcept { return MonoTime::min(); }
  // From now on these are wanted; a port that hands over every frame need not know.
  virtual void select(std::span<const WantedFrames>) noexcept {}
};

}  // namespace beltgrip::daemon
