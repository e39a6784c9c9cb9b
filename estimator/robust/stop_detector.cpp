#include "estimator/robust/stop_detector.h"

#include <Eigen/Core>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>

#include "estimator/physics/slip.h"
#include "estimator/physics/units.h"
#include "estimator/robust/thresholds.h"
#include "estimator/signal/slow_noise.h"
#include "estimator/statistics/square.h"

namespace beltgrip::estimator {
namespace {

constexpr double kShortestWindow_s = 0.12;
constexpr double kWindowFactor = 1.3;
constexpr double kQuietDeviation = 0.05;  // percent: noise of the smallest slip at most
constexpr double kTiny = 1e-12;

struct Known {
  double value, variance;
};

// Torque on the belt as the window begins: of the readings just before it and of the line that the
// torque had run along until then, by their variances. How far the two are apart counts as
// uncertainty: a line that has begun to bend shows in the readings first.
Known torque_at_begin(const ExperimentRecord& record, double begin_s, const Known& readings,
                      double variation) {
  const ExperimentRecord::TorqueEstimate line = record.torque_estimate_at(begin_s);
  if (!line.valid) return readings;
  const double line_variance = line.variance + variation;
  const double share = readings.variance / (readings.variance + line_variance + kTiny);
  const double apart = line.torque_Nm - readings.value;
  return {readings.value + share * apart, square(share) * (line_variance + square(apart)) +
                                              square(1.0 - share) * readings.variance};
}

}  // namespace

StopDetector::Weights StopDetector::sensor_weights(double tau) noexcept {
  return {{1.0, tau * tau}, {0.0, 0.0}};
}

StopDetector::Weights StopDetector::engine_weights(double tau) noexcept {
  const double rest = 1.0 - tau;
  return {{tau * rest * rest, tau * tau * rest},
          {1.0 - 4.0 * tau + 3.0 * tau * tau, 2.0 * tau - 3.0 * tau * tau}};
}

StopDetector::StopDetector() {
  const auto fill = [](MomentTable& table, Weights (*weights)(double)) {
    for (std::size_t n = 1; n < table.size(); ++n) {
      for (std::size_t i = 0; i < n; ++i) {
        const Weights w = weights((static_cast<double>(i) + 0.5) / static_cast<double>(n));
        table[n].sum += w.value;
        table[n].value += w.value * w.value.transpose();
        table[n].derivative += w.derivative * w.derivative.transpose();
      }
    }
  };
  fill(sensor_moments_, sensor_weights);
  fill(engine_moments_, engine_weights);
  double window = kShortestWindow_s;
  for (double& w : window_s_) {
    w = window;
    window *= kWindowFactor;
  }
  fill_slow(sensor_slow_, sensor_weights);
  fill_slow(engine_slow_, engine_weights);
}

void StopDetector::fill_slow(SlowTable& table, Weights (*weights)(double)) const noexcept {
  for (std::size_t window = 0; window < window_s_.size(); ++window) {
    // Each half of so many parts: the time before, then the window.
    constexpr std::size_t kParts = 40;
    const double faded = std::exp(-window_s_[window] / (kSlowTime_s * double{kParts}));
    Eigen::Vector3d recent = Eigen::Vector3d::Zero();  // sum of earlier weights, faded
    table[window].setZero();
    for (std::size_t i = 0; i < 2 * kParts; ++i) {
      Eigen::Vector3d w = Eigen::Vector3d::UnitX();
      if (i >= kParts) {
        const double tau = (static_cast<double>(i - kParts) + 0.5) / double{kParts};
        w << 0.0, weights(tau).value;
      }
      w /= double{kParts};
      recent *= faded;
      table[window] += w * w.transpose() + w * recent.transpose() + recent * w.transpose();
      recent += w;
    }
  }
}

void StopDetector::reset(double traction_per_Nm_N, double inertia_kg_m2) noexcept {
  c_ = traction_per_Nm_N;
  inertia_kg_m2_ = inertia_kg_m2;
  turn_ = 0;
  smallest_slip_percent_ = 1e9;
  slope_ = 0.0;
  seen_ = level_ = false;
  level_slip_percent_ = level_until_s_ = 0.0;
}

// In one piece: in seven functions it took 206 instructions a sample more, of the 15,000 that
// tests/instructions allows.
StopDetector::Slope StopDetector::slope_over(const ExperimentRecord& record,
                                             std::size_t window) const noexcept {
  Slope out;
  const double window_s = window_s_[window];
  const History& history = record.history();
  std::size_t level = 0;
  while (level + 1 < History::kLevels &&
         history.cell_s(level) * static_cast<double>(kMostCells) < window_s) {
    ++level;
  }
  const double cell_s = history.cell_s(level);
  const auto cells = static_cast<std::size_t>(window_s / cell_s);
  if (cells < 4 || history.size(level) < 2 * cells + 1) return out;
  const double n = static_cast<double>(cells);
  const double W = cell_s * n;

  // Slip around the window's begin and over its last quarter.
  const std::size_t quarter = std::max<std::size_t>(1, cells / 4);
  const double per_quarter = 1.0 / static_cast<double>(quarter);
  double s_1 = 0.0, s_2 = 0.0;
  for (std::size_t i = 0; i < quarter; ++i) {
    s_1 += history.cell(level, cells - quarter / 2 + i).slip_percent * per_quarter;
    s_2 += history.cell(level, i).slip_percent * per_quarter;
  }
  out.gained = s_2 - s_1;
  if (out.gained < kSmallestGain_percent) return out;  // most windows: no more is needed
  double force_before = 0.0, force_after = 0.0;
  for (std::size_t i = 0; i < quarter; ++i) {
    force_before += history.cell(level, cells - quarter / 2 + i).clamp_force_N * per_quarter;
    force_after += record.clamp_force_N(history.cell(level, i)) * per_quarter;
  }
  // Deformation moves the slip by itself as the clamp force falls: that counts for nothing.
  const double deformation = kPercent * kDeformationMost_1_N * std::abs(force_before - force_after);
  if (out.gained < kSmallestGain_percent + deformation) return out;
  // A longer window is new less often in proportion, and may err more often in proportion. In a
  // Gaussian's far tail: twice the logarithm of how much less often the window is a new one.
  // While the noise itself is known from few data, Student's tail is as much longer (Wallace).
  const double gained_variance = 2.0 * record.slip_noise_percent2_s() * per_quarter / cell_s;
  const double freedom = std::max(1.0, record.slip_noise_freedom());
  const double normal_squared = square(kInManyLooks) - 2.0 * std::log(W / kShortestWindow_s);
  const double gain_deviations_squared = freedom * std::expm1(normal_squared / freedom);
  if (square(out.gained) < gain_deviations_squared * gained_variance) return out;

  // What was before: torque and its turn over as long a time as the window, speed's slope.
  const Cell& begin = history.cell(level, cells);
  const double t_1 = begin.t_s + 0.5 * cell_s;
  double torque_before = 0.0, torque_turn = 0.0;
  for (std::size_t i = cells; i < 2 * cells; ++i) {
    const double torque = history.cell(level, i).torque_Nm;
    torque_before += torque / n;
    torque_turn += (2 * i + 1 < 3 * cells ? torque : -torque) / (0.5 * n);
  }
  const Line& force = record.force_line();
  const Line& held = record.torque_line();
  const double F_1 = t_1 >= force.begin_s ? force.at(t_1) : force_before;
  const double noise = record.torque_noise_Nm2_s();
  const double density = std::max(noise, record.torque().density(W));
  const double variation = density - noise;  // of the true torque, at this time scale
  // Torque if it is held: of the line, of the readings, or between, by their variances.
  const double line_variance = variation / W + held.variance_at(record.duration_s()) + kTiny;
  const double readings_variance = noise / W + kTiny;
  const double line_share =
      t_1 >= held.begin_s ? readings_variance / (readings_variance + line_variance) : 0.0;
  const double hold_variance =
      square(line_share) * line_variance + square(1.0 - line_share) * readings_variance;
  const double T_1 = line_share * held.at(t_1) + (1.0 - line_share) * torque_before;

  Eigen::Matrix2d A = Eigen::Matrix2d::Zero();
  Eigen::Vector2d y = Eigen::Vector2d::Zero();
  double hold_top = 0.0, hold_bottom = 0.0;
  const bool engine = inertia_kg_m2_ > 0.0;
  const double omega_reference = history.cell(level, cells / 2).omega_p_rad_s;
  for (std::size_t i = 0; i < cells; ++i) {
    const Cell& cell = history.cell(level, cells - 1 - i);
    const double tau = (static_cast<double>(i) + 0.5) / n;
    const double F = record.clamp_force_N(cell);
    const double x = cell.slip_percent - s_1;
    const Weights w = engine ? engine_weights(tau) : sensor_weights(tau);
    if (engine) {
      // - integral of w domega/dt = integral of dw/dt omega.
      const double T = line_share * held.at(cell.t_s) + (1.0 - line_share) * cell.torque_Nm;
      y += w.value * T +
           w.derivative * (inertia_kg_m2_ / W * (cell.omega_p_rad_s - omega_reference));
    } else {
      y += w.value * cell.torque_Nm;
    }
    A.col(0) += w.value * F;
    A.col(1) += w.value * (F * x);
    hold_top += square(tau) * (1.0 - F / F_1);
    hold_bottom += square(tau) * F * x;
  }
  y *= c_;
  const Moments& moments = engine ? engine_moments_[cells] : sensor_moments_[cells];
  Eigen::Matrix2d N = moments.value * noise;
  if (engine) {
    N = moments.derivative * (square(inertia_kg_m2_ / W) * record.omega_noise_rad2_s()) +
        moments.value * (square(line_share) * variation + square(1.0 - line_share) * noise);
  }
  N *= square(c_) / cell_s;
  // What is known of m_1 from before.
  double m_1 = c_ * T_1 / F_1;
  double m_1_variance = hold_variance;
  if (engine) {
    N += square(c_ * line_share) * held.variance_at(record.duration_s()) * moments.sum *
         moments.sum.transpose();
    const double span = W - cell_s;
    const double rate_before =
        (begin.omega_p_rad_s - history.cell(level, 2 * cells - 1).omega_p_rad_s) / span;
    const double rate_after = (history.cell(level, 0).omega_p_rad_s - begin.omega_p_rad_s) / W;
    m_1 -= c_ * inertia_kg_m2_ * rate_before / F_1;
    m_1_variance += square(inertia_kg_m2_) * (square(rate_after - rate_before) +
                                              12.0 * record.omega_noise_rad2_s() / (W * W * W));
  } else {
    const Known torque = torque_at_begin(record, t_1, {torque_before, density / W}, variation / W);
    m_1 = c_ * torque.value / F_1;
    m_1_variance = torque.variance + std::max(0.0, square(torque_turn) - 4.0 * density / W);
  }
  m_1_variance *= square(c_ / F_1);
  // Of what is known from before and of the two moments.
  Eigen::Matrix3d spread = Eigen::Matrix3d::Zero();
  spread(0, 0) = m_1_variance;
  spread.bottomRightCorner<2, 2>() = N;
  const Eigen::Vector3d per_Nm(c_ / F_1, c_ * n, c_ * n);
  spread += record.torque_slow_variance() * per_Nm.asDiagonal() *
            (engine ? engine_slow_ : sensor_slow_)[window] * per_Nm.asDiagonal();
  const Eigen::Vector3d seen(m_1, y(0), y(1));
  spread.diagonal() += kTiny * (seen.cwiseAbs2() + Eigen::Vector3d::Constant(kTiny));
  Eigen::Matrix<double, 3, 2> known;
  known << 1.0, 0.0, A;
  const Eigen::Matrix<double, 2, 3> weighted = known.transpose() * spread.inverse();
  const Eigen::Matrix2d covariance = (weighted * known).inverse();
  const Eigen::Vector2d right = weighted * seen;
  out.k = (covariance * right)(1);

  const double mu_1 = c_ * T_1 / F_1;
  const double gain_variance = gained_variance / square(out.gained);  // relative
  const double force_variance = square(mu_1 * W / (F_1 * out.gained)) * force.slope_variance;
  out.k_deviation = std::sqrt(covariance(1, 1) + square(out.k) * gain_variance + force_variance);
  out.hold = mu_1 * F_1 * hold_top / hold_bottom;
  out.hold_deviation = std::sqrt(square(out.hold) * gain_variance + force_variance +
                                 square(c_ / (F_1 * out.gained)) * hold_variance);
  out.slip_percent = s_2;
  out.level =
      kLevelElasticity * mu_1 / std::max(s_2 - smallest_slip_percent_, kLevelSlipLeast_percent);
  out.duration_s = W;
  out.valid = std::isfinite(out.k) && std::isfinite(out.k_deviation) && out.level > 0.0;
  return out;
}

void StopDetector::update_smallest_slip(const ExperimentRecord& record) noexcept {
  const History& history = record.history();
  std::size_t level = 3;
  while (level + 1 < History::kLevels &&
         record.slip_noise_percent2_s() > square(kQuietDeviation) * history.cell_s(level)) {
    ++level;
  }
  if (history.size(level) > 0) {
    smallest_slip_percent_ = std::min(smallest_slip_percent_, history.cell(level, 0).slip_percent);
  }
}

StopReason StopDetector::backup(const ExperimentRecord& record) const noexcept {
  // A straight line through the last tenth of a second of slip.
  const History& history = record.history();
  const auto cells = static_cast<std::size_t>(std::max(4.0, std::round(0.1 / history.cell_s(0))));
  if (history.size(0) < cells) return StopReason::kNone;
  const double n = static_cast<double>(cells);
  double s = 0.0, st = 0.0;
  const double middle = 0.5 * (n - 1.0);
  for (std::size_t i = 0; i < cells; ++i) {
    const double slip_percent = history.cell(0, i).slip_percent;
    s += slip_percent / n;
    st += slip_percent * (middle - static_cast<double>(i));
  }
  const double moment = n * (n * n - 1.0) / 12.0;
  const double cell_s = history.cell_s(0);
  const double rate = st / moment / cell_s;
  const double rate_deviation =
      std::sqrt(record.slip_noise_percent2_s() / cell_s / moment) / cell_s;
  const double now = s + rate * middle * cell_s;
  if (s - smallest_slip_percent_ > kBackupSlip_percent) return StopReason::kSlip;
  if (now + (rate - 4.0 * rate_deviation) * kBackupAhead_s > kBackupAhead_percent) {
    return StopReason::kSlipRate;
  }
  return StopReason::kNone;
}

StopReason StopDetector::step(const ExperimentRecord& record) noexcept {
  if (!record.force_line().valid || !record.torque_line().valid) return StopReason::kNone;
  update_smallest_slip(record);
  if (smallest_slip_percent_ > 1e8) return StopReason::kNone;
  ++turn_;
  const double now_s = record.duration_s();
  if (now_s > level_until_s_) level_ = false;
  StopReason stop = StopReason::kNone;
  if (now_s < kSettle_s) return backup(record);
  seen_ = false;
  double nearest = 1e9;
  for (std::size_t i = 0; i < window_s_.size() && window_s_[i] < 0.5 * now_s; ++i) {
    // Long windows change slowly: each in its turn.
    const std::size_t every = window_s_[i] < 0.4 ? 1 : window_s_[i] < 1.6 ? 4 : 16;
    if ((turn_ + i) % every != 0) continue;
    const Slope slope = slope_over(record, i);
    if (!slope.valid) continue;
    seen_ = true;
    if (std::abs(slope.gained - 0.5) < nearest) {
      nearest = std::abs(slope.gained - 0.5);
      slope_ = slope.k;
    }
    const double hold_most = std::max(slope.level, slope.hold + 2.0 * slope.hold_deviation);
    const double evidence =
        std::min(kLevelDeviationsMost,
                 kLevelDeviations + kLevelDeviationsPerE * std::log(hold_most / slope.level)) /
        std::max(1.0, slope.gained / kLargeGain_percent);
    if (slope.k + evidence * slope.k_deviation < slope.level ||
        slope.hold + 2.0 * slope.hold_deviation < slope.level) {
      if (!level_) level_slip_percent_ = slope.slip_percent - slope.gained;
      level_ = true;
      level_until_s_ = std::max(level_until_s_, now_s + slope.duration_s);
    }
    // A friction curve rises less and less: where it rises now it was not level before.
    if (level_ && slope.slip_percent - slope.gained >= level_slip_percent_ &&
        slope.k - kEvident * slope.k_deviation > slope.level) {
      level_ = false;
      level_until_s_ = now_s;
    }
    const bool falling = slope.k + std::max(kEvident, evidence) * slope.k_deviation < 0.0;
    if (falling ||
        (level_ && slope.slip_percent + kAhead_s * 2.0 * slope.gained / slope.duration_s >
                       level_slip_percent_ + kFollow_percent)) {
      stop = StopReason::kSlope;
    }
  }
  return stop != StopReason::kNone ? stop : backup(record);
}

}  // namespace beltgrip::estimator
