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

// Of a moment's torque and of its derivative over tau = 0..1, the window from begin to end.
struct Weights {
  Eigen::Vector2d value;
  Eigen::Vector2d derivative;  // by tau
};

Weights sensor_weights(double tau) noexcept { return {{1.0, tau * tau}, {0.0, 0.0}}; }

Weights engine_weights(double tau) noexcept {
  const double rest = 1.0 - tau;
  return {{tau * rest * rest, tau * tau * rest},
          {1.0 - 4.0 * tau + 3.0 * tau * tau, 2.0 * tau - 3.0 * tau * tau}};
}

Eigen::Matrix3d slow_covariance(double window_s, Weights (*weights)(double) noexcept) noexcept {
  // Each half of so many parts: the time before, then the window. Fine enough: 32 and 48 change no
  // result, value or stop of 120 drawn traces.
  constexpr std::size_t kParts = 40;
  const double faded = std::exp(-window_s / (kSlowTime_s * double{kParts}));
  Eigen::Vector3d recent = Eigen::Vector3d::Zero();  // sum of earlier weights, faded
  Eigen::Matrix3d out = Eigen::Matrix3d::Zero();
  for (std::size_t i = 0; i < 2 * kParts; ++i) {
    Eigen::Vector3d w = Eigen::Vector3d::UnitX();
    if (i >= kParts) {
      const double tau = (static_cast<double>(i - kParts) + 0.5) / double{kParts};
      w << 0.0, weights(tau).value;
    }
    w /= double{kParts};
    recent *= faded;
    out += w * w.transpose() + w * recent.transpose() + recent * w.transpose();
    recent += w;
  }
  return out;
}

// The window up to now, and as long a time before it, in cells; the newest has age 0.
struct Stretch {
  const History& history;
  std::size_t level = 0;
  std::size_t cells = 0;  // of the window; 0: the record is too short
  double cell_s = 0.0, count = 0.0, length_s = 0.0;

  const Cell& cell(std::size_t age) const noexcept { return history.cell(level, age); }
};

Stretch stretch_of(const History& history, double window_s) noexcept {
  Stretch out{history};
  while (out.level + 1 < History::kLevels &&
         history.cell_s(out.level) * static_cast<double>(StopDetector::kMostCells) < window_s) {
    ++out.level;
  }
  out.cell_s = history.cell_s(out.level);
  const auto cells = static_cast<std::size_t>(window_s / out.cell_s);
  if (cells < 4 || history.size(out.level) < 2 * cells + 1) return out;
  out.cells = cells;
  out.count = static_cast<double>(cells);
  out.length_s = out.cell_s * out.count;
  return out;
}

// Slip around the window's begin and over its last quarter.
struct Gain {
  bool counts = false;  // it is more than noise and deformation
  double begin_percent = 0.0, end_percent = 0.0, percent = 0.0;
  double variance = 0.0;
  double force_before_N = 0.0;
};

Gain gain_over(const ExperimentRecord& record, const Stretch& window) noexcept {
  Gain out;
  const std::size_t quarter = std::max<std::size_t>(1, window.cells / 4);
  const double per_quarter = 1.0 / static_cast<double>(quarter);
  for (std::size_t i = 0; i < quarter; ++i) {
    out.begin_percent += window.cell(window.cells - quarter / 2 + i).slip_percent * per_quarter;
    out.end_percent += window.cell(i).slip_percent * per_quarter;
  }
  out.percent = out.end_percent - out.begin_percent;
  if (out.percent < kSmallestGain_percent) return out;  // most windows: no more is needed
  double force_after_N = 0.0;
  for (std::size_t i = 0; i < quarter; ++i) {
    out.force_before_N += window.cell(window.cells - quarter / 2 + i).clamp_force_N * per_quarter;
    force_after_N += record.clamp_force_N(window.cell(i)) * per_quarter;
  }
  // Deformation moves the slip by itself as the clamp force falls: that counts for nothing.
  const double deformation_percent =
      kPercent * kDeformationMost_1_N * std::abs(out.force_before_N - force_after_N);
  if (out.percent < kSmallestGain_percent + deformation_percent) return out;
  // A longer window is new less often in proportion, and may err more often in proportion. In a
  // Gaussian's far tail: twice the logarithm of how much less often the window is a new one.
  // While the noise itself is known from few data, Student's tail is as much longer (Wallace).
  out.variance = 2.0 * record.slip_noise_percent2_s() * per_quarter / window.cell_s;
  const double freedom = std::max(1.0, record.slip_noise_freedom());
  const double normal_squared =
      square(kInManyLooks) - 2.0 * std::log(window.length_s / kShortestWindow_s);
  const double deviations_squared = freedom * std::expm1(normal_squared / freedom);
  out.counts = !(square(out.percent) < deviations_squared * out.variance);
  return out;
}

