#include "tests/estimator/robust/peak_reference.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <numbers>
#include <vector>

#include "estimator/robust/curve_health.h"
#include "estimator/robust/thresholds.h"
#include "estimator/statistics/interval.h"
#include "tests/estimator/robust/peak_reference_points.h"

namespace beltgrip::test {

namespace {
using Eigen::MatrixXd;
using Eigen::VectorXd;
using estimator::CurveSums;
using estimator::ExperimentRecord;
using estimator::Line;
using estimator::PeakFitResult;
using estimator::Residual;
namespace number = estimator;

constexpr double kSlowTime_s = 1.2;
constexpr std::size_t kNewestPoints = 256, kFewest = 8, kWanted = 16;
constexpr std::size_t kBeside = 3, kBesideMost = 24;
constexpr int kCornerCount = 20;
constexpr double kLambdaGrows = 1.35, kLambdaMost = 1.2, kSpanLeast_percent = 0.3;
constexpr double kRounding = 1e-9;  // of sums that are compared

double square(double x) { return x * x; }

class Fit {
 public:
  Fit(const ExperimentRecord& record, double c, double inertia_kg_m2, double stop_s)
      : record_(record), c_(c), J_(inertia_kg_m2), stop_s_(stop_s) {}
  PeakReference run();

 private:
  using Point = ReferencePoint;
  struct Form {
    bool power = false;
    double lambda = 0.0, end = 0.0;
    int n = 0;
    double corner = std::numeric_limits<double>::infinity();
    double prior = 1.0;
    VectorXd theta;  // a, B, d, h
    double chi2 = 0.0;
    double mu = 0.0, variance = 0.0, x = 0.0, fall = 0.0, fall_variance = 0.0, slope = 0.0,
           slope_variance = 0.0;
    bool falls = false;  // over all of the data
  };
  double course(std::size_t point) const;
  void find_stretch();
  void add_variances();
  void find_reached();
  double missing(const Form& form, double x) const;
  double slope_at(const Form& form, double x) const;
  VectorXd terms(const Form& form, double x) const;
  VectorXd whitened(const std::function<double(const Point&)>& term) const;
  void fit_forms();
  void solve(Form& form, const VectorXd& missing_there, const VectorXd& beyond_corner);
  double top_of(Form& form) const;
  void average();
  bool passed() const;
  double tested_until_s() const;
  void chords();
  bool slip_moves(double until_s) const;
  void test_residuals();
  const Form& best() const;

