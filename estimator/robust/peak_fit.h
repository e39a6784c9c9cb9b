// The friction curve around its peak, from what was recorded up to the stop. Slip in percent.
// Real-time thread: all memory is taken by the constructor, the work is cut into bounded steps.
//
// Cells of the record are put together to points, each as long as slip takes to move on by a small
// step. Over the stretch from where mu* came to 0.9 of its top until the stop, a curve
//   mu(s) = a - B exp(-(s - s_0) / lambda) - d (s - s_0) - h max(0, s - s_k),   B, h >= 0
// is fitted by weighted least squares for a grid of lambda and s_k: a round peak where h = 0 or s_k
// lies elsewhere, a corner or the end of a plateau at s_k; and, for tops that are flat from s_e on,
//   mu(s) = a - B max(0, s_e - s)^n - h max(0, s - s_k),   n = 2, 3,   s_k >= s_e.
// The points share the slow error of the torque (slow_noise.h): all terms and the points pass the
// same Kalman filter, which leaves what is independent from point to point. The forms are averaged
// with the weights that the data give them, so that the uncertainty of the form is in the result.
// No form is taken from a friction model: near the top, rise and fall of all of them look like
// this.
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <cstddef>
#include <vector>

#include "estimator/record/experiment_record.h"
#include "estimator/robust/curve_health.h"

namespace beltgrip::estimator {

struct PeakFitResult {
  bool valid = false;
  double mu = 0.0;            // largest value of the curve within the data
  double variance = 0.0;      // of mu, with the torque's slow error, without what all points share
  double slip_percent = 0.0;  // where it is
  double t_s = 0.0;           // when slip was there last
  // Part that the line of the engine's torque has in the torque there; the readings have the rest.
  double held_share = 0.0;
  double inside = 0.0;  // probability that the curve turns down within the data
  double fall = 0.0;    // from there to the end of the data
  double fall_variance = 0.0;
  bool passed = false;      // the data beyond the peak come after those before it
  double duration_s = 0.0;  // of the data that were used
  // What mu* has surely reached: the mean over that window, of any length, whose lower end is
  // largest; its relative deviation by the noise of torque, speed and clamp force.
  double reached = 0.0;
  double reached_deviation = 0.0;
  double reached_slip_percent = 0.0;
  // Where the data end, for what the curve may still rise: its expected slope there, 1/percent,
  // falling taken for level.
  double end_slip_percent = 0.0;
  double end_rise = 0.0;
  // Do the points lie on one curve? In deviations (curve_health.h).
  double below_chord = 0.0;
  ResidualTests residuals;
};

class PeakFit {
 public:
  PeakFit();
  // c: cos(theta) / (2 R_p); inertia 0 where the torque of the belt is measured. Whether the points
  // lie on one curve is tested until the stop.
  void begin(const ExperimentRecord& record, double traction_per_Nm_N, double inertia_kg_m2,
             double stop_s) noexcept;
  // One piece of the work; true when the result stands.
  bool step() noexcept;
  const PeakFitResult& result() const noexcept { return result_; }

 private:
  struct Point {  // means over a stretch of time
    double t_s, slip_percent, mu, force_N, duration_s;
    double variance;        // of mu, with what the noise in slip does to it
    double force_variance;  // of mu, by readings of the force where its line does not reach
    double held_share;
    double torque_Nm;             // that the belt carries
    double torque_variance;       // of it, without
    double speed_variance_begin;  // that of the speeds at its ends, which the neighbour shares
    double speed_variance_end;
  };
  struct Form {
    double chi2, prior, mu, variance, slip_percent, fall, fall_variance;
    double end_slope, end_slope_variance;
  };
  enum class Stage {
    kIdle,
    kCells,
    kPoints,
    kCourse,
    kStretch,
    kReached,
    kTerms,
    kForms,
    kAverage,
    kResult,
    kHealthSums,
    kChords,
    kResiduals
  };
  // How mu* comes up to its top: what is missing there, by slip x relative to the highest. Either
  // exp(-(x + span) / lambda), or ((end - x) / span)^power up to x = end.
  struct Rise {
    double lambda = 0.0;
    int power = 0;  // 0: exponential
    double end = 0.0;
    double span = 1.0;
    double at(double x) const noexcept;
  };
  // Terms of the curves, whitened: 1, x = slip - highest slip, y = mu - top, and for each corner
  // what lies beyond it. One column each; the products of two are summed over the points.
  enum : Eigen::Index { kOne, kX, kY, kCorner, kTermCount = kCorner + 20 };
  using Terms = Eigen::Matrix<double, kTermCount, 1>;
  // The filter of the slow error, at a point: by what the error before has faded, what of it is in
  // the reading, by how much of what was not expected it changes, and that one's deviation.
  struct Whitening {
    double faded, per_Nm, gain, per_deviation;
  };
  struct Average {
    double weight = 0, mu = 0, squares = 0, variance = 0, slip_percent = 0, inside = 0,
           end_rise = 0, fall = 0, fall_variance = 0;
  };

