// The inputs: one row for each role, filled from frames and aged with time. A frame that is bad in
// any way changes what is known of validity, never a value. Fixed memory after construction; a
// frame costs one table look-up, whatever its identifier. Real-time thread.
//
// A frame is taken when its kind (standard or extended, classic or FD, data) and its length are
// those of the DBC. A value is taken when its multiplexer selects it, it is finite, and inside the
// DBC's range; all bits one in a signal without a range counts as "not available". What is not
// taken is as if it had not come: the row grows stale. Not so a spike of a required signal
// (spike_gate.h): it is left out, but the signal is alive.
//
// Rate, counter and CRC of each message are judged by frame_guard.h; the rate where its period is
// configured or in the DBC, and neither the message is multiplexed nor several sources may send it.
//
// J1939 and NMEA 2000: a frame is a message's by its parameter group. Where several sources send
// one group, each row follows one of them: the source address of the DBC's identifier when values
// come from it, else the first source that gives a value, until the row has grown stale. On a
// change nothing of the former source stays in the history.
//
// A role from diagnostics takes the data of a positive answer as another takes a payload.
#pragma once

#include <array>
#include <bitset>
#include <cstdint>
#include <optional>

#include "daemon/core/base/faults.h"
#include "daemon/core/base/port.h"
#include "daemon/core/config/options/config.h"
#include "daemon/core/input/frame_guard.h"
#include "daemon/core/input/signal_history.h"
#include "daemon/core/input/spike_gate.h"
#include "daemon/core/input/stop_cause.h"
#include "daemon/core/input/uds_client.h"
#include "daemon/core/input/value_course.h"
#include "estimator/method/reading_status.h"

namespace beltgrip::daemon {

enum class FrameUse : std::uint8_t { kForeign, kTaken, kBad };

// Of a role's message, the best of them: of another length or kind than the DBC's, refused for
// counter or CRC, or such that its value was looked at.
enum class FramesCame : std::uint8_t { kNone, kOfOtherKind, kRefused, kTaken };

class InputMonitor {
 public:
  // Silence after which a signal of this period is stale: two and a half periods, and no less than
  // what a busy bus may take.
  static constexpr Duration stale_after(Duration period) noexcept {
    constexpr Duration kLeast = 50 * kMillisecond;
    return std::max(kLeast, period * 5 / 2);
  }
  static constexpr std::size_t kLearnIntervals = 8;
  static constexpr Duration kStandstillShown = 600 * kMillisecond;

  explicit InputMonitor(const Config& config);

  // For who looks at a recording as a whole: a step that looks like a spike is taken at once.
  void take_spikes(Role role) noexcept { row(role).is_gated = false; }
  FrameUse on_frame(const RxFrame& frame, FaultSet& faults) noexcept;
  UdsClient& diagnostics() noexcept { return uds_; }
  const UdsClient& diagnostics() const noexcept { return uds_; }
  // Ages every row to t and raises the faults of the required ones. The first call starts the time
  // after which an input that never came counts as missing.
  void update(MonoTime t, FaultSet& faults) noexcept;

  estimator::ReadingVerdict verdict(Role role) const noexcept { return row(role).verdict; }
  // Of the newest value heard; tested are those whose spikes are left out (spike_gate.h).
  estimator::ReadingStatus status(Role role) const noexcept;
  // kNone for a role of diagnostics.
  FramesCame frames_came(Role role) const noexcept;
  bool is_bound(Role role) const noexcept { return row(role).binding != nullptr; }
  const SignalHistory& history(Role role) const noexcept { return row(role).history; }
  // The newest value; `otherwise` where the configuration has no such role, or none has come. fresh
  // falls where the role is bound and its verdict is not kValid.
  double value_or(Role role, double otherwise, bool& fresh) const noexcept;
  double value_if_known(Role role) const noexcept;  // 0: it is not
  // Of the signal's own frames: configured, from the DBC, or learned; nothing until then. Learned,
  // it is the middle of kLearnIntervals; where the signal is multiplexed, the longest but one, as
  // pages need not come evenly.
  const std::optional<Duration>& period(Role role) const noexcept { return row(role).period; }
  // Configured: how long before its stamp a value was true.
  Duration delay(Role role) const noexcept { return row(role).delay; }

  // The roles without which there is no sample.
  std::span<const Role> required() const noexcept { return {required_.data(), required_count_}; }
  bool all_valid() const noexcept;  // every required role
  // A required role stale or frozen, or the engine's speed frozen.
  bool any_lost() const noexcept;
  Stop lost(MonoTime t) const noexcept;  // which, if any_lost()
  std::optional<Role> frozen() const noexcept;

