#include "estimator/belt/belt_history.h"

#include <algorithm>
#include <cmath>

#include "estimator/physics/units.h"
#include "estimator/statistics/distributions.h"
#include "estimator/statistics/interval.h"

namespace beltgrip::estimator {

namespace {

constexpr double kYear_s = 365.25 * 86400.0;
constexpr double kDay_s = 86400.0;
constexpr double kPriorLevel = -2.35;  // ln 0.095
constexpr double kPriorStd = 0.25;     // 0.06 to 0.155 within two deviations
constexpr double kAgeingVariance_1_s = 0.05 * 0.05 / kYear_s;
constexpr double kTemperatureStd_1_K = 1.5e-3;
constexpr double kReference_degC = 80.0;
constexpr double kLeastVariance = 1e-8;              // 0.01 %
constexpr double kSaneLow = 0.005, kSaneHigh = 1.0;  // of a mu_max

constexpr std::array kSteps{0.0, 5e-4, 1.5e-3, 4e-3, 1e-2, 3e-2};   // sqrt(q)
constexpr std::array kScatters{0.0, 2e-3, 5e-3, 1e-2, 2e-2, 4e-2};  // tau
constexpr std::array kScatterPrior{0.2, 0.25, 0.25, 0.15, 0.1, 0.05};
constexpr std::size_t kFilters = kSteps.size() * kScatters.size();

constexpr double kHold = 4.0;     // deviations: wait for a second one
constexpr double kConfirm = 2.0;  // the second one
constexpr std::size_t kRunMin = 8;

struct Observation {
  double time_s = 0.0;
  double y = 0.0;         // ln mu_max
  double variance = 0.0;  // stated, of y
  double constant = 0.0;  // variance of y by constant errors of the sensors
  double warmth_K = 0.0;  // oil above the reference; 0: not known
  double torque_Nm = 0.0;
};

struct Window {
  std::array<Observation, kWindow> seen{};
  std::size_t count = 0;
  std::span<const Observation> span() const { return {seen.data(), count}; }
};

bool counts(const BeltExperiment& each, Direction direction, EndStop end_stop) {
  return each.kind == PeakKind::kValue && each.direction == direction &&
         each.end_stop == end_stop && each.mu_max >= kSaneLow && each.mu_max <= kSaneHigh &&
         std::isfinite(each.mu_max_std) && each.mu_max_std > 0.0;
}

Observation observation_of(const BeltExperiment& each) {
  Observation seen;
  seen.time_s = each.time_s;
  seen.y = std::log(each.mu_max);
  const double width = (each.ci95_high - each.ci95_low) / (2.0 * kNormal95 * each.mu_max);
  const double stated = std::isfinite(width) && width > 0.0 ? width : each.mu_max_std / each.mu_max;
  const double sensor = std::isfinite(each.sensor_std) ? each.sensor_std / each.mu_max : 0.0;
  seen.constant = sensor * sensor;
  seen.variance = std::max(stated * stated - seen.constant, kLeastVariance);
  if (std::isfinite(each.oil_degC)) seen.warmth_K = each.oil_degC - kReference_degC;
  seen.torque_Nm = std::abs(each.torque_Nm);
  return seen;
}

// The last kWindow of a group, oldest first.
Window window_of(std::span<const BeltExperiment> experiments, Direction direction,
                 EndStop end_stop) {
  Window window;
  for (std::size_t i = experiments.size(); i-- > 0 && window.count < kWindow;) {
    if (!counts(experiments[i], direction, end_stop)) continue;
    window.seen[window.count++] = observation_of(experiments[i]);
  }
  std::reverse(window.seen.begin(),
               window.seen.begin() + static_cast<std::ptrdiff_t>(window.count));
  return window;
}

// One choice of q and tau: level and temperature coefficient with their covariance.
struct Filter {
  double step = 0.0, scatter = 0.0;
  double weight = 0.0;
  double level = kPriorLevel, coefficient = 0.0;
  double p00 = kPriorStd * kPriorStd, p01 = 0.0, p11 = kTemperatureStd_1_K * kTemperatureStd_1_K;
  double foreseen = 0.0, foreseen_variance = 0.0;  // of the next y

