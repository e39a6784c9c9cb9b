// ISO-TP (ISO 15765-2:2016), normal addressing (11 or 29 bit, also normal fixed): messages out of
// single, first and consecutive frames on classic CAN and CAN FD, and the frames that a receiver
// sends, on classic CAN. Not here: extended and mixed addressing, sending of more than a single
// frame. Fixed memory, no clock, no I/O; any thread, also the real-time one.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

#include "can_dbc/frame/can_frame.h"

namespace beltgrip::can {

inline constexpr std::size_t kIsoTpMax = 4095;  // bytes that the 12 bits of a first frame can say
inline constexpr std::int64_t kIsoTpFrameTimeout_ns = 1'000'000'000;  // N_Cr
inline constexpr std::uint8_t kIsoTpPadding = 0xCC;  // what the standard fills frames up with

// Puts one sender's frames together. What is no frame of the protocol is ignored, as the standard
// has it: a first frame whose message would fit in one, or that is not full, a single frame that
// says more than it holds, an unknown kind. A new single or first frame ends what was being
// received.
class IsoTpReceiver {
 public:
  enum class Event : std::uint8_t {
    kIgnored,
    kMessage,    // complete: message()
    kFirst,      // of several: its sender waits for a flow control "continue"
    kTooLong,    // of more than kIsoTpMax: its sender waits for "overflow"
    kContinued,  // one of several, more to come
    kBroken      // a wrong sequence number, or too late: what had come is dropped
  };

  // t_ns: any clock that does not step, the same for all calls.
  Event on_frame(std::int64_t t_ns, const CanFrame& frame) noexcept;
  // True when the frame that is due has not come in time: what had come is dropped.
  bool expire(std::int64_t t_ns) noexcept;
  void reset() noexcept { receiving_ = false; }

  bool receiving() const noexcept { return receiving_; }
  // Of the last kMessage, until the next frame; after kFirst the bytes that have come.
  std::span<const std::uint8_t> message() const noexcept { return {bytes_.data(), size_}; }
  std::int64_t first_ns() const noexcept { return first_ns_; }  // of its single or first frame

 private:
  Event on_single(std::int64_t t_ns, std::span<const std::uint8_t> payload) noexcept;
  Event on_first(std::int64_t t_ns, std::span<const std::uint8_t> payload) noexcept;
  Event on_consecutive(std::int64_t t_ns, std::span<const std::uint8_t> payload) noexcept;
  void take(std::span<const std::uint8_t> bytes) noexcept;

  std::array<std::uint8_t, kIsoTpMax> bytes_{};
  std::size_t size_ = 0;    // that have come
  std::size_t length_ = 0;  // of the message
  std::int64_t first_ns_ = 0;
  std::int64_t last_ns_ = 0;
  std::uint8_t sequence_ = 0;    // of the consecutive frame that is due
  std::size_t frame_bytes_ = 0;  // of the first frame, and of all but the last
  bool receiving_ = false;
};

// At most 7 bytes in a single frame, filled up to 8.
CanFrame iso_tp_single(CanId id, std::span<const std::uint8_t> payload) noexcept;

enum class FlowStatus : std::uint8_t { kContinue = 0, kWait = 1, kOverflow = 2 };
// "Continue" asks for all that is left without a pause (block size 0, separation time 0).
CanFrame iso_tp_flow_control(CanId id, FlowStatus status) noexcept;

}  // namespace beltgrip::can