// What was before the window, over as long a time: torque and its turn, and what it is if the belt
// goes on to carry what it is loaded with: of the line, of the readings, or between, by their
// variances.
struct Before {
  double end_s = 0.0;
  double force_N = 0.0;
  double readings_Nm = 0.0, turn_Nm = 0.0;
  double noise_Nm2_s = 0.0, density_Nm2_s = 0.0;
  double variation_Nm2_s = 0.0;  // of the true torque, at this time scale
  double line_share = 0.0;
  double torque_Nm = 0.0, hold_variance = 0.0;
};

Before before_of(const ExperimentRecord& record, const Stretch& window,
                 double force_before_N) noexcept {
  Before out;
  const std::size_t cells = window.cells;
  out.end_s = window.cell(cells).t_s + 0.5 * window.cell_s;
  for (std::size_t i = cells; i < 2 * cells; ++i) {
    const double torque_Nm = window.cell(i).torque_Nm;
    out.readings_Nm += torque_Nm / window.count;
    out.turn_Nm += (2 * i + 1 < 3 * cells ? torque_Nm : -torque_Nm) / (0.5 * window.count);
  }
  const Line& force = record.force_line();
  const Line& held = record.torque_line();
  out.force_N = out.end_s >= force.begin_s ? force.at(out.end_s) : force_before_N;
  out.noise_Nm2_s = record.torque_noise_Nm2_s();
  out.density_Nm2_s = std::max(out.noise_Nm2_s, record.torque().density(window.length_s));
  out.variation_Nm2_s = out.density_Nm2_s - out.noise_Nm2_s;
  const double line_variance =
      out.variation_Nm2_s / window.length_s + held.variance_at(record.duration_s()) + kTiny;
  const double readings_variance = out.noise_Nm2_s / window.length_s + kTiny;
  out.line_share =
      out.end_s >= held.begin_s ? readings_variance / (readings_variance + line_variance) : 0.0;
  out.hold_variance =
      square(out.line_share) * line_variance + square(1.0 - out.line_share) * readings_variance;
  out.torque_Nm = out.line_share * held.at(out.end_s) + (1.0 - out.line_share) * out.readings_Nm;
  return out;
}

// The two weighted moments over the window, of the torque and of what it is in m_1 and k; and those
// of k_hold.
struct Sums {
  Eigen::Vector2d torque = Eigen::Vector2d::Zero();
  Eigen::Matrix2d force = Eigen::Matrix2d::Zero();
  double hold_top = 0.0, hold_bottom = 0.0;
};

