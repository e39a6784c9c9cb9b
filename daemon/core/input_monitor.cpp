#include "daemon/core/input_monitor.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "can_dbc/message_index.h"

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
// Spikes that are left out in a row: so many values, and of a slow signal for so long at most.
constexpr std::size_t kSpikeValues = 3;
constexpr Duration kSpikeLongest = 60 * kMillisecond;

std::size_t spike_values(Duration period) noexcept {
  const Duration whole = std::max<Duration>(period, 1);
  const auto most = static_cast<std::size_t>((kSpikeLongest + whole / 2) / whole);
  return std::clamp<std::size_t>(most, 1, kSpikeValues);
}

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

constexpr std::uint8_t source_of(can::CanId id) noexcept {
  return static_cast<std::uint8_t>(id.value & 0xFFU);
}

// What the frames of a 29-bit message have in common. Groups differ from identifiers in bit 31.
constexpr std::uint32_t key_of(std::uint8_t bus, can::CanId id, bool by_group) noexcept {
  static_assert(kBusMax <= 4, "two bits");
  constexpr std::uint32_t kGroup = std::uint32_t{1} << 31;
  return (id.value & can::identifier_mask(id, by_group)) | std::uint32_t{bus} << 29U |
         (by_group ? kGroup : 0);
}

Duration scaled(Duration duration, double factor) {
  return static_cast<Duration>(static_cast<double>(duration) * factor);
}

}  // namespace

