#include "estimator/robust_estimator.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <vector>

#include <Eigen/Cholesky>
#include <Eigen/Core>

#include "estimator/sensor_error.h"
#include "estimator/signal_chain.h"
#include "estimator/units.h"

namespace beltgrip::estimator {
namespace {

constexpr double kCutoff_hz = 8.0;
constexpr double kPointRate_hz = 50.0;
constexpr std::size_t kPoints = 8192;        // then every second one is dropped
constexpr double kStretch_percent = 1.0;     // over which the slope is taken
constexpr double kSignificance = 3.0;        // deviations
constexpr double kBackupSlip_percent = 8.0;  // above the smallest slip
constexpr double kBackupRate_percent_s = 15.0;
constexpr double kFitBehind_percent = 1.0;  // local fit: slip below and above the largest mu*
constexpr double kFitAhead_percent = 1.0;

struct Point {
  double slip, mu, force, torque, omega_s;
};

class RobustEstimator final : public SlipCurveEstimator {
 public:
  RobustEstimator(const EstimatorSettings& settings, const VariatorParameters& variator,
                  const SensorAccuracies& accuracies)
      : settings_(settings),
        variator_(variator),
        accuracies_(accuracies),
        chain_(settings, variator, std::min(kCutoff_hz, settings.sample_rate_hz / 4.0)),
        stride_(std::max(1L, std::lround(settings.sample_rate_hz / kPointRate_hz))),
        points_(kPoints) {
    RobustEstimator::reset();
  }

  void reset() noexcept override {
    chain_.reset();
    out_ = {};
    peak_ = {};
    size_ = 0;
    decimate_ = stride_;
    since_ = 0;
    slip_min_ = 1e9;
    noise_sum_ = 0.0;
    noise_count_ = 0;
  }

  const CurveEstimate& step(const VariatorSample& sample) noexcept override {
    const Measurement& now = chain_.step(sample);
    out_.t_ns = sample.t_ns;
    out_.usable = now.usable;
    if (out_.stop == StopReason::kNone) out_.stop = now.stop;
    if (!now.usable) return out_;
    out_.mu_star = now.mu_star;
    out_.sigma_star_percent = now.slip_percent;
    out_.clamp_force_N = now.clamp_force_N;
    out_.torque_p_Nm = now.torque_p_Nm;
    out_.slip_energy_J += std::max(0.0, now.slip_percent / kPercent) * std::abs(now.torque_p_Nm) *
                          now.omega_p_rad_s / settings_.sample_rate_hz;
    out_.direction = chain_.point().direction;
    out_.end_stop = chain_.point().end_stop;
    if (++since_ < decimate_) return out_;
    since_ = 0;
    add({now.slip_percent, now.mu_star, now.clamp_force_N, std::abs(now.torque_p_Nm),
         now.omega_s_rad_s});
    decide();
    return out_;
  }

  bool conclude() noexcept override {
    fit_peak();
    return true;
  }

  const PeakEstimate& peak() const noexcept override { return peak_; }

 private:
  void add(const Point& point) noexcept {
    if (size_ == kPoints) {
      for (std::size_t i = 0; i < kPoints / 2; ++i) points_[i] = points_[2 * i + 1];
      size_ = kPoints / 2;
      decimate_ *= 2;
    }
    points_[size_++] = point;
    if (size_ >= 3) {
      // Second differences see noise, not drift: their variance is six times that of the points.
      const double second =
          points_[size_ - 1].slip - 2.0 * points_[size_ - 2].slip + points_[size_ - 3].slip;
      noise_sum_ += second * second / 6.0;
      ++noise_count_;
    }
    slip_min_ = std::min(slip_min_, point.slip);
  }

  void decide() noexcept {
    const double slip = points_[size_ - 1].slip;
    double n = 0.0, sx = 0.0, sy = 0.0, sxx = 0.0, sxy = 0.0, syy = 0.0;
    const double mu0 = points_[size_ - 1].mu;
    std::size_t i = size_;
    while (i > 0 && slip - points_[i - 1].slip < kStretch_percent && size_ - i < 500) {
      const double x = points_[i - 1].slip - slip;
      const double y = points_[i - 1].mu - mu0;
      n += 1.0;
      sx += x;
      sy += y;
      sxx += x * x;
      sxy += x * y;
      syy += y * y;
      --i;
    }
    const double noise = noise_count_ > 20 ? noise_sum_ / static_cast<double>(noise_count_) : 0.0;
    out_.phase = Phase::kQuiet;
    if (n < 5.0) return;
    const double vx = sxx / n - sx * sx / (n * n);
    out_.slip_variance = vx;
    // Slip must have moved well beyond its noise and above its smallest value.
    if (vx < 4.0 * noise || vx < 0.02 || slip - slip_min_ < kStretch_percent) return;
    const double cxy = sxy / n - sx * sy / (n * n);
    const double vy = syy / n - sy * sy / (n * n);
    const double slope = cxy / (vx - noise);
    const double residual = std::max(0.0, vy - slope * cxy);
    // Low-passed points are correlated over about 1/(2 cutoff).
    const double independent = std::max(2.0, n * 2.0 * kCutoff_hz / kPointRate_hz * 0.5);
    const double deviation = std::sqrt(residual / (vx * independent));
    out_.friction_slope = slope;
    out_.phase = slope > deviation
                     ? Phase::kExcited
                     : (slope < -kSignificance * deviation ? Phase::kMacroSlip : Phase::kPeak);
    if (out_.stop != StopReason::kNone) return;
    if (slope < -kSignificance * deviation) {
      out_.stop = StopReason::kSlope;
    } else if (slip - slip_min_ > kBackupSlip_percent) {
      out_.stop = StopReason::kSlip;
    } else if (size_ > 12) {
      const double rate = (slip - points_[size_ - 11].slip) * kPointRate_hz / 10.0;
      if (rate > kBackupRate_percent_s) out_.stop = StopReason::kSlipRate;
    }
  }

