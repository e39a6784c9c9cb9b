// What is known of one channel's reading: one form for all who judge one, the daemon of what
// arrives on the bus, a method of its samples. It is the only thing that says of trust what is
// passed on. Plain data; real-time thread.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <string_view>

namespace beltgrip::estimator {

enum class ReadingVerdict : std::uint8_t {  // by severity
  kValid,
  kLearning,    // its period is not known yet
  kStepped,     // it has gone to another level by itself
  kNeverMoved,  // one value since the beginning: doubtful where other channels move
  kFrozen,      // it stands still where a live one would have moved
  kStale,
  kMissing,  // never seen
  kUnbound   // the configuration has no signal for the role
};
inline constexpr std::array<std::string_view, 8> kReadingVerdicts{
    "valid", "learning", "stepped", "never_moved", "frozen", "stale", "missing", "unbound"};

struct ReadingStatus {
  static constexpr double kUnknown = std::numeric_limits<double>::quiet_NaN();

  ReadingVerdict verdict = ReadingVerdict::kUnbound;
  std::int64_t since_ns = 0;   // it is so; on the clock of the samples
  double value = 0.0;          // the newest, left out or not; SI, as the two that follow
  double expected = kUnknown;  // by the values before it
  double variance = kUnknown;  // of the difference
  // The difference in what is still taken: above 1 the value is left out. No number: not tested.
  double test_ratio = kUnknown;
};

constexpr bool is_doubtful(ReadingVerdict verdict) noexcept {
  return verdict != ReadingVerdict::kValid && verdict != ReadingVerdict::kUnbound;
}
inline std::string_view verdict_text(ReadingVerdict verdict) {
  return kReadingVerdicts.at(static_cast<std::size_t>(verdict));
}

// The channels that a method reads.
enum class Channel : std::uint8_t { kPrimarySpeed, kSecondarySpeed, kSecondaryPressure, kTorque };
inline constexpr std::array<std::string_view, 4> kChannels{"primary_speed", "secondary_speed",
                                                           "secondary_pressure", "torque"};
using ReadingStatuses = std::array<ReadingStatus, kChannels.size()>;  // by Channel

}  // namespace beltgrip::estimator
