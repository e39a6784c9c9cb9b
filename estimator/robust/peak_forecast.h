// mu_max before the peak has been seen: what curves of many forms, fitted to what was measured so
// far, say of their top. Slip in percent. Real-time thread: memory is taken by the constructor;
// each step does a bounded piece of work, and the next point is collected until the last has been
// used.
//
// A form g(u), u = slip / slip at the peak, has its top g(1) = 1. On a grid of forms, of the slip
// at the peak and of the deformation of the pulleys, mu* = m g(u) is fitted by weighted least
// squares, with small shifts of the slip (end stop, deformation, place on the grid) as further
// linear parameters of known width; m is mu_max. The fits count by their likelihood; the spread
// between them is the uncertainty, wide while only the foot of the curve is known. What mu* has
// reached for sure is no longer possible for its top. Forms: tanh,
// brush (1 - (1 - u)^n), magic formula, u exp(1 - u): the ones in use for traction of belts and
// tyres.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "estimator/record/experiment_record.h"

namespace beltgrip::estimator {

struct Forecast {
  bool valid = false;
  double mu_max = 0.0;  // median
  double low = 0.0;     // 95 % of the probability lies between
  double high = 0.0;
  double slip_peak_percent = 0.0;  // sigma* expected at the peak
};

class PeakForecast {
 public:
  explicit PeakForecast(double sample_rate_hz);
  // c: cos(theta) / (2 R_p); inertia 0 where the torque of the belt is measured.
  void reset(double traction_per_Nm_N, double inertia_kg_m2) noexcept;
  // After each cell of the record.
  void collect(const ExperimentRecord& record) noexcept;
  // Every sample. True when the forecast has changed.
  bool step() noexcept;
  const Forecast& forecast() const noexcept { return forecast_; }

 private:
  static constexpr std::size_t kForms = 11;
  static constexpr std::size_t kPeaks = 18;  // slips at the peak
  static constexpr std::size_t kDeformations = 9;
  static constexpr std::size_t kCurves = kForms * kPeaks * kDeformations;
  static constexpr std::size_t kTable = 200;  // u = 0 .. 4
  static constexpr std::size_t kBins = 500;
  static constexpr std::size_t kReachedScales = 5;
  static constexpr std::size_t kTerms = 4;
  enum class Stage : std::uint8_t { kIdle, kTakeIn, kSum, kQuantiles };
  struct Curve {  // one of the grid
    std::size_t form;
    double slip_peak_percent, deformation;
    std::array<double, 10> A;  // normal equations so far, lower triangle; the last term is m
    std::array<double, kTerms> b;
    double yy;
    double weights, log_weights;          // product of all, in two parts
    double log_likelihood, mu, variance;  // of the last fit
  };
  struct Point {
    double slip_percent, mu, force_share, variance_mu, variance_slip_percent2;
  };
  void raise_reached(double force_variance) noexcept;
  void add_point(Curve& curve) const noexcept;
  void fit(Curve& curve) const noexcept;
  void take_in() noexcept;
  void sum_up() noexcept;
  void conclude() noexcept;

  std::array<std::array<double, kTable + 1>, kForms> value_{};
  std::vector<Curve> curves_;
  std::vector<std::uint16_t> order_;  // the curves that are left
  std::vector<double> bins_;
  int work_per_step_;
  double c_ = 0.0, inertia_kg_m2_ = 0.0;
  double first_force_N_ = 0.0;
  // The point that is being collected.
  double sum_s_ = 0.0, sum_slip_percent_s_ = 0.0, sum_torque_ = 0.0, sum_force_ = 0.0;
  double begin_s_ = 0.0, begin_omega_rad_s_ = 0.0;
  double last_slip_percent_ = 0.0, last_force_N_ = 0.0;
  double top_mu_ = 0.0;
  Point point_{};
  std::array<std::array<double, 2>, kReachedScales>
      means_{};  // weight, weight * mu: 1, 2, 4 .. points
  double reached_ = 0.0;
  std::size_t points_ = 0;
  // The work on the last point.
  Stage stage_ = Stage::kIdle;
  std::size_t next_ = 0, kept_ = 0, left_ = kCurves;
  double best_ = 0.0, best_before_ = 0.0;
  double sum_ = 0.0, sum_all_ = 0.0, sum_slip_peak_percent_ = 0.0;  // of weights: possible, all
  Forecast forecast_;
};

}  // namespace beltgrip::estimator