  void widen(double variance) { p00 = std::min(p00 + variance, kPriorStd * kPriorStd); }
  void foresee(const Observation& seen) {
    foreseen = level + coefficient * seen.warmth_K;
    foreseen_variance = p00 + 2.0 * p01 * seen.warmth_K + p11 * seen.warmth_K * seen.warmth_K +
                        seen.variance + scatter * scatter;
  }
  double likelihood(double y) const {
    const double z2 = (y - foreseen) * (y - foreseen) / foreseen_variance;
    return std::exp(-0.5 * z2) / std::sqrt(foreseen_variance);
  }
  void take(const Observation& seen) {
    const double g0 = (p00 + p01 * seen.warmth_K) / foreseen_variance;
    const double g1 = (p01 + p11 * seen.warmth_K) / foreseen_variance;
    const double error = seen.y - foreseen;
    level += g0 * error;
    coefficient += g1 * error;
    p00 -= g0 * g0 * foreseen_variance;
    p01 -= g0 * g1 * foreseen_variance;
    p11 -= g1 * g1 * foreseen_variance;
  }
};

struct Mean {
  double value = 0.0, variance = 0.0;
};

class Bank {
 public:
  Bank() {
    std::size_t i = 0;
    for (const double step : kSteps) {
      for (std::size_t s = 0; s < kScatters.size(); ++s, ++i) {
        filters_[i].step = step;
        filters_[i].scatter = kScatters[s];
        filters_[i].weight = kScatterPrior[s] / static_cast<double>(kSteps.size());
      }
    }
  }
  // Time passes; with an experiment at its end (walk) or not.
  void age(double time_s, bool walk) {
    for (Filter& each : filters_) {
      each.widen(std::max(time_s, 0.0) * kAgeingVariance_1_s +
                 (walk ? each.step * each.step : 0.0));
    }
  }
  void forget() {
    for (Filter& each : filters_) each.widen(kPriorStd * kPriorStd);
  }
  // Deviations of seen from what was to be expected.
  double foresee(const Observation& seen) {
    for (Filter& each : filters_) each.foresee(seen);
    const Mean mean = mixture([](const Filter& each) {
      return Mean{each.foreseen, each.foreseen_variance};
    });
    return (seen.y - mean.value) / std::sqrt(mean.variance);
  }
  void take(const Observation& seen, bool weigh) {
    double sum = 0.0;
    for (Filter& each : filters_) {
      if (weigh) each.weight *= each.likelihood(seen.y);
      sum += each.weight;
      each.take(seen);
    }
    // Beyond every filter's reach: none is better than another.
    for (Filter& each : filters_) {
      each.weight = sum > 1e-250 ? each.weight / sum : 1.0 / static_cast<double>(kFilters);
    }
  }
  Mean level() const {
    return mixture([](const Filter& each) { return Mean{each.level, each.p00}; });
  }
  double scatter() const {
    return mixture([](const Filter& each) { return Mean{each.scatter, 0.0}; }).value;
  }

