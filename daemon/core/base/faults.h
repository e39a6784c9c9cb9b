// What can be wrong, one bit each: the one-bit signals named Fault... of BeltGripStatus, in the
// order of their bits. Pure, no clock. Real-time thread.
#pragma once

#include <array>
#include <cstdint>
#include <string_view>

#include "daemon/core/base/mono_time.h"
#include "daemon/core/base/named.h"

namespace beltgrip::daemon {

enum class Fault : std::uint8_t {
  kInputMissing,    // a required signal has never come
  kInputStale,      // a required signal came and has stopped
  kInputFrozen,     // a value that stays for longer than a live one could, or an impossible course
  kInputRange,      // outside the DBC's range, the code for "not available", or a spike
  kInputNotFinite,  // NaN or infinite
  kInputFrame,      // a frame of wrong length or kind
  kTimeStamp,       // a stamp went backwards
  kFramesLost,      // the kernel dropped received frames
  kSampleLate,      // a sample was processed late
  kBusPassive,
  kBusOff,
  kBusDown,        // interface down or gone
  kForeignSender,  // another node sends with one of our identifiers
  kSendFailed,
  kFrameRefused,      // by the transmit gate; latched
  kResultDoubtful,    // the last result contradicts the ones before it, or itself
  kHistoryUnwritten,  // the history of experiments cannot be read or written as it should
  kInputRate,         // an input message comes too often or too seldom
  kInputProtection,   // wrong counter or CRC of an input message
  kClampStuck  // the clamping force did not come back after a request; latched where it stays
               // at what was asked, else until it does
};
// Bits 24 to 43 of BeltGripStatus; the gate refuses a status frame with a bit beyond
// (guard/tx_gate).
inline constexpr std::size_t kFaultCount = 20;  // of the enumeration above

// Signal names are "Fault" followed by these.
inline constexpr std::array<Named<Fault>, kFaultCount> kFaults{
    {{Fault::kInputMissing, "InputMissing"},
     {Fault::kInputStale, "InputStale"},
     {Fault::kInputFrozen, "InputFrozen"},
     {Fault::kInputRange, "InputRange"},
     {Fault::kInputNotFinite, "InputNotFinite"},
     {Fault::kInputFrame, "InputFrame"},
     {Fault::kTimeStamp, "TimeStamp"},
     {Fault::kFramesLost, "FramesLost"},
     {Fault::kSampleLate, "SampleLate"},
     {Fault::kBusPassive, "BusPassive"},
     {Fault::kBusOff, "BusOff"},
     {Fault::kBusDown, "BusDown"},
     {Fault::kForeignSender, "ForeignSender"},
     {Fault::kSendFailed, "SendFailed"},
     {Fault::kFrameRefused, "FrameRefused"},
     {Fault::kResultDoubtful, "ResultDoubtful"},
     {Fault::kHistoryUnwritten, "HistoryUnwritten"},
     {Fault::kInputRate, "InputRate"},
     {Fault::kInputProtection, "InputProtection"},
     {Fault::kClampStuck, "ClampStuck"}}};
static_assert(in_wire_order(kFaults));

constexpr std::uint32_t fault_bit(Fault fault) {
  return std::uint32_t{1} << static_cast<unsigned>(fault);
}

// The set as published. A fault shows at once and for at least kHold after it was last seen, so
// that a condition that flickers changes the status at most twice a second. A foreign sender shows
// for kForeignHold, ten periods of its slowest frame: then it is gone, not between two frames.
class FaultSet {
 public:
  static constexpr Duration kHold = kSecond;
  static constexpr Duration kForeignHold = 10 * kSecond;

  void raise(Fault fault, MonoTime t) noexcept {
    const Duration hold = fault == Fault::kForeignSender ? kForeignHold : kHold;
    until_[static_cast<std::size_t>(fault)] = t + hold;
    bits_ |= fault_bit(fault);
  }
  void latch(Fault fault) noexcept { latched_ |= fault_bit(fault); }
  // Forgets what is older than the hold time.
  void expire(MonoTime t) noexcept {
    for (std::size_t i = 0; i < kFaultCount; ++i) {
      if (t >= until_[i]) bits_ &= ~(std::uint32_t{1} << i);
    }
  }
  std::uint32_t bits() const noexcept { return bits_ | latched_; }
  bool has(Fault fault) const noexcept { return (bits() & fault_bit(fault)) != 0; }

 private:
  std::array<MonoTime, kFaultCount> until_{};
  std::uint32_t bits_ = 0;
  std::uint32_t latched_ = 0;
};

}  // namespace beltgrip::daemon
