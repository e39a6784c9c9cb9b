#include "daemon/core/loop/pipeline.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "daemon/core/base/bus_error.h"
#include "daemon/core/loop/pipeline_parts.h"
#include "estimator/method/possible_friction.h"
#include "estimator/physics/sensor_error.h"
#include "estimator/physics/slip.h"
#include "estimator/physics/units.h"

namespace beltgrip::daemon {

using estimator::PeakKind;
using estimator::StopReason;
using estimator::VariatorSample;

namespace {

// More calls than an evaluation takes; at the end there is no next sample to go on with it.
constexpr int kConcludeCallsMax = 1'000'000;

// Two periods of BeltGripClamp.
constexpr Duration kConfirmationMax = 20 * kMillisecond;
constexpr Duration kConfirmationRetry = kSecond;  // then the frame is taken for lost

constexpr Duration kStillComing = 50 * kMillisecond;
// As long as a fault shows: what flickers changes the state at most twice a second.
constexpr Duration kUsableAgain = FaultSet::kHold;
constexpr double kAnswerLags = 3.0;  // of the actuator: then its pressure has answered

// A stop may come before the very top: mu* is then this much short of it at the most (chosen: the
// width that a value may have).
constexpr double kShortOfTheTop = 0.05;
constexpr double kSlipped_percent = 1.5;  // more than deformation and a drift of the ratio explain
constexpr double kSlipOfAPeak = 0.007;    // since the start: less of it has passed no peak
constexpr double kBoundMargin = 0.97;     // of mu* carried without a ramp
constexpr double kFrictionLeast = 0.01;   // that MinClampForce rests on, however little is known

bool in_experiment(State state) noexcept {
  return state == State::kRamping || state == State::kEvaluating || state == State::kReleasing;
}

// What the safety monitor found, as a reason to stop: motion leaves data worth evaluating. What
// its own request broke is an input's fault.
Stop stop_of(SafetyVerdict verdict, double figure, double limit) noexcept {
  constexpr double kPercent = 100.0;
  const auto percent = [&](const char* what) {
    return StopCause{
        .what = what, .figure = kPercent * figure, .limit = kPercent * limit, .unit = "%"};
  };
  const auto in = [&](const char* what, const char* unit) {
    return StopCause{.what = what, .figure = figure, .limit = limit, .unit = unit};
  };
  switch (verdict) {
    case SafetyVerdict::kSlip:
      return {StopReason::kSlip, percent("slip since the start")};
    case SafetyVerdict::kSlipSpeed:
      return {StopReason::kSlip, in("slip speed", "m/s")};
    case SafetyVerdict::kEnergy:
      return {StopReason::kSlipEnergy, in("slip energy", "J")};
    case SafetyVerdict::kSpeed: {
      StopCause cause = in("falls to", "rad/s");
      cause.role = Role::kPrimarySpeed;
      return {StopReason::kEngineSpeed, cause};
    }
    case SafetyVerdict::kSecondary: {
      StopCause cause = in("stands still or turns back", "rad/s");
      cause.role = Role::kSecondarySpeed;
      return {StopReason::kInputs, cause};
    }
    case SafetyVerdict::kEngine: {
      StopCause cause = percent("leaves the primary speed by");
      cause.role = Role::kEngineSpeed;
      return {StopReason::kEngineSpeed, cause};
    }
    case SafetyVerdict::kDuration:
      return {StopReason::kTime, {.what = "the request stands for too long"}};
    case SafetyVerdict::kFloor:
      return {StopReason::kForceFloor, in("request below its floor", "N")};
    case SafetyVerdict::kPause:
      return {StopReason::kInputs, {.what = "a request too soon after the last"}};
    case SafetyVerdict::kRise:
    case SafetyVerdict::kRate:
      return {StopReason::kInputs, {.what = "the request itself rises or falls too fast"}};
    default:
      return {StopReason::kInputs, {}};
  }
}

// Why an experiment was refused: what will not pass by itself first.
Stop stop_of(std::uint32_t inhibits) noexcept {
  if ((inhibits & inhibit_bit(Inhibit::kUnreachable)) != 0) {
    return {StopReason::kForceFloor, {.what = "the force floor lies above the peak's force"}};
  }
  if ((inhibits & inhibit_bit(Inhibit::kGrip)) != 0) {
    return {StopReason::kSlip,
            {.what = "friction has fallen: the own force hardly holds the belt"}};
  }
  if ((inhibits & inhibit_bit(Inhibit::kQuiet)) != 0) {
    return {StopReason::kInputs,
            {.what = "moves too seldom to show that it stands still, and so does engine_speed",
             .role = Role::kPrimarySpeed}};
  }
  if ((inhibits & inhibit_bit(Inhibit::kForce)) != 0) {
    return {StopReason::kTime, {.what = "the controller's own force did not come to rest"}};
  }
  if ((inhibits & inhibit_bit(Inhibit::kRamp)) != 0) {
    return {StopReason::kTime, {.what = "no ramp keeps the slip limits in the worst case"}};
  }
  return {StopReason::kTime, {.what = "the ramp would last longer than the coast-down"}};
}

}  // namespace

// --- frames ---------------------------------------------------------------------------------

void Pipeline::on_frame(const RxFrame& frame) noexcept {
  Parts& parts = *parts_;
  ++parts.counters.frames;
  if (frame.bus >= kBusMax) return;
  Parts::BusHealth& bus = parts.buses[frame.bus];
  if (frame.dropped_before != 0) parts.faults.raise(Fault::kFramesLost, frame.t);
  if (frame.frame.error) {
    const std::optional<BusState> state = bus_state_of(frame.frame);
    if (state) bus.controller = *state;
    if (state == BusState::kOff) bus.off_since = frame.t;
    return;
  }
  switch (parts.inputs.on_frame(frame, parts.faults)) {
    case FrameUse::kTaken:
      ++parts.counters.frames_decoded;
      // A controller that is off the bus hears nothing: it has come back. What it had heard before
      // may still be on its way.
      if (bus.controller == BusState::kOff && frame.t - bus.off_since > kStillComing) {
        bus.controller = BusState::kActive;
      }
      break;
    case FrameUse::kBad:
      ++parts.counters.frames_bad;
      break;
    case FrameUse::kForeign:
      parts.take_own_frame(frame);
      break;
  }
}

void Pipeline::Parts::take_own_frame(const RxFrame& frame) noexcept {
  if (frame.bus != 0 || frame.frame.id.extended) return;
  if (frame.own_echo) {
    if (frame.frame.id.value == config.identifiers.clamp) clamp_unconfirmed = false;
    return;
  }
  for (std::size_t i = 0; i < kOwnMessageCount; ++i) {
    if (frame.frame.id.value == own_identifier(config.identifiers, static_cast<OwnMessage>(i))) {
      faults.raise(Fault::kForeignSender, frame.t);
      last.foreign_identifier = frame.frame.id.value;
    }
  }
}

void Pipeline::on_bus_state(BusState state, MonoTime, std::uint8_t bus) noexcept {
  Parts::BusHealth& health = parts_->buses[bus];
  // A link that comes up again begins with a fresh controller.
  if (state == BusState::kActive && health.link != BusState::kActive) {
    health.controller = BusState::kActive;
  }
  health.link = state;
}

void Pipeline::on_late(MonoTime t, bool lost) noexcept {
  parts_->faults.raise(Fault::kSampleLate, t);
  parts_->samples_lost = parts_->samples_lost || lost;
}

void Pipeline::on_silence(std::int64_t samples) noexcept {
  parts_->counters.samples += static_cast<std::uint64_t>(samples);
}

void Pipeline::on_send_failed(const can::CanFrame& frame, MonoTime t, std::uint8_t bus) noexcept {
  parts_->faults.raise(Fault::kSendFailed, t);
  parts_->inputs.diagnostics().on_send_failed(frame, bus, t);
  if (bus == 0 && frame.id.value == parts_->config.identifiers.clamp) parts_->clamp_refused = true;
}

// --- one sample -----------------------------------------------------------------------------

void Pipeline::Parts::raise_bus_faults(MonoTime t) noexcept {
  for (const BusHealth& bus : buses) {
    if (bus.link == BusState::kDown || bus.link == BusState::kAbsent) {
      faults.raise(Fault::kBusDown, t);
    }
    if (bus.controller == BusState::kOff) faults.raise(Fault::kBusOff, t);
    if (bus.controller == BusState::kPassive) faults.raise(Fault::kBusPassive, t);
  }
}

bool Pipeline::Parts::buses_up() const noexcept {
  return std::all_of(buses.begin(), buses.end(),
                     [](const BusHealth& bus) { return !bus.needed || bus.up(); });
}

void Pipeline::learn(const estimator::LearnedFriction& learned) noexcept {
  parts_->learned = learned;
  if (!parts_->remembers) parts_->memory = learned.memory;
}

void Pipeline::Parts::raise_history_faults(MonoTime t) noexcept {
  const std::size_t group = estimator::belt_group(last.curve.direction, last.curve.end_stop);
  const bool fallen = memory.any_slip() || (last.curve.usable && share_left(group) < 1.0);
  if (learned.doubtful || contradictory || fallen) faults.raise(Fault::kResultDoubtful, t);
  if (learned.unwritten) faults.raise(Fault::kHistoryUnwritten, t);
}

// What MinClampForce may rest on at the present direction and end stop; 0: not known. What the belt
// has shown since a value was measured, there or elsewhere, lowers it.
double Pipeline::Parts::friction_to_rest_on() const noexcept {
  const std::size_t group = estimator::belt_group(last.curve.direction, last.curve.end_stop);
  return friction_measured(group) * std::min(share_slipped(group), share_left(group));
}

// mu_max of all experiments where they are kept, else of the last; its lower end where it rests on
// assumptions; 0: not known. A last value that differs by more than its noise and the scatter
// between experiments may be a belt that has changed: then the lower one of both.
double Pipeline::Parts::friction_measured(std::size_t index) const noexcept {
  const estimator::FusedFriction& fused = learned.groups[index];
  const auto safe = [&](double value, double low) {
    return config.friction_is_assumed ? std::max(low, kFrictionLeast) : value;
  };
  const double of_all = fused.known ? safe(fused.mu_max, fused.ci95_low) : 0.0;
  const std::size_t group = fused.known ? index : memory.rests_on(index);
  if (group == estimator::kBeltGroups || !memory.values[group].known()) return of_all;
  const estimator::BeltMemory::Value& newest = memory.values[group];
  const double of_last = safe(newest.mu_max, newest.ci95_low);
  if (!fused.known) return of_last;
  const double noise =
      estimator::kNormal95 *
      std::hypot(newest.relative_noise, fused.repeatability_percent / estimator::kPercent);
  if (std::abs(std::log(newest.mu_max / fused.mu_max)) <= noise) return of_all;
  return std::min(of_all, of_last);
}

// mu* of a torque by a clamp force.
double Pipeline::Parts::traction_1_m(std::size_t index) const noexcept {
  const bool overdrive = index % 2 == 0;
  const auto end_stop = overdrive ? estimator::EndStop::kOverdrive : estimator::EndStop::kLow;
  return 1.0 / estimator::torque_carried_Nm(config.variator, end_stop, 1.0, 1.0);
}

// The friction that a group rests on, as it would be read under the configuration's constants; 0:
// not known. A history keeps it as it was weighed, which differs where constants are assumed: then
// what the belt carried as its experiment ended stands for it, a little beyond its peak.
double Pipeline::Parts::known_as_read(std::size_t index) const noexcept {
  const std::size_t group = memory.rests_on(index);
  if (group == estimator::kBeltGroups) return learned.groups[index].mu_max;
  const estimator::BeltMemory::Value& value = memory.values[group];
  if (value.as_read > 0.0) return value.as_read;
  return config.friction_is_assumed ? value.carried_Nm_per_N * traction_1_m(group) : value.mu_max;
}

// Share of the friction known of a group that was left as the belt slipped there; 1: it has not.
double Pipeline::Parts::share_slipped(std::size_t index) const noexcept {
  const estimator::BeltMemory::Slip& slip = memory.slips[index];
  const double known = known_as_read(index);
  if (!slip.known() || !(known > 0.0)) return 1.0;
  // Both were read under the same constants, assumed ones or not: their ratio is the belt's.
  return std::min(1.0, slip.carried_Nm_per_N * traction_1_m(index) / known);
}

// Share that is left by what the other groups have shown since this one was measured.
double Pipeline::Parts::share_left(std::size_t index) const noexcept {
  const std::size_t group = memory.rests_on(index);
  if (group == estimator::kBeltGroups) return 1.0;
  const double scatter = learned.groups[index].repeatability_percent / estimator::kPercent;
  double share = memory.share_left(group, scatter);
  for (std::size_t other = 0; other < estimator::kBeltGroups; ++other) {
    if (other != index && memory.slips[other].order > memory.values[group].order) {
      share = std::min(share, share_slipped(other));
    }
  }
  return share;
}

bool Pipeline::Parts::stopped_by_slip() const noexcept {
  const StopReason reason = running.stop_reason;
  return running.stopped && (reason == StopReason::kSlope || reason == StopReason::kSlip ||
                             reason == StopReason::kSlipRate || reason == StopReason::kSlipEnergy);
}

// The belt went through with less friction than is known, and the data give no value: a worn belt
// whose ramp began too near its peak. What it carried at the most is then all that may be counted
// on, until something is measured.
void Pipeline::Parts::keep_slipped() noexcept {
  // Where the estimator doubts an input as it stops, the belt may have slipped all the same.
  const bool doubted = running.stopped && running.stop_reason == StopReason::kInputs &&
                       running.sigma_stop_percent - sigma_first_percent > kSlipped_percent;
  if (running.peak.kind == PeakKind::kValue || !(stopped_by_slip() || doubted)) return;
  const std::size_t index = estimator::belt_group(running.direction, running.end_stop);
  const double known = known_as_read(index);
  if (!(mu_star_most > 0.0) || mu_star_most >= (1.0 - kShortOfTheTop) * known) return;
  memory.take_slip(index, mu_star_most / traction_1_m(index));
  remembers = result.slipped = true;
}

void Pipeline::Parts::keep_measured() noexcept {
  const estimator::PeakEstimate& peak = running.peak;
  if (peak.kind != PeakKind::kValue) return;
  const double noise = (peak.noise_high - peak.noise_low) / (2.0 * estimator::kNormal95);
  memory.take_value(estimator::belt_group(running.direction, running.end_stop), peak.mu_max,
                    peak.ci95_low, noise / peak.mu_max, friction_as_read, 0.0);
  remembers = true;
}

SlipShown& Pipeline::Parts::shown(estimator::Direction direction,
                                  estimator::EndStop end_stop) noexcept {
  return slip_shown[direction == estimator::Direction::kDrive ? 0 : 1]
                   [end_stop == estimator::EndStop::kOverdrive ? 0 : 1];
}

bool Pipeline::Parts::by_conditions() const noexcept {
  return config.trigger == Trigger::kCoastDown || config.trigger == Trigger::kSteady;
}

bool Pipeline::Parts::triggered() const noexcept {
  if (by_conditions()) {
    return in_experiment(state) ? !ended_by() : arming.triggered();
  }
  if (config.trigger == Trigger::kAlways) return true;
  // A signal that has gone keeps its last word: the end of an experiment must be said.
  const SignalHistory& active = inputs.history(Role::kExperimentActive);
  return !active.empty() && active.newest_value() > 0.5;
}

// What of the car ends the experiment under way. Torque, ratio and slip are what it is about: they
// are the estimator's to judge.
Stop Pipeline::Parts::ended_by() const noexcept {
  const double speed_min_rad_s =
      limits::kRequestSpeedShare * config.experiment.primary_speed_min_rad_s;
  if (last.sample.omega_p_rad_s < speed_min_rad_s) {
    return {StopReason::kEngineSpeed,
            {.what = "falls to",
             .figure = last.sample.omega_p_rad_s,
             .limit = speed_min_rad_s,
             .unit = "rad/s",
             .role = Role::kPrimarySpeed}};
  }
  return arming.ended_by(conditions);
}

// An observed experiment is over when what it needs of the car has gone, or when the force that was
// lowered is back and holds the belt: not before, the flag tells whoever lowers it.
bool Pipeline::Parts::observed_over() const noexcept {
  const VariatorSample& sample = last.sample;
  const double torque_Nm =
      config.trigger == Trigger::kCoastDown ? -sample.torque_Nm : sample.torque_Nm;
  if (!triggered() || inputs.any_lost() || torque_Nm < 0.0) return true;
  const double restored_N = ClampRequest::kRestored * own_force_N;
  return last.curve.usable && running.clamp_force_N < restored_N &&
         measured_force_N() >= restored_N &&
         arming.at_end_stop(sample.omega_s_rad_s / sample.omega_p_rad_s);
}

double Pipeline::Parts::value_or(Role role, double otherwise, bool& fresh) const noexcept {
  if (!inputs.is_bound(role)) return otherwise;
  fresh = fresh && inputs.quality(role) == SignalQuality::kValid;
  return inputs.history(role).empty() ? otherwise : inputs.history(role).newest_value();
}

Conditions Pipeline::Parts::read_conditions() const noexcept {
  Conditions now;
  now.permitted = value_or(Role::kExperimentPermitted, 1.0, now.fresh) > 0.5;
  now.lockup_closed = value_or(Role::kLockupClosed, 1.0, now.fresh) > 0.5;
  now.brake_pressed = value_or(Role::kBrakePressed, 0.0, now.fresh) > 0.5;
  now.accelerator = value_or(Role::kAcceleratorPedal, now.accelerator, now.fresh);
  now.oil_degC = value_or(Role::kOilTemperature, now.oil_degC, now.fresh);
  return now;
}

// How long the slowest of those inputs may be silent whose silence could hide that a request must
// end. Oil and vehicle speed change nothing within it.
Duration Pipeline::Parts::slowest_stale() const noexcept {
  Duration slowest = InputMonitor::kStaleMinimum;
  for (std::size_t i = 0; i < kRoleCount; ++i) {
    const auto role = static_cast<Role>(i);
    const bool idle = role == Role::kOilTemperature || role == Role::kVehicleSpeed;
    if (idle || !inputs.is_bound(role)) continue;
    slowest = std::max(slowest, inputs.period(role).value_or(0) * 5 / 2);
  }
  return slowest;
}

// The clamp force in the transmission's own measure, which requests are made in.
double Pipeline::Parts::measured_force_N() const noexcept {
  return last.curve.clamp_force_N - (correction ? correction->force_error_N() : 0.0);
}

double Pipeline::Parts::value_if_known(Role role) const noexcept {
  bool known = inputs.is_bound(role);
  const double value = value_or(role, 0.0, known);
  return known ? value : 0.0;
}

ClampRequest::Now Pipeline::Parts::request_now(MonoTime t) const noexcept {
  return {t,
          last.sample.omega_p_rad_s,
          last.sample.omega_s_rad_s,
          last.curve.torque_p_Nm,
          measured_force_N(),
          last.curve.mu_star,
          value_if_known(Role::kEngineSpeed),
          value_if_known(Role::kVehicleSpeed)};
}

// The trigger's preconditions, with the estimator's view of the sample before.
void Pipeline::Parts::arm(MonoTime t) noexcept {
  conditions = read_conditions();
  if (in_experiment(state)) return;
  Arming::Now now;
  now.t = t;
  now.usable = last.sample.usable && last.curve.usable;
  now.cooled = !commands() || request.cooled();
  now.faulted =
      commands() && (faults.has(Fault::kForeignSender) || faults.has(Fault::kFrameRefused) ||
                     faults.has(Fault::kBusPassive) || faults.has(Fault::kSampleLate) ||
                     faults.has(Fault::kBusOff) || faults.has(Fault::kBusDown) ||
                     faults.has(Fault::kSendFailed) || inputs.suspect() || unconfirmed(t));
  now.omega_p_rad_s = last.sample.omega_p_rad_s;
  now.omega_s_rad_s = last.sample.omega_s_rad_s;
  now.torque_Nm = last.curve.torque_p_Nm;
  now.clamp_force_N = measured_force_N();
  now.slip_percent = last.curve.sigma_star_percent;
  now.mu_max_known = estimate.kind == PeakKind::kValue ? friction_as_read : 0.0;
  const std::size_t group = estimator::belt_group(last.curve.direction, last.curve.end_stop);
  const estimator::BeltMemory::Slip& slip = memory.slips[group];
  if (slip.known()) now.mu_max_known = slip.carried_Nm_per_N * traction_1_m(group);
  now.shown = shown(last.curve.direction, last.curve.end_stop);
  now.stale = slowest_stale();
  now.watched = !commands() || state != State::kSettling || inputs.standstill_shows();
  now.conditions = conditions;
  arming.step(now);
}

// Every input comes, but for as long as makes one stale no sample could be made of them: a primary
// speed at zero, say.
bool Pipeline::Parts::starved(MonoTime t) const noexcept {
  if (state != State::kRamping) return false;
  const Duration slowest = std::max(sampler.delay().value_or(0), sample_period(config));
  return t - last_usable > std::max(InputMonitor::kStaleMinimum, slowest * 5 / 2);
}

// Nobody has confirmed what was asked: it may not be on the bus at all.
bool Pipeline::Parts::unconfirmed(MonoTime t) const noexcept {
  return clamp_unconfirmed && t - clamp_sent >= kConfirmationMax;
}

// A controller that has seen no inactive frame refuses a request: before each one it gets some.
void Pipeline::Parts::announce(MonoTime t) noexcept {
  const bool ready = commands() && by_conditions() && state == State::kSettling &&
                     arming.settled() && arming.cleared();
  if (!ready) {
    announced.reset();
  } else if (!announced) {
    announced = t;
    publisher.repeat_inactive();
  }
}

// A frame that was lost with its bus is never confirmed. Inactive frames tell whether the bus is
// back, and the receiver that the request is over.
void Pipeline::Parts::ask_again(MonoTime t) noexcept {
  if (!clamp_unconfirmed || in_experiment(state) || t - clamp_sent < kConfirmationRetry) return;
  clamp_unconfirmed = false;
  if (!faults.has(Fault::kForeignSender)) publisher.repeat_inactive();
}

void Pipeline::Parts::withdraw(const Stop& stop) noexcept {
  if (!withdrawn) withdrawn = stop;
}

// Which of the signals beside the sample is not there.
Stop Pipeline::Parts::missing_condition() const noexcept {
  for (const Role role : {Role::kExperimentPermitted, Role::kLockupClosed, Role::kBrakePressed,
                          Role::kAcceleratorPedal, Role::kOilTemperature}) {
    if (!inputs.is_bound(role) || inputs.quality(role) == SignalQuality::kValid) continue;
    return {StopReason::kInputs, {.what = "silent", .role = role}};
  }
  return {StopReason::kInputs, {}};
}

// Why there is no sample where there should be one.
Stop Pipeline::Parts::lost(MonoTime t) const noexcept {
  if (const Stop gone = inputs.lost(t)) return gone;
  if (samples_lost) return {StopReason::kInputs, {.what = "samples were taken too late"}};
  if (starved(t)) {
    return {StopReason::kInputs,
            {.what = "reads what gives no sample for",
             .figure = static_cast<double>(t - last_usable) * 1e-9,
             .unit = "s",
             .role = Role::kPrimarySpeed}};
  }
  return missing_condition();
}

void Pipeline::Parts::withdraw_for_bus(MonoTime t) noexcept {
  const char* what = clamp_refused                       ? "a clamp frame could not be sent"
                     : faults.has(Fault::kForeignSender) ? "a foreign sender uses our identifiers"
                     : faults.has(Fault::kFrameRefused)  ? "the transmit gate refused a frame"
                     : unconfirmed(t)                    ? "clamp frames are not confirmed"
                                                         : nullptr;
  if (what != nullptr) withdraw({StopReason::kBus, {.what = what}});
}

// Does the force follow, and is it the force that does not, or its reading?
void Pipeline::Parts::judge_following(MonoTime t) noexcept {
  if (request.followed()) return;
  const ValueCourse& pressure = inputs.course(Role::kSecondaryPressure);
  if (request.changed_since(pressure.since()) &&
      pressure.stood_for() >= ClampRequest::kFollowTime) {
    inputs.stands_still(Role::kSecondaryPressure);
    faults.raise(Fault::kInputFrozen, t);
    withdraw({StopReason::kInputFrozen,
              {.what = "stands still while the request falls, for",
               .figure = static_cast<double>(pressure.stood_for()) * 1e-9,
               .unit = "s",
               .role = Role::kSecondaryPressure}});
    return;
  }
  withdraw({StopReason::kClampNotFollowed,
            {.what = "clamping force off the request by",
             .figure = request.off_N(),
             .limit = request.follow_band_N(),
             .unit = "N"}});
}

void Pipeline::Parts::judge_safety(MonoTime t) noexcept {
  SafetySignals signals;
  signals.fresh = !inputs.any_lost() && !inputs.suspect() && !samples_lost && conditions.fresh;
  signals.omega_p_rad_s = last.sample.omega_p_rad_s;
  signals.omega_s_rad_s = last.sample.omega_s_rad_s;
  signals.torque_Nm = last.sample.torque_Nm;
  signals.primary_radius_m = signals.omega_s_rad_s > signals.omega_p_rad_s
                                 ? config.variator.primary_radius_overdrive_m
                                 : config.variator.primary_radius_low_m;
  signals.omega_e_rad_s = value_if_known(Role::kEngineSpeed);
  const SafetyVerdict verdict =
      safety.check(t, signals, state == State::kRamping ? request.force_N() : 0.0);
  if (verdict == SafetyVerdict::kAllowed) return;
  const Stop stop = stop_of(verdict, safety.figure(), safety.limit());
  if (stop.reason == StopReason::kInputs) {
    withdraw(verdict == SafetyVerdict::kInputs ? lost(t) : stop);
  } else if (!backup_stop) {
    backup_stop = stop;
  }
}

// Inputs that come and go would open and close the way to an experiment many times a second: once
// lost, they count again when they have held.
bool Pipeline::Parts::usable_again(MonoTime t) const noexcept {
  return state != State::kInhibited || !last_unusable || t - *last_unusable >= kUsableAgain;
}

// One sample of a standing request: what ends it, and by how much it falls. The safety monitor has
// the last word.
void Pipeline::Parts::step_request(MonoTime t) noexcept {
  backup_stop = withdrawn = {};
  if (!commands()) return;
  if (state == State::kRamping) {
    if (!conditions.fresh) withdraw(missing_condition());
    if (inputs.suspect()) {
      withdraw({StopReason::kInputs, {.what = "a message at a wrong rate, or its counter or CRC"}});
    }
    withdraw(arming.ended_by(conditions));
    withdraw_for_bus(t);
    if (last.sample.usable && last.curve.usable) {
      request.step(request_now(t), arming.floor_N(last.sample.omega_s_rad_s));
      backup_stop = {request.backup_stop(), request.cause()};
      if (backup_stop.reason == StopReason::kInputFrozen && backup_stop.cause.role) {
        inputs.stands_still(*backup_stop.cause.role);
        faults.raise(Fault::kInputFrozen, t);
        withdraw(backup_stop);
      }
      judge_following(t);
    } else {
      request.hold(t);
    }
  }
  if (state == State::kReleasing && !refused) judge_release(t);
  clamp_refused = false;
  judge_safety(t);
}

// A force that seems not to come back: is it the force, or its reading?
void Pipeline::Parts::judge_release(MonoTime t) noexcept {
  if (!last.sample.usable || !last.curve.usable) return;
  const ClampRequest::Now now = request_now(t);
  request.follow_release(now);
  if (!request.stuck(now)) return;
  const MonoTime since = inputs.course(Role::kSecondaryPressure).since();
  misread = request.held_again().value_or(since <= request.ended());
  if (!misread) return;
  inputs.stands_still(Role::kSecondaryPressure);
  faults.raise(Fault::kInputFrozen, t);
}

// How the inputs should move while a request stands, and until the force is back.
void Pipeline::Parts::watch_inputs() noexcept {
  InputMonitor::Watch watch;
  const bool runs = in_experiment(state) && !refused;
  watch.on = commands() && (runs || state == State::kSettling);
  watch.slopes = state == State::kSettling || state == State::kRamping;
  if (commands() && state == State::kRamping) {
    watch.torque_sign = std::copysign(1.0, last.curve.torque_p_Nm);
    watch.request_begun = running.start;
    watch.fall_Pa_per_s = request.rate_N_per_s() / config.variator.secondary_piston_area_m2;
    watch.answer = std::llround(1e9 * (config.experiment.actuator_dead_time_s +
                                       kAnswerLags * config.experiment.actuator_lag_s));
  }
  inputs.watch(watch);
}

Guards Pipeline::Parts::guards(MonoTime t) const noexcept {
  Guards now;
  now.inputs_usable = last.sample.usable && usable_again(t);
  now.inputs_lost =
      inputs.any_lost() || samples_lost || starved(t) || (observes() && !conditions.fresh);
  if (now.inputs_lost) now.lost_reason = lost(t).reason;
  now.bus_up = buses_up();
  now.triggered = triggered();
  now.settled = !by_conditions() || arming.settled();
  if (commands() && arming.cleared()) {
    now.settled = now.settled && announced && t - *announced >= limits::kAnnounced &&
                  publisher.inactive_told();
  }
  now.cleared = !commands() || arming.cleared();
  now.released = observes() ? observed_over() : !now.triggered;
  now.cooled = true;
  if (!commands()) return now;
  // While a request stands, its own stops say when it ends.
  if (state == State::kRamping) now.triggered = true;
  now.released = refused || request.released(request_now(t));
  now.stuck = !refused && last.sample.usable && !misread && request.stuck(request_now(t));
  now.cooled = request.cooled();
  now.faulted = forbidden();
  return now;
}

void Pipeline::Parts::step(MonoTime t) noexcept {
  last.curve = estimator->step(correction ? correction->correct(last.sample) : last.sample);
  if (state == State::kRamping && last.sample.usable) ++running.samples;
  if (state == State::kRamping && last.sample.usable && last.curve.usable) {
    mu_star_most = std::max(mu_star_most, std::abs(last.curve.mu_star));
  }
  if (last.sample.usable) last_usable = t;
  // Outside an experiment the estimator only watches; what would have stopped it (a ratio that is
  // no end stop's, torque that changes its sign) starts it afresh.
  if (!in_experiment(state) && last.curve.stop != StopReason::kNone) {
    estimator->reset();
    last.curve = {};
    last.curve.t_ns = last.sample.t_ns;
  }
  last.t = t;
}

void Pipeline::Parts::stop(MonoTime t, const Stop& why) noexcept {
  running.end = t;
  running.stop_reason = why.reason;
  running.cause = why.cause;
  running.sigma_stop_percent = std::abs(last.curve.sigma_star_percent);
  running.direction = last.curve.direction;
  running.end_stop = last.curve.end_stop;
  running.omega_p_rad_s = last.sample.omega_p_rad_s;
  running.omega_s_rad_s = last.sample.omega_s_rad_s;
  running.torque_Nm = last.curve.torque_p_Nm;
  running.clamp_force_N = last.curve.clamp_force_N;
  const bool oil_known = inputs.quality(Role::kOilTemperature) == SignalQuality::kValid;
  running.oil_degC = oil_known ? inputs.history(Role::kOilTemperature).newest_value()
                               : std::numeric_limits<double>::quiet_NaN();
}

Outcome Pipeline::Parts::judged_outcome() const noexcept {
  return running.peak.kind == PeakKind::kValue ? Outcome::kCompleted : Outcome::kInconclusive;
}

void Pipeline::Parts::publish_result(Outcome outcome) noexcept {
  running.outcome = outcome;
  result = running;
  last.new_result = true;
  if (outcome == Outcome::kAborted) return;  // says nothing of mu_max: the last result stands
  // Only a measured value settles a doubt.
  const bool doubtful = running.peak.contradictory || running.peak.impossible;
  contradictory = doubtful || (contradictory && running.peak.kind != PeakKind::kValue);
  keep_slipped();
  keep_measured();
  // Neither does a bound below what is known: coast-downs without a ramp come all the time.
  const bool weaker = running.peak.kind != PeakKind::kValue && estimate.kind == PeakKind::kValue &&
                      running.peak.mu_max <= estimate.mu_max;
  if (by_conditions() && weaker && !running.peak.impossible) return;
  estimate.kind = running.peak.kind;
  estimate.mu_max = running.peak.mu_max;
  estimate.mu_max_std = running.peak.mu_max_std;
  ++estimate.experiment_count;
  estimate_changed = true;
  if (commands() && running.peak.kind == PeakKind::kValue) {
    shown(running.direction, running.end_stop) = {slip_own_percent,
                                                  running.peak.sigma_peak_percent};
  }
}

// What the estimator saw when it stopped.
StopCause Pipeline::Parts::estimator_cause() const noexcept {
  switch (last.curve.stop) {
    case StopReason::kSlope:
      return {.what = "friction no longer rises with slip: slope",
              .figure = last.curve.friction_slope,
              .unit = "1/%"};
    case StopReason::kSlip:
    case StopReason::kSlipRate:
      return {.what = "slip runs away, at", .figure = last.curve.sigma_star_percent, .unit = "%"};
    case StopReason::kInputs:
      return {.what = "an input stands still, or reads what no belt does: mu*",
              .figure = last.curve.mu_star};
    case StopReason::kTorque:
      return {.what = "torque near zero or of the other sign",
              .figure = last.curve.torque_p_Nm,
              .unit = "Nm"};
    case StopReason::kRatio:
      return {.what = "slip that no end stop explains",
              .figure = last.curve.sigma_star_percent,
              .unit = "%"};
    default:
      return {};
  }
}

// With the reason that the state machine chose.
Stop Pipeline::Parts::abort_of(StopReason reason, MonoTime t) const noexcept {
  if (withdrawn.reason == reason) return withdrawn;
  if (reason == StopReason::kBus) return {reason, {.what = "a bus is down or off"}};
  const Stop gone = lost(t);
  return gone.reason == reason ? gone : Stop{reason, {}};
}

void Pipeline::Parts::apply(const Transition& transition, MonoTime t) noexcept {
  state = transition.next;
  switch (transition.action) {
    case Action::kNone:
      break;
    case Action::kStart:
      if (commands()) {
        request.begin(request_now(t), arming.ramp().rate_N_per_s,
                      arming.floor_N(last.sample.omega_s_rad_s));
      }
      own_force_N = measured_force_N();
      omega_s_at_start = last.sample.omega_s_rad_s;
      mu_star_most = 0.0;
      sigma_first_percent = std::abs(last.curve.sigma_star_percent);
      estimator->reset();
      running = {};
      running.start = t;
      evaluation = Evaluation::kCurve;
      slip_own_percent = arming.slip_percent();
      refused = misread = false;
      break;
    case Action::kRefuse:
      running = {};
      running.start = t;
      evaluation = Evaluation::kCurve;
      refused = true;
      request.end(t);
      stop(t, stop_of(arming.inhibits()));
      break;
    case Action::kStop:
      macro_slip_stop = true;
      running.stopped = true;
      stop(t, backup_stop ? backup_stop : Stop{last.curve.stop, estimator_cause()});
      break;
    case Action::kEnd:
      stop(t, observes() ? ended_by() : Stop{});
      break;
    case Action::kAbort:
      macro_slip_stop = true;
      running.stopped = true;
      stop(t, abort_of(transition.abort_reason, t));
      publish_result(Outcome::kAborted);
      break;
    case Action::kPublish:
      publish_result(judged_outcome());
      break;
    case Action::kOver:
      macro_slip_stop = false;
      if (state == State::kFault) faults.latch(Fault::kClampStuck);
      arming.reset();
      estimator->reset();
      break;
  }
  if (state != State::kRamping && request.standing()) request.end(t);
}

// Without a ramp the data hold no peak, only what the belt carried.
void Pipeline::Parts::bound_only() noexcept {
  const double carried = kBoundMargin * std::abs(last.curve.mu_star);
  running.peak = {};
  if (!(carried > 0.0)) return;
  running.peak.kind = PeakKind::kLowerBound;
  running.peak.mu_max = carried;
  running.peak.clamp_force_N = last.curve.clamp_force_N;
  running.peak.omega_s_rad_s = last.sample.omega_s_rad_s;
}

void Pipeline::Parts::read_peak() noexcept {
  running.peak = estimator->peak();
  if (refused) {
    bound_only();
  } else if (commands() && running.peak.kind == PeakKind::kValue &&
             request.slip_max() < kSlipOfAPeak) {
    running.peak.kind = PeakKind::kLowerBound;
    running.peak.mu_max = running.peak.ci95_low;
  }
  if (running.peak.kind == PeakKind::kValue) friction_as_read = running.peak.mu_max;
}

// One sample's share of an evaluation; true once running.peak says what is published. What was read
// rests on the configuration's constants; what is known of mu_max also on those that nobody stated.
bool Pipeline::Parts::evaluate() noexcept {
  estimator::PeakEstimate& peak = running.peak;
  if (evaluation == Evaluation::kCurve) {
    if (!estimator->conclude()) return false;
    read_peak();
    const double noise = (peak.noise_high - peak.noise_low) / (2.0 * estimator::kNormal95);
    begin_weighing(peak.kind == PeakKind::kNone ? 0.0 : peak.mu_max, peak.clamp_force_N,
                   peak.kind == PeakKind::kValue ? noise / peak.mu_max : 0.0);
    evaluation = Evaluation::kPeak;
    if (weighing) return false;
  }
  if (weighing && !assumptions->step()) return false;
  if (evaluation == Evaluation::kPeak) {
    if (weighing) weigh_peak();
    estimator::refuse_no_belt(peak);
    begin_weighing(peak.contradictory ? top_reached() : 0.0, top_force_N(), 0.0);
    evaluation = Evaluation::kTop;
    if (weighing) return false;
  }
  if (evaluation == Evaluation::kTop) weigh_top();
  evaluation = Evaluation::kDone;
  return true;
}

// Of a friction mu, read at this clamp force; 0: there is nothing to be weighed.
void Pipeline::Parts::begin_weighing(double mu, double force_N, double relative_noise) noexcept {
  weighing = assumptions && mu > 0.0 && force_N > 0.0;
  if (!weighing) return;
  estimator::PeakReading reading = reading_at(mu, force_N);
  reading.relative_noise = relative_noise;
  assumptions->begin(reading);
}

// Points that lie on no one curve have a top all the same: the belt slipped there.
double Pipeline::Parts::top_reached() const noexcept {
  if (running.peak.mu_refused > 0.0) return running.peak.mu_refused;
  return stopped_by_slip() ? mu_star_most : 0.0;
}

double Pipeline::Parts::top_force_N() const noexcept {
  return running.peak.clamp_force_N > 0.0 ? running.peak.clamp_force_N : running.clamp_force_N;
}

void Pipeline::Parts::weigh_top() noexcept {
  estimator::PeakEstimate& peak = running.peak;
  const double reached = top_reached();
  if (peak.contradictory && reached > 0.0 && top_force_N() > 0.0) {
    estimator::FrictionSpread top{reached, reached, reached};
    if (weighing && assumptions) top = assumptions->spread();
    peak.impossible = top.high < estimator::kBeltLeast || top.low > estimator::kBeltMost;
    if (peak.impossible) peak.mu_refused = reached;
  }
  if (peak.kind != PeakKind::kValue) return;
  const double noise_std = (peak.noise_high - peak.noise_low) / (2.0 * estimator::kNormal95);
  running.sensor_std =
      std::sqrt(std::max(0.0, peak.mu_max_std * peak.mu_max_std - noise_std * noise_std));
}

estimator::PeakReading Pipeline::Parts::reading_at(double mu, double force_N) const noexcept {
  const bool overdrive = running.end_stop == estimator::EndStop::kOverdrive;
  const double ratio = overdrive ? config.variator.ratio_overdrive : config.variator.ratio_low;
  const double sign = running.direction == estimator::Direction::kDrive ? 1.0 : -1.0;
  const auto duration_ns = static_cast<double>(std::max<Duration>(running.end - running.start, 1));
  const double duration_s = duration_ns / static_cast<double>(kSecond);
  estimator::PeakReading reading;
  reading.end_stop = running.end_stop;
  reading.mu = mu;
  reading.clamp_force_N = force_N;
  reading.torque_Nm = estimator::torque_carried_Nm(config.variator, running.end_stop, force_N, mu);
  const double omega_s_rad_s = running.peak.omega_s_rad_s;
  reading.omega_s_rad_s = omega_s_rad_s > 0.0 ? omega_s_rad_s : running.omega_s_rad_s;
  // The primary speed itself falls or rises by slip at the end.
  reading.acceleration_rad_s2 =
      sign * (running.omega_s_rad_s - omega_s_at_start) / (ratio * duration_s);
  return reading;
}

void Pipeline::Parts::weigh_peak() noexcept {
  if (!assumptions) return;
  estimator::PeakEstimate& peak = running.peak;
  const estimator::FrictionSpread& spread = assumptions->spread();
  if (peak.kind == PeakKind::kLowerBound) {
    peak.mu_max = std::min(peak.mu_max, spread.low);
    return;
  }
  const double scale = spread.median / peak.mu_max;
  peak.mu_max = spread.median;
  peak.ci95_low = spread.low;
  peak.ci95_high = spread.high;
  peak.mu_max_std = (spread.high - spread.low) / (2.0 * estimator::kNormal95);
  peak.noise_low *= scale;
  peak.noise_high *= scale;
}

const SampleReport& Pipeline::on_sample(MonoTime t, Outbox& outbox) noexcept {
  Parts& parts = *parts_;
  ++parts.counters.samples;
  parts.last.new_result = false;
  parts.estimate_changed = false;
  parts.faults.expire(t);
  parts.watch_inputs();
  parts.inputs.update(t, parts.faults);
  parts.raise_bus_faults(t);
  parts.raise_history_faults(t);
  parts.last.sample = parts.sampler.sample(t, !in_experiment(parts.state));
  if (!parts.last.sample.usable && parts.was_usable) parts.last_unusable = t;
  parts.was_usable = parts.was_usable || parts.last.sample.usable;

  parts.ask_again(t);

  // An experiment begins before the sample is used and stops after it.
  if (parts.by_conditions()) parts.arm(t);
  parts.announce(t);
  bool speed_known = true;
  const double speed_m_s = parts.value_or(Role::kVehicleSpeed, 0.0, speed_known);
  parts.request.travel(t, speed_known ? speed_m_s : 0.0);
  if (!in_experiment(parts.state)) parts.apply(next_state(parts.state, parts.guards(t)), t);
  parts.step(t);
  parts.step_request(t);
  Guards guards = parts.guards(t);
  guards.stop_decided =
      parts.last.curve.stop != StopReason::kNone || static_cast<bool>(parts.backup_stop);
  guards.withdrawn = static_cast<bool>(parts.withdrawn);
  guards.withdrawn_reason = parts.withdrawn.reason;
  if (parts.state == State::kRamping || parts.state == State::kReleasing) {
    parts.apply(next_state(parts.state, guards), t);
  }
  if (parts.state == State::kEvaluating) {
    guards.concluded = parts.evaluate();
    parts.apply(next_state(parts.state, guards), t);
  }
  parts.samples_lost = false;

  Outbox wanted;
  parts.report(t);
  parts.publisher.collect(t, parts.publication(), wanted);
  parts.inputs.diagnostics().step(t, {parts.buses[0].up(), parts.buses[1].up()}, wanted);
  parts.pass_gate(wanted, outbox);
  return parts.last;
}

const SampleReport& Pipeline::on_end(MonoTime t, StopReason reason, Outbox& outbox) noexcept {
  Parts& parts = *parts_;
  parts.last.new_result = false;
  parts.estimate_changed = false;
  const bool running = parts.state == State::kRamping;
  if (running) parts.stop(parts.last.t, {reason, {}});
  if (running || parts.state == State::kEvaluating) {
    bool concluded = false;
    for (int call = 0; call < kConcludeCallsMax && !concluded; ++call) {
      concluded = parts.evaluate();
    }
    if (!concluded) parts.running.peak = {};
    parts.publish_result(parts.judged_outcome());
  }
  parts.state = State::kInhibited;
  if (parts.request.standing()) parts.request.end(t);
  Outbox wanted;
  parts.report(t);
  parts.publisher.collect_all(t, parts.publication(), wanted);
  parts.pass_gate(wanted, outbox);
  parts.last.sample.usable = false;
  return parts.last;
}

// --- what leaves ----------------------------------------------------------------------------

void Pipeline::Parts::report(MonoTime t) noexcept {
  last.t = t;
  last.state = state;
  last.in_experiment = in_experiment(state);
  last.macro_slip_stop = macro_slip_stop;
  last.stop_reason = macro_slip_stop ? running.stop_reason : StopReason::kNone;
  last.stop_cause = macro_slip_stop ? running.cause : StopCause{};
  last.result = result;
  last.faults = faults.bits();
  last.frozen = inputs.frozen();
  last.inhibits = by_conditions() ? arming.inhibits() : 0U;
  last.request_force_N = state == State::kRamping ? request.force_N() : 0.0;
  last.ramp_N_per_s = state == State::kRamping && commands() ? request.rate_N_per_s() : 0.0;
}

Publication Pipeline::Parts::publication() const noexcept {
  Publication now;
  now.command = commands();
  now.clamp = {last.request_force_N > 0.0, last.request_force_N};
  now.in_experiment = last.in_experiment;
  now.new_result = estimate_changed;
  now.estimate = estimate;
  const estimator::CurveEstimate& curve = last.curve;
  const double friction = friction_to_rest_on();
  if (friction > 0.0 && curve.usable && last.sample.usable) {
    now.estimate.min_clamp_force_N =
        estimator::min_clamp_force_N(config.variator, curve.end_stop, curve.torque_p_Nm, friction);
  }
  now.slip.macro_slip_stop = macro_slip_stop;
  now.slip.phase = curve.phase;
  now.slip.available = curve.usable && last.sample.usable;
  now.slip.mu_star = curve.mu_star;
  now.slip.sigma_star_percent = curve.sigma_star_percent;
  now.slip.friction_slope = curve.friction_slope;
  now.status = {state, result.outcome, result.stop_reason, last.faults};
  return now;
}

void Pipeline::Parts::pass_gate(const Outbox& wanted, Outbox& outbox) noexcept {
  for (std::size_t i = 0; i < wanted.size; ++i) {
    if (!gate.permits(wanted.frames[i], wanted.bus[i], last.t)) {
      faults.latch(Fault::kFrameRefused);
      continue;
    }
    outbox.push(wanted.frames[i], wanted.bus[i]);
    if (wanted.bus[i] == 0 && wanted.frames[i].id.value == config.identifiers.clamp &&
        !clamp_unconfirmed) {
      clamp_unconfirmed = true;
      clamp_sent = last.t;
    }
  }
  counters.frames_refused = refused_before + gate.refused();
  counters.diagnostics = inputs.diagnostics().counters();
}

// --- another configuration ------------------------------------------------------------------

void Pipeline::Parts::go_on_from(const Parts& before, bool keeps_results) noexcept {
  publisher.go_on_from(before.publisher);
  faults = before.faults;
  counters = before.counters;
  refused_before = before.counters.frames_refused;
  // While a fault forbids requests; a controller that kept one is not to be asked again at all.
  if (before.state == State::kFault) state = State::kFault;
  for (std::size_t i = 0; i < kBusMax; ++i) {
    const bool needed = buses[i].needed;
    buses[i] = before.buses[i];
    buses[i].needed = needed;
  }
  clamp_unconfirmed = before.clamp_unconfirmed;
  clamp_sent = before.clamp_sent;
  last.t = before.last.t;
  // What was found is no less found under a configuration that it does not hold for.
  estimate.experiment_count = before.estimate.experiment_count;
  if (!keeps_results) return;
  estimate = before.estimate;
  result = before.result;
  learned = before.learned;
  friction_as_read = before.friction_as_read;
  memory = before.memory;
  remembers = before.remembers;
  contradictory = before.contradictory;
  slip_shown = before.slip_shown;
}

void Pipeline::give_way_to(Pipeline& next, bool keeps_results) noexcept {
  next.parts_->go_on_from(*parts_, keeps_results);
  parts_.swap(next.parts_);
}

const PipelineCounters& Pipeline::counters() const noexcept { return parts_->counters; }

std::size_t Pipeline::bus_count() const noexcept { return parts_->config.further_bus ? 2 : 1; }

SignalObservation Pipeline::signal(Role role) const noexcept {
  const SignalHistory& history = parts_->inputs.history(role);
  SignalObservation seen{.quality = parts_->inputs.quality(role), .seen = !history.empty()};
  if (seen.seen) {
    seen.value = history.newest_value();
    seen.t = history.newest();
  }
  return seen;
}

}  // namespace beltgrip::daemon