 private:
  Mean mixture(const auto& of) const {
    Mean mean;
    for (const Filter& each : filters_) mean.value += each.weight * of(each).value;
    for (const Filter& each : filters_) {
      const Mean one = of(each);
      mean.variance +=
          each.weight * (one.variance + (one.value - mean.value) * (one.value - mean.value));
    }
    return mean;
  }
  std::array<Filter, kFilters> filters_{};
};

// Slope of y over the number of the experiment, in percent.
void fit_drift(std::span<const Observation> seen, FusedFriction& fused) {
  constexpr std::size_t kDriftMin = 5;
  if (seen.size() < kDriftMin) return;
  const auto n = static_cast<double>(seen.size());
  double mean_y = 0.0;
  for (const Observation& each : seen) mean_y += each.y / n;
  const double mean_x = 0.5 * (n - 1.0);
  double xx = 0.0, xy = 0.0, yy = 0.0;
  for (std::size_t i = 0; i < seen.size(); ++i) {
    const double x = static_cast<double>(i) - mean_x;
    const double y = seen[i].y - mean_y;
    xx += x * x;
    xy += x * y;
    yy += y * y;
  }
  const double slope = xy / xx;
  const double variance = std::max(yy - slope * xy, 0.0) / ((n - 2.0) * xx);
  fused.drift_percent = kPercent * slope;
  fused.drift_percent_std = kPercent * std::sqrt(variance);
}

double mean_of(std::span<const double> values) {
  double sum = 0.0;
  for (const double each : values) sum += each;
  return sum / static_cast<double>(values.size());
}

double squares_about(std::span<const double> values, double mean) {
  double sum = 0.0;
  for (const double each : values) sum += (each - mean) * (each - mean);
  return sum;
}

bool near(double value, double reference, double share) {
  return std::abs(value - reference) <= share * std::abs(reference);
}

constexpr double kConsistency = 2.5758293035489004;  // 1 % two-sided

// ln(a / b) outside [low, high] by more than chance.
bool apart(const FusedFriction& a, const FusedFriction& b, double low, double high) {
  const double ratio = std::log(a.mu_max / b.mu_max);
  const double margin = kConsistency * std::hypot(a.mu_max_std / a.mu_max, b.mu_max_std / b.mu_max);
  return ratio < low - margin || ratio > high + margin;
}

bool directions_disagree(const LearnedFriction& learned, EndStop end_stop) {
  constexpr double kLossMax_Nm = 5.0;
  const FusedFriction& drive = learned.of(Direction::kDrive, end_stop);
  const FusedFriction& overrun = learned.of(Direction::kOverrun, end_stop);
  if (!drive.known || !overrun.known) return false;
  return apart(drive, overrun, 0.0,
               kLossMax_Nm * (1.0 / drive.torque_Nm + 1.0 / overrun.torque_Nm));
}

bool end_stops_disagree(const LearnedFriction& learned, Direction direction) {
  constexpr double kLowest = 0.9, kHighest = 1.15;
  const FusedFriction& low = learned.of(direction, EndStop::kLow);
  const FusedFriction& overdrive = learned.of(direction, EndStop::kOverdrive);
  if (!low.known || !overdrive.known) return false;
  return apart(low, overdrive, std::log(kLowest), std::log(kHighest));
}

bool one_sided_run(std::span<const double> innovations) {
  std::size_t run = 0;
  for (std::size_t i = innovations.size(); i-- > 0; ++run) {
    if ((innovations[i] > 0.0) != (innovations.back() > 0.0)) break;
  }
  return run >= kRunMin;
}

}  // namespace

void remember(const BeltExperiment& each, BeltMemory& memory) {
  const std::size_t group = belt_group(each.direction, each.end_stop);
  if (counts(each, each.direction, each.end_stop)) {
    const double noise = std::sqrt(observation_of(each).variance);
    // mu_max is kept as it was weighed.
    memory.take_value(group, each.mu_max, each.ci95_low, noise, 0.0, each.carried_Nm_per_N);
  } else if (each.slipped && each.carried_Nm_per_N > 0.0) {
    memory.take_slip(group, each.carried_Nm_per_N);
  }
}

FusedFriction fuse(std::span<const BeltExperiment> experiments, Direction direction,
                   EndStop end_stop, double now_s, Innovations* innovations) {
  const Window window = window_of(experiments, direction, end_stop);
  FusedFriction fused;
  if (innovations != nullptr) innovations->count = 0;
  if (window.count == 0) return fused;
  Bank bank;
  const Observation* held = nullptr;
  double held_z = 0.0;
  double constant = 0.0;
  for (std::size_t i = 0; i < window.count; ++i) {
    const Observation& seen = window.seen[i];
    if (i > 0) bank.age(seen.time_s - window.seen[i - 1].time_s, true);
    const double z = bank.foresee(seen);
    if (innovations != nullptr) innovations->value[innovations->count++] = z;
    constant += seen.constant / static_cast<double>(window.count);
    fused.torque_Nm += seen.torque_Nm / static_cast<double>(window.count);
    if (held != nullptr && std::abs(z) > kConfirm && (z > 0.0) == (held_z > 0.0)) {
      bank.forget();
      bank.foresee(*held);
      bank.take(*held, false);
      bank.foresee(seen);
      bank.take(seen, true);
      held = nullptr;
      fused.weighed = 2;
    } else if (std::abs(z) > kHold) {
      held = &seen;
      held_z = z;
    } else {
      bank.take(seen, true);
      held = nullptr;
      ++fused.weighed;
    }
  }
  fused.experiments = static_cast<int>(window.count);
  fused.last_waits = held != nullptr;
  if (fused.weighed == 0) return fused;
  const double age_s = now_s - window.seen[window.count - 1].time_s;
  if (age_s < -kDay_s) {
    bank.forget();
  } else {
    bank.age(age_s, false);
  }
  const Mean level = bank.level();
  const double deviation = std::sqrt(level.variance + constant);
  fused.known = true;
  fused.mu_max = std::exp(level.value);
  fused.mu_max_std = fused.mu_max * deviation;
  fused.ci95_low = fused.mu_max * std::exp(-kNormal95 * deviation);
  fused.ci95_high = fused.mu_max * std::exp(kNormal95 * deviation);
  fused.repeatability_percent = kPercent * bank.scatter();
  fit_drift(window.span(), fused);
  return fused;
}

LearnedFriction learn(std::span<const BeltExperiment> experiments, double now_s) {
  LearnedFriction learned;
  for (const BeltExperiment& each : experiments) remember(each, learned.memory);
  for (const Direction direction : {Direction::kDrive, Direction::kOverrun}) {
    for (const EndStop end_stop : {EndStop::kOverdrive, EndStop::kLow}) {
      learned.groups[LearnedFriction::index(direction, end_stop)] =
          fuse(experiments, direction, end_stop, now_s);
    }
  }
  return learned;
}

WearTest compare(std::span<const double> before, std::span<const double> after) {
  WearTest test;
  test.before = static_cast<int>(before.size());
  test.after = static_cast<int>(after.size());
  if (before.size() < 2 || after.size() < 2) return test;
  test.judged = true;
  const auto n = static_cast<double>(before.size());
  const auto m = static_cast<double>(after.size());
  const double mean_before = mean_of(before);
  const double mean_after = mean_of(after);
  const double degrees = n + m - 2.0;
  const double variance =
      (squares_about(before, mean_before) + squares_about(after, mean_after)) / degrees;
  // Values without any scatter: the least difference would count.
  constexpr double kLeastStd = 1e-6;
  const double deviation = std::max(std::sqrt(variance), kLeastStd) * std::sqrt(1.0 / n + 1.0 / m);
  const double change = mean_after - mean_before;
  test.p_value = student_cdf(change / deviation, degrees);
  test.found = test.p_value < kWearFalseAlarm;
  const double half = student_quantile(kUpper95, degrees) * deviation;
  test.change_percent = kPercent * std::expm1(change);
  test.ci95_low = kPercent * std::expm1(change - half);
  test.ci95_high = kPercent * std::expm1(change + half);
  return test;
}

namespace {

// What an experiment must be like to be held against the last five.
class Conditions {
 public:
  void take(const BeltExperiment& each) {
    oil_degC_ += each.oil_degC;
    torque_Nm_ += each.torque_Nm;
    omega_rad_s_ += each.omega_p_rad_s;
    count_ += 1.0;
  }
  bool equal(const BeltExperiment& each) const {
    constexpr double kOilReach_K = 10.0;
    constexpr double kReach = 0.2;
    const double oil_degC = oil_degC_ / count_;
    const bool oil_differs = std::isfinite(oil_degC) && std::isfinite(each.oil_degC) &&
                             std::abs(each.oil_degC - oil_degC) > kOilReach_K;
    return !oil_differs && near(each.torque_Nm, torque_Nm_ / count_, kReach) &&
           near(each.omega_p_rad_s, omega_rad_s_ / count_, kReach);
  }

