#include "estimator/robust/peak_fit.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "estimator/robust/thresholds.h"
#include "estimator/signal/slow_noise.h"
#include "estimator/statistics/interval.h"
#include "estimator/statistics/square.h"

namespace beltgrip::estimator {
namespace {

constexpr std::size_t kCellsPerLevel = 64;
constexpr std::size_t kMostCells = kCellsPerLevel * History::kLevels;
constexpr std::size_t kMostPoints = 256;  // the newest
constexpr std::size_t kFewestPoints = 8;
// Work of one step; that on forms in instructions, about.
constexpr std::size_t kCellsPerStep = 48, kPointsPerStep = 64, kFormsPerStep = 48;
constexpr std::size_t kLevelsPerStep = 4;
constexpr int kFormWork = 8000, kPointWork = 130, kSolveWork = 650;
constexpr std::size_t kTermsPerStep = 16;
constexpr std::size_t kTailCells = 4;  // of a point
constexpr std::size_t kWantedPoints = 16;
constexpr std::size_t kMostNeighbours = 24;
constexpr std::size_t kNeighbours = 3;  // to each side, for a first look at the course of mu*
constexpr std::size_t kEdgeCells = 2;   // to each side of a point's end, for speed
constexpr double kLastLambda = 1.2;     // of the span of slip
constexpr double kLambdaFactor = 1.35;
constexpr std::size_t kCorners = 20;
constexpr std::size_t kMostForms = 16 * (kCorners + 1) + kCorners * kCorners;
// Times and slips that are equal but for rounding: it decides nothing. Chosen, far above a rounding
// and far below a cell; a fifth less or more leaves each of 120 drawn traces as it is.
constexpr double kSameTime_s = 1e-6, kSameSlip_percent = 1e-9;
constexpr double kSmallestSlope = 1e-9;    // 1/percent, of a deviation that is divided by
constexpr std::size_t kLargestGroup = 16;  // points

// R = L D L', positive definite, without pivoting.
class Factors {
 public:
  explicit Factors(const Eigen::Matrix4d& R) noexcept : L_(R) {
    for (int k = 0; k < 4; ++k) {
      inverse_(k) = 1.0 / L_(k, k);
      for (int i = k + 1; i < 4; ++i) {
        const double factor = L_(i, k) * inverse_(k);
        for (int j = k + 1; j <= i; ++j) L_(i, j) -= factor * L_(j, k);
      }
      for (int i = k + 1; i < 4; ++i) L_(i, k) *= inverse_(k);
    }
  }
  Eigen::Vector4d solve(const Eigen::Vector4d& b) const noexcept {
    Eigen::Vector4d x = forward(b).cwiseProduct(inverse_);
    for (int i = 3; i > 0; --i) {
      for (int j = 0; j < i; ++j) x(j) -= L_(i, j) * x(i);
    }
    return x;
  }
  // g' R^-1 g.
  double square_of(const Eigen::Vector4d& g) const noexcept {
    const Eigen::Vector4d z = forward(g);
    return z.cwiseProduct(inverse_).dot(z);
  }

