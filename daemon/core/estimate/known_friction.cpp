#include "daemon/core/estimate/known_friction.h"

#include <algorithm>
#include <cmath>

#include "estimator/physics/slip.h"
#include "estimator/physics/units.h"
#include "estimator/statistics/interval.h"

namespace beltgrip::daemon {

using estimator::PeakKind;

namespace {

// A stop may come before the very top: mu* is then this much short of it at the most (chosen: the
// width that a value may have).
constexpr double kShortOfTheTop = 0.05;
constexpr unsigned kSlipsBelieved = 2;   // chosen: in a row
constexpr double kFrictionLeast = 0.01;  // that MinClampForce rests on, however little is known

std::size_t group_of(const estimator::CurveEstimate& curve) noexcept {
  return estimator::belt_group(curve.direction, curve.end_stop);
}

}  // namespace

void KnownFriction::learn(const estimator::LearnedFriction& learned) noexcept {
  learned_ = learned;
  if (!remembers_) memory_ = learned.memory;
}

KnownFriction::Taken KnownFriction::take(const estimator::PeakEstimate& peak,
                                         const EndedExperiment& ended, double as_read,
                                         bool keeps_better) noexcept {
  Taken taken;
  const bool is_value = peak.kind == PeakKind::kValue;
  const std::size_t group = estimator::belt_group(ended.direction, ended.end_stop);
  // Only a measured value settles a doubt.
  contradictory_ = peak.contradictory || peak.impossible || (contradictory_ && !is_value);
  if (!is_value) keep_slipped(group, ended, taken);
  if (is_value) {
    const double noise = (peak.noise_high - peak.noise_low) / (2.0 * estimator::kNormal95);
    memory_.take_value(group, peak.mu_max, peak.ci95_low, noise / peak.mu_max, as_read, 0.0);
    remembers_ = true;
    slips_in_a_row_[group] = 0;
  }
  // Neither does a bound below what is known: coast-downs without a ramp come all the time.
  const bool weaker =
      !is_value && newest_.kind == PeakKind::kValue && peak.mu_max <= newest_.mu_max;
  if (keeps_better && weaker && !peak.impossible) return taken;
  newest_.kind = peak.kind;
  newest_.mu_max = peak.mu_max;
  newest_.mu_max_std = peak.mu_max_std;
  ++newest_.experiment_count;
  taken.changed = true;
  return taken;
}

// The belt went through with less friction than is known, and the data give no value: a worn belt
// whose ramp began too near its peak. What it carried at the most is then all that may be counted
// on, until something is measured. Where the estimator doubted an input as it stopped, the belt may
// have slipped all the same.
void KnownFriction::keep_slipped(std::size_t group, const EndedExperiment& ended,
                                 Taken& taken) noexcept {
  if (!ended.ended_by_slip && !ended.may_have_slipped) return;
  const double known = known_as_read(group);
  const double most = ended.mu_star_most;
  if (!(most > 0.0) || most >= (1.0 - kShortOfTheTop) * known) return;
  memory_.take_slip(group, most / traction_1_m(group));
  remembers_ = taken.slipped = true;
  ++slips_in_a_row_[group];
}

double KnownFriction::peak_as_read(const estimator::CurveEstimate& curve,
                                   double as_read) const noexcept {
  const std::size_t group = group_of(curve);
  const estimator::BeltMemory::Slip& slip = memory_.slips[group];
  if (slip.known() && slips_in_a_row_[group] >= kSlipsBelieved) {
    return slip.carried_Nm_per_N * traction_1_m(group);
  }
  return newest_.kind == PeakKind::kValue ? as_read : 0.0;
}

double KnownFriction::to_rest_on(const estimator::CurveEstimate& curve) const noexcept {
  const std::size_t group = group_of(curve);
  return measured(group) * std::min(share_slipped(group), share_left(group));
}

std::optional<double> KnownFriction::min_clamp_force_N(
    const estimator::CurveEstimate& curve) const noexcept {
  const double friction = to_rest_on(curve);
  if (!(friction > 0.0)) return std::nullopt;
  return estimator::min_clamp_force_N(config_.variator, curve.end_stop, curve.torque_p_Nm,
                                      friction);
}

void KnownFriction::raise_faults(MonoTime t, const estimator::CurveEstimate& curve,
                                 FaultSet& faults) const noexcept {
  const bool fallen = memory_.any_slip() || (curve.usable && share_left(group_of(curve)) < 1.0);
  if (learned_.doubtful || contradictory_ || fallen) faults.raise(Fault::kResultDoubtful, t);
  if (learned_.unwritten) faults.raise(Fault::kHistoryUnwritten, t);
}

// mu_max of all experiments where they are kept, else of the last; its lower end where it rests on
// assumptions; 0: not known. A last value that differs by more than its noise and the scatter
// between experiments may be a belt that has changed: then the lower one of both.
double KnownFriction::measured(std::size_t index) const noexcept {
  const estimator::FusedFriction& fused = learned_.groups[index];
  const auto safe = [&](double value, double low) {
    return config_.friction_is_assumed ? std::max(low, kFrictionLeast) : value;
  };
  const double of_all = fused.known ? safe(fused.mu_max, fused.ci95_low) : 0.0;
  const std::size_t group = fused.known ? index : memory_.rests_on(index);
  if (group == estimator::kBeltGroups || !memory_.values[group].known()) return of_all;
  const estimator::BeltMemory::Value& newest = memory_.values[group];
  const double of_last = safe(newest.mu_max, newest.ci95_low);
  if (!fused.known) return of_last;
  const double noise =
      estimator::kNormal95 *
      std::hypot(newest.relative_noise, fused.repeatability_percent / estimator::kPercent);
  if (std::abs(std::log(newest.mu_max / fused.mu_max)) <= noise) return of_all;
  return std::min(of_all, of_last);
}

// mu* of a torque by a clamp force.
double KnownFriction::traction_1_m(std::size_t index) const noexcept {
  const bool overdrive = index % 2 == 0;
  const auto end_stop = overdrive ? estimator::EndStop::kOverdrive : estimator::EndStop::kLow;
  return 1.0 / estimator::torque_carried_Nm(config_.variator, end_stop, 1.0, 1.0);
}

// The friction that a group rests on, as it would be read under the configuration's constants; 0:
// not known. A history keeps it as it was weighed, which differs where constants are assumed: then
// what the belt carried as its experiment ended stands for it, a little beyond its peak.
double KnownFriction::known_as_read(std::size_t index) const noexcept {
  const std::size_t group = memory_.rests_on(index);
  if (group == estimator::kBeltGroups) return learned_.groups[index].mu_max;
  const estimator::BeltMemory::Value& value = memory_.values[group];
  if (value.as_read > 0.0) return value.as_read;
  return config_.friction_is_assumed ? value.carried_Nm_per_N * traction_1_m(group) : value.mu_max;
}

// Share of the friction known of a group that was left as the belt slipped there; 1: it has not.
double KnownFriction::share_slipped(std::size_t index) const noexcept {
  const estimator::BeltMemory::Slip& slip = memory_.slips[index];
  const double known = known_as_read(index);
  if (!slip.known() || !(known > 0.0)) return 1.0;
  // Both were read under the same constants, assumed ones or not: their ratio is the belt's.
  return std::min(1.0, slip.carried_Nm_per_N * traction_1_m(index) / known);
}

// Share that is left by what the other groups have shown since this one was measured.
double KnownFriction::share_left(std::size_t index) const noexcept {
  const std::size_t group = memory_.rests_on(index);
  if (group == estimator::kBeltGroups) return 1.0;
  const double scatter = learned_.groups[index].repeatability_percent / estimator::kPercent;
  double share = memory_.share_left(group, scatter);
  for (std::size_t other = 0; other < estimator::kBeltGroups; ++other) {
    if (other != index && memory_.slips[other].order > memory_.values[group].order) {
      share = std::min(share, share_slipped(other));
    }
  }
  return share;
}

void KnownFriction::go_on_from(const KnownFriction& before, bool keeps_results) noexcept {
  // What was found is no less found under a configuration that it does not hold for.
  newest_.experiment_count = before.newest_.experiment_count;
  if (!keeps_results) return;
  newest_ = before.newest_;
  learned_ = before.learned_;
  memory_ = before.memory_;
  slips_in_a_row_ = before.slips_in_a_row_;
  remembers_ = before.remembers_;
  contradictory_ = before.contradictory_;
}

}  // namespace beltgrip::daemon
