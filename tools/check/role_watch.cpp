#include "tools/check/role_watch.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "can_dbc/dbc/message_index.h"
#include "can_dbc/frame/e2e.h"
#include "can_dbc/uds/uds.h"
#include "tools/check/thresholds.h"

namespace beltgrip::check {

namespace {

constexpr std::size_t kGapsKept = 64;
constexpr std::size_t kRefusedKept = 8;
constexpr std::size_t kIdentifiersMost = 4096;
constexpr double kPerMedian = 1.0 / (0.6745 * 2.449489742783178);  // of second differences

bool has_range(const daemon::RoleBinding& binding) { return binding.minimum < binding.maximum; }

// A request in one frame that names the identifier, alone or among others.
bool asks_for(const can::CanFrame& frame, const daemon::UdsSource& source) {
  const auto payload = frame.payload();
  if (payload.size() < 2 || payload[0] >= payload.size() || payload[1] != source.service) {
    return false;
  }
  auto rest = payload.subspan(2, payload[0] - std::size_t{1});
  while (const auto identifier = can::uds_take_identifier(source.service, rest)) {
    if (*identifier == source.identifier) return true;
  }
  return false;
}

bool is_in_range(const daemon::RoleBinding& binding, std::uint64_t raw, double physical) {
  if (!std::isfinite(physical)) return false;
  if (!has_range(binding)) return !binding.codec.is_all_ones(raw) || raw == ~std::uint64_t{0};
  const double half_step = 0.5 * std::abs(binding.codec.physical(1) - binding.codec.physical(0));
  return physical >= binding.minimum - half_step && physical <= binding.maximum + half_step;
}

}  // namespace

double RoleCourse::rate_Hz() const {
  const double period_s = quantile(intervals_s.values(), 0.5);
  return period_s > 0.0 ? 1.0 / period_s : 0.0;
}

namespace {

double noise_of(const Thinned<double>& bends) {
  std::vector<double> magnitudes;
  for (const double bend : bends.values()) magnitudes.push_back(std::abs(bend));
  return magnitudes.empty() ? 0.0 : kPerMedian * quantile(std::move(magnitudes), 0.5);
}

}  // namespace

double RoleCourse::noise() const { return noise_of(bends); }
double RoleCourse::live_noise() const { return noise_of(live_bends); }

RoleWatch::RoleWatch(const daemon::Config& config) : config_(config) {
  courses_.resize(config_.roles.size());
  for (std::size_t i = 0; i < courses_.size(); ++i) courses_[i].binding = &config_.roles[i];
  begin_log();
}

void RoleWatch::begin_log() {
  states_.assign(courses_.size(), {});
  span_s_ += last_span_s_;
  last_span_s_ = 0.0;
  first_.reset();
  newest_.reset();
  const bool asks =
      std::any_of(config_.roles.begin(), config_.roles.end(),
                  [](const daemon::RoleBinding& role) { return role.uds.has_value(); });
  if (asks) diagnostics_.emplace(config_);
}

void RoleWatch::end_log() {
  if (!first_) return;
  for (std::size_t i = 0; i < courses_.size(); ++i) {
    RoleCourse& course = courses_[i];
    if (!states_[i].heard) continue;
    const double end_s = last_span_s_ - daemon::seconds(states_[i].heard_at - *first_);
    const double before_s = states_[i].begun_s;
    if (end_s > course.silent_s) {
      course.silent_s = end_s;
      course.silent_from_s = last_span_s_ - end_s;
    }
    if (before_s > course.silent_s) {
      course.silent_s = before_s;
      course.silent_from_s = 0.0;
    }
  }
}

const RoleCourse* RoleWatch::find(Role role) const {
  for (const RoleCourse& course : courses_) {
    if (course.binding->role == role) return &course;
  }
  return nullptr;
}

void RoleWatch::on_frame(const daemon::RxFrame& frame) {
  if (frame.frame.error) return;
  ++frames_;
  if (!first_) first_ = frame.t;
  take_pause(frame.t);
  last_span_s_ = std::max(last_span_s_, daemon::seconds(frame.t - first_.value_or(frame.t)));
  const std::pair key{frame.bus, frame.frame.id};
  if (census_.size() < kIdentifiersMost || census_.contains(key)) {
    Heard& heard = census_[key];
    if (heard.frames++ == 0) heard.first = frame.t;
    heard.last = frame.t;
    heard.length = frame.frame.length;
    heard.fd = frame.frame.fd;
  }
  if (diagnostics_) diagnostics_->on_frame(frame, faults_);
  for (std::size_t i = 0; i < courses_.size(); ++i) take_frame(courses_[i], states_[i], frame);
}

// A car that was parked, or a recorder that was stopped, is no gap of each of its messages.
void RoleWatch::take_pause(MonoTime t) {
  const MonoTime before = newest_.value_or(t);
  const double silent_s = daemon::seconds(t - before);
  // Rows that nobody stamped come evenly, however seldom.
  const bool evenly = config_.table && config_.table->rate_Hz > 0.0;
  if (silent_s > kSilentLeast_s && !evenly) {
    ++pauses_;
    longest_pause_s_ = std::max(longest_pause_s_, silent_s);
    for (State& state : states_) {
      state.heard_at += t - before;
      state.counter.reset();
      state.known = 0;
      state.same = false;
    }
  }
  newest_ = t;
}

void RoleWatch::take_frame(RoleCourse& course, State& state, const daemon::RxFrame& frame) {
  if (!course.binding) return;
  const daemon::RoleBinding& binding = *course.binding;
  if (binding.uds) {
    take_diagnostics(course, state, *binding.uds, frame);
    return;
  }
  if (frame.bus != binding.bus) return;
  const bool by_group = binding.sources.any();
  if (!can::is_of_message(frame.frame.id, binding.id, by_group)) return;
  if (by_group && !binding.sources[frame.frame.id.value & 0xFF]) return;
  ++course.frames;
  const can::CanFrame& f = frame.frame;
  if (f.remote || f.fd != binding.message_fd || f.length != binding.message_length) {
    ++course.wrong_kind;
    course.other_length = f.length;
    return;
  }
  if (!protection_holds(course, state, f)) return;
  for (const daemon::MuxCondition& condition : binding.mux) {
    const std::uint64_t selector = condition.selector.raw(f.payload());
    const bool selected = std::any_of(
        condition.ranges.begin(), condition.ranges.end(),
        [&](const auto& range) { return selector >= range.first && selector <= range.second; });
    if (selected) continue;
    ++course.not_selected;
    return;
  }
  take_time(course, state, frame.t);
  const std::uint64_t raw = binding.codec.raw(f.payload());
  const double physical = binding.codec.physical(raw);
  const auto& names = binding.true_when;
  const bool named =
      std::find(names.begin(), names.end(), static_cast<std::int64_t>(raw)) != names.end();
  const bool flag = daemon::role_dimension(binding.role) == can::Dimension::kNone;
  const double value =
      flag && !names.empty() ? (named ? 1.0 : 0.0) : binding.factor * physical + binding.shift;
  ++course.values;
  if (!named && (!is_in_range(binding, raw, physical) || (flag && value != 0.0 && value != 1.0))) {
    course.out_of_range = physical;
    return;
  }
  ++course.in_range;
  if (state.raw && !binding.codec.is_float()) {
    const std::uint64_t difference = raw > *state.raw ? raw - *state.raw : *state.raw - raw;
    const double unit =
        std::abs(binding.factor * (binding.codec.physical(1) - binding.codec.physical(0)));
    // A negative value beside a positive one: the difference of the 64 bits is that of the values.
    const std::uint64_t least = std::min(difference, ~difference + 1);
    const auto so_far =
        static_cast<std::uint64_t>(unit > 0.0 ? std::llround(course.step / unit) : 0);
    course.step = static_cast<double>(std::gcd(so_far, least)) * unit;
  }
  state.raw = raw;
  take_value(course, state, value, daemon::seconds(frame.t - first_.value_or(frame.t)));
}

void RoleWatch::take_diagnostics(RoleCourse& course, State& state, const daemon::UdsSource& source,
                                 const daemon::RxFrame& frame) {
  const daemon::RoleBinding& binding = *course.binding;
  if (frame.bus == binding.bus && frame.frame.id == source.request &&
      asks_for(frame.frame, source)) {
    if (const std::optional<MonoTime> before = state.asked_at) {
      course.asked_every_s.add(daemon::seconds(frame.t - *before));
    }
    state.asked_at = frame.t;
    state.waits = true;
    ++course.requests;
  }
  if (!diagnostics_) return;
  const daemon::SignalHistory& history = diagnostics_->history(binding.role);
  if (history.empty() || history.newest() == state.diagnostics) return;
  state.diagnostics = history.newest();
  if (const std::optional<MonoTime> asked = state.asked_at; asked && state.waits) {
    course.answers_s.add(daemon::seconds(frame.t - *asked));
  }
  state.waits = false;
  ++course.frames;
  ++course.values;
  ++course.in_range;
  take_time(course, state, frame.t);
  take_value(course, state, history.newest_value(),
             daemon::seconds(frame.t - first_.value_or(frame.t)));
}

// Counts what the daemon would refuse. False: what the frame says is not believed either.
bool RoleWatch::protection_holds(RoleCourse& course, State& state, const can::CanFrame& frame) {
  for (const daemon::MessageProtection& protection : config_.protections) {
    if (protection.id != course.binding->id) continue;
    bool holds = true;
    if (protection.crc) {
      std::array<std::uint8_t, can::kMaxPayload> others{};
      std::size_t count = 0;
      const auto payload = frame.payload();
      for (std::size_t i = 0; i < payload.size(); ++i) {
        if (i != protection.crc->byte) others[count++] = payload[i];
      }
      holds = can::e2e::crc_profile1(protection.crc->data_id, {others.data(), count}) ==
              payload[protection.crc->byte];
      if (!holds) {
        ++course.crc_bad;
        if (course.refused.size() < kRefusedKept) course.refused.push_back(frame);
      }
    }
    if (protection.counter) {
      const auto now = static_cast<std::uint32_t>(protection.counter->codec.raw(frame.payload()));
      const std::uint32_t numbers = protection.counter->maximum + 1;
      if (state.counter) {
        const std::uint32_t step = (now + numbers - *state.counter % numbers) % numbers;
        if (now == *state.counter) {
          ++course.counter_still;
        } else if (now >= numbers || step > 1) {
          ++course.counter_jumps;
        }
      }
      state.counter = course.counter_last = now;
    }
    return holds;
  }
  return true;
}

void RoleWatch::take_time(RoleCourse& course, State& state, MonoTime t) {
  const double t_s = daemon::seconds(t - first_.value_or(t));
  if (!state.heard) {
    state.heard = true;
    state.begun_s = t_s;
    course.first_s = course.span_s == 0.0 ? t_s : course.first_s;
  } else {
    const double interval_s = daemon::seconds(t - state.heard_at);
    course.intervals_s.add(interval_s);
    course.span_s += interval_s;
    course.longest_gap_s = std::max(course.longest_gap_s, interval_s);
    const double usual_s = course.binding->period_ms
                               ? 1e-3 * *course.binding->period_ms
                               : course.span_s / static_cast<double>(course.intervals_s.count());
    state.behind_gap =
        interval_s > std::max(kGapLeast_s, kGapPeriods * usual_s) && course.intervals_s.count() > 8;
    if (state.behind_gap) {
      ++course.gap_count;
      if (course.gaps.size() < kGapsKept) course.gaps.push_back({t_s - interval_s, interval_s});
    }
  }
  state.heard_at = t;
  course.last_s = t_s;
}

double RoleWatch::other_pulley(Role role) const {
  const RoleCourse* other = nullptr;
  if (role == Role::kPrimarySpeed) other = find(Role::kSecondarySpeed);
  if (role == Role::kSecondarySpeed) other = find(Role::kPrimarySpeed);
  return other == nullptr ? 0.0 : other->value;
}

// On a bench a motor may hold the primary while the belt slips: in drive the secondary falls back
// behind it, in overrun the primary behind the secondary. A torque that nobody sees explains
// either.
bool RoleWatch::slip_explains(Role role, double other_moved) const {
  const RoleCourse* torque =
      find(config_.estimator.torque_is_engine ? Role::kEngineTorque : Role::kPrimaryTorque);
  if (torque == nullptr || torque->values == 0) return true;
  const double ratio_moved = role == Role::kPrimarySpeed ? other_moved : -other_moved;
  return torque->value * ratio_moved < 0.0;
}

void RoleWatch::take_stand(RoleCourse& course, const State& state, double other, double t_s) const {
  const double stood_s = t_s - state.same_since_s, value = state.previous;
  course.stuck_s = std::max(course.stuck_s, stood_s);
  if (!(value > kMoving_rad_s)) return;
  if (stood_s > course.stood_s) {
    course.stood_s = stood_s;
    course.stood_from_s = state.same_since_s;
    course.stood_at = value;
    course.stood_values = state.same_values;
  }
  const double moved = state.other_at_same > 0.0 ? other / state.other_at_same - 1.0 : 0.0;
  const bool explained = slip_explains(course.binding->role, moved);
  const double enough = explained ? kSlipBand : kOtherMoved;
  if (std::abs(moved) > enough && stood_s > course.frozen_s) {
    course.frozen_s = stood_s;
    course.frozen_from_s = state.same_since_s;
    course.frozen_at = value;
    course.frozen_other = std::abs(moved);
    course.frozen_against = !explained && std::abs(moved) <= kSlipBand;
  }
}

// Behind a frozen stretch a shaft goes on where it has come to meanwhile.
void RoleWatch::take_move(RoleCourse& course, const State& state, double value, double t_s) const {
  const double move = std::abs(value - state.previous), stood_s = t_s - state.same_since_s;
  if (!state.same || state.same_values < kRepeats || stood_s < kStuck_s) {
    course.moves.add(move);
  } else if (!state.behind_gap && std::min(value, state.previous) > kMoving_rad_s &&
             move > course.leap) {
    course.leap = move;
    course.leap_stood_s = stood_s;
    course.leap_from_s = state.same_since_s;
    course.leap_at = state.previous;
  }
}

void RoleWatch::take_value(RoleCourse& course, State& state, double value, double t_s) {
  const bool first = course.spread.count() == 0;
  course.least = first ? value : std::min(course.least, value);
  course.largest = first ? value : std::max(course.largest, value);
  course.value = value;
  course.spread.add(value);
  const double other = other_pulley(course.binding->role);
  if (state.known > 0 && value == state.previous) {
    if (!state.same) {
      state.same = true;
      state.same_values = 0;
      state.other_at_same = other;
    }
    ++state.same_values;
    take_stand(course, state, other, t_s);
  } else {
    if (state.known > 0) {
      take_move(course, state, value, t_s);
      ++course.changes;
    }
    state.same = false;
    state.same_since_s = t_s;
  }
  if (state.known > 1) {
    const double bend = value - 2.0 * state.previous + state.before;
    course.bends.add(bend);
    if (!state.same || state.previous != state.before) course.live_bends.add(bend);
  }
  state.before = state.previous;
  state.previous = value;
  state.known = std::min(state.known + 1, 2);
}

}  // namespace beltgrip::check