  const ExperimentRecord& record_;
  double c_, J_, stop_s_;
  std::vector<Point> all_;      // the newest points
  std::vector<Point> stretch_;  // of them, to the last
  std::vector<double> course_variance_;
  double mu_top_ = 0.0, low_percent_ = 0.0, high_percent_ = 0.0, span_ = 0.0;
  MatrixXd covariance_;
  Eigen::LLT<MatrixXd> factor_;
  VectorXd one_, x_, y_;  // whitened
  std::vector<Form> forms_;
  PeakReference out_;
};

// mu* around a point: over as many neighbours as it takes to know it well enough.
double Fit::course(std::size_t point) const {
  double mean = 0.0;
  for (std::size_t reach = kBeside; reach <= kBesideMost; reach *= 2) {
    double weights = 0.0, sum = 0.0;
    for (std::size_t i = point > reach ? point - reach : 0; i < all_.size() && i <= point + reach;
         ++i) {
      weights += 1.0 / course_variance_[i];
      sum += all_[i].mu / course_variance_[i];
    }
    mean = sum / weights;
    if (1.0 / std::sqrt(weights) < number::kCoursePrecision * std::abs(mean)) break;
  }
  return mean;
}

// From where mu* came near its top; from further down where too few points lie beyond.
void Fit::find_stretch() {
  for (const Point& point : all_) course_variance_.push_back(point.variance);
  std::size_t top = 0;
  for (std::size_t i = 0; i < all_.size(); ++i) {
    const double mu = course(i);
    if (mu <= mu_top_) continue;
    mu_top_ = mu;
    top = i;
  }
  std::size_t first = top;
  const auto beyond = [&] { return all_.size() - first; };
  while (first > 0 && (beyond() < kWanted || course(first) >= number::kTopFrom * mu_top_)) {
    --first;
  }
  stretch_.assign(all_.begin() + static_cast<std::ptrdiff_t>(first), all_.end());
  out_.of_stretch = stretch_.size();
}

// What the forms leave, and the noise of slip by the slope between the neighbours.
void Fit::add_variances() {
  const auto last = static_cast<std::ptrdiff_t>(stretch_.size()) - 1;
  const auto at = [&](std::ptrdiff_t i) -> const Point& {
    return stretch_[static_cast<std::size_t>(std::clamp<std::ptrdiff_t>(i, 0, last))];
  };
  constexpr auto kReach = static_cast<std::ptrdiff_t>(kBeside);
  for (std::ptrdiff_t i = 0; i <= last; ++i) {
    const double rises = at(i + kReach).mu - at(i - kReach).mu;
    const double over = std::max(0.1, at(i + kReach).slip_percent - at(i - kReach).slip_percent);
    const double slope = std::min(0.1, std::max(0.0, rises / over));
    Point& point = stretch_[static_cast<std::size_t>(i)];
    point.variance += square(number::kFormError * std::max(0.0, mu_top_ - point.mu)) +
                      square(slope) * record_.slip_noise_percent2_s() / point.duration_s;
    out_.fit.duration_s += point.duration_s;
  }
  std::copy(stretch_.begin(), stretch_.end(),
            all_.end() - static_cast<std::ptrdiff_t>(stretch_.size()));
}

// Of all windows of 1, 2, 4, ... points the one whose lower end is largest.
void Fit::find_reached() {
  double largest = 0.0;
  for (std::size_t length = 1; length <= stretch_.size(); length *= 2) {
    for (std::size_t begin = 0; begin + length <= stretch_.size(); ++begin) {
      const Point& first = stretch_[begin];
      const Point& last = stretch_[begin + length - 1];
      double time_s = 0.0, T = 0.0, F = 0.0, slip = 0.0, T_variance = 0.0;
      for (std::size_t i = begin; i < begin + length; ++i) {
        time_s += stretch_[i].duration_s;
      }
      for (std::size_t i = begin; i < begin + length; ++i) {
        const double w = stretch_[i].duration_s / time_s;
        T += w * stretch_[i].torque_Nm;
        F += w * stretch_[i].force_N;
        slip += w * stretch_[i].slip_percent;
        T_variance += w * w * stretch_[i].torque_variance;
      }
      if (J_ > 0.0) {
        T_variance += square(J_ / time_s) * (first.speed_variance[0] + last.speed_variance[1]) +
                      square(last.held_share) * record_.torque_line().variance_at(last.t_s);
      }
      const double u = time_s / kSlowTime_s;
      const double slow = 2.0 / square(u) * (u - 1.0 + std::exp(-u));  // of a mean over time_s
      T_variance += square(number::kNormal99Upper / number::kReachedDeviations) *
                    record_.torque_slow_variance() * slow;
      const Line& line = record_.force_line();
      const double from_s = first.begin_s(), to_s = last.end_s();
      const double F_variance = from_s < line.begin_s - kRounding
                                    ? record_.force().density(to_s - from_s) / (to_s - from_s)
                                    : line.variance_at(0.5 * (from_s + to_s));
      const double deviation = std::sqrt(T_variance / square(T) + F_variance / square(F));
      const double mu = c_ * T / F;
      const double surely = mu - number::kReachedDeviations * deviation * std::abs(mu);
      if (!(surely > largest)) continue;
      largest = surely;
      out_.fit.reached = mu;
      out_.fit.reached_deviation = deviation;
      out_.fit.reached_slip_percent = slip;
    }
  }
}

// What is missing to the top of the rise, of 1; x: slip relative to the highest.
double Fit::missing(const Form& form, double x) const {
  if (form.power) return std::pow(std::max(0.0, form.end - x) / span_, form.n);
  return std::exp(-(x + span_) / form.lambda);
}

double Fit::slope_at(const Form& form, double x) const {
  const double falls = form.theta(2) + (x >= form.corner ? form.theta(3) : 0.0);
  if (form.power) {
    return form.theta(1) * form.n / span_ *
               std::pow(std::max(0.0, form.end - x) / span_, form.n - 1) -
           falls;
  }
  return form.theta(1) / form.lambda * missing(form, x) - falls;
}

VectorXd Fit::terms(const Form& form, double x) const {
  return Eigen::Vector4d(1.0, -missing(form, x), -x, -std::max(0.0, x - form.corner));
}

VectorXd Fit::whitened(const std::function<double(const Point&)>& term) const {
  VectorXd out(static_cast<Eigen::Index>(stretch_.size()));
  for (std::size_t i = 0; i < stretch_.size(); ++i) {
    out(static_cast<Eigen::Index>(i)) = term(stretch_[i]);
  }
  return factor_.matrixL().solve(out);
}

void Fit::fit_forms() {
  low_percent_ = std::numeric_limits<double>::infinity();
  high_percent_ = -low_percent_;
  for (const Point& point : stretch_) {
    low_percent_ = std::min(low_percent_, point.slip_percent);
    high_percent_ = std::max(high_percent_, point.slip_percent);
  }
  span_ = std::max(kSpanLeast_percent, high_percent_ - low_percent_);

  const auto n = static_cast<Eigen::Index>(stretch_.size());
  covariance_ = MatrixXd::Zero(n, n);
  for (Eigen::Index i = 0; i < n; ++i) {
    const Point& a = stretch_[static_cast<std::size_t>(i)];
    for (Eigen::Index j = 0; j <= i; ++j) {
      const Point& b = stretch_[static_cast<std::size_t>(j)];
      covariance_(i, j) = covariance_(j, i) = record_.torque_slow_variance() * square(c_) /
                                              (a.force_N * b.force_N) *
                                              std::exp(-(a.t_s - b.t_s) / kSlowTime_s);
    }
    covariance_(i, i) += a.variance;
  }
  factor_.compute(covariance_);
  const auto x_at = [&](const Point& point) { return point.slip_percent - high_percent_; };
  one_ = whitened([](const Point&) { return 1.0; });
  x_ = whitened(x_at);
  y_ = whitened([&](const Point& point) { return point.mu - mu_top_; });
  std::vector<double> corners;
  std::vector<VectorXd> beyond;
  for (int i = 0; i < kCornerCount; ++i) {
    const double corner = -span_ * number::kCornersOver * (i + 0.5) / kCornerCount;
    corners.push_back(corner);
    beyond.push_back(
        whitened([&](const Point& point) { return std::max(0.0, x_at(point) - corner); }));
  }
  const VectorXd none = VectorXd::Zero(n);
  for (double lambda = number::kFirstLambda * span_; lambda <= kLambdaMost * span_;
       lambda *= kLambdaGrows) {
    Form form;
    form.lambda = lambda;
    const VectorXd there = whitened([&](const Point& point) { return missing(form, x_at(point)); });
    solve(form, there, none);
    form.prior = 1.0 / kCornerCount;
    for (std::size_t k = 0; k < corners.size(); ++k) {
      form.corner = corners[k];
      solve(form, there, beyond[k]);
    }
  }
  for (std::size_t e = 0; e < corners.size(); e += 2) {
    for (const int power : {2, 3}) {
      Form form;
      form.power = true;
      form.n = power;
      form.end = corners[e];
      form.prior = 4.0 / square(kCornerCount);
      const VectorXd there =
          whitened([&](const Point& point) { return missing(form, x_at(point)); });
      for (std::size_t k = 0; k <= e; ++k) {
        form.corner = corners[k];
        solve(form, there, beyond[k]);
      }
    }
  }
  out_.forms = forms_.size();
}

// The priors are four more readings.
void Fit::solve(Form& form, const VectorXd& there, const VectorXd& beyond) {
  const Eigen::Index n = y_.size();
  MatrixXd X = MatrixXd::Zero(n + 4, 4);
  VectorXd y = VectorXd::Zero(n + 4);
  X.col(0).head(n) = one_;
  X.col(1).head(n) = -there;
  X.col(2).head(n) = -x_;
  X.col(3).head(n) = -beyond;
  y.head(n) = y_;
  X(n, 0) = 1.0 / (20.0 * mu_top_);
  X(n + 1, 1) = 1.0 / (2.0 * mu_top_);
  X(n + 2, 2) = form.power ? 1e9 : 1.0 / 0.05;
  X(n + 3, 3) = 1.0 / 0.02;
  const Eigen::ColPivHouseholderQR<MatrixXd> qr(X);
  form.theta = qr.solve(y);
  // Where a rise ends before the data begin there is nothing of it: B is 0.
  const double least = -1e-12 * mu_top_;
  if (!(form.theta(1) >= least && form.theta(3) >= least)) return;
  form.chi2 = (y - X * form.theta).head(n).squaredNorm();
  const auto variance_of = [&](const VectorXd& g) {
    const VectorXd turned = qr.colsPermutation().transpose() * g;
    return qr.matrixR()
        .topLeftCorner(4, 4)
        .template triangularView<Eigen::Upper>()
        .transpose()
        .solve(turned)
        .squaredNorm();
  };
  form.x = top_of(form);
  const VectorXd at_top = terms(form, form.x), at_end = terms(form, 0.0);
  form.mu = mu_top_ + at_top.dot(form.theta);
  form.variance = variance_of(at_top);
  form.fall = (at_top - at_end).dot(form.theta);
  form.fall_variance = variance_of(at_top - at_end);
  const double rise = form.power ? 0.0 : missing(form, 0.0) / form.lambda;
  const Eigen::Vector4d slope(0.0, rise, -1.0, std::isfinite(form.corner) ? -1.0 : 0.0);
  form.slope = slope.dot(form.theta);
  form.slope_variance = variance_of(slope);
  forms_.push_back(form);
}

// All of these curves bend down only: their slope changes its sign once, or not at all. A flat
// top's is its end.
double Fit::top_of(Form& form) const {
  const double low = low_percent_ - high_percent_;
  form.falls = false;
  if (form.power) return std::max(low, form.corner);
  if (slope_at(form, 0.0) >= 0.0) return 0.0;
  form.falls = slope_at(form, low) <= 0.0;
  if (form.falls) return low;
  double rises = low, falls = 0.0;
  for (int i = 0; i < 60; ++i) {
    const double middle = 0.5 * (rises + falls);
    (slope_at(form, middle) > 0.0 ? rises : falls) = middle;
  }
  return falls;
}

const Fit::Form& Fit::best() const {
  return *std::min_element(forms_.begin(), forms_.end(),
                           [](const Form& a, const Form& b) { return a.chi2 < b.chi2; });
}

void Fit::average() {
  const double chi2 = best().chi2;
  const double freedom = std::max(1.0, static_cast<double>(stretch_.size()) - 5.0);
  out_.scale = std::max(1.0, chi2 / freedom);
  PeakFitResult& fit = out_.fit;
  double weights = 0.0;
  std::vector<double> weight;
  for (const Form& form : forms_) {
    weight.push_back(form.prior * std::exp(-0.5 * (form.chi2 - chi2) / out_.scale));
    weights += weight.back();
  }
  double below_highest = 0.0;
  for (std::size_t i = 0; i < forms_.size(); ++i) fit.mu += weight[i] / weights * forms_[i].mu;
  for (std::size_t i = 0; i < forms_.size(); ++i) {
    const Form& form = forms_[i];
    const double w = weight[i] / weights;
    fit.variance += w * (form.variance * out_.scale + square(form.mu - fit.mu));
    below_highest += w * form.x;
    fit.fall += w * form.fall;
    fit.fall_variance += w * form.fall_variance * out_.scale;
    // The slope at the end, a normal variable: probability that it is below 0; its expectation,
    // what is below 0 taken for 0.
    const double deviation = std::max(1e-9, std::sqrt(form.slope_variance * out_.scale));
    const double z = form.slope / deviation;
    const double below = 0.5 * std::erfc(z / std::numbers::sqrt2);
    fit.inside += w * below;
    fit.end_rise += w * (form.slope * (1.0 - below) +
                         deviation * std::exp(-0.5 * z * z) / std::sqrt(2.0 * std::numbers::pi));
    if (form.falls) out_.tops_at_the_begin += w;
  }
  fit.slip_percent = high_percent_ + below_highest;
  fit.end_slip_percent = high_percent_;
  const Point* there = &stretch_.front();
  for (const Point& point : stretch_) {
    if (point.slip_percent <= fit.slip_percent + kRounding) there = &point;
  }
  fit.t_s = there->t_s;
  fit.held_share = there->held_share;
  fit.valid = std::isfinite(fit.mu) && fit.mu > 0.0;
  fit.passed = passed();
}

// On average the points beyond the peak are later than those before it, and the last tenth of all
// lies beyond.
bool Fit::passed() const {
  double time_s[2] = {0.0, 0.0}, sum[2] = {0.0, 0.0}, last_time_s = 0.0, last_sum = 0.0;
  const std::size_t last = std::max<std::size_t>(1, stretch_.size() / 10);
  for (std::size_t i = 0; i < stretch_.size(); ++i) {
    const Point& point = stretch_[i];
    const double beyond_percent = point.slip_percent - out_.fit.slip_percent;
    const std::size_t side = beyond_percent > 0.0 ? 1 : 0;
    if (std::abs(beyond_percent) > kRounding) {
      time_s[side] += point.duration_s;
      sum[side] += point.duration_s * point.t_s;
    }
    if (i + last >= stretch_.size()) {
      last_time_s += point.duration_s;
      last_sum += point.duration_s * point.slip_percent;
    }
  }
  return time_s[0] > 0.0 && time_s[1] > 0.0 && sum[1] / time_s[1] > sum[0] / time_s[0] &&
         last_sum / last_time_s > out_.fit.slip_percent;
}

// Where the force has come to a stand or comes back, or the experiment was ended, no curve is
// followed any more.
double Fit::tested_until_s() const {
  const Line& line = record_.force_line();
  const double end_s = record_.duration_s();
  const double falls = std::abs(line.at(end_s) - line.at(line.begin_s));
  double out = end_s;
  if (falls < number::kStandsStill * line.at(end_s)) out = std::min(out, line.begin_s);
  out = std::min(out, record_.lowered_until_s());
  return std::min(out, stop_s_) - kRounding;
}

double slow_share(const ExperimentRecord& record) {
  return record.torque_slow_variance() / square(record.torque_line().value);
}

// From 0.6 of the top to the top.
void Fit::chords() {
  std::size_t begin = all_.size() - stretch_.size();
  while (begin > 0 && all_[begin - 1].mu > number::kHealthFrom * mu_top_) --begin;
  std::vector<CurveSums> sums(1);
  for (std::size_t i = begin; i < all_.size(); ++i) {
    const Point& point = all_[i];
    if (point.t_s > std::min(out_.fit.t_s, tested_until_s())) break;
    const double w = 1.0 / (point.variance + point.force_variance);
    CurveSums next = sums.back();
    next.weight += w;
    next.slip_percent += w * point.slip_percent;
    next.mu += w * point.mu;
    next.force_N += w * point.force_N;
    next.t_s += point.duration_s * point.t_s;
    next.duration_s += point.duration_s;
    sums.push_back(next);
  }
  for (std::size_t length = 1; length <= 16; length *= 2) {
    out_.fit.below_chord =
        std::max(out_.fit.below_chord,
                 estimator::below_chord(sums, length,
                                        {record_.slip_noise_percent2_s(), slow_share(record_)}));
  }
}

// From the first half of the time to the second, by more than the force deforms.
bool Fit::slip_moves(double until_s) const {
  const double middle_s = 0.5 * (stretch_.front().t_s + until_s);
  double time_s[2] = {0.0, 0.0}, slip[2] = {0.0, 0.0}, force[2] = {0.0, 0.0};
  for (const Point& point : stretch_) {
    if (point.t_s >= until_s) break;
    const int half = point.t_s < middle_s ? 0 : 1;
    time_s[half] += point.duration_s;
    slip[half] += point.duration_s * point.slip_percent;
    force[half] += point.duration_s * point.force_N;
  }
  if (time_s[0] <= 0.0 || time_s[1] <= 0.0) return true;
  return std::abs(slip[1] / time_s[1] - slip[0] / time_s[0]) >
         estimator::kDeformation_percent_per_N *
             std::abs(force[1] / time_s[1] - force[0] / time_s[0]);
}

// Free of what they share, by their covariance.
std::vector<Residual> by_covariance(std::vector<Residual> residuals) {
  const auto n = static_cast<Eigen::Index>(residuals.size());
  if (n == 0) return residuals;
  MatrixXd covariance(n, n);
  VectorXd values(n);
  for (Eigen::Index i = 0; i < n; ++i) {
    const Residual& a = residuals[static_cast<std::size_t>(i)];
    values(i) = a.value;
    for (Eigen::Index j = 0; j < n; ++j) {
      const Residual& b = residuals[static_cast<std::size_t>(j)];
      covariance(i, j) = std::sqrt(a.slow_variance * b.slow_variance) *
                         std::exp(-std::abs(a.t_s - b.t_s) / kSlowTime_s);
    }
    covariance(i, i) += a.variance;
  }
  const Eigen::LLT<MatrixXd> factor(covariance);
  values = factor.matrixL().solve(values);
  for (Eigen::Index i = 0; i < n; ++i) residuals[static_cast<std::size_t>(i)].value = values(i);
  return residuals;
}

void Fit::test_residuals() {
  const double until_s = tested_until_s();
  if (!slip_moves(until_s)) return;
  const Form& form = best();
  std::vector<Residual> residuals;
  for (const Point& point : stretch_) {
    if (point.t_s >= until_s) break;
    const double fitted = mu_top_ + terms(form, point.slip_percent - high_percent_).dot(form.theta);
    if (fitted < number::kNearTop * out_.fit.mu) continue;
    residuals.push_back(
        {point.t_s, point.mu - fitted,
         point.variance + point.force_variance + square(number::kFormTolerance * fitted),
         slow_share(record_) * square(fitted)});
  }
  out_.innovation = estimator::test_residuals(by_covariance(residuals)).innovation;
  estimator::whiten(residuals);
  out_.fit.residuals = estimator::test_residuals(residuals);
}

PeakReference Fit::run() {
  all_ = reference_points(record_, c_, J_);
  if (all_.empty()) return out_;
  out_.points = all_.size();
  if (all_.size() > kNewestPoints) all_.erase(all_.begin(), all_.end() - kNewestPoints);
  find_stretch();
  add_variances();
  find_reached();
  if (stretch_.size() < kFewest || mu_top_ <= 0.0) return out_;
  fit_forms();
  if (forms_.empty()) return out_;
  average();
  if (!out_.fit.valid) return out_;
  chords();
  test_residuals();
  return out_;
}
}  // namespace

PeakReference fit_peak(const ExperimentRecord& record, double traction_per_Nm_N,
                       double inertia_kg_m2, double stop_s) {
  return Fit(record, traction_per_Nm_N, inertia_kg_m2, stop_s).run();
}

}  // namespace beltgrip::test