Sums sums_over(const ExperimentRecord& record, const Stretch& window, const Before& before,
               double slip_begin_percent, double inertia_kg_m2) noexcept {
  Sums out;
  const bool engine = inertia_kg_m2 > 0.0;
  const Line& held = record.torque_line();
  const double omega_reference_rad_s = window.cell(window.cells / 2).omega_p_rad_s;
  for (std::size_t i = 0; i < window.cells; ++i) {
    const Cell& cell = window.cell(window.cells - 1 - i);
    const double tau = (static_cast<double>(i) + 0.5) / window.count;
    const double F = record.clamp_force_N(cell);
    const double x = cell.slip_percent - slip_begin_percent;
    const Weights w = engine ? engine_weights(tau) : sensor_weights(tau);
    if (engine) {
      // - integral of w domega/dt = integral of dw/dt omega.
      const double T =
          before.line_share * held.at(cell.t_s) + (1.0 - before.line_share) * cell.torque_Nm;
      out.torque += w.value * T + w.derivative * (inertia_kg_m2 / window.length_s *
                                                  (cell.omega_p_rad_s - omega_reference_rad_s));
    } else {
      out.torque += w.value * cell.torque_Nm;
    }
    out.force.col(0) += w.value * F;
    out.force.col(1) += w.value * (F * x);
    out.hold_top += square(tau) * (1.0 - F / before.force_N);
    out.hold_bottom += square(tau) * F * x;
  }
  return out;
}

// Of the torque's moments, as traction.
Eigen::Matrix2d moment_noise(const ExperimentRecord& record, const Stretch& window,
                             const Before& before, const StopDetector::Moments& moments, double c,
                             double inertia_kg_m2) noexcept {
  const bool engine = inertia_kg_m2 > 0.0;
  const double share = before.line_share;
  Eigen::Matrix2d out = moments.value * before.noise_Nm2_s;
  if (engine) {
    out = moments.derivative *
              (square(inertia_kg_m2 / window.length_s) * record.omega_noise_rad2_s()) +
          moments.value *
              (square(share) * before.variation_Nm2_s + square(1.0 - share) * before.noise_Nm2_s);
  }
  out *= square(c) / window.cell_s;
  if (engine) {
    out += square(c * share) * record.torque_line().variance_at(record.duration_s()) * moments.sum *
           moments.sum.transpose();
  }
  return out;
}

// What is known of m_1 from before.
Known begin_by_engine(const ExperimentRecord& record, const Stretch& window, const Before& before,
                      double c, double inertia_kg_m2) noexcept {
  const std::size_t cells = window.cells;
  const double length_s = window.length_s;
  const double begin_rad_s = window.cell(cells).omega_p_rad_s;
  const double rate_before =
      (begin_rad_s - window.cell(2 * cells - 1).omega_p_rad_s) / (length_s - window.cell_s);
  const double rate_after = (window.cell(0).omega_p_rad_s - begin_rad_s) / length_s;
  Known m_1{c * before.torque_Nm / before.force_N, before.hold_variance};
  m_1.value -= c * inertia_kg_m2 * rate_before / before.force_N;
  m_1.variance += square(inertia_kg_m2) *
                  (square(rate_after - rate_before) +
                   12.0 * record.omega_noise_rad2_s() / (length_s * length_s * length_s));
  m_1.variance *= square(c / before.force_N);
  return m_1;
}

Known begin_by_sensor(const ExperimentRecord& record, const Stretch& window, const Before& before,
                      double c) noexcept {
  const double length_s = window.length_s;
  const double mean_variance = before.density_Nm2_s / length_s;
  const Known torque = torque_at_begin(record, before.end_s, {before.readings_Nm, mean_variance},
                                       before.variation_Nm2_s / length_s);
  Known m_1{c * torque.value / before.force_N, torque.variance};
  m_1.variance += std::max(0.0, square(before.turn_Nm) - 4.0 * before.density_Nm2_s / length_s);
  m_1.variance *= square(c / before.force_N);
  return m_1;
}