  // What of the rest says how a signal should move, while it matters that it does: what follows a
  // request for clamping force.
  struct Watch {
    bool on = false;
    bool slopes = false;       // the shafts go on as they did: no belt takes hold again
    double torque_sign = 0.0;  // of the torque on the belt, 1 or -1; 0: no request stands
    MonoTime request_begun = MonoTime::origin();  // since then the pressure falls,
    double fall_Pa_per_s = 0.0;                   // so fast
    Duration answer = Duration::zero();           // and so much later
  };
  void watch(const Watch& watch) noexcept { watch_ = watch; }
  // Something else has shown that it stands still: it does until it moves.
  void stands_still(Role role) noexcept { row(role).stands_since = row(role).course.since(); }
  // Of a role that is watched: since when its value has been the same.
  const ValueCourse& course(Role role) const noexcept { return row(role).course; }
  // Would it show within kStandstillShown if the primary's speed, or the engine's beside it, stood
  // still from now on? Slip of the belt is not seen otherwise.
  bool standstill_shows() const noexcept;
  bool suspect() const noexcept;  // a message at a wrong rate, or invalid by its protection

 private:
  struct Row {
    const RoleBinding* binding = nullptr;
    double minimum = 0.0, maximum = 0.0;  // of the physical value, with half a step to spare
    bool has_range = false;
    bool is_flag = false;                    // 0 or 1
    bool by_group = false;                   // J1939
    std::optional<std::uint8_t> own_source;  // of the DBC's identifier, unless it is the null one
    std::optional<std::uint8_t> source;      // that it follows
    SignalHistory history;
    bool is_gated = false;  // its spikes are left out
    SpikeGate gate;
    MonoTime heard = MonoTime::origin();  // newest stamp, of a spike too
    bool is_watched = false;
    ValueCourse course;
    std::optional<MonoTime> stands_since;  // it has been found to stand still, since then
    estimator::ReadingVerdict verdict = estimator::ReadingVerdict::kUnbound;
    estimator::ReadingVerdict verdict_before = estimator::ReadingVerdict::kUnbound;
    MonoTime verdict_since = MonoTime::origin();
    std::optional<Duration> period;
    Duration delay = Duration::zero();
    bool learns = false;
    std::array<Duration, kLearnIntervals> intervals{};
    std::size_t interval_count = 0;
  };
  // Since when a speed has stood still, and what the other was then.
  struct Motion {
    bool known = false;
    MonoTime since = MonoTime::origin();
    double value = 0.0;
    double other = 0.0;
  };
  struct Message {
    std::uint8_t bus = 0;
    can::CanId id;
    std::bitset<256> sources;  // J1939; else none
    bool fd = false;
    FramesCame came = FramesCame::kNone;
    std::uint8_t length = 0;
    std::uint8_t row_count = 0;
    std::array<std::uint8_t, kRoleCount> rows{};
    FrameGuard guard;
  };
  static constexpr std::uint8_t kNone = 0xFF;

  Row& row(Role role) noexcept { return rows_[static_cast<std::size_t>(role)]; }
  const Row& row(Role role) const noexcept { return rows_[static_cast<std::size_t>(role)]; }
  std::span<const std::uint8_t> bound() const noexcept { return {bound_.data(), bound_count_}; }
  void bind(const RoleBinding& binding);
  void guard(Message& message) noexcept;
  void bind_identifier(const Message& message, std::uint8_t index) noexcept;
  Message* message_of(std::uint8_t bus, can::CanId id) noexcept;
  bool is_followed(const Message& message, std::uint8_t source) const noexcept;
  bool take_reading(const UdsReading& reading, FaultSet& faults) noexcept;
  void take(Row& row, std::span<const std::uint8_t> payload, std::uint8_t source, MonoTime t,
            FaultSet& faults) noexcept;
  void learn(Row& row, MonoTime t) noexcept;
  static Duration stale_limit(const Row& row) noexcept;
  estimator::ReadingVerdict judge(const Row& row, MonoTime t) const noexcept;
  static bool is_frozen(Motion& motion, const Row& row, const Row& other, MonoTime t) noexcept;
  double moved_since(Role role, MonoTime t) const noexcept;
  double should_have_moved(Role role, MonoTime t) const noexcept;
  void watch_courses(MonoTime t) noexcept;

  Config config_;  // the bindings' home
  std::array<Row, kRoleCount> rows_{};
  std::array<std::uint8_t, kRoleCount> bound_{};  // rows with a binding
  std::size_t bound_count_ = 0;
  std::array<Message, kRoleCount> messages_{};
  std::uint8_t message_count_ = 0;
  // Bus and identifier -> message.
  std::array<std::array<std::uint8_t, can::kStandardIdMax + 1>, kBusMax> standard_{};
  static constexpr std::size_t kHashSize = 64;  // four times the messages
  // Open addressing, by what identifies the message: bus, and identifier or parameter group.
  std::array<std::uint8_t, kHashSize> extended_{};
  std::array<Role, kRoleCount> required_{};
  std::size_t required_count_ = 0;
  Motion primary_motion_, secondary_motion_;
  std::array<MonoTime, kBusMax> newest_;  // stamp of the newest frame taken from each bus
  Watch watch_;
  UdsClient uds_;
  std::optional<MonoTime> began_;
};

}  // namespace beltgrip::daemon
