// Instants and durations of one monotonic time line: int64 nanoseconds. Which clock it is, the Port
// says.
#pragma once

#include <cstdint>

namespace beltgrip::daemon {

using MonoTime = std::int64_t;  // ns since the Port's origin
using Duration = std::int64_t;  // ns

inline constexpr Duration kMillisecond = 1'000'000;
inline constexpr Duration kSecond = 1'000'000'000;

constexpr double seconds(Duration duration) noexcept {
  return static_cast<double>(duration) / double{kSecond};
}

}  // namespace beltgrip::daemon