// k, of what is known from before and of the two moments.
Known slope_of(const Stretch& window, const Before& before, const Sums& sums, const Known& m_1,
               const Eigen::Matrix2d& noise, double slow_variance, const Eigen::Matrix3d& slow,
               double c) noexcept {
  Eigen::Matrix3d spread = Eigen::Matrix3d::Zero();
  spread(0, 0) = m_1.variance;
  spread.bottomRightCorner<2, 2>() = noise;
  const Eigen::Vector3d per_Nm(c / before.force_N, c * window.count, c * window.count);
  spread += slow_variance * per_Nm.asDiagonal() * slow * per_Nm.asDiagonal();
  const Eigen::Vector2d traction = sums.torque * c;
  const Eigen::Vector3d measured(m_1.value, traction(0), traction(1));
  spread.diagonal() += kTiny * (measured.cwiseAbs2() + Eigen::Vector3d::Constant(kTiny));
  Eigen::Matrix<double, 3, 2> known;
  known << 1.0, 0.0, sums.force;
  const Eigen::Matrix<double, 2, 3> weighted = known.transpose() * spread.inverse();
  const Eigen::Matrix2d covariance = (weighted * known).inverse();
  const Eigen::Vector2d right = weighted * measured;
  return {(covariance * right)(1), covariance(1, 1)};
}

}  // namespace

StopDetector::StopDetector() {
  const auto fill = [](MomentTable& table, auto weights) {
    for (std::size_t n = 1; n < table.size(); ++n) {
      for (std::size_t i = 0; i < n; ++i) {
        const Weights w = weights((static_cast<double>(i) + 0.5) / static_cast<double>(n));
        table[n].sum += w.value;
        table[n].value += w.value * w.value.transpose();
        table[n].derivative += w.derivative * w.derivative.transpose();
      }
    }
  };
  fill(sensor_.moments, sensor_weights);
  fill(engine_.moments, engine_weights);
  double window = kShortestWindow_s;
  for (double& w : window_s_) {
    w = window;
    window *= kWindowFactor;
  }
  for (std::size_t i = 0; i < window_s_.size(); ++i) {
    sensor_.slow[i] = slow_covariance(window_s_[i], sensor_weights);
    engine_.slow[i] = slow_covariance(window_s_[i], engine_weights);
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

StopDetector::Slope StopDetector::slope_over(const ExperimentRecord& record,
                                             std::size_t window) const noexcept {
  Slope out;
  const Stretch stretch = stretch_of(record.history(), window_s_[window]);
  if (stretch.cells == 0) return out;
  const Gain gain = gain_over(record, stretch);
  if (!gain.counts) return out;
  const bool engine = inertia_kg_m2_ > 0.0;
  const WeightTables& tables = engine ? engine_ : sensor_;
  const Before before = before_of(record, stretch, gain.force_before_N);
  const Sums sums = sums_over(record, stretch, before, gain.begin_percent, inertia_kg_m2_);
  const Known m_1 = engine ? begin_by_engine(record, stretch, before, c_, inertia_kg_m2_)
                           : begin_by_sensor(record, stretch, before, c_);
  const Eigen::Matrix2d noise =
      moment_noise(record, stretch, before, tables.moments[stretch.cells], c_, inertia_kg_m2_);
  const Known k = slope_of(stretch, before, sums, m_1, noise, record.torque_slow_variance(),
                           tables.slow[window], c_);

  const double F_1 = before.force_N;
  const double mu_1 = c_ * before.torque_Nm / F_1;
  const double gain_variance = gain.variance / square(gain.percent);  // relative
  const double force_variance =
      square(mu_1 * stretch.length_s / (F_1 * gain.percent)) * record.force_line().slope_variance;
  out.gained = gain.percent;
  out.k = k.value;
  out.k_deviation = std::sqrt(k.variance + square(out.k) * gain_variance + force_variance);
  out.hold = mu_1 * F_1 * sums.hold_top / sums.hold_bottom;
  out.hold_deviation = std::sqrt(square(out.hold) * gain_variance + force_variance +
                                 square(c_ / (F_1 * gain.percent)) * before.hold_variance);
  out.slip_percent = gain.end_percent;
  out.level = kLevelElasticity * mu_1 /
              std::max(gain.end_percent - smallest_slip_percent_, kLevelSlipLeast_percent);
  out.duration_s = stretch.length_s;
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