  void go_to(Stage stage) noexcept;
  void gather_level() noexcept;
  double slip_step_percent(double duration_s) const noexcept;
  void make_points() noexcept;
  void add_point(std::size_t begin, std::size_t end) noexcept;
  double mean_mu(std::size_t point) const noexcept;
  void find_course() noexcept;
  bool belongs(std::size_t point) const noexcept;
  void find_stretch() noexcept;
  void find_reached(std::size_t length) noexcept;
  bool came_after() const noexcept;
  double force_variance(double begin_s, double end_s) const noexcept;
  double span() const noexcept { return std::max(0.3, slip_high_percent_ - slip_low_percent_); }
  double corner(std::size_t index) const noexcept;
  void find_span() noexcept;
  void whiten_terms() noexcept;
  void begin_rise(const Rise& rise) noexcept;
  bool next_rise() noexcept;
  void sum_up(std::size_t point) noexcept;
  void fit_forms() noexcept;
  void solve(std::size_t corner) noexcept;
  void average() noexcept;
  void finish() noexcept;
  double tested_until_s() const noexcept;
  void sum_for_health() noexcept;
  bool slip_moves(double until_s) const noexcept;
  double slow_relative() const noexcept;
  void test_best_form() noexcept;
  double speed_at_edge(std::size_t cell, double& t_s, double& weight_s) const noexcept;

  const ExperimentRecord* record_ = nullptr;
  double c_ = 0.0, inertia_kg_m2_ = 0.0;
  double stop_s_ = 0.0;
  Stage stage_ = Stage::kIdle;
  std::size_t level_ = 0;
  std::vector<Cell> cells_;  // newest first, without overlap
  std::vector<double> lengths_s_;
  std::size_t cell_count_ = 0;
  double covered_from_s_ = 0.0;
  std::size_t next_cell_ = 0;  // from the oldest
  std::vector<Point> points_;  // oldest first
  std::size_t point_count_ = 0;
  std::vector<Eigen::Vector2d> sums_;  // of weight and weight * mu before each point
  double last_slip_percent_ = 0.0;
  std::size_t oldest_ = 0;           // that counts
  std::size_t first_ = 0, top_ = 0;  // the stretch that is fitted begins at first
  double mu_top_ = 0.0;
  double slip_low_percent_ = 0.0, slip_high_percent_ = 0.0;  // of the stretch
  std::vector<Whitening> whitening_;                         // of the points of the stretch
  std::vector<Terms> terms_;                                 // likewise
  Terms slow_terms_ = Terms::Zero();                         // slow error in them, as expected
  double slow_spread_ = 1.0;  // its variance, in that of the slow error
  Eigen::Matrix<double, kTermCount, kTermCount> term_sums_;
  std::size_t next_ = 0;             // where the work on this stage goes on
  Rise rise_;                        // that is being fitted, with
  double slow_rise_ = 0.0;           // slow error in it, as expected
  double rise_square_ = 0.0;         // sums: of the whitened rise, by itself
  Terms rise_sums_ = Terms::Zero();  // and by the terms
  std::size_t summed_ = 0;           // so many points in the sums
  std::size_t next_corner_ = 0;      // the corner of the next form; 0: none, i + 1: corner(i)
  double best_chi2_ = 0.0;
  Average average_;
  std::vector<Form> forms_;
  std::size_t form_count_ = 0;
  std::vector<CurveSums> health_sums_;
  std::size_t health_count_ = 0;
  Rise best_rise_;
  Eigen::Vector4d best_theta_ = Eigen::Vector4d::Zero();
  double best_corner_ = 0.0;
  std::vector<Residual> residuals_;
  PeakFitResult result_;
};

}  // namespace beltgrip::estimator
