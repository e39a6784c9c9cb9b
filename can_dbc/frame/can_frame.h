// One CAN frame as a plain value: classic, FD, remote or error. No I/O, no clock, any thread.
#pragma once

#include <array>
#include <compare>
#include <cstddef>
#include <cstdint>
#include <span>

namespace beltgrip::can {

inline constexpr std::size_t kMaxPayload = 64;
inline constexpr std::int64_t kSecond_ns = 1'000'000'000;  // of the instants of frames
inline constexpr std::uint32_t kStandardIdMax = 0x7FF;
inline constexpr std::uint32_t kExtendedIdMax = 0x1FFF'FFFF;

// Identifier without flag bits. Standard 0x123 and extended 0x123 are different identifiers.
struct CanId {
  std::uint32_t value = 0;
  bool extended = false;
  friend constexpr auto operator<=>(const CanId&, const CanId&) = default;
};

struct CanFrame {
  CanId id;                      // error frames: the error class bits, extended = false
  bool remote = false;           // classic only; length is then the DLC asked for and data is empty
  bool error = false;            // error frame (controller state), payload as in linux/can/error.h
  bool fd = false;               // CAN FD format
  bool bit_rate_switch = false;  // FD only
  bool error_state_indicator = false;            // FD only
  std::uint8_t length = 0;                       // payload bytes: 0..8 classic, 0..64 FD
  std::array<std::uint8_t, kMaxPayload> data{};  // bytes past length are zero

  std::span<const std::uint8_t> payload() const noexcept {
    return {data.data(), remote ? std::size_t{0} : length};
  }
  friend bool operator==(const CanFrame&, const CanFrame&) = default;
};

// A frame with the instant it was seen. t_ns counts from the origin of whatever clock or log it
// came from; it never mixes with another origin.
struct StampedFrame {
  std::int64_t t_ns = 0;
  CanFrame frame;
  std::uint8_t bus = 0;  // where there are several, in whatever order their owner has them
};

}  // namespace beltgrip::can
