// Whether a frame is one of those that are wanted, without looking through them all. Tools only.
#pragma once

#include <algorithm>
#include <cstdint>
#include <span>
#include <vector>

#include "can_dbc/dbc/message_index.h"
#include "can_dbc/frame/can_frame.h"
#include "daemon/core/base/port.h"

namespace beltgrip::ports {

class WantedSet {
 public:
  // None: every frame is wanted.
  explicit WantedSet(std::span<const daemon::WantedFrames> wanted)
      : every_(wanted.empty()), standard_(can::kStandardIdMax + 1) {
    for (const daemon::WantedFrames& each : wanted) {
      every_ = every_ || each.every;
      if (each.id.extended) {
        extended_.push_back(each);
      } else if (each.id.value <= can::kStandardIdMax) {
        standard_[each.id.value] |= bit(each.bus);
      }
    }
  }

  bool has(const can::CanFrame& frame, std::uint8_t bus) const {
    // What a controller says of the bus counts whatever its identifier.
    if (every_ || frame.error) return true;
    if (!frame.id.extended) {
      return frame.id.value > can::kStandardIdMax || (standard_[frame.id.value] & bit(bus)) != 0;
    }
    return std::any_of(extended_.begin(), extended_.end(), [&](const auto& each) {
      return each.bus == bus && can::is_of_message(frame.id, each.id, each.by_group);
    });
  }

 private:
  static std::uint8_t bit(std::uint8_t bus) { return static_cast<std::uint8_t>(1U << (bus % 8)); }

  bool every_;
  std::vector<std::uint8_t> standard_;  // of each 11-bit identifier the buses it is wanted from
  std::vector<daemon::WantedFrames> extended_;
};

}  // namespace beltgrip::ports