  void fit_peak() noexcept {
    peak_ = {};
    if (size_ < 20) return;
    // The largest mu* of a running mean says where the peak is.
    constexpr std::size_t kMean = 15;
    double sum = 0.0;
    std::size_t best = 0;
    double best_mu = -1.0;
    for (std::size_t i = 0; i < size_; ++i) {
      sum += points_[i].mu;
      if (i >= kMean) sum -= points_[i - kMean].mu;
      if (i + 1 >= kMean && sum > best_mu * kMean) {
        best_mu = sum / kMean;
        best = i - kMean / 2;
      }
    }
    const double centre = points_[best].slip;
    Eigen::Matrix3d A = Eigen::Matrix3d::Zero();
    Eigen::Vector3d b = Eigen::Vector3d::Zero();
    double yy = 0.0, n = 0.0, force = 0.0, torque = 0.0, omega_s = 0.0, largest = centre;
    for (std::size_t i = 0; i < size_; ++i) {
      const double x = points_[i].slip - centre;
      if (x < -kFitBehind_percent || x > kFitAhead_percent) continue;
      if (i < best && points_[i].mu < 0.9 * best_mu) continue;
      const Eigen::Vector3d h(1.0, x, x * x);
      const double y = points_[i].mu - best_mu;
      A += h * h.transpose();
      b += h * y;
      yy += y * y;
      n += 1.0;
      force += points_[i].force;
      torque += points_[i].torque;
      omega_s += points_[i].omega_s;
      largest = std::max(largest, points_[i].slip);
    }
    if (n < 10.0) return;
    const Eigen::Vector3d c = A.ldlt().solve(b);
    const double residual = std::max(0.0, (yy - c.dot(b)) / n);
    const double independent = std::max(1.0, n * kCutoff_hz / kPointRate_hz);
    const double spread = std::sqrt(residual / independent);
    double x_peak = 0.0;
    if (c[2] < 0.0) {
      x_peak = std::clamp(-0.5 * c[1] / c[2], -kFitBehind_percent, largest - centre);
    }
    const double value = best_mu + c[0] + c[1] * x_peak + c[2] * x_peak * x_peak;
    const double sensors = value * relative_sensor_deviation(variator_, accuracies_, torque / n,
                                                             force / n, omega_s / n);
    const double deviation = std::max(kSmallestStd, std::hypot(2.0 * spread, sensors));
    const bool turned = out_.stop == StopReason::kSlope || points_[size_ - 1].mu < 0.99 * value;
    peak_.sigma_peak_percent = centre + x_peak;
    peak_.samples = static_cast<std::int64_t>(n) * decimate_;
    if (turned) {
      peak_.kind = PeakKind::kValue;
      peak_.mu_max = value;
      peak_.mu_max_std = deviation;
      peak_.ci95_low = value - kNormal95 * deviation;
      peak_.ci95_high = value + kNormal95 * deviation;
    } else {
      peak_.kind = PeakKind::kLowerBound;
      peak_.mu_max = value - 2.3 * deviation;
    }
  }

  EstimatorSettings settings_;
  VariatorParameters variator_;
  SensorAccuracies accuracies_;
  SignalChain chain_;
  long stride_;
  std::vector<Point> points_;
  std::size_t size_ = 0;
  long decimate_ = 1, since_ = 0;
  double slip_min_ = 0.0;
  double noise_sum_ = 0.0;
  long noise_count_ = 0;
  CurveEstimate out_;
  PeakEstimate peak_;
};

}  // namespace

std::unique_ptr<SlipCurveEstimator> make_robust_estimator(const EstimatorSettings& settings,
                                                          const VariatorParameters& variator,
                                                          const SensorAccuracies& accuracies) {
  return std::make_unique<RobustEstimator>(settings, variator, accuracies);
}

}  // namespace beltgrip::estimator
