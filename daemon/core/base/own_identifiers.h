// Which identifiers are the daemon's own, and whether it may ask for a clamp force: plain numbers
// that the gate judges by and everything else reads from the same place.
#pragma once

#include <cstdint>

namespace beltgrip::daemon {

enum class Control : std::uint8_t { kObserve, kCommand };

struct FrameIdentifiers {  // standard 11 bit
  std::uint32_t estimate = 0x6A0, slip = 0x6A1, clamp = 0x6A2, status = 0x6A3;
};

}  // namespace beltgrip::daemon
