// Which values a flag can have at all: one that is 0, or 1, at every raw value was set up wrongly.
// Start-up and tools only.
#pragma once

#include <cstdint>
#include <string>

#include "can_dbc/dbc/model.h"
#include "daemon/core/config/options/config.h"

namespace beltgrip::daemon {

struct FlagValues {
  bool zero = false, one = false;
};
// What the raw values of the signal that are in its range read as.
FlagValues flag_values(const RoleBinding& flag, const can::SignalDef& signal);

// What the bits of an integer signal hold, the ends included.
struct RawRange {
  std::int64_t low = 0, high = 0;
};
RawRange raw_range(const can::SignalDef& signal);
std::string raw_range_text(const can::SignalDef& signal);  // "0 to 3"

}  // namespace beltgrip::daemon