 private:
  Eigen::Vector4d forward(Eigen::Vector4d x) const noexcept {
    for (int i = 1; i < 4; ++i) {
      for (int j = 0; j < i; ++j) x(i) -= L_(i, j) * x(j);
    }
    return x;
  }
  Eigen::Matrix4d L_;
  Eigen::Vector4d inverse_;  // of D
};

double normal_density(double z) noexcept {
  return std::exp(-0.5 * z * z) / std::sqrt(2.0 * std::numbers::pi);
}

}  // namespace

double PeakFit::Rise::at(double x) const noexcept {
  if (power == 0) return std::exp(-(x + span) / lambda);
  const double rest = std::max(0.0, (end - x) / span);
  return power == 2 ? rest * rest : rest * rest * rest;
}

PeakFit::PeakFit()
    : cells_(kMostCells),
      lengths_s_(kMostCells),
      points_(2 * kMostPoints),
      sums_(2 * kMostPoints + 1, Eigen::Vector2d::Zero()),
      whitening_(kMostPoints),
      terms_(kMostPoints, Terms::Zero()),
      forms_(kMostForms),
      health_sums_(kMostPoints + 1),
      residuals_(kMostPoints) {}

void PeakFit::begin(const ExperimentRecord& record, double traction_per_Nm_N, double inertia_kg_m2,
                    double stop_s) noexcept {
  record_ = &record;
  c_ = traction_per_Nm_N;
  inertia_kg_m2_ = inertia_kg_m2;
  stop_s_ = stop_s;
  stage_ = Stage::kCells;
  level_ = 0;
  cell_count_ = point_count_ = form_count_ = 0;
  covered_from_s_ = 1e300;
  result_ = {};
}

bool PeakFit::step() noexcept {
  switch (stage_) {
    case Stage::kIdle:
      return true;
    case Stage::kCells:
      for (std::size_t i = 0; i < kLevelsPerStep; ++i, ++level_) gather_level();
      if (level_ < History::kLevels) return false;
      if (cell_count_ < kFewestPoints || !record_->force_line().valid) {
        stage_ = Stage::kIdle;
        return true;
      }
      next_cell_ = cell_count_;
      last_slip_percent_ = cells_[cell_count_ - 1].slip_percent;
      stage_ = Stage::kPoints;
      return false;
    case Stage::kPoints:
      make_points();
      if (next_cell_ == 0) go_to(Stage::kCourse);
      return false;
    case Stage::kCourse:
      find_course();
      return false;
    case Stage::kStretch:
      find_stretch();
      go_to(Stage::kReached);
      next_ = 1;
      return false;
    case Stage::kReached:
      for (std::size_t seen = 0; seen < kMostPoints && next_ <= point_count_ - first_; next_ *= 2) {
        find_reached(next_);
        seen += point_count_ - first_;
      }
      if (next_ <= point_count_ - first_) return false;
      // No friction, no curve of it.
      go_to(point_count_ - first_ < kFewestPoints || !(mu_top_ > 0.0) ? Stage::kIdle
                                                                      : Stage::kTerms);
      if (stage_ == Stage::kIdle) return true;
      find_span();
      return false;
    case Stage::kTerms:
      whiten_terms();
      return false;
    case Stage::kForms:
      fit_forms();
      return false;
    case Stage::kAverage:
      average();
      return false;
    case Stage::kResult:
      finish();
      go_to(result_.valid ? Stage::kHealthSums : Stage::kIdle);
      return stage_ == Stage::kIdle;
    case Stage::kHealthSums:
      sum_for_health();
      go_to(Stage::kChords);
      next_ = 1;
      return false;
    case Stage::kChords:
      // Groups of 1, 2, 4, ...: the longer ones are few.
      do {
        result_.below_chord =
            std::max(result_.below_chord,
                     below_chord({health_sums_.data(), health_count_}, next_,
                                 {.slip_noise_percent2_s = record_->slip_noise_percent2_s(),
                                  .slow_relative = slow_relative()}));
        next_ *= 2;
      } while (next_ > 4 && next_ <= kLargestGroup);
      if (next_ > kLargestGroup) go_to(Stage::kResiduals);
      return false;
    case Stage::kResiduals:
      test_best_form();
      stage_ = Stage::kIdle;
      return true;
  }
  return true;
}

void PeakFit::go_to(Stage stage) noexcept {
  stage_ = stage;
  next_ = 0;
}

void PeakFit::gather_level() noexcept {
  const History& history = record_->history();
  const double length_s = history.cell_s(level_);
  std::size_t taken = 0;
  for (std::size_t age = 0; age < history.size(level_) && taken < kCellsPerLevel; ++age) {
    const Cell& cell = history.cell(level_, age);
    if (cell.t_s + 0.5 * length_s > covered_from_s_ + kSameTime_s) continue;
    cells_[cell_count_] = cell;
    lengths_s_[cell_count_] = length_s;
    covered_from_s_ = cell.t_s - 0.5 * length_s;
    ++cell_count_;
    ++taken;
  }
}

// By which slip has surely moved, from one mean over so long to the next.
double PeakFit::slip_step_percent(double duration_s) const noexcept {
  return std::max(kPointSlip_percent,
                  2.0 * std::sqrt(record_->slip_noise_percent2_s() / duration_s));
}

void PeakFit::make_points() noexcept {
  const double slip_noise_percent2_s = record_->slip_noise_percent2_s();
  std::size_t budget = kCellsPerStep;
  while (next_cell_ > 0 && budget > 0) {
    const std::size_t begin = next_cell_;
    double duration_s = 0.0, slip_percent_s = 0.0;
    double tail_s = 0.0, tail = 0.0;  // of its newest cells
    while (next_cell_ > 0) {
      --next_cell_;
      budget -= budget > 0 ? 1 : 0;
      const auto count_in = [&](std::size_t cell, double sign, double& sum_s, double& sum) {
        sum_s += sign * lengths_s_[cell];
        sum += sign * lengths_s_[cell] * cells_[cell].slip_percent;
      };
      count_in(next_cell_, 1.0, duration_s, slip_percent_s);
      count_in(next_cell_, 1.0, tail_s, tail);
      if (begin - next_cell_ > kTailCells) count_in(next_cell_ + kTailCells, -1.0, tail_s, tail);
      if (duration_s < kPointShortest_s) continue;
      if (std::abs(slip_percent_s / duration_s - last_slip_percent_) >
              slip_step_percent(duration_s) ||
          duration_s > kPointLongest_s)
        break;
      // Slip that begins to run away is seen in the newest cells, before it moves the mean.
      const double head_s = duration_s - tail_s;
      if (head_s < 0.5 * kPointShortest_s) continue;
      const double drift = tail / tail_s - (slip_percent_s - tail) / head_s;
      if (std::abs(drift) >
          std::max(kPointSlip_percent,
                   kEvident * std::sqrt(slip_noise_percent2_s * (1.0 / tail_s + 1.0 / head_s)))) {
        break;
      }
    }
    last_slip_percent_ = slip_percent_s / duration_s;
    add_point(begin, next_cell_);
  }
}

// Mean speed of the cells on both sides of the boundary before cell (counted from the newest).
double PeakFit::speed_at_edge(std::size_t cell, double& t_s, double& weight_s) const noexcept {
  const std::size_t from = cell > kEdgeCells ? cell - kEdgeCells : 0;
  const std::size_t to = std::min(cell_count_, cell + kEdgeCells);
  double speed = 0.0;
  t_s = weight_s = 0.0;
  for (std::size_t i = from; i < to; ++i) {
    speed += lengths_s_[i] * cells_[i].omega_p_rad_s;
    t_s += lengths_s_[i] * cells_[i].t_s;
    weight_s += lengths_s_[i];
  }
  t_s /= weight_s;
  return speed / weight_s;
}

// Cells end .. begin - 1, counted from the newest: begin is the older side.
void PeakFit::add_point(std::size_t begin, std::size_t end) noexcept {
  Point point{};
  double torque = 0.0;
  for (std::size_t i = end; i < begin; ++i) {
    const double length_s = lengths_s_[i];
    point.duration_s += length_s;
    point.t_s += length_s * cells_[i].t_s;
    point.slip_percent += length_s * cells_[i].slip_percent;
    point.force_N += length_s * record_->clamp_force_N(cells_[i]);
    torque += length_s * cells_[i].torque_Nm;
  }
  point.t_s /= point.duration_s;
  point.slip_percent /= point.duration_s;
  point.force_N /= point.duration_s;
  torque /= point.duration_s;
  const double noise = record_->torque_noise_Nm2_s();
  double variance = noise / point.duration_s;
  point.torque_variance = variance;
  if (inertia_kg_m2_ > 0.0) {
    // The engine's torque changes slowly: of its line and the readings, by their variances.
    const Line& held = record_->torque_line();
    if (point.t_s > held.begin_s + kSameTime_s) {
      const double variation =
          std::max(0.0, record_->torque().density(1.0) - noise) / point.duration_s;
      const double share = variance / (variance + variation + 1e-12);
      torque += share * (held.at(point.t_s) - torque);
      point.held_share = share;
      variance = square(share) * variation + square(1.0 - share) * variance;
      point.torque_variance = variance;
    }
    double t_0, t_1, weight_0, weight_1;
    const double speed_0 = speed_at_edge(begin, t_0, weight_0);
    const double speed_1 = speed_at_edge(end, t_1, weight_1);
    const double span_s = std::max(1e-3, t_1 - t_0);
    torque -= inertia_kg_m2_ * (speed_1 - speed_0) / span_s;
    point.speed_variance_begin = record_->omega_noise_rad2_s() / weight_0;
    point.speed_variance_end = record_->omega_noise_rad2_s() / weight_1;
    variance +=
        square(inertia_kg_m2_ / span_s) * (point.speed_variance_begin + point.speed_variance_end);
  }
  point.torque_Nm = torque;
  const double traction = c_ / point.force_N;
  point.mu = traction * torque;
  point.variance = std::max(square(traction) * variance, 1e-12);
  if (point.t_s < record_->force_line().begin_s - kSameTime_s) {
    point.force_variance = square(point.mu / point.force_N) *
                           record_->force().density(point.duration_s) / point.duration_s;
  }
  if (point_count_ == points_.size()) {
    std::copy(points_.begin() + kMostPoints, points_.end(), points_.begin());
    point_count_ = kMostPoints;
  }
  points_[point_count_++] = point;
}

// Course of mu*: the mean of as many neighbours as make it precise enough.
double PeakFit::mean_mu(std::size_t point) const noexcept {
  double mean = 0.0;
  for (std::size_t reach = kNeighbours; reach <= kMostNeighbours; reach *= 2) {
    const Eigen::Vector2d sum = sums_[std::min(point_count_, point + reach + 1)] -
                                sums_[std::max(oldest_ + reach, point) - reach];
    mean = sum[1] / sum[0];
    if (sum[0] * square(kCoursePrecision * mean) > 1.0) break;
  }
  return mean;
}

void PeakFit::find_course() noexcept {
  if (next_ == 0) {
    oldest_ = point_count_ > kMostPoints ? point_count_ - kMostPoints : 0;
    sums_[oldest_] = {0.0, 0.0};
    for (std::size_t i = oldest_; i < point_count_; ++i) {
      const double w = 1.0 / points_[i].variance;
      sums_[i + 1] = {sums_[i][0] + w, sums_[i][1] + w * points_[i].mu};
    }
    mu_top_ = 0.0;
    top_ = next_ = oldest_;
  }
  const std::size_t end = std::min(point_count_, next_ + kPointsPerStep);
  for (; next_ < end; ++next_) {
    const double mu = mean_mu(next_);
    if (mu > mu_top_) {
      mu_top_ = mu;
      top_ = next_;
    }
  }
  if (next_ == point_count_) go_to(Stage::kStretch);
}

// To the stretch that is fitted, which begins right after it. Where points are few, it reaches
// further down.
bool PeakFit::belongs(std::size_t point) const noexcept {
  const std::size_t count = point_count_ - point - 1;
  return count < kWantedPoints || mean_mu(point + 1) >= kTopFrom * mu_top_;
}

void PeakFit::find_stretch() noexcept {
  first_ = top_;
  while (first_ > oldest_ && belongs(first_ - 1)) --first_;
  // What the noise in slip does to mu*: by the slope around.
  const double slip_noise_percent2_s = record_->slip_noise_percent2_s();
  for (std::size_t i = first_; i < point_count_; ++i) {
    points_[i].variance += square(kFormError * std::max(0.0, mu_top_ - points_[i].mu));
    const Point& a = points_[i > first_ + kNeighbours ? i - kNeighbours : first_];
    const Point& b = points_[std::min(point_count_ - 1, i + kNeighbours)];
    const double slope =
        std::clamp((b.mu - a.mu) / std::max(0.1, b.slip_percent - a.slip_percent), 0.0, 0.1);
    points_[i].variance += square(slope) * slip_noise_percent2_s / points_[i].duration_s;
    result_.duration_s += points_[i].duration_s;
  }
}

// Of the mean clamp force over a stretch of time: of the line, or of the readings where it does not
// reach.
double PeakFit::force_variance(double begin_s, double end_s) const noexcept {
  const Line& line = record_->force_line();
  const double readings = record_->force().density(end_s - begin_s) / (end_s - begin_s);
  return begin_s < line.begin_s - kSameTime_s ? readings
                                              : line.variance_at(0.5 * (begin_s + end_s));
}

// Mean torque by mean force is a mean of mu*, weighted by force: its largest was no less. Within a
// window the speeds at its points' ends cancel, all but the first and the last.
void PeakFit::find_reached(std::size_t length) noexcept {
  double time_s = 0.0, torque = 0.0, force = 0.0, slip_percent_s = 0.0, squares = 0.0;
  const auto count_in = [&](const Point& point, double sign) {
    const double weight_s = sign * point.duration_s;
    time_s += weight_s;
    torque += weight_s * point.torque_Nm;
    force += weight_s * point.force_N;
    slip_percent_s += weight_s * point.slip_percent;
    squares += weight_s * point.duration_s * point.torque_variance;
  };
  for (std::size_t i = first_; i < point_count_; ++i) {
    count_in(points_[i], 1.0);
    if (i >= first_ + length) count_in(points_[i - length], -1.0);
    if (i + 1 < first_ + length) continue;
    const Point& begin = points_[i + 1 - length];
    const Point& end = points_[i];
    const double mu = c_ * torque / force;
    if (mu < result_.reached * (1.0 - kReachedDeviations * result_.reached_deviation)) continue;
    const double T = torque / time_s, F = force / time_s;
    double torque_variance =
        (squares + square(inertia_kg_m2_) * (begin.speed_variance_begin + end.speed_variance_end)) /
        square(time_s);
    if (inertia_kg_m2_ > 0.0) {
      torque_variance += square(end.held_share) * record_->torque_line().variance_at(end.t_s);
    }
    // Windows share the slow error: it is not the largest of many.
    torque_variance += square(kNormal99Upper / kReachedDeviations) *
                       record_->torque_slow_variance() * slow_variance_of_mean(time_s);
    const double deviation =
        std::sqrt(torque_variance / square(T) + force_variance(begin.t_s - 0.5 * begin.duration_s,
                                                               end.t_s + 0.5 * end.duration_s) /
                                                    square(F));
    const double surely = mu * (1.0 - kReachedDeviations * deviation);
    if (!(surely > result_.reached * (1.0 - kReachedDeviations * result_.reached_deviation))) {
      continue;
    }
    result_.reached = mu;
    result_.reached_deviation = deviation;
    result_.reached_slip_percent = slip_percent_s / time_s;
  }
}

// Of the grid, from the highest slip down; relative to it.
double PeakFit::corner(std::size_t index) const noexcept {
  return -span() * kCornersOver * (static_cast<double>(index) + 0.5) / kCorners;
}

void PeakFit::find_span() noexcept {
  slip_low_percent_ = slip_high_percent_ = points_[first_].slip_percent;
  for (std::size_t i = first_; i < point_count_; ++i) {
    slip_low_percent_ = std::min(slip_low_percent_, points_[i].slip_percent);
    slip_high_percent_ = std::max(slip_high_percent_, points_[i].slip_percent);
  }
  slow_terms_.setZero();
  slow_spread_ = 1.0;
  term_sums_.setZero();
}

void PeakFit::whiten_terms() noexcept {
  static_assert(kTermCount == kCorner + kCorners);
  const double slow = record_->torque_slow_variance();
  const std::size_t end = std::min(point_count_ - first_, next_ + kTermsPerStep);
  for (; next_ < end; ++next_) {
    const Point& point = points_[first_ + next_];
    Whitening& filter = whitening_[next_];
    filter.faded = 0.0;
    if (next_ > 0) {
      const double since_s = std::max(0.0, point.t_s - points_[first_ + next_ - 1].t_s);
      filter.faded = std::exp(-since_s / kSlowTime_s);
      slow_spread_ = 1.0 - square(filter.faded) * (1.0 - slow_spread_);
    }
    filter.per_Nm = c_ / point.force_N;
    const double seen = filter.per_Nm * slow * slow_spread_;
    const double variance = point.variance + filter.per_Nm * seen;
    filter.gain = seen / variance;
    filter.per_deviation = 1.0 / std::sqrt(variance);
    slow_spread_ *= 1.0 - filter.gain * filter.per_Nm;

    Terms& terms = terms_[next_];
    const double x = point.slip_percent - slip_high_percent_;
    terms(kOne) = 1.0;
    terms(kX) = x;
    terms(kY) = point.mu - mu_top_;
    for (std::size_t i = 0; i < kCorners; ++i) {
      terms(kCorner + static_cast<Eigen::Index>(i)) = std::max(0.0, x - corner(i));
    }
    slow_terms_ *= filter.faded;
    terms -= filter.per_Nm * slow_terms_;
    slow_terms_ += filter.gain * terms;
    terms *= filter.per_deviation;
    for (Eigen::Index i = kOne; i <= kY; ++i) term_sums_.col(i) += terms(i) * terms;
    for (Eigen::Index i = kCorner; i < kTermCount; ++i) term_sums_(i, i) += square(terms(i));
  }
  if (next_ < point_count_ - first_) return;
  go_to(Stage::kForms);
  begin_rise({.lambda = kFirstLambda * span(), .span = span()});
}

void PeakFit::begin_rise(const Rise& rise) noexcept {
  rise_ = rise;
  slow_rise_ = rise_square_ = 0.0;
  rise_sums_.setZero();
  summed_ = 0;
  next_corner_ = rise.power == 0 ? 0 : 1;
}

// Exponentials of growing length, then powers that end at every second corner. False: no more.
bool PeakFit::next_rise() noexcept {
  if (rise_.power == 0) {
    Rise next = rise_;
    next.lambda *= kLambdaFactor;
    if (next.lambda > kLastLambda * span()) next = {.power = 2, .end = corner(0), .span = span()};
    begin_rise(next);
    return true;
  }
  if (rise_.power == 2) {
    begin_rise({.power = 3, .end = rise_.end, .span = span()});
    return true;
  }
  next_ += 2;
  if (next_ >= kCorners) return false;
  begin_rise({.power = 2, .end = corner(next_), .span = span()});
  return true;
}

void PeakFit::sum_up(std::size_t at) noexcept {
  const Whitening& filter = whitening_[at];
  slow_rise_ *= filter.faded;
  const double rest =
      rise_.at(points_[first_ + at].slip_percent - slip_high_percent_) - filter.per_Nm * slow_rise_;
  slow_rise_ += filter.gain * rest;
  const double e = rest * filter.per_deviation;
  rise_square_ += e * e;
  rise_sums_ += e * terms_[at];
}

void PeakFit::fit_forms() noexcept {
  const std::size_t count = point_count_ - first_;
  for (int work = 0; work < kFormWork;) {
    if (summed_ < count) {
      sum_up(summed_++);
      work += kPointWork;
      continue;
    }
    const std::size_t form = next_corner_++;
    const bool last =
        form > kCorners || (form > 0 && rise_.power > 0 && corner(form - 1) < rise_.end);
    if (last) {
      if (next_rise()) continue;
      go_to(Stage::kAverage);
      return;
    }
    solve(form);
    work += kSolveWork;
  }
}

// corner_number: 0: none, i + 1: corner(i).
void PeakFit::solve(std::size_t corner_number) noexcept {
  const bool has_corner = corner_number > 0;
  const double corner = has_corner ? this->corner(corner_number - 1) : 0.0;
  const Rise& rise = rise_;
  const auto sum = [this](Eigen::Index a, Eigen::Index b) { return term_sums_(a, b); };
  // Terms 1, -e, -x, -max(0, x - corner).
  Eigen::Matrix4d A = Eigen::Matrix4d::Zero();
  Eigen::Vector4d b(sum(kY, kOne), -rise_sums_(kY), -sum(kY, kX), 0.0);
  A(0, 0) = sum(kOne, kOne);
  A(0, 1) = A(1, 0) = -rise_sums_(kOne);
  A(0, 2) = A(2, 0) = -sum(kX, kOne);
  A(1, 1) = rise_square_;
  A(1, 2) = A(2, 1) = rise_sums_(kX);
  A(2, 2) = sum(kX, kX);
  if (has_corner) {
    const Eigen::Index k = kCorner + static_cast<Eigen::Index>(corner_number) - 1;
    A(0, 3) = A(3, 0) = -sum(k, kOne);
    A(1, 3) = A(3, 1) = rise_sums_(k);
    A(2, 3) = A(3, 2) = sum(k, kX);
    A(3, 3) = sum(k, k);
    b(3) = -sum(k, kY);
  }
  // Weak priors: coefficients of a curve of this height, slopes of 0.05 and 0.02 per percent.
  Eigen::Matrix4d R = A;
  R(0, 0) += 1.0 / square(20.0 * mu_top_);
  R(1, 1) += 1.0 / square(2.0 * mu_top_);
  R(2, 2) += 1.0 / square(rise.power == 0 ? 0.05 : 1e-9);  // the top of a power is level
  R(3, 3) += has_corner ? 1.0 / square(0.02) : 1.0;
  const Factors factors(R);
  const Eigen::Vector4d theta = factors.solve(b);
  if (!(theta(1) >= 0.0) || (has_corner && !(theta(3) >= 0.0))) return;

  const double B = theta(1), d = theta(2), h = has_corner ? theta(3) : 0.0;
  const double low = slip_low_percent_ - slip_high_percent_;
  const auto terms = [&](double x) {
    return Eigen::Vector4d(1.0, -rise.at(x), -x, has_corner ? -std::max(0.0, x - corner) : 0.0);
  };
  double best = 0.0;  // the end of the data
  const auto consider = [&](double x) {
    if (x >= low && x <= 0.0 && terms(x).dot(theta) >= terms(best).dot(theta)) best = x;
  };
  // Where the slope B/lambda exp(..) - d (- h) vanishes, before and beyond the corner; the corner;
  // where the data begin, if the curve falls over all of them.
  const auto level_at = [&](double fall) {
    return rise.lambda * std::log(B / (rise.lambda * fall)) - rise.span;
  };
  if (rise.power > 0) {
    best = std::max(low, corner);  // level until there
  } else {
    consider(low);
    if (B > 0.0 && d > 0.0) {
      const double x = level_at(d);
      if (!has_corner || x < corner) consider(x);
    }
    if (has_corner) {
      consider(corner);
      if (B > 0.0 && d + h > 0.0) {
        const double x = level_at(d + h);
        if (x > corner) consider(x);
      }
    }
  }
  const double prior = rise.power > 0 ? 4.0 / square(kCorners) : has_corner ? 1.0 / kCorners : 1.0;
  const Eigen::Vector4d g = terms(best);
  const Eigen::Vector4d g_fall = g - terms(0.0);
  const double rise_slope = rise.power == 0 ? rise.at(0.0) / rise.lambda : 0.0;
  const Eigen::Vector4d g_end(0.0, rise_slope, -1.0, has_corner ? -1.0 : 0.0);
  forms_[form_count_++] = {.chi2 = sum(kY, kY) - 2.0 * theta.dot(b) + theta.dot(A * theta),
                           .prior = prior,
                           .mu = mu_top_ + g.dot(theta),
                           .variance = factors.square_of(g),
                           .slip_percent = slip_high_percent_ + best,
                           .fall = g_fall.dot(theta),
                           .fall_variance = factors.square_of(g_fall),
                           .end_slope = g_end.dot(theta),
                           .end_slope_variance = factors.square_of(g_end)};
  const double chi2 = forms_[form_count_ - 1].chi2;
  if (form_count_ > 1 && !(chi2 < best_chi2_)) return;
  best_chi2_ = chi2;
  best_rise_ = rise;
  best_theta_ = theta;
  best_corner_ = has_corner ? corner : 0.0;  // at 0 its term vanishes in the data
}

void PeakFit::average() noexcept {
  if (next_ == 0) average_ = {};
  const double degrees = std::max(1.0, static_cast<double>(point_count_ - first_) - 5.0);
  // Where even the best form scatters more than the noise says, the noise was taken too small.
  const double scale = std::max(1.0, best_chi2_ / degrees);
  const std::size_t end = std::min(form_count_, next_ + kFormsPerStep);
  for (; next_ < end; ++next_) {
    const Form& form = forms_[next_];
    const double w = form.prior * std::exp(-0.5 * (form.chi2 - best_chi2_) / scale);
    const double rest = form.mu - mu_top_;
    average_.weight += w;
    average_.mu += w * rest;
    average_.squares += w * rest * rest;
    average_.variance += w * form.variance * scale;
    average_.slip_percent += w * (form.slip_percent - slip_high_percent_);
    // All of these curves bend down only: one that falls at the end of the data has its top in
    // them.
    const double deviation = std::max(kSmallestSlope, std::sqrt(form.end_slope_variance * scale));
    const double z = form.end_slope / deviation;
    const double rises = 0.5 * std::erfc(-z / std::numbers::sqrt2);
    average_.inside += w * (1.0 - rises);
    average_.end_rise += w * (form.end_slope * rises + deviation * normal_density(z));
    average_.fall += w * form.fall;
    average_.fall_variance += w * form.fall_variance * scale;
  }
  if (next_ == form_count_) go_to(Stage::kResult);
}

void PeakFit::finish() noexcept {
  if (form_count_ == 0) return;
  const Average& a = average_;
  const double mu = a.mu / a.weight;
  result_.mu = mu_top_ + mu;
  result_.variance = a.variance / a.weight + std::max(0.0, a.squares / a.weight - mu * mu);
  result_.slip_percent = slip_high_percent_ + a.slip_percent / a.weight;
  result_.inside = a.inside / a.weight;
  result_.end_slip_percent = slip_high_percent_;
  result_.end_rise = a.end_rise / a.weight;
  result_.fall = a.fall / a.weight;
  result_.fall_variance = a.fall_variance / a.weight;
  for (std::size_t i = point_count_; i > first_; --i) {
    result_.t_s = points_[i - 1].t_s;
    result_.held_share = points_[i - 1].held_share;
    if (points_[i - 1].slip_percent <= result_.slip_percent + kSameSlip_percent) break;
  }
  result_.valid = std::isfinite(result_.mu) && result_.mu > 0.0;
  result_.passed = came_after();
}

// Do the points beyond the peak come after those before it, and the last ones among them? Where
// deformation drives slip back while mu* still rises, what looks like a fall along slip is the way
// there.
bool PeakFit::came_after() const noexcept {
  struct Side {
    double time_s = 0.0, sum = 0.0;
    double mean() const { return sum / time_s; }
  };
  Side before, beyond, last;  // times, times, slip
  const std::size_t end_begin =
      point_count_ - std::max<std::size_t>(1, (point_count_ - first_) / 10);
  for (std::size_t i = first_; i < point_count_; ++i) {
    const Point& point = points_[i];
    const double beyond_percent = point.slip_percent - result_.slip_percent;
    if (std::abs(beyond_percent) > kSameSlip_percent) {
      Side& side = beyond_percent > 0.0 ? beyond : before;
      side.time_s += point.duration_s;
      side.sum += point.duration_s * point.t_s;
    }
    if (i < end_begin) continue;
    last.time_s += point.duration_s;
    last.sum += point.duration_s * point.slip_percent;
  }
  return before.time_s > 0.0 && beyond.time_s > 0.0 && beyond.mean() > before.mean() &&
         last.mean() > result_.slip_percent;
}

// Where the clamp force has come to a stand, the load alone moves slip and mu* to and fro, by less
// than slip's noise: that is no curve to be tested.
double PeakFit::tested_until_s() const noexcept {
  const Line& line = record_->force_line();
  const double end_s = record_->duration_s();
  const bool stands = std::abs(line.slope) * (end_s - line.begin_s) < kStandsStill * line.at(end_s);
  const double until_s = std::min(stands ? line.begin_s : end_s, record_->lowered_until_s());
  return std::min(until_s, stop_s_) - kSameTime_s;
}

// From where mu* came to a share of its top, to where the curve has its top.
void PeakFit::sum_for_health() noexcept {
  const double until_s = std::min(result_.t_s, tested_until_s());
  std::size_t begin = first_;
  const std::size_t oldest = point_count_ > kMostPoints ? point_count_ - kMostPoints : 0;
  while (begin > oldest && points_[begin - 1].mu > kHealthFrom * mu_top_) --begin;
  health_sums_[0] = {};
  health_count_ = 1;
  for (std::size_t i = begin; i < point_count_; ++i) {
    const Point& point = points_[i];
    if (point.t_s > until_s) break;
    const double w = 1.0 / (point.variance + point.force_variance);
    const CurveSums& before = health_sums_[health_count_ - 1];
    health_sums_[health_count_++] = {.weight = before.weight + w,
                                     .slip_percent = before.slip_percent + w * point.slip_percent,
                                     .mu = before.mu + w * point.mu,
                                     .force_N = before.force_N + w * point.force_N,
                                     .t_s = before.t_s + point.t_s * point.duration_s,
                                     .duration_s = before.duration_s + point.duration_s};
  }
}

// By more, from the first half to the second, than deformation alone moves it as the clamp force
// falls: else mu* rises at one slip, and no function of slip runs through such points.
bool PeakFit::slip_moves(double until_s) const noexcept {
  struct Half {
    double duration_s = 0.0, slip_percent = 0.0, force_N = 0.0;
  };
  std::array<Half, 2> halves;
  const double middle_s = 0.5 * (points_[first_].t_s + until_s);
  for (std::size_t i = first_; i < point_count_ && points_[i].t_s < until_s; ++i) {
    const Point& point = points_[i];
    Half& half = halves[point.t_s < middle_s ? 0 : 1];
    half.duration_s += point.duration_s;
    half.slip_percent += point.duration_s * point.slip_percent;
    half.force_N += point.duration_s * point.force_N;
  }
  if (!(halves[0].duration_s > 0.0) || !(halves[1].duration_s > 0.0)) return true;
  const auto moved = [&halves](double Half::*what) {
    return std::abs(halves[1].*what / halves[1].duration_s -
                    halves[0].*what / halves[0].duration_s);
  };
  return moved(&Half::slip_percent) > kDeformation_percent_per_N * moved(&Half::force_N);
}

// Variance of mu* by the torque's slow error.
double PeakFit::slow_relative() const noexcept {
  return record_->torque_slow_variance() / square(record_->torque_line().value);
}

void PeakFit::test_best_form() noexcept {
  const auto fitted_at = [this](double x) {
    const Eigen::Vector4d terms(1.0, -best_rise_.at(x), -x, -std::max(0.0, x - best_corner_));
    return mu_top_ + terms.dot(best_theta_);
  };
  const double until_s = tested_until_s();
  if (!slip_moves(until_s)) return;
  const double slow = slow_relative();
  std::size_t used = 0;
  for (std::size_t i = first_; i < point_count_ && points_[i].t_s < until_s; ++i) {
    const Point& point = points_[i];
    const double fitted = fitted_at(point.slip_percent - slip_high_percent_);
    // Further down deformation makes of it what is no function of slip any more.
    if (fitted < kNearTop * result_.mu) continue;
    residuals_[used++] = {
        .t_s = point.t_s,
        .value = point.mu - fitted,
        .variance = point.variance + point.force_variance + square(kFormTolerance * fitted),
        .slow_variance = slow * square(fitted)};
  }
  whiten({residuals_.data(), used});
  result_.residuals = test_residuals({residuals_.data(), used});
}

}  // namespace beltgrip::estimator
