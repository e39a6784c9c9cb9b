// What several formats say of a frame in the same bits.
#pragma once

#include <cstdint>

namespace beltgrip::can {

inline constexpr std::uint32_t kExtendedFlag = 0x8000'0000;  // beside an identifier
inline constexpr std::uint32_t kErrorFlag = 0x2000'0000;     // the same
// An error frame that says no more than that there was one: class bits as in linux/can/error.h.
inline constexpr std::uint32_t kBusError = 0x80;
inline constexpr std::uint8_t kErrorLength = 8;

}  // namespace beltgrip::can