InputMonitor::InputMonitor(const Config& config) : config_(config), uds_(config) {
  for (auto& each : standard_) each.fill(kNone);
  newest_.fill(std::numeric_limits<MonoTime>::min());
  extended_.fill(kNone);
  for (const RoleBinding& binding : config_.roles) bind(binding);
  for (std::uint8_t i = 0; i < message_count_; ++i) guard(messages_[i]);

  const Role torque =
      config_.estimator.torque_is_engine ? Role::kEngineTorque : Role::kPrimaryTorque;
  for (const Role role :
       {Role::kPrimarySpeed, Role::kSecondarySpeed, Role::kSecondaryPressure, torque}) {
    required_[required_count_++] = role;
    row(role).is_gated = true;
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
  const double step = binding.codec.physical(1) - binding.codec.physical(0);
  row.gate = SpikeGate(std::abs(binding.factor * step));
  row.delay = static_cast<Duration>(binding.delay_ms * static_cast<double>(kMillisecond));
  row.learns = !row.period;
  row.by_group = binding.sources.any();
  constexpr std::uint8_t kNullAddress = 0xFE;  // what a DBC writes for "any source"
  if (row.by_group && source_of(binding.id) < kNullAddress) row.own_source = source_of(binding.id);

  if (binding.uds) return;

  const auto role_index = static_cast<std::uint8_t>(binding.role);
  for (std::uint8_t i = 0; i < message_count_; ++i) {
    if (messages_[i].bus != binding.bus || messages_[i].id != binding.id) continue;
    messages_[i].rows[messages_[i].row_count++] = role_index;
    return;
  }
  Message& message = messages_[message_count_];
  message.bus = binding.bus;
  message.id = binding.id;
  message.sources = binding.sources;
  message.fd = binding.message_fd;
  message.length = binding.message_fd ? fd_length(binding.message_length)
                                      : static_cast<std::uint8_t>(binding.message_length);
  message.rows[message.row_count++] = role_index;
  bind_identifier(message, message_count_);
  ++message_count_;
}

void InputMonitor::guard(Message& message) noexcept {
  std::optional<Duration> period = rows_[message.rows[0]].period;
  for (std::size_t i = 0; i < message.row_count; ++i) {
    if (!rows_[message.rows[i]].binding->mux.empty() || message.sources.any()) period.reset();
  }
  const auto protection =
      std::find_if(config_.protections.begin(), config_.protections.end(),
                   [&](const auto& each) { return message.bus == 0 && each.id == message.id; });
  message.guard =
      FrameGuard(period, protection == config_.protections.end() ? nullptr : &*protection);
}

void InputMonitor::bind_identifier(const Message& message, std::uint8_t index) noexcept {
  if (!message.id.extended) {
    standard_[message.bus][message.id.value] = index;
    return;
  }
  std::size_t slot = hash_of(key_of(message.bus, message.id, message.sources.any()), kHashSize);
  while (extended_[slot] != kNone) slot = (slot + 1) % kHashSize;
  extended_[slot] = index;
}

InputMonitor::Message* InputMonitor::message_of(std::uint8_t bus, can::CanId id) noexcept {
  if (bus >= kBusMax) return nullptr;
  if (!id.extended) {
    if (id.value > can::kStandardIdMax || standard_[bus][id.value] == kNone) return nullptr;
    return &messages_[standard_[bus][id.value]];
  }
  for (const bool by_group : {false, true}) {
    const std::uint32_t key = key_of(bus, id, by_group);
    for (std::size_t slot = hash_of(key, kHashSize); extended_[slot] != kNone;
         slot = (slot + 1) % kHashSize) {
      Message& message = messages_[extended_[slot]];
      if (message.sources.any() != by_group || key_of(message.bus, message.id, by_group) != key) {
        continue;
      }
      if (!by_group || message.sources[source_of(id)]) return &message;
    }
  }
  return nullptr;
}

bool InputMonitor::is_followed(const Message& message, std::uint8_t source) const noexcept {
  return message.sources.none() ||
         std::any_of(message.rows.begin(), message.rows.begin() + message.row_count,
                     [&](std::uint8_t i) { return rows_[i].source.value_or(source) == source; });
}

FrameUse InputMonitor::on_frame(const RxFrame& frame, FaultSet& faults) noexcept {
  const can::CanFrame& can_frame = frame.frame;
  Message* message = can_frame.error ? nullptr : message_of(frame.bus, can_frame.id);
  if (message == nullptr) {
    UdsReading reading;
    if (!uds_.on_frame(frame, reading)) return FrameUse::kForeign;
    return take_reading(reading, faults) ? FrameUse::kTaken : FrameUse::kBad;
  }
  MonoTime& newest = newest_[message->bus];
  if (frame.t < newest) faults.raise(Fault::kTimeStamp, newest);
  const MonoTime t = std::max(frame.t, newest);
  if (can_frame.remote || can_frame.fd != message->fd || can_frame.length != message->length) {
    if (!is_followed(*message, source_of(can_frame.id))) return FrameUse::kForeign;
    faults.raise(Fault::kInputFrame, t);
    return FrameUse::kBad;
  }
  message->guard.count(t);
  if (message->guard.wrong_rate()) faults.raise(Fault::kInputRate, t);
  if (!message->guard.admit(can_frame)) {
    faults.raise(Fault::kInputProtection, t);
    return FrameUse::kBad;
  }
  newest = t;
  for (std::size_t i = 0; i < message->row_count; ++i) {
    take(rows_[message->rows[i]], can_frame.payload(), source_of(can_frame.id), t, faults);
  }
  return FrameUse::kTaken;
}

// False when an answer is too short for a role that it should hold.
bool InputMonitor::take_reading(const UdsReading& reading, FaultSet& faults) noexcept {
  bool whole = true;
  for (const Role role : reading.roles) {
    if (row(role).binding->codec.fits(reading.data.size())) {
      take(row(role), reading.data, 0, reading.t, faults);
    } else {
      faults.raise(Fault::kInputFrame, reading.t);
      whole = false;
    }
  }
  return whole;
}

void InputMonitor::take(Row& row, std::span<const std::uint8_t> payload, std::uint8_t source,
                        MonoTime t, FaultSet& faults) noexcept {
  const RoleBinding& binding = *row.binding;
  const bool another = row.by_group && row.source.value_or(source) != source;
  if (another && row.own_source != source && row.quality != SignalQuality::kStale) return;
  // What a source is not followed for is no fault of the input.
  const auto refuse = [&](Fault fault) {
    if (!another) faults.raise(fault, t);
  };
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
    refuse(Fault::kInputNotFinite);
    return;
  }
  // A signed signal of all ones is -1, an ordinary value; it reads as 64 ones.
  const bool all_ones = binding.codec.is_all_ones(raw) && raw != ~std::uint64_t{0};
  const bool in_range =
      row.has_range ? physical >= row.minimum && physical <= row.maximum : !all_ones;
  if (!in_range || (row.is_flag && physical != 0.0 && physical != 1.0)) {
    refuse(Fault::kInputRange);
    return;
  }
  if (another) {
    row.history.clear();
    row.gate.reset();
    row.interval_count = 0;
    row.quality = SignalQuality::kMissing;  // until update() has judged it
  }
  row.source = source;
  row.heard = t;
  if (row.is_gated && row.period) {
    const SpikeGate::Verdict verdict = row.gate.judge(value, spike_values(*row.period));
    if (verdict == SpikeGate::Verdict::kLeftOut) return;
    if (verdict == SpikeGate::Verdict::kTakenAfterSpike) faults.raise(Fault::kInputRange, t);
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
  const Duration age = t - row.heard;
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
  // What comes next need not go on from there.
  for (Row& each : rows_) {
    if (each.quality != SignalQuality::kValid) each.gate.reset();
  }

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

bool InputMonitor::suspect() const noexcept {
  return std::any_of(messages_.begin(), messages_.begin() + message_count_, [](const auto& each) {
    return each.guard.wrong_rate() || each.guard.invalid();
  });
}

bool InputMonitor::any_lost() const noexcept {
  return std::any_of(required().begin(), required().end(), [&](Role role) {
    const SignalQuality now = quality(role);
    return now == SignalQuality::kStale || now == SignalQuality::kFrozen;
  });
}

}  // namespace beltgrip::daemon
