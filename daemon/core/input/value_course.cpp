#include "daemon/core/input/value_course.h"

#include <algorithm>
#include <cmath>

namespace beltgrip::daemon {

namespace {

constexpr long kFewest = 5;  // equal values beside the first
constexpr Duration kShortest = 40 * kMillisecond;
constexpr double kSteps = 3.0, kDeviations = 5.0;  // of a motion that shows
// - ln 1e-8. An experiment has some thousand runs, few of them with their mean where it is worst.
constexpr double kNever = 18.4;
// Of what was measured, from kRemembered values: little noise keeps a value, much explains one
// that has stayed behind a motion. What is least against the run counts.
constexpr double kNoiseLeast = 0.87, kNoiseMost = 1.3;
constexpr double kRemembered = 100.0;
constexpr double kTurnMost = 9.0;
constexpr double kPerScatter = 0.89;  // sigma of white noise
constexpr double kEnough = 60.0;
constexpr double kDrift = 20.0;  // values
constexpr Duration kSlopeOver = 400 * kMillisecond;
constexpr double kSlopePoints = 6.0, kSlopeDeviations = 3.0;
constexpr Duration kSpan = 2 * kSecond;
// What has no inertia rests between two steps for as long as it likes.
constexpr double kTimesLongest = 1.2, kTimesLongestRest = 3.0, kTimesHeld = 3.0;
constexpr std::size_t kHolds = 8;
constexpr int kMeans = 8;  // along the motion
// A value that goes to and fro between two neighbouring steps lies near their edge. How large its
// noise is it does not say: in the middle of a step it may rest for ever.
constexpr double kWide = 1.5;          // steps at once: noise that reaches beyond two neighbours
constexpr double kLeastChance = 1e-6;  // of a single value

}  // namespace

void ValueCourse::reset() noexcept {
  if (count_ > 0) *this = ValueCourse(step_, has_inertia_);
}

void ValueCourse::close_run(MonoTime t, double value) noexcept {
  const double change = value - value_;
  const double size = std::abs(change);
  resolution_ = resolution_ > 0.0 ? std::min(resolution_, size) : size;
  since_wide_ = size > kWide * resolution_ ? 0 : std::min(since_wide_ + run_ + 1, kNarrow);
  // Within a run nothing turns back.
  const double quiet = static_cast<double>(run_);
  known_ = std::min(known_ + 1.0 + quiet, kRemembered);
  const double left = run_ == 0 ? 1.0 : std::max(0.0, 1.0 - quiet / known_);
  const double before = run_ == 0 ? change_ : 0.0;
  // A shaft that swings for a while is not to be taken for less noise long after.
  const double most = kTurnMost * std::max(turns_, resolution_ * resolution_);
  const double turn = std::clamp(-(before - drift_) * (change - drift_), -most, most);
  turns_ = left * turns_ - (1.0 - left) * std::min(most, drift_ * drift_);
  scatter_ = left * scatter_ + (1.0 - left) * std::abs(drift_);
  // Both by one division.
  using Two [[gnu::vector_size(2 * sizeof(double))]] = double;
  const Two news = Two{turn - turns_, std::abs(change - drift_) - scatter_} / Two{known_, known_};
  turns_ += news[0];
  scatter_ += news[1];
  if (has_inertia_) {
    if (run_ > 0) drift_ *= std::max(0.0, 1.0 - quiet / kDrift);
    drift_ += (change - drift_) / std::min(known_, kDrift);
  }
  if (t - span_ >= kSpan) {
    longest_before_ = longest_;
    longest_ = {};
    span_ = t;
  }
  longest_ = std::max(longest_, newest_ - since_);
  change_ = change;
}

void ValueCourse::add(MonoTime t, double value) noexcept {
  if (count_ > 0 && t <= newest_) return;
  if (count_ > 0 && !(value < value_) && !(value > value_)) {
    ++run_;
    newest_ = t;
    return;
  }
  if (count_ > 0) {
    close_run(t, value);
  } else {
    span_ = t;
  }
  points_[count_ % kPoints] = {t, value};
  ++count_;
  value_ = value;
  since_ = newest_ = t;
  run_ = 0;
}

double ValueCourse::resolution() const noexcept { return std::max(step_, resolution_); }

double ValueCourse::noise() const noexcept {
  const double step = resolution();
  return std::sqrt(std::max(0.0, turns_ - step * step / 12.0));
}

// Of the values where runs began, over the last kSlopeOver before this one; less what noise may
// have made of it. Magnitude.
double ValueCourse::slope_per_s() const noexcept {
  double n = 0.0, sum_t = 0.0, sum_x = 0.0, sum_tt = 0.0, sum_tx = 0.0;
  for (std::size_t age = 0; age < std::min(count_, kPoints); ++age) {
    const Point& each = point(age);
    if (since_ - each.t > kSlopeOver) break;
    const double t = seconds(each.t - since_);
    const double x = each.value - value_;
    n += 1.0;
    sum_t += t;
    sum_x += x;
    sum_tt += t * t;
    sum_tx += t * x;
  }
  if (n < kSlopePoints) return 0.0;
  const double moment = sum_tt - sum_t * sum_t / n;
  const double slope = (sum_tx - sum_t * sum_x / n) / moment;
  const double sigma = noise(), step = resolution();
  const double deviation = std::sqrt((sigma * sigma + step * step / 12.0) / moment);
  return std::max(0.0, std::abs(slope) - kSlopeDeviations * deviation);
}

// A sender may tell a value several times before it has a new one: the shortest of the last runs.
Duration ValueCourse::usual_hold() const noexcept {
  Duration shortest = kSpan;
  for (std::size_t age = 0; age + 1 < std::min(count_, kHolds + 1); ++age) {
    shortest = std::min(shortest, point(age).t - point(age + 1).t);
  }
  return shortest;
}

// - ln of the probability of one value of a run.
double ValueCourse::evidence(double moved, double sigma) const noexcept {
  const double half_step = 0.5 * resolution();
  const double per_root2 = 1.0 / (std::sqrt(2.0) * sigma);
  double sum = 0.0;
  for (int i = 0; i < kMeans; ++i) {
    const double mean = moved * ((i + 0.5) / kMeans - 0.5);
    const double chance =
        0.5 * (std::erf((half_step - mean) * per_root2) + std::erf((half_step + mean) * per_root2));
    sum -= std::log(std::max(kLeastChance, chance));
  }
  return sum / kMeans;
}

double ValueCourse::noise_most(double sigma) const noexcept {
  return std::max(kNoiseMost * sigma, kPerScatter * scatter_);
}

// A motion that shows.
double ValueCourse::moving(double sigma) const noexcept {
  return kSteps * resolution() + kDeviations * noise_most(sigma);
}

std::optional<Duration> ValueCourse::shown_after(Duration period) const noexcept {
  if (known_ < kEnough) return std::nullopt;
  const double sigma = noise();
  constexpr double kNotAtAll = 1e18;
  double by_motion_ns = kNotAtAll, by_noise_ns = kNotAtAll;
  if (const double slope = has_inertia_ ? slope_per_s() : 0.0; slope > 0.0) {
    const double after_s = moving(sigma) / slope;
    if (after_s < seconds(kSlopeOver)) {
      by_motion_ns = std::max(after_s * 1e9, kTimesHeld * static_cast<double>(usual_hold().ns()));
    }
  }
  if (sigma > 0.0) {
    const double values = kNever / evidence(0.0, kNoiseLeast * sigma);
    by_noise_ns = std::max(values * static_cast<double>(period.ns()),
                           (has_inertia_ ? kTimesLongest : kTimesLongestRest) *
                               static_cast<double>(std::max(longest_, longest_before_).ns()));
  }
  const double after_ns = std::min(by_motion_ns, by_noise_ns);
  if (after_ns >= kNotAtAll) return std::nullopt;
  return std::max(
      {Duration::of_ns(static_cast<std::int64_t>(after_ns)), kShortest, kFewest * period});
}

bool ValueCourse::rests() const noexcept {
  return run_ >= kFewest && stood_for() >= kShortest && known_ >= kEnough;
}

bool ValueCourse::stands_still(double moved, bool goes_on) const noexcept {
  if (!rests()) return false;
  const Duration stood = stood_for();
  const double sigma = noise();
  const double stood_s = seconds(std::min(stood, kSlopeOver));
  const double most = std::max(moved, goes_on && has_inertia_ ? slope_per_s() * stood_s : 0.0);
  const auto times = [stood](Duration duration) {
    return fraction(stood, std::max(duration, kNanosecond));
  };
  if (most > moving(sigma) && times(usual_hold()) > kTimesHeld) {
    return true;
  }
  return sigma > 0.0 && (has_inertia_ || since_wide_ < kNarrow) &&
         times(std::max(longest_, longest_before_)) >
             (has_inertia_ ? kTimesLongest : kTimesLongestRest) &&
         static_cast<double>(run_) *
                 std::min(evidence(most, kNoiseLeast * sigma), evidence(most, noise_most(sigma))) >
             kNever;
}

}  // namespace beltgrip::daemon