 private:
  double oil_degC_ = 0.0, torque_Nm_ = 0.0, omega_rad_s_ = 0.0, count_ = 0.0;
};

// The last five values of a group and those before under their conditions; newest first.
struct Comparable {
  std::array<double, kWearAfter + kBeforeMax> ln_mu{};
  std::array<std::size_t, kWearAfter + kBeforeMax> place{};  // in the history
  std::size_t count = 0;
  std::size_t after() const { return std::min(count, kWearAfter); }
  std::size_t before() const { return count - after(); }
};

Comparable comparable(std::span<const BeltExperiment> experiments, Direction direction,
                      EndStop end_stop) {
  Comparable all;
  Conditions last;
  for (std::size_t i = experiments.size(); i-- > 0 && all.count < all.ln_mu.size();) {
    const BeltExperiment& each = experiments[i];
    if (!counts(each, direction, end_stop)) continue;
    if (all.count < kWearAfter) {
      last.take(each);
    } else if (!last.equal(each)) {
      continue;
    }
    all.ln_mu[all.count] = std::log(each.mu_max);
    all.place[all.count++] = i;
  }
  return all;
}

}  // namespace

WearTest wear(std::span<const BeltExperiment> experiments, Direction direction, EndStop end_stop) {
  const Comparable all = comparable(experiments, direction, end_stop);
  if (all.after() < kWearAfter || all.before() < kWearBeforeMin) {
    WearTest test;
    test.before = static_cast<int>(all.before());
    test.after = static_cast<int>(all.after());
    return test;
  }
  return compare({all.ln_mu.data() + kWearAfter, all.before()}, {all.ln_mu.data(), kWearAfter});
}

WearStep wear_step(std::span<const BeltExperiment> experiments, Direction direction,
                   EndStop end_stop) {
  constexpr std::size_t kLeast = 2;
  const Comparable all = comparable(experiments, direction, end_stop);
  WearStep step;
  double ways = 0.0;
  for (std::size_t after = kLeast; after + kLeast <= all.count; ++after) {
    const WearTest test =
        compare({all.ln_mu.data() + after, all.count - after}, {all.ln_mu.data(), after});
    ways += 1.0;
    if (step.test.judged && test.p_value >= step.test.p_value) continue;
    step.test = test;
    step.first = all.place[after - 1];
  }
  step.test.p_value = std::min(1.0, step.test.p_value * std::max(1.0, ways));
  step.test.found = step.test.judged && step.test.p_value < kStepFalseAlarm;
  return step;
}

std::uint32_t notes_on_last(std::span<const BeltExperiment> experiments, double now_s) {
  if (experiments.empty()) return 0;
  const BeltExperiment& last = experiments.back();
  std::uint32_t notes = 0;
  Innovations innovations;
  const FusedFriction fused = fuse(experiments, last.direction, last.end_stop, now_s, &innovations);
  if (last.kind == PeakKind::kLowerBound && fused.known && last.mu_max > fused.ci95_high) {
    notes |= note_bit(Note::kOutlier);
  }
  if (!counts(last, last.direction, last.end_stop)) return notes;
  // The first of a group has nothing but the prior to disagree with.
  if (innovations.count > 1 && std::abs(innovations.span().back()) > kHold) {
    notes |= note_bit(Note::kOutlier);
  }
  if (one_sided_run(innovations.span())) notes |= note_bit(Note::kTrend);
  if (wear(experiments, last.direction, last.end_stop).found) notes |= note_bit(Note::kWear);
  const LearnedFriction learned = learn(experiments, now_s);
  if (directions_disagree(learned, last.end_stop)) notes |= note_bit(Note::kDirections);
  if (end_stops_disagree(learned, last.direction)) notes |= note_bit(Note::kEndStops);
  return notes;
}

}  // namespace beltgrip::estimator
