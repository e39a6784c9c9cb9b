#include "daemon/core/input/input_monitor.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "can_dbc/dbc/message_index.h"

namespace beltgrip::daemon {

using estimator::ReadingVerdict;

namespace {

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

constexpr std::array kWatched{Role::kPrimarySpeed, Role::kSecondarySpeed, Role::kEngineSpeed,
                              Role::kSecondaryPressure};
constexpr double kOtherDeviations = 3.0;  // taken off what another signal says of a motion

std::size_t spike_values(Duration period) noexcept {
  const Duration whole = std::max(period, kNanosecond);
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

}  // namespace

InputMonitor::InputMonitor(const Config& config) : config_(config), uds_(config) {
  for (auto& each : standard_) each.fill(kNone);
  newest_.fill(MonoTime::min());
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
  for (const Role role : kWatched) row(role).is_watched = row(role).binding != nullptr;
  if (config_.trigger == Trigger::kSignal) required_[required_count_++] = Role::kExperimentActive;
}

void InputMonitor::bind(const RoleBinding& binding) {
  Row& row = this->row(binding.role);
  bound_[bound_count_++] = static_cast<std::uint8_t>(binding.role);  // each role stands once
  row.binding = &binding;
  row.verdict = ReadingVerdict::kMissing;
  row.is_flag = role_dimension(binding.role) == can::Dimension::kNone;
  row.has_range = binding.minimum < binding.maximum;
  const double spare = 1e-9 * std::max(std::abs(binding.minimum), std::abs(binding.maximum));
  row.minimum = binding.minimum - spare;
  row.maximum = binding.maximum + spare;
  if (binding.period_ms) {
    row.period = Duration::of_ms(*binding.period_ms);
  }
  const double step = binding.codec.physical(1) - binding.codec.physical(0);
  row.gate = SpikeGate(std::abs(binding.factor * step));
  row.course = ValueCourse(std::abs(binding.factor * step),
                           role_dimension(binding.role) == can::Dimension::kAngularSpeed);
  row.delay = Duration::of_ms(binding.delay_ms);
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
    bool good = take_reading(reading, faults);
    while (uds_.next(reading)) good &= take_reading(reading, faults);
    return good ? FrameUse::kTaken : FrameUse::kBad;
  }
  MonoTime& newest = newest_[message->bus];
  if (frame.t < newest) faults.raise(Fault::kTimeStamp, newest);
  const MonoTime t = std::max(frame.t, newest);
  if (can_frame.remote || can_frame.fd != message->fd || can_frame.length != message->length) {
    if (!is_followed(*message, source_of(can_frame.id))) return FrameUse::kForeign;
    faults.raise(Fault::kInputFrame, t);
    message->came = std::max(message->came, FramesCame::kOfOtherKind);
    return FrameUse::kBad;
  }
  message->guard.count(t);
  if (message->guard.wrong_rate()) faults.raise(Fault::kInputRate, t);
  if (!message->guard.admit(can_frame)) {
    faults.raise(Fault::kInputProtection, t);
    message->came = std::max(message->came, FramesCame::kRefused);
    return FrameUse::kBad;
  }
  message->came = FramesCame::kTaken;
  newest = t;
  for (std::size_t i = 0; i < message->row_count; ++i) {
    take(rows_[message->rows[i]], can_frame.payload(), source_of(can_frame.id), t, faults);
  }
  return FrameUse::kTaken;
}

FramesCame InputMonitor::frames_came(Role role) const noexcept {
  for (std::size_t i = 0; i < message_count_; ++i) {
    const Message& message = messages_[i];
    const auto* const end = message.rows.begin() + message.row_count;
    if (std::find(message.rows.begin(), end, static_cast<std::uint8_t>(role)) != end) {
      return message.came;
    }
  }
  return FramesCame::kNone;
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
  if (another && row.own_source != source && row.verdict != ReadingVerdict::kStale) return;
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
  const bool named = std::find(binding.true_when.begin(), binding.true_when.end(),
                               static_cast<std::int64_t>(raw)) != binding.true_when.end();
  const double value =
      !binding.true_when.empty() ? (named ? 1.0 : 0.0) : binding.factor * physical + binding.shift;
  if (!std::isfinite(physical) || !std::isfinite(value)) {
    refuse(Fault::kInputNotFinite);
    return;
  }
  // A signed signal of all ones is -1, an ordinary value; it reads as 64 ones.
  const bool all_ones = binding.codec.is_all_ones(raw) && raw != ~std::uint64_t{0};
  const bool in_range =
      row.has_range ? physical >= row.minimum && physical <= row.maximum : !all_ones;
  if ((!in_range && !named) || (row.is_flag && value != 0.0 && value != 1.0)) {
    refuse(Fault::kInputRange);
    return;
  }
  if (another) {
    row.history.clear();
    row.gate.reset();
    row.course.reset();
    row.interval_count = 0;
    row.verdict = ReadingVerdict::kMissing;  // until update() has judged it
  }
  row.source = source;
  row.heard = t;
  if (row.is_watched) row.course.add(t, value);
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
  const std::size_t rank = row.binding->mux.empty() ? kLearnIntervals / 2 : kLearnIntervals - 2;
  const auto typical = row.intervals.begin() + static_cast<std::ptrdiff_t>(rank);
  std::nth_element(row.intervals.begin(), typical, row.intervals.end());
  row.period = *typical;
  row.learns = false;
}

Duration InputMonitor::stale_limit(const Row& row) noexcept {
  return row.period ? stale_after(*row.period) : kLearningStale;
}

ReadingVerdict InputMonitor::judge(const Row& row, MonoTime t) const noexcept {
  if (row.history.empty()) return ReadingVerdict::kMissing;
  if (t - row.heard > stale_limit(row)) return ReadingVerdict::kStale;
  return row.period ? ReadingVerdict::kValid : ReadingVerdict::kLearning;
}

bool InputMonitor::is_frozen(Motion& motion, const Row& row, const Row& other,
                             MonoTime t) noexcept {
  if (row.verdict != ReadingVerdict::kValid || other.verdict != ReadingVerdict::kValid) {
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

// By how much, with sign and less its noise, a signal has moved since then.
double InputMonitor::moved_since(Role role, MonoTime t) const noexcept {
  const Row& from = row(role);
  double then = 0.0;
  if (from.verdict != ReadingVerdict::kValid || !from.history.value_at(t, Duration{}, then))
    return 0.0;
  const double moved = from.history.newest_value() - then;
  const double spare = kOtherDeviations * from.course.noise() + from.course.resolution();
  return std::copysign(std::max(0.0, std::abs(moved) - spare), moved);
}

// Slip that grows under a request takes the primary away from the secondary. What would make it
// fall does not happen under constant torque: where one shaft moves that way, the other does too.
double InputMonitor::should_have_moved(Role role, MonoTime t) const noexcept {
  const Row& primary = row(Role::kPrimarySpeed);
  const Row& secondary = row(Role::kSecondarySpeed);
  const MonoTime since = row(role).course.since();
  if (role == Role::kSecondaryPressure) {
    const Duration asked = t - watch_.answer - std::max(since, watch_.request_begun);
    return watch_.fall_Pa_per_s * seconds(std::max(Duration{}, asked));
  }
  if (role == Role::kEngineSpeed) return std::abs(moved_since(Role::kPrimarySpeed, since));
  const double ratio = secondary.course.value() / primary.course.value();
  if (!std::isfinite(ratio) || ratio <= 0.0) return 0.0;
  if (role == Role::kSecondarySpeed) {
    return std::max(0.0, -watch_.torque_sign * moved_since(Role::kPrimarySpeed, since) * ratio);
  }
  return std::max(watch_.torque_sign * moved_since(Role::kSecondarySpeed, since) / ratio,
                  std::abs(moved_since(Role::kEngineSpeed, since)));
}

bool InputMonitor::standstill_shows() const noexcept {
  constexpr std::array kWitnesses{Role::kPrimarySpeed, Role::kEngineSpeed};
  return std::any_of(kWitnesses.begin(), kWitnesses.end(), [this](Role role) {
    const Row& each = row(role);
    if (each.verdict != ReadingVerdict::kValid || !each.period) return false;
    const std::optional<Duration> after = each.course.shown_after(*each.period);
    return after && *after <= kStandstillShown;
  });
}

void InputMonitor::watch_courses(MonoTime t) noexcept {
  std::array<bool, kWatched.size()> found{};
  for (std::size_t i = 0; i < kWatched.size(); ++i) {
    Row& each = row(kWatched[i]);
    if (each.verdict != ReadingVerdict::kValid) {
      each.stands_since.reset();
      if (each.verdict != ReadingVerdict::kFrozen) each.course.reset();
      continue;
    }
    // Until it moves again.
    if (each.stands_since != each.course.since()) each.stands_since.reset();
    found[i] = watch_.on && each.course.rests() &&
               each.course.stands_still(should_have_moved(kWatched[i], t), watch_.slopes);
  }
  for (std::size_t i = 0; i < kWatched.size(); ++i) {
    Row& each = row(kWatched[i]);
    if (found[i]) each.stands_since = each.course.since();
    if (each.stands_since) each.verdict = ReadingVerdict::kFrozen;
  }
}

void InputMonitor::update(MonoTime t, FaultSet& faults) noexcept {
  if (!began_) began_ = t;
  for (const std::uint8_t i : bound()) {
    Row& each = rows_[i];
    each.verdict = judge(each, t);
    // Intervals from before a message stopped say nothing of its period.
    if (each.verdict == ReadingVerdict::kStale && each.learns) each.interval_count = 0;
  }
  Row& primary = row(Role::kPrimarySpeed);
  Row& secondary = row(Role::kSecondarySpeed);
  const bool primary_frozen = is_frozen(primary_motion_, primary, secondary, t);
  const bool secondary_frozen = is_frozen(secondary_motion_, secondary, primary, t);
  if (primary_frozen) primary.verdict = ReadingVerdict::kFrozen;
  if (secondary_frozen) secondary.verdict = ReadingVerdict::kFrozen;
  watch_courses(t);
  if (row(Role::kEngineSpeed).verdict == ReadingVerdict::kFrozen) {
    faults.raise(Fault::kInputFrozen, t);
  }
  // What comes next need not go on from there.
  for (const std::uint8_t i : bound()) {
    Row& each = rows_[i];
    if (each.verdict != ReadingVerdict::kValid) each.gate.reset();
    if (each.verdict != each.verdict_before) each.verdict_since = t;
    each.verdict_before = each.verdict;
  }

  for (const Role role : required()) {
    const Row& now = row(role);
    switch (now.verdict) {
      case ReadingVerdict::kMissing:
        if (t - *began_ >= scaled(now.period.value_or(kPeriodAssumed), kMissingPeriods)) {
          faults.raise(Fault::kInputMissing, t);
        }
        break;
      case ReadingVerdict::kStale:
        faults.raise(Fault::kInputStale, t);
        break;
      case ReadingVerdict::kFrozen:
        faults.raise(Fault::kInputFrozen, t);
        break;
      default:
        break;
    }
  }
}

estimator::ReadingStatus InputMonitor::status(Role role) const noexcept {
  const Row& from = row(role);
  estimator::ReadingStatus status = from.gate.status();
  const bool tested = std::isfinite(status.test_ratio);
  if (!tested && !from.history.empty()) status.value = from.history.newest_value();
  status.verdict = from.verdict;
  status.since_ns = from.verdict_since.ns();
  return status;
}

double InputMonitor::value_or(Role role, double otherwise, bool& fresh) const noexcept {
  if (!is_bound(role)) return otherwise;
  fresh = fresh && verdict(role) == ReadingVerdict::kValid;
  return history(role).empty() ? otherwise : history(role).newest_value();
}

double InputMonitor::value_if_known(Role role) const noexcept {
  bool known = is_bound(role);
  const double value = value_or(role, 0.0, known);
  return known ? value : 0.0;
}

bool InputMonitor::all_valid() const noexcept {
  return std::all_of(required().begin(), required().end(),
                     [&](Role role) { return verdict(role) == ReadingVerdict::kValid; });
}

bool InputMonitor::suspect() const noexcept {
  return std::any_of(messages_.begin(), messages_.begin() + message_count_, [](const auto& each) {
    return each.guard.wrong_rate() || each.guard.invalid();
  });
}

bool InputMonitor::any_lost() const noexcept {
  return verdict(Role::kEngineSpeed) == ReadingVerdict::kFrozen ||
         std::any_of(required().begin(), required().end(), [&](Role role) {
           const ReadingVerdict now = verdict(role);
           return now == ReadingVerdict::kStale || now == ReadingVerdict::kFrozen;
         });
}

std::optional<Role> InputMonitor::frozen() const noexcept {
  for (const Role role : kWatched) {
    if (verdict(role) == ReadingVerdict::kFrozen || row(role).stands_since) return role;
  }
  return std::nullopt;
}

Stop InputMonitor::lost(MonoTime t) const noexcept {
  using estimator::StopReason;
  if (const auto role = frozen()) {
    return {StopReason::kInputFrozen,
            {.what = "stands still for",
             .figure = seconds(course(*role).stood_for()),
             .unit = "s",
             .role = role}};
  }
  for (const Role role : required()) {
    if (verdict(role) != ReadingVerdict::kStale) continue;
    return {StopReason::kInputs,
            {.what = "silent for",
             .figure = seconds(t - row(role).heard),
             .limit = seconds(stale_limit(row(role))),
             .unit = "s",
             .role = role}};
  }
  return {};
}

}  // namespace beltgrip::daemon
