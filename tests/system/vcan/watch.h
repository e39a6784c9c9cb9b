// What one daemon that asks for clamping force says on the bus, as another node sees it.
#pragma once

#include <functional>
#include <string>

#include "tests/system/vcan/published_frames.h"

namespace beltgrip::test {

inline constexpr std::int64_t kMs = 1'000'000;
// An experiment every 7 s; one that a busy machine spoils is followed by another.
inline constexpr Milliseconds kExperiments{60000};

struct Watch {
  PublishedFrames published{PublishedFrames::Control::kCommand};
  std::int64_t last_ns = 0;  // of any frame

  bool take(const ReceivedFrame& seen);
  // The last value on the bus; 0 before the first.
  double clamp(const char* signal) const { return last("BeltGripClamp", signal); }
  double estimate(const char* signal) const { return last("BeltGripEstimate", signal); }
  double status(const char* signal) const { return last("BeltGripStatus", signal); }
  bool asking() const { return clamp("RequestActive") == 1.0; }
  bool until(const BusSocket& bus, const std::function<bool(const Watch&)>& done,
             Milliseconds limit = kExperiments);
  // The bus's own time passes; the vehicle sends all the while.
  bool pass(const BusSocket& bus, std::int64_t for_ns);

 private:
  double last(const std::string& message, const char* signal) const;
};

bool asks(const Watch& watch);
bool has_value(const Watch& watch);
// The last frames of a request: this many inactive ones in a row.
std::size_t inactive_at_end(const Watch& watch);
// This many frames of a request that stands.
std::size_t active_at_end(const Watch& watch);

}  // namespace beltgrip::test
