#include "daemon/core/input_monitor.h"

#include <algorithm>
#include <cmath>

namespace beltgrip::daemon {

namespace {

constexpr double kStalePeriods = 2.5;
constexpr double kMissingPeriods = 10.0;
constexpr Duration kPeriodAssumed = 50 * kMillisecond;  // until it is known
constexpr Duration kLearningStale = kSecond;            // while the period is being learned
constexpr Duration kFrozenAfter = 200 * kMillisecond;
// More than any slip an experiment may reach: the two speeds then differ by more than slip can.
constexpr double kFrozenShare = 0.15;
constexpr double kFrozenFloor_rad_s = 10.0;

// Payload bytes of a CAN FD frame that carries at least `length`.
std::uint8_t fd_length(std::uint32_t length) {
  constexpr std::array<std::uint8_t, 8> kSteps{12, 16, 20, 24, 32, 48, 64, 64};
  if (length <= 8) return static_cast<std::uint8_t>(length);
  return *std::find_if(kSteps.begin(), kSteps.end() - 1,
                       [&](std::uint8_t step) { return length <= step; });
}

std::size_t hash_of(std::uint32_t id, std::size_t size) noexcept {
  return (id * 0x9E37'79B1U >> 16) % size;
}

Duration scaled(Duration duration, double factor) {
  return static_cast<Duration>(static_cast<double>(duration) * factor);
}

}  // namespace

InputMonitor::InputMonitor(const Config& config) : config_(config) {
  standard_.fill(kNone);
  extended_.fill(kNone);
  for (const RoleBinding& binding : config_.roles) bind(binding);

  const Role torque =
      config_.estimator.torque_is_engine ? Role::kEngineTorque : Role::kPrimaryTorque;
  for (const Role role :
       {Role::kPrimarySpeed, Role::kSecondarySpeed, Role::kSecondaryPressure, torque}) {
    required_[required_count_++] = role;
  }
  if (config_.trigger == Trigger::kSignal) required_[required_count_++] = Role::kExperimentActive;
}

void InputMonitor::bind(const RoleBinding& binding) {
  Row& row = this->row(binding.role);
  row.binding = &binding;
  row.quality = SignalQuality::kMissing;
  row.is_flag = role_dimension(binding.role) == can::Dimension::kNone;
  row.has_range = binding.minimum < binding.maximum;
  const double spare = 1e-9 * std::max(std::abs(binding.minimum), std::abs(binding.maximum));
  row.minimum = binding.minimum - spare;
  row.maximum = binding.maximum + spare;
  if (binding.period_ms) {
    row.period = static_cast<Duration>(*binding.period_ms * static_cast<double>(kMillisecond));
  }
  row.learns = !row.period;

  const auto role_index = static_cast<std::uint8_t>(binding.role);
  for (std::uint8_t i = 0; i < message_count_; ++i) {
    if (messages_[i].id != binding.id) continue;
    messages_[i].rows[messages_[i].row_count++] = role_index;
    return;
  }
  Message& message = messages_[message_count_];
  message.id = binding.id;
  message.fd = binding.message_fd;
  message.length = binding.message_fd ? fd_length(binding.message_length)
                                      : static_cast<std::uint8_t>(binding.message_length);
  message.rows[message.row_count++] = role_index;
  if (binding.id.extended) {
    std::size_t slot = hash_of(binding.id.value, kHashSize);
    while (extended_[slot] != kNone) slot = (slot + 1) % kHashSize;
    extended_[slot] = message_count_;
  } else {
    standard_[binding.id.value] = message_count_;
  }
  ++message_count_;
}

const InputMonitor::Message* InputMonitor::message_of(can::CanId id) const noexcept {
  if (!id.extended) {
    if (id.value > can::kStandardIdMax || standard_[id.value] == kNone) return nullptr;
    return &messages_[standard_[id.value]];
  }
  for (std::size_t slot = hash_of(id.value, kHashSize); extended_[slot] != kNone;
       slot = (slot + 1) % kHashSize) {
    if (messages_[extended_[slot]].id == id) return &messages_[extended_[slot]];
  }
  return nullptr;
}

FrameUse InputMonitor::on_frame(const RxFrame& frame, FaultSet& faults) noexcept {
  const can::CanFrame& can_frame = frame.frame;
  const Message* message = can_frame.error ? nullptr : message_of(can_frame.id);
  if (message == nullptr) return FrameUse::kForeign;
  if (frame.t < newest_) faults.raise(Fault::kTimeStamp, newest_);
  const MonoTime t = std::max(frame.t, newest_);
  if (can_frame.remote || can_frame.fd != message->fd || can_frame.length != message->length) {
    faults.raise(Fault::kInputFrame, t);
    return FrameUse::kBad;
  }
  newest_ = t;
  for (std::size_t i = 0; i < message->row_count; ++i) {
    take(rows_[message->rows[i]], frame, t, faults);
  }
  return FrameUse::kTaken;
}

void InputMonitor::take(Row& row, const RxFrame& frame, MonoTime t, FaultSet& faults) noexcept {
  const RoleBinding& binding = *row.binding;
  const auto payload = frame.frame.payload();
  for (const MuxCondition& condition : binding.mux) {
    const std::uint64_t selector = condition.selector.raw(payload);
    const bool selected = std::any_of(
        condition.ranges.begin(), condition.ranges.end(),
        [&](const auto& range) { return selector >= range.first && selector <= range.second; });
    if (!selected) return;
  }
  const std::uint64_t raw = binding.codec.raw(payload);
  const double physical = binding.codec.physical(raw);
  const double value = binding.factor * physical + binding.shift;
  if (!std::isfinite(physical) || !std::isfinite(value)) {
    faults.raise(Fault::kInputNotFinite, t);
    return;
  }
  // A signed signal of all ones is -1, an ordinary value; it reads as 64 ones.
  const bool all_ones = binding.codec.is_all_ones(raw) && raw != ~std::uint64_t{0};
  const bool in_range =
      row.has_range ? physical >= row.minimum && physical <= row.maximum : !all_ones;
  if (!in_range || (row.is_flag && physical != 0.0 && physical != 1.0)) {
    faults.raise(Fault::kInputRange, t);
    return;
  }
  if (row.learns) learn(row, t);
  row.history.add(t, value);
}

void InputMonitor::learn(Row& row, MonoTime t) noexcept {
  if (row.history.empty() || t <= row.history.newest()) return;
  row.intervals[row.interval_count++] = t - row.history.newest();
  if (row.interval_count < kLearnIntervals) return;
  const auto middle = row.intervals.begin() + kLearnIntervals / 2;
  std::nth_element(row.intervals.begin(), middle, row.intervals.end());
  row.period = *middle;
  row.learns = false;
}

SignalQuality InputMonitor::judge(const Row& row, MonoTime t) const noexcept {
  if (row.binding == nullptr) return SignalQuality::kUnbound;
  if (row.history.empty()) return SignalQuality::kMissing;
  const Duration age = t - row.history.newest();
  const Duration limit =
      row.period ? std::max(kStaleMinimum, scaled(*row.period, kStalePeriods)) : kLearningStale;
  if (age > limit) return SignalQuality::kStale;
  return row.period ? SignalQuality::kValid : SignalQuality::kLearning;
}

bool InputMonitor::is_frozen(Motion& motion, const Row& row, const Row& other,
                             MonoTime t) noexcept {
  if (row.quality != SignalQuality::kValid || other.quality != SignalQuality::kValid) {
    motion.known = false;
    return false;
  }
  const double value = row.history.newest_value();
  const double other_value = other.history.newest_value();
  if (!motion.known || value != motion.value) motion = {true, t, value, other_value};
  return t - motion.since >= kFrozenAfter &&
         std::abs(other_value - motion.other) >
             kFrozenShare * std::max(std::abs(motion.other), kFrozenFloor_rad_s);
}

void InputMonitor::update(MonoTime t, FaultSet& faults) noexcept {
  if (!began_) began_ = t;
  for (Row& each : rows_) {
    each.quality = judge(each, t);
    // Intervals from before a message stopped say nothing of its period.
    if (each.quality == SignalQuality::kStale && each.learns) each.interval_count = 0;
  }
  Row& primary = row(Role::kPrimarySpeed);
  Row& secondary = row(Role::kSecondarySpeed);
  const bool primary_frozen = is_frozen(primary_motion_, primary, secondary, t);
  const bool secondary_frozen = is_frozen(secondary_motion_, secondary, primary, t);
  if (primary_frozen) primary.quality = SignalQuality::kFrozen;
  if (secondary_frozen) secondary.quality = SignalQuality::kFrozen;

  for (const Role role : required()) {
    const Row& now = row(role);
    switch (now.quality) {
      case SignalQuality::kMissing:
        if (t - *began_ >= scaled(now.period.value_or(kPeriodAssumed), kMissingPeriods)) {
          faults.raise(Fault::kInputMissing, t);
        }
        break;
      case SignalQuality::kStale:
        faults.raise(Fault::kInputStale, t);
        break;
      case SignalQuality::kFrozen:
        faults.raise(Fault::kInputFrozen, t);
        break;
      default:
        break;
    }
  }
}

bool InputMonitor::all_valid() const noexcept {
  return std::all_of(required().begin(), required().end(),
                     [&](Role role) { return quality(role) == SignalQuality::kValid; });
}

bool InputMonitor::any_lost() const noexcept {
  return std::any_of(required().begin(), required().end(), [&](Role role) {
    const SignalQuality now = quality(role);
    return now == SignalQuality::kStale || now == SignalQuality::kFrozen;
  });
}

}  // namespace beltgrip::daemon
