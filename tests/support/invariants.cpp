#include "tests/support/invariants.h"

#include <algorithm>
#include <bit>
#include <cmath>

namespace beltgrip::test {

using daemon::Fault;
using daemon::fault_bit;
using daemon::State;

namespace {

constexpr std::uint32_t kClamp = 0x6A2;
constexpr double kFloorTolerance_N = 1e-6;
constexpr std::size_t kLinesMost = 10;
constexpr daemon::Duration kMs = daemon::kMillisecond;

// With one of these no request may stand (I3).
constexpr std::uint32_t kForbidding =
    fault_bit(Fault::kInputMissing) | fault_bit(Fault::kInputStale) |
    fault_bit(Fault::kInputFrozen) | fault_bit(Fault::kBusOff) | fault_bit(Fault::kBusDown) |
    fault_bit(Fault::kForeignSender) | fault_bit(Fault::kFrameRefused);
// With one of these frames may be missing from the bus.
constexpr std::uint32_t kGaps = fault_bit(Fault::kSendFailed) | fault_bit(Fault::kBusDown) |
                                fault_bit(Fault::kBusOff) | fault_bit(Fault::kSampleLate) |
                                fault_bit(Fault::kFrameRefused);

std::uint8_t crc(const can::CanFrame& frame) {
  unsigned value = 0;
  const auto add = [&value](unsigned byte) {
    value ^= byte;
    for (int bit = 0; bit < 8; ++bit)
      value = (value & 0x80U) != 0 ? value << 1 ^ 0x11DU : value << 1;
  };
  add(frame.id.value & 0xFFU);
  add(frame.id.value >> 8);
  for (std::size_t i = 1; i < 8; ++i) add(frame.data[i]);
  return static_cast<std::uint8_t>(value);
}

std::string text(double value) { return std::to_string(value); }

}  // namespace

Invariants::Invariants(const daemon::Config& config) : config_(config) {}

void Invariants::broken(const std::string& which, const std::string& how) {
  problems_.try_emplace(which,
                        how + " at " + text(static_cast<double>(before_.t.ns()) * 1e-9) + " s");
}

void Invariants::on_sent(const can::CanFrame& frame) { frames_.push_back(frame); }

void Invariants::on_unsent() {
  unsent_ = true;
  counters_.clear();
  results_.reset();
}

void Invariants::on_report(const daemon::SampleReport& now) noexcept {
  check_report(now);
  check_request(now);
  follow_friction(now);
  check_frames(now);
  check_events(now);
  frames_.clear();
  unsent_ = false;
  before_ = now;
  any_ = true;
}

void Invariants::check_report(const daemon::SampleReport& now) {
  // The end is reported at the present instant, which may be that of the last sample.
  const bool end = now.t == before_.t && now.state == State::kInhibited;
  if (any_ && now.t <= before_.t && !end) broken("I8", "the time of a sample does not increase");
  const daemon::Duration period = daemon::period_of(config_.estimator.sample_rate_hz);
  if (any_ && now.t > before_.t && now.t - before_.t != period && now.state != State::kInhibited &&
      (now.faults & fault_bit(Fault::kSampleLate)) == 0) {
    broken("I8", "a sample is missing without being counted");
  }
  for (const double value :
       {now.curve.mu_star, now.curve.sigma_star_percent, now.curve.friction_slope,
        now.curve.clamp_force_N, now.curve.torque_p_Nm, now.curve.slip_energy_J,
        now.result.peak.mu_max, now.result.peak.mu_max_std, now.result.sigma_stop_percent,
        now.request_force_N}) {
    if (!std::isfinite(value)) broken("I7", "an estimate is no number");
  }
  if (now.result.peak.kind == estimator::PeakKind::kValue && !(now.result.peak.mu_max_std > 0.0)) {
    broken("I7", "a value without a deviation");
  }
  if (any_ && before_.macro_slip_stop && !now.macro_slip_stop && now.in_experiment) {
    broken("I4", "MacroSlipStop fell within the experiment");
  }
}

void Invariants::check_request(const daemon::SampleReport& now) {
  const bool stands = now.request_force_N > 0.0;
  const bool stood = any_ && before_.request_force_N > 0.0;
  if (stands && (now.state != State::kRamping || config_.control != daemon::Control::kCommand)) {
    broken("I1", "a request outside Ramping");
  }
  if (stands && (now.faults & kForbidding) != 0) {
    broken("I3", "a request with faults " + std::to_string(now.faults));
  }
  if (stands && now.macro_slip_stop) broken("I3", "a request with MacroSlipStop");
  if (stands && !stood) {
    const double pause_s = static_cast<double>((now.t - request_ended_).ns()) * 1e-9;
    if (pause_s < config_.experiment.cooldown_s) broken("I2", "no cool-down: " + text(pause_s));
    request_begun_ = now.t;
    asked_ = true;
  }
  if (stands && stood) {
    const double fall_N = before_.request_force_N - now.request_force_N;
    const double fall_max_N = config_.estimator.ramp_rate_max_N_per_s *
                              static_cast<double>((now.t - before_.t).ns()) * 1e-9;
    if (fall_N < 0.0) broken("I2", "the request rises by " + text(-fall_N) + " N");
    if (fall_N > fall_max_N + 1e-6) broken("I2", "the request falls by " + text(fall_N) + " N");
    if (now.t - request_begun_ > 15 * daemon::kSecond + 5 * kMs) broken("I2", "longer than 15 s");
  }
  if (stands) {
    const auto& v = config_.variator;
    const double omega_s = now.sample.omega_s_rad_s;
    const double floor_N =
        v.secondary_spring_force_N + v.secondary_centrifugal_N_s2 * omega_s * omega_s +
        v.secondary_piston_area_m2 * config_.experiment.secondary_pressure_floor_Pa;
    if (now.request_force_N < floor_N - kFloorTolerance_N) {
      broken("I2", "below the floor by " + text(floor_N - now.request_force_N) + " N");
    }
  }
  if (!stands && stood) {
    request_ended_ = now.t;
    inactive_due_ = 5;
  }
}

void Invariants::check_clamp(const can::CanFrame& frame, const daemon::SampleReport& now) {
  const bool active = frame.data[2] == 1;
  const double force_N = frame.data[3] + 256.0 * frame.data[4];
  if (config_.control != daemon::Control::kCommand) broken("I14", "a clamp frame in observe");
  if (active != (now.request_force_N > 0.0)) broken("I1", "the frame and the report differ");
  if (active && std::abs(force_N - now.request_force_N) > 0.51) {
    broken("I5", "another force in the frame");
  }
  if (!active && inactive_due_ > 0) --inactive_due_;
  // What a controller needs that has only just come up.
  if (now.t - last_clamp_ > 100 * kMs) inactive_before_ = 0;
  if (active && inactive_before_ < 5 && !(before_.request_force_N > 0.0) &&
      (now.faults & kGaps) == 0) {
    broken("I5", "fewer than five inactive frames before a request");
  }
  inactive_before_ = active ? 0 : inactive_before_ + 1;
  if (active && asked_ && before_.request_force_N > 0.0 && now.t - last_clamp_ > 16 * kMs &&
      (now.faults & kGaps) == 0) {
    broken("I5", "a clamp frame is late");
  }
  last_clamp_ = now.t;
}

// I9: a line for each change of state, of the stop flag, of a fault, and for each result; none
// without; a stop and an end have a cause; at most ten a second.
void Invariants::check_events(const daemon::SampleReport& now) {
  events_.on_report(now);
  int states = 0, stops = 0, results = 0, faults = 0;
  daemon::Event event;
  while (ring_.pop(event)) {
    if (budget_.take(event)) lines_.push_back(now.t);
    if (budget_.left_out(event.t) > 0) lines_.push_back(now.t);
    switch (event.id) {
      case daemon::EventId::kState:
        ++states;
        if (event.from != static_cast<std::uint8_t>(before_.state) ||
            event.to != static_cast<std::uint8_t>(now.state)) {
          broken("I9", "an event of another change of state");
        }
        break;
      case daemon::EventId::kStop:
        ++stops;
        if (event.reason == estimator::StopReason::kNone) broken("I9", "a stop without a cause");
        break;
      case daemon::EventId::kResult:
        ++results;
        if (event.result.outcome == daemon::Outcome::kAborted &&
            event.result.stop_reason == estimator::StopReason::kNone) {
          broken("I9", "an end without a cause");
        }
        break;
      case daemon::EventId::kFaultRaised:
      case daemon::EventId::kFaultCleared:
        ++faults;
        break;
      case daemon::EventId::kInhibit:
        break;
    }
    if (daemon::text_of(event).empty()) broken("I9", "an event without words");
  }
  while (!lines_.empty() && now.t - lines_.front() >= daemon::kSecond) lines_.pop_front();
  if (lines_.size() > kLinesMost) broken("I9", std::to_string(lines_.size()) + " lines a second");
  const bool changed = any_ ? now.state != before_.state : now.state != State::kInhibited;
  if (states != (changed ? 1 : 0)) broken("I9", "a change of state without its event");
  if (stops != (now.macro_slip_stop && !(any_ && before_.macro_slip_stop) ? 1 : 0)) {
    broken("I9", "a stop without its event");
  }
  if (results != (now.new_result ? 1 : 0)) broken("I9", "a result without its event");
  if (faults != std::popcount(now.faults ^ (any_ ? before_.faults : 0U))) {
    broken("I9", "a fault without its event");
  }
}

// I13: what is published is the last result that was worth it, to the last digit of the frame.
void Invariants::check_estimate(const can::CanFrame& frame, const daemon::SampleReport& now) {
  const unsigned kind = frame.data[1] >> 4 & 3U;
  const double mu = (frame.data[2] | (frame.data[3] & 0x7FU) << 8) * 1e-5;
  const unsigned count = ((static_cast<unsigned>(frame.data[6]) << 8 | frame.data[5]) >> 3) & 0xFFU;
  const bool has_value = now.result.peak.kind == estimator::PeakKind::kValue &&
                         now.result.outcome == daemon::Outcome::kCompleted;
  if (now.new_result && has_value &&
      (kind != 1 || std::abs(mu - now.result.peak.mu_max) > 0.6e-5)) {
    broken("I13", "the frame says " + text(mu) + ", the result " + text(now.result.peak.mu_max));
  }
  if (now.new_result && now.result.outcome == daemon::Outcome::kAborted &&
      count != results_.value_or(count)) {
    broken("I13", "an aborted experiment counts");
  }
  if (now.new_result && has_value && results_ && count != (*results_ + 1) % 256) {
    broken("I13", "a result does not count");
  }
  if (!now.new_result && count != results_.value_or(count))
    broken("I13", "a count without a result");
  results_ = count;
}

void Invariants::follow_friction(const daemon::SampleReport& now) {
  const daemon::ExperimentResult& result = now.result;
  if (now.state == State::kRamping && before_.state != State::kRamping) carried_ = 0.0;
  // Also with the sample that ends it.
  const bool asked = now.state == State::kRamping || before_.state == State::kRamping;
  if (asked && now.sample.usable && now.curve.usable) {
    carried_ = std::max(carried_, std::abs(now.curve.mu_star));
  }
  if (!now.new_result) return;
  const std::pair where{result.direction, result.end_stop};
  if (result.outcome == daemon::Outcome::kCompleted) {
    const double half = (result.peak.noise_high - result.peak.noise_low) / 2.0;
    values_[where] = {result.peak.mu_max, result.peak.ci95_low, half / 1.96 / result.peak.mu_max,
                      1.0};
    return;
  }
  using estimator::StopReason;
  const auto value = values_.find(where);
  const bool slipped = result.stop_reason == StopReason::kSlope ||
                       result.stop_reason == StopReason::kSlip ||
                       result.stop_reason == StopReason::kSlipRate;
  // Under assumed constants what is read is not what is published.
  if (result.outcome != daemon::Outcome::kInconclusive || !slipped || value == values_.end() ||
      config_.friction_is_assumed) {
    return;
  }
  const double share = carried_ / value->second.mu_max;
  if (share > 0.0 && share < 0.95) value->second.share = share;
}

// 0: nothing has been measured.
double Invariants::friction_allowed(const daemon::SampleReport& now) const {
  const auto found = values_.find({now.curve.direction, now.curve.end_stop});
  if (found == values_.end()) return 0.0;
  const Friction& last = found->second;
  const bool low = config_.friction_is_assumed;
  double allowed = low ? last.low : last.mu_max;
  const estimator::FusedFriction& all = learned_.of(now.curve.direction, now.curve.end_stop);
  const double noise = 1.96 * std::hypot(last.relative_noise, all.repeatability_percent / 100.0);
  if (all.known && std::abs(std::log(last.mu_max / all.mu_max)) < 1.001 * noise) {
    allowed = std::max(allowed, low ? all.ci95_low : all.mu_max);
  }
  return allowed * last.share;
}

void Invariants::check_min_clamp(const can::CanFrame& frame, const daemon::SampleReport& now) {
  if (!now.curve.usable || !now.sample.usable) return;
  const double allowed = friction_allowed(now);
  constexpr unsigned kNotAvailable = 8191;
  constexpr double kStep_N = 4.0, kMost_N = 32760.0;  // more cannot be said
  const unsigned raw = (frame.data[6] >> 3U | static_cast<unsigned>(frame.data[7]) << 5U) & 0x1FFFU;
  if (allowed <= 0.0 || raw == kNotAvailable) return;
  const estimator::VariatorParameters& variator = config_.variator;
  const double radius_m = now.curve.end_stop == estimator::EndStop::kLow
                              ? variator.primary_radius_low_m
                              : variator.primary_radius_overdrive_m;
  const double needed_N = variator.safety_factor *
                          (std::abs(now.curve.torque_p_Nm) + variator.torque_reserve_Nm) *
                          std::cos(variator.half_wedge_angle_rad) / (2.0 * radius_m * allowed);
  if (raw * kStep_N < std::min(needed_N, kMost_N) - 0.01) {
    broken("I15",
           "MinClampForce " + text(raw * kStep_N) + ", what was measured needs " + text(needed_N));
  }
}

void Invariants::check_status(const can::CanFrame& frame, const daemon::SampleReport& now) {
  const unsigned state = frame.data[1] >> 4;
  const unsigned outcome = frame.data[2] & 3U, reason = frame.data[2] >> 2 & 31U;
  const auto faults =
      static_cast<unsigned>(frame.data[3] | frame.data[4] << 8 | frame.data[5] << 16);
  if (state != static_cast<unsigned>(now.state) ||
      outcome != static_cast<unsigned>(now.result.outcome) ||
      reason != static_cast<unsigned>(now.result.stop_reason) || faults != now.faults) {
    broken("I13", "the status frame says something else than the report");
  }
}

void Invariants::check_frames(const daemon::SampleReport& now) {
  bool slip_sent = false;
  for (const can::CanFrame& frame : frames_) {
    const std::uint32_t id = frame.id.value;
    if (id < 0x6A0 || id > 0x6A3 || frame.id.extended || frame.remote || frame.error || frame.fd ||
        frame.length != 8) {
      broken("I5", "a frame that is none of ours");
      continue;
    }
    if (frame.data[0] != crc(frame)) broken("I5", "a wrong CRC");
    const unsigned counter = frame.data[1] & 0x0FU;
    const auto last = counters_.find(id);
    if (last != counters_.end() && counter != (last->second + 1) % 15 &&
        (now.faults & kGaps) == 0) {
      broken("I5", "a counter that does not follow");
    }
    counters_[id] = counter;
    if (id == kClamp) check_clamp(frame, now);
    if (id == 0x6A0) check_estimate(frame, now);
    if (id == 0x6A0) check_min_clamp(frame, now);
    if (id == 0x6A3) check_status(frame, now);
    if (id == 0x6A0) {
      const unsigned kind = frame.data[1] >> 4 & 3U;
      const bool valid = (frame.data[1] & 0x40U) != 0;
      const unsigned mu = frame.data[2] | (frame.data[3] & 0x7FU) << 8;
      if (valid && (kind != 1 || mu == 0)) broken("I6", "MuMaxValid without a value");
      if (valid != (kind == 1)) broken("I6", "a value that is not valid");
    }
    if (id == 0x6A1) {
      slip_sent = true;
      if (((frame.data[1] & 0x10U) != 0) != now.macro_slip_stop) broken("I5", "another stop flag");
    }
  }
  if (unsent_) inactive_due_ = 0;
  const bool gaps = unsent_ || (now.faults & kGaps) != 0;
  if (any_ && now.macro_slip_stop != before_.macro_slip_stop && !slip_sent && !gaps) {
    broken("I5", "MacroSlipStop changed without a frame");
  }
  const bool ended = any_ && before_.request_force_N > 0.0 && !(now.request_force_N > 0.0);
  if (ended && !gaps) {
    bool inactive = false;
    for (const can::CanFrame& frame : frames_) {
      inactive = inactive || (frame.id.value == kClamp && frame.data[2] == 0);
    }
    if (!inactive) broken("I3", "no inactive frame at once");
  }
  if (inactive_due_ > 0 && now.t - request_ended_ > 60 * kMs && !gaps) {
    broken("I5", "fewer than five inactive frames");
  }
}

}  // namespace beltgrip::test
