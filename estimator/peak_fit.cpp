#include "estimator/peak_fit.h"

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <algorithm>
#include <cmath>

namespace beltgrip::estimator {
namespace {

constexpr std::size_t kFewest = 8;     // points
constexpr double kLambdaFirst = 0.06;  // of the span of slip
constexpr double kLambdaFactor = 1.35;
constexpr double kHingeReach = 0.75;  // corners lie in this last share of the span
constexpr double kShortestSpan_percent = 0.3;
// Weak priors: slopes of a friction curve per percent of slip, 1 deviation.
constexpr double kSlopePrior = 0.05;
constexpr double kCornerPrior = 0.02;

constexpr int kTerms = 4;  // 1, exp, linear, hinge
using Vector = Eigen::Matrix<double, kTerms, 1>;
using Matrix = Eigen::Matrix<double, kTerms, kTerms>;

}  // namespace

PeakFit PeakFitter::fit(std::span<const CurvePoint> points, double c) noexcept {
  points_ = points;
  c_ = c;
  count_ = 0;
  best_chi2_ = 1e300;
  mu_scale_ = 0.0;
  slip_low_ = 1e9;
  slip_high_ = -1e9;
  for (const CurvePoint& point : points_) {
    slip_low_ = std::min(slip_low_, point.slip_percent);
    slip_high_ = std::max(slip_high_, point.slip_percent);
    mu_scale_ = std::max(mu_scale_, c_ * point.torque_Nm / point.force_N);
  }
  span_ = std::max(kShortestSpan_percent, slip_high_ - slip_low_);
  if (points_.size() < kFewest || mu_scale_ <= 0.0) return {};
  double lambda = kLambdaFirst * span_;
  for (int i = 0; i < kLambdas; ++i, lambda *= kLambdaFactor) {
    for (int hinge = -1; hinge < kHinges; ++hinge) fit_form(lambda, hinge);
  }
  return average();
}

// One form: hinge -1 has no corner.
void PeakFitter::fit_form(double lambda, int hinge) noexcept {
  const bool corner = hinge >= 0;
  const double s_k = slip_high_ - span_ * kHingeReach * (hinge + 0.5) / kHinges;
  const auto terms = [&](double slip_percent) {
    const double x = slip_percent - slip_high_;
    Vector phi;
    phi << 1.0, -std::exp(-(x + span_) / lambda), -x,
        corner ? -std::max(0.0, slip_percent - s_k) : 0.0;
    return phi;
  };
  Matrix A = Matrix::Zero();
  Vector b = Vector::Zero();
  double yy = 0.0;
  for (const CurvePoint& point : points_) {
    const Vector phi = terms(point.slip_percent);
    const double y = c_ * point.torque_Nm / point.force_N;
    const double w = point.force_N * point.force_N / (c_ * c_ * point.variance);
    A += w * phi * phi.transpose();
    b += w * y * phi;
    yy += w * y * y;
  }
  Matrix R = A;
  const double height = 1.0 / (4.0 * mu_scale_ * mu_scale_);
  R(0, 0) += height * 1e-2;
  R(1, 1) += height;
  R(2, 2) += 1.0 / (kSlopePrior * kSlopePrior);
  R(3, 3) = corner ? R(3, 3) + 1.0 / (kCornerPrior * kCornerPrior) : 1e12;
  const Eigen::LDLT<Matrix> ldlt(R);
  const Vector theta = ldlt.solve(b);
  if (!theta.allFinite() || theta(1) < 0.0 || (corner && theta(3) < 0.0)) return;

  // The largest value within the data: at the end, at a round top before or after the corner, or at
  // the corner.
  const double B = theta(1) * std::exp(-span_ / lambda);
  const double d = theta(2);
  const double h = corner ? theta(3) : 0.0;
  double best = slip_high_;
  bool inside = false;
  const auto consider = [&](double slip_percent) {
    if (slip_percent > slip_low_ && slip_percent <= slip_high_ &&
        terms(slip_percent).dot(theta) >= terms(best).dot(theta)) {
      best = slip_percent;
      inside = true;
    }
  };
  if (B > 0.0 && d > 0.0) consider(slip_high_ + lambda * std::log(B / (lambda * d)));
  if (corner) {
    if (B > 0.0 && d + h > 0.0) {
      const double top = slip_high_ + lambda * std::log(B / (lambda * (d + h)));
      if (top > s_k) consider(top);
    }
    consider(s_k);
  }
  const Vector g = terms(best);
  Candidate& candidate = candidates_[count_++];
  candidate.chi2 = yy - 2.0 * theta.dot(b) + theta.dot(A * theta);
  candidate.mu = g.dot(theta);
  candidate.variance = g.dot(ldlt.solve(g));
  candidate.slip_percent = best;
  candidate.prior = corner ? 1.0 / kHinges : 1.0;
  candidate.inside = inside;
  best_chi2_ = std::min(best_chi2_, candidate.chi2);
}

// Each form counts with the likelihood of its residuals; what the forms disagree about widens the
// variance, as does a misfit of the best one.
PeakFit PeakFitter::average() const noexcept {
  if (count_ == 0) return {};
  const double degrees = std::max(1.0, static_cast<double>(points_.size()) - 5.0);
  const double scale = std::max(1.0, best_chi2_ / degrees);
  double weight = 0.0, mu = 0.0, mu2 = 0.0, variance = 0.0, slip = 0.0, inside = 0.0;
  for (std::size_t i = 0; i < count_; ++i) {
    const Candidate& candidate = candidates_[i];
    const double w = candidate.prior * std::exp(-0.5 * (candidate.chi2 - best_chi2_) / scale);
    weight += w;
    mu += w * candidate.mu;
    mu2 += w * candidate.mu * candidate.mu;
    variance += w * candidate.variance * scale;
    slip += w * candidate.slip_percent;
    inside += candidate.inside ? w : 0.0;
  }
  PeakFit result;
  result.mu = mu / weight;
  result.variance = variance / weight + std::max(0.0, mu2 / weight - result.mu * result.mu);
  result.slip_percent = slip / weight;
  result.inside = inside / weight;
  return result;
}

}  // namespace beltgrip::estimator
