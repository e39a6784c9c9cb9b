// The friction curve near its peak, from what was measured until the stop: a sum of forms
//   mu(s) = a - B exp(-(s - s_0) / lambda) - d (s - s_0) - h max(0, s - s_k)
// over grids of lambda and s_k (a round peak without the last term, a corner with it), each fitted
// by weighted least squares, averaged with the weights that the data give them. Slip in percent.
// Fixed memory. Real-time thread.
#pragma once

#include <array>
#include <cstddef>
#include <span>

namespace beltgrip::estimator {

struct CurvePoint {  // means over a stretch of time
  double t_s = 0.0;
  double slip_percent = 0.0;
  double torque_Nm = 0.0;  // on the belt
  double force_N = 0.0;
  double duration_s = 0.0;
  double variance = 0.0;  // of the torque, with what the noise in slip does to it
};

struct PeakFit {
  double mu = 0.0;  // the largest value of the curve within the data; 0: no form fits
  double variance = 0.0;
  double slip_percent = 0.0;
  double inside = 0.0;  // probability that the peak lies within the data
};

class PeakFitter {
 public:
  // mu = c torque / force.
  PeakFit fit(std::span<const CurvePoint> points, double c) noexcept;

 private:
  static constexpr int kHinges = 24;
  static constexpr int kLambdas = 10;
  static constexpr std::size_t kForms = std::size_t{kLambdas} * (kHinges + 1);
  struct Candidate {
    double chi2 = 0.0, mu = 0.0, variance = 0.0, slip_percent = 0.0, prior = 0.0;
    bool inside = false;
  };
  void fit_form(double lambda, int hinge) noexcept;
  PeakFit average() const noexcept;

  std::span<const CurvePoint> points_;
  double c_ = 0.0;
  double slip_low_ = 0.0, slip_high_ = 0.0, span_ = 0.0, mu_scale_ = 0.0;
  double best_chi2_ = 0.0;
  std::array<Candidate, kForms> candidates_{};
  std::size_t count_ = 0;
};

}  // namespace beltgrip::estimator
