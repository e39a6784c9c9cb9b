// When has the friction curve been seen past its top? Slope of mu* over slip in windows of many
// lengths up to now, its uncertainty, and the decision to stop. Slip in percent, slopes in
// 1/percent. Real-time thread; no allocation after construction.
//
// In a window that began at slip s_1 with mu* = m_1, the torque that the belt carries is
//   c T_b = F (m_1 + k x),   x = s - s_1,   c = cos(theta) / (2 R_p)                 (equation 5)
// T_b is measured; or it is the engine torque less J domega_p/dt. Two weighted moments over the
// window and what is known of m_1 from before give m_1, k and their covariance. Before the peak the
// belt carries what it is loaded with: the line that the torque had run along until the window
// began says more about m_1 than the readings just before it. The weights do not
// depend on the noisy slip: noise in the regressor does not flatten the slope (instrumental
// variables). With an engine torque they vanish at both ends, so that integration by parts moves
// the derivative from the speed to the weights.
//
// From the clamp force alone comes a second slope, k_hold: what k would be if the belt still
// carried the torque of before. Past the peak it carries less, so k <= k_hold. k_hold is nearly
// free of noise and says whether "no longer rising" is a small step from what is seen, or a large
// one that needs more evidence.
//
// Slopes are judged by their elasticity, k s / mu. Curves that saturate (tanh, magic formula,
// brush, exponential) have come within half a percent of their top when it falls to 0.03-0.07.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstddef>

#include "estimator/method/slip_curve_estimator.h"
#include "estimator/record/experiment_record.h"

namespace beltgrip::estimator {

class StopDetector {
 public:
  static constexpr std::size_t kMostCells = 40;  // in a window
  // Sums over the cells of a window: of the weights, of their products, of those of their
  // derivatives by tau. They depend on the number of cells only.
  struct Moments {
    Eigen::Vector2d sum = Eigen::Vector2d::Zero();
    Eigen::Matrix2d value = Eigen::Matrix2d::Zero();
    Eigen::Matrix2d derivative = Eigen::Matrix2d::Zero();
  };

  // c: cos(theta) / (2 R_p); inertia 0 where the torque of the belt is measured.
  StopDetector();
  void reset(double traction_per_Nm_N, double inertia_kg_m2) noexcept;
  // After each cell of the record. First reason wins; the caller keeps it.
  StopReason step(const ExperimentRecord& record) noexcept;

  double slope() const noexcept { return slope_; }
  bool rising() const noexcept { return seen_ && !level_; }  // slip grows, mu* with it
  bool level() const noexcept { return level_; }
  double smallest_slip_percent() const noexcept { return smallest_slip_percent_; }

 private:
  static constexpr int kWindows = 30;  // 0.12 s * 1.3^n: up to 4 min
  using MomentTable = std::array<Moments, kMostCells + 1>;
  struct WeightTables {
    MomentTable moments;
    // Covariance of the torque's slow error, where its variance is 1, in each window: of its mean
    // over as long a time before, and of its two weighted means within.
    std::array<Eigen::Matrix3d, kWindows> slow;
  };
  struct Slope {
    bool valid = false;
    double gained = 0.0;
    double slip_percent = 0.0;  // at the end
    double k = 0.0, k_deviation = 0.0;
    double hold = 0.0, hold_deviation = 0.0;  // k_hold
    double level = 0.0;                       // slope that counts as level
    double duration_s = 0.0;
  };
  Slope slope_over(const ExperimentRecord& record, std::size_t window) const noexcept;
  void update_smallest_slip(const ExperimentRecord& record) noexcept;
  StopReason backup(const ExperimentRecord& record) const noexcept;

  WeightTables sensor_, engine_;
  double c_ = 0.0;
  double inertia_kg_m2_ = 0.0;
  std::array<double, kWindows> window_s_{};
  std::size_t turn_ = 0;
  double smallest_slip_percent_ = 0.0;
  double slope_ = 0.0;
  bool seen_ = false;
  bool level_ = false;
  double level_slip_percent_ = 0.0;
  double level_until_s_ = 0.0;
};

}  // namespace beltgrip::estimator
