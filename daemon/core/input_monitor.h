// The inputs: one row for each role, filled from frames and aged with time. A frame that is bad in
// any way changes what is known of validity, never a value. Fixed memory after construction; a
// frame costs one table look-up, whatever its identifier. Real-time thread.
//
// A frame is taken when its kind (standard or extended, classic or FD, data) and its length are
// those of the DBC. A value is taken when its multiplexer selects it, it is finite, and inside the
// DBC's range; all bits one in a signal without a range counts as "not available". What is not
// taken is as if it had not come: the row grows stale.
#pragma once

#include <array>
#include <cstdint>
#include <limits>
#include <optional>

#include "daemon/core/config.h"
#include "daemon/core/faults.h"
#include "daemon/core/port.h"
#include "daemon/core/signal_history.h"

namespace beltgrip::daemon {

enum class SignalQuality : std::uint8_t {  // by severity
  kValid,
  kLearning,  // its period is not known yet
  kFrozen,    // a speed that stands still while the other moves
  kStale,
  kMissing,  // never seen
  kUnbound   // the configuration has no signal for the role
};

enum class FrameUse : std::uint8_t { kForeign, kTaken, kBad };

class InputMonitor {
 public:
  static constexpr Duration kStaleMinimum = 50 * kMillisecond;
  static constexpr std::size_t kLearnIntervals = 8;

  explicit InputMonitor(const Config& config);

  FrameUse on_frame(const RxFrame& frame, FaultSet& faults) noexcept;
  // Ages every row to t and raises the faults of the required ones. The first call starts the time
  // after which an input that never came counts as missing.
  void update(MonoTime t, FaultSet& faults) noexcept;

  SignalQuality quality(Role role) const noexcept { return row(role).quality; }
  bool is_bound(Role role) const noexcept { return row(role).binding != nullptr; }
  const SignalHistory& history(Role role) const noexcept { return row(role).history; }
  // Configured, from the DBC, or learned; nothing until then.
  std::optional<Duration> period(Role role) const noexcept { return row(role).period; }

  // The roles without which there is no sample.
  std::span<const Role> required() const noexcept { return {required_.data(), required_count_}; }
  bool all_valid() const noexcept;  // every required role
  bool any_lost() const noexcept;   // a required role stale or frozen

 private:
  struct Row {
    const RoleBinding* binding = nullptr;
    double minimum = 0.0, maximum = 0.0;  // of the physical value, with half a step to spare
    bool has_range = false;
    bool is_flag = false;  // 0 or 1
    SignalHistory history;
    SignalQuality quality = SignalQuality::kUnbound;
    std::optional<Duration> period;
    bool learns = false;
    std::array<Duration, kLearnIntervals> intervals{};
    std::size_t interval_count = 0;
  };
  // Since when a speed has stood still, and what the other was then.
  struct Motion {
    bool known = false;
    MonoTime since = 0;
    double value = 0.0;
    double other = 0.0;
  };
  struct Message {
    can::CanId id;
    bool fd = false;
    std::uint8_t length = 0;
    std::uint8_t row_count = 0;
    std::array<std::uint8_t, kRoleCount> rows{};
  };
  static constexpr std::uint8_t kNone = 0xFF;

  Row& row(Role role) noexcept { return rows_[static_cast<std::size_t>(role)]; }
  const Row& row(Role role) const noexcept { return rows_[static_cast<std::size_t>(role)]; }
  void bind(const RoleBinding& binding);
  const Message* message_of(can::CanId id) const noexcept;
  void take(Row& row, const RxFrame& frame, MonoTime t, FaultSet& faults) noexcept;
  void learn(Row& row, MonoTime t) noexcept;
  SignalQuality judge(const Row& row, MonoTime t) const noexcept;
  static bool is_frozen(Motion& motion, const Row& row, const Row& other, MonoTime t) noexcept;

  Config config_;  // the bindings' home
  std::array<Row, kRoleCount> rows_{};
  std::array<Message, kRoleCount> messages_{};
  std::uint8_t message_count_ = 0;
  std::array<std::uint8_t, can::kStandardIdMax + 1> standard_{};  // identifier -> message
  static constexpr std::size_t kHashSize = 64;                    // four times the messages
  std::array<std::uint8_t, kHashSize> extended_{};                // open addressing
  std::array<Role, kRoleCount> required_{};
  std::size_t required_count_ = 0;
  Motion primary_motion_, secondary_motion_;
  MonoTime newest_ = std::numeric_limits<MonoTime>::min();  // stamp of the newest frame taken
  std::optional<MonoTime> began_;
};

}  // namespace beltgrip::daemon
