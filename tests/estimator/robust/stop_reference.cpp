#include "tests/estimator/robust/stop_reference.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <map>
#include <utility>
#include <vector>

#include "estimator/robust/thresholds.h"

namespace beltgrip::test {

namespace {
using estimator::Cell;
using estimator::ExperimentRecord;
using estimator::History;
using estimator::Line;
using estimator::StopReason;
namespace number = estimator;

constexpr double kShortest_s = 0.12, kLonger = 1.3;
constexpr int kWindows = 30;
constexpr double kSlowTime_s = 1.2;
constexpr double kDeformed_percent_per_N = 4e-4;
constexpr std::size_t kMostCells = 40;

double mean(const std::vector<double>& values) {
  double sum = 0.0;
  for (const double each : values) sum += each;
  return sum / static_cast<double>(values.size());
}

// The cells of a window, the oldest first, on the coarsest level that is fine enough for it.
struct Cut {
  std::vector<Cell> before, within;
  double cell_s = 0.0;
};
bool cut(const History& history, double window_s, Cut& out) {
  std::size_t level = 0;
  while (level + 1 < History::kLevels && kMostCells * history.cell_s(level) < window_s) ++level;
  out.cell_s = history.cell_s(level);
  const auto cells = static_cast<std::size_t>(window_s / out.cell_s);
  if (cells < 4 || history.size(level) < 2 * cells + 1) return false;
  for (std::size_t age = 2 * cells; age-- > cells;) {
    out.before.push_back(history.cell(level, age));
  }
  for (std::size_t age = cells; age-- > 0;) out.within.push_back(history.cell(level, age));
  return true;
}

// The weights of the two moments, and their derivatives by the window's length.
struct Weight {
  double value[2], slope[2];
};
Weight weight(bool engine, double tau) {
  if (!engine) return {{1.0, tau * tau}, {0.0, 0.0}};
  return {{tau * (1.0 - tau) * (1.0 - tau), tau * tau * (1.0 - tau)},
          {(1.0 - tau) * (1.0 - 3.0 * tau), tau * (2.0 - 3.0 * tau)}};
}

// Covariance, for an error of variance 1 that fades with kSlowTime_s, of its mean over the time
// before a window and of the two weighted means within.
const Eigen::Matrix3d& slow_covariance(bool engine, double window_s) {
  static std::map<std::pair<bool, double>, Eigen::Matrix3d> known;
  const auto [place, is_new] = known.try_emplace({engine, window_s}, Eigen::Matrix3d::Zero());
  Eigen::Matrix3d& out = place->second;
  if (!is_new) return out;
  constexpr int kParts = 40;
  const auto row = [&](int part) {
    Eigen::Vector3d w = Eigen::Vector3d::Zero();
    if (part < kParts) {
      w(0) = 1.0 / kParts;
      return w;
    }
    const Weight each = weight(engine, (part - kParts + 0.5) / kParts);
    w(1) = each.value[0] / kParts;
    w(2) = each.value[1] / kParts;
    return w;
  };
  for (int a = 0; a < 2 * kParts; ++a) {
    for (int b = 0; b < 2 * kParts; ++b) {
      const double apart_s = std::abs(a - b) * window_s / kParts;
      out += std::exp(-apart_s / kSlowTime_s) * row(a) * row(b).transpose();
    }
  }
  return out;
}
}  // namespace

StopReference::Look StopReference::look(const ExperimentRecord& record, double window_s) const {
  Look out;
  Cut window;
  if (!cut(record.history(), window_s, window)) return out;
  const std::vector<Cell>& within = window.within;
  const double n = static_cast<double>(within.size()), W = n * window.cell_s;

  // What slip has gained from around the begin to the last quarter, and the force meanwhile.
  const std::size_t quarter = std::max<std::size_t>(1, within.size() / 4);
  std::vector<Cell> all = window.before;
  all.insert(all.end(), within.begin(), within.end());
  const std::size_t first = within.size() - 1 + quarter / 2;  // the newest of those at the begin
  std::vector<double> slip_then, slip_now, force_then, force_now;
  for (std::size_t i = 0; i < quarter; ++i) {
    const Cell& then = all[first - i];
    const Cell& now = all[all.size() - 1 - i];
    slip_then.push_back(then.slip_percent);
    slip_now.push_back(now.slip_percent);
    force_then.push_back(then.clamp_force_N);
    force_now.push_back(record.clamp_force_N(now));
  }
  const double s_1 = mean(slip_then), s_2 = mean(slip_now);
  out.gained_percent = s_2 - s_1;
  const double deformed = kDeformed_percent_per_N * std::abs(mean(force_now) - mean(force_then));
  if (out.gained_percent < number::kSmallestGain_percent + deformed) return out;
  const double gained_variance =
      2.0 * record.slip_noise_percent2_s() / (window.cell_s * static_cast<double>(quarter));
  const double freedom = std::max(1.0, record.slip_noise_freedom());
  const double normal =
      number::kInManyLooks * number::kInManyLooks - 2.0 * std::log(W / kShortest_s);
  const double student = freedom * (std::exp(normal / freedom) - 1.0);
  if (out.gained_percent * out.gained_percent < student * gained_variance) return out;

  // The torque that the belt is loaded with, as the window begins.
  const bool engine = inertia_kg_m2_ > 0.0;
  const double t_1 = window.before.back().t_s + 0.5 * window.cell_s;
  std::vector<double> torque_then, early, late;
  for (std::size_t i = 0; i < window.before.size(); ++i) {
    torque_then.push_back(window.before[i].torque_Nm);
    // The younger half is the one whose middle lies after that of all.
    const std::size_t age = 2 * within.size() - 1 - i;
    (2 * age + 1 < 3 * within.size() ? late : early).push_back(window.before[i].torque_Nm);
  }
  double turn = 0.0;
  for (const double each : late) turn += each / (0.5 * n);
  for (const double each : early) turn -= each / (0.5 * n);
  const Line& force = record.force_line();
  const Line& held = record.torque_line();
  const double F_1 = t_1 >= force.begin_s ? force.at(t_1) : mean(force_then);
  const double noise = record.torque_noise_Nm2_s();
  const double density = std::max(noise, record.torque().density(W));
  const double variation = density - noise;
  const double line_variance = variation / W + held.variance_at(record.duration_s());
  const double readings_variance = noise / W;
  double share = 0.0;  // of the line in the torque that is held
  if (t_1 >= held.begin_s) share = readings_variance / (readings_variance + line_variance);
  const double hold_variance =
      share * share * line_variance + (1.0 - share) * (1.0 - share) * readings_variance;
  const double T_1 = share * held.at(t_1) + (1.0 - share) * mean(torque_then);

  // Two moments of c T_b = F (m_1 + k x), and what is known of m_1.
  Eigen::Vector3d seen = Eigen::Vector3d::Zero();
  Eigen::Matrix<double, 3, 2> of = Eigen::Matrix<double, 3, 2>::Zero();
  of(0, 0) = 1.0;
  Eigen::Matrix2d by_torque = Eigen::Matrix2d::Zero(), by_speed = Eigen::Matrix2d::Zero();
  Eigen::Vector2d sum = Eigen::Vector2d::Zero();
  double carried = 0.0, carried_slip = 0.0;
  for (std::size_t i = 0; i < within.size(); ++i) {
    const Cell& cell = within[i];
    const double tau = (static_cast<double>(i) + 0.5) / n;
    const double F = record.clamp_force_N(cell), x = cell.slip_percent - s_1;
    const Weight w = weight(engine, tau);
    const double T =
        engine ? share * held.at(cell.t_s) + (1.0 - share) * cell.torque_Nm : cell.torque_Nm;
    for (int a = 0; a < 2; ++a) {
      // - the integral of w J domega/dt is that of dw/dt J omega.
      seen(1 + a) +=
          c_ * (w.value[a] * T + w.slope[a] * inertia_kg_m2_ / W *
                                     (cell.omega_p_rad_s -
                                      within[within.size() - 1 - within.size() / 2].omega_p_rad_s));
      of(1 + a, 0) += w.value[a] * F;
      of(1 + a, 1) += w.value[a] * F * x;
      sum(a) += w.value[a];
      for (int b = 0; b < 2; ++b) {
        by_torque(a, b) += w.value[a] * w.value[b];
        by_speed(a, b) += w.slope[a] * w.slope[b];
      }
    }
    carried += tau * tau * (1.0 - F / F_1);
    carried_slip += tau * tau * F * x;
  }
  Eigen::Matrix3d spread = Eigen::Matrix3d::Zero();
  if (engine) {
    const double per_reading = share * share * variation + (1.0 - share) * (1.0 - share) * noise;
    spread.bottomRightCorner<2, 2>() =
        c_ * c_ / window.cell_s *
            (by_torque * per_reading +
             by_speed * inertia_kg_m2_ * inertia_kg_m2_ / (W * W) * record.omega_noise_rad2_s()) +
        c_ * c_ * share * share * held.variance_at(record.duration_s()) * sum * sum.transpose();
    const double before =
        (window.before.back().omega_p_rad_s - window.before.front().omega_p_rad_s) /
        (W - window.cell_s);
    const double after = (within.back().omega_p_rad_s - window.before.back().omega_p_rad_s) / W;
    seen(0) = c_ / F_1 * (T_1 - inertia_kg_m2_ * before);
    const double speed_variance = 12.0 * record.omega_noise_rad2_s() / (W * W * W);
    spread(0, 0) = c_ * c_ / (F_1 * F_1) *
                   (hold_variance + inertia_kg_m2_ * inertia_kg_m2_ *
                                        ((after - before) * (after - before) + speed_variance));
  } else {
    spread.bottomRightCorner<2, 2>() = c_ * c_ / window.cell_s * by_torque * noise;
    // The readings just before, and the line that the torque had run along until then; how far
    // they are apart counts as uncertainty.
    double value = mean(torque_then), variance = density / W;
    const ExperimentRecord::TorqueEstimate line = record.torque_estimate_at(t_1);
    if (line.valid) {
      const double of_line = line.variance + variation / W;
      const double part = variance / (variance + of_line);
      const double apart = line.torque_Nm - value;
      value += part * apart;
      variance = part * part * (of_line + apart * apart) + (1.0 - part) * (1.0 - part) * variance;
    }
    seen(0) = c_ * value / F_1;
    spread(0, 0) =
        c_ * c_ / (F_1 * F_1) * (variance + std::max(0.0, turn * turn - 4.0 * density / W));
  }
  const Eigen::Vector3d per_Nm(c_ / F_1, c_ * n, c_ * n);
  spread += record.torque_slow_variance() *
            (per_Nm * per_Nm.transpose()).cwiseProduct(slow_covariance(engine, window_s));
  for (int i = 0; i < 3; ++i) spread(i, i) += 1e-12 * (seen(i) * seen(i) + 1e-12);
  const Eigen::Matrix3d precision = spread.fullPivLu().inverse();
  const Eigen::Matrix2d covariance = (of.transpose() * precision * of).fullPivLu().inverse();
  out.k = (covariance * of.transpose() * precision * seen)(1);

  const double mu_1 = c_ * T_1 / F_1;
  const double relative_gain = gained_variance / (out.gained_percent * out.gained_percent);
  const double by_force = mu_1 * W / (F_1 * out.gained_percent);
  const double force_variance = by_force * by_force * force.slope_variance;
  out.k_deviation = std::sqrt(covariance(1, 1) + out.k * out.k * relative_gain + force_variance);
  out.hold = mu_1 * F_1 * carried / carried_slip;
  const double by_hold = c_ / (F_1 * out.gained_percent);
  out.hold_deviation = std::sqrt(out.hold * out.hold * relative_gain + force_variance +
                                 by_hold * by_hold * hold_variance);
  out.slip_percent = s_2;
  out.level = number::kLevelElasticity * mu_1 /
              std::max(s_2 - smallest_slip_percent_, number::kLevelSlipLeast_percent);
  out.duration_s = W;
  out.counts = std::isfinite(out.k) && std::isfinite(out.k_deviation) && out.level > 0.0;
  return out;
}

// The smallest of the newest means that are long enough for their noise to be below 0.05 %.
void StopReference::follow_smallest_slip(const ExperimentRecord& record) {
  const History& history = record.history();
  std::size_t level = 3;
  for (; level + 1 < History::kLevels; ++level) {
    if (std::sqrt(record.slip_noise_percent2_s() / history.cell_s(level)) <= 0.05) break;
  }
  if (history.size(level) == 0) return;
  smallest_slip_percent_ = std::min(smallest_slip_percent_, history.cell(level, 0).slip_percent);
}

// Slip that has come too far, or soon will have, by the line through its last tenth of a second.
StopReason StopReference::backup(const ExperimentRecord& record) const {
  const History& history = record.history();
  const double cell_s = history.cell_s(0);
  const auto cells = static_cast<std::size_t>(std::max(4.0, std::round(0.1 / cell_s)));
  if (history.size(0) < cells) return StopReason::kNone;
  std::vector<double> slip;
  for (std::size_t age = cells; age-- > 0;) slip.push_back(history.cell(0, age).slip_percent);
  const double middle = 0.5 * static_cast<double>(cells - 1);
  double top = 0.0, bottom = 0.0;
  for (std::size_t i = 0; i < cells; ++i) {
    const double from = static_cast<double>(i) - middle;
    top += from * slip[i];
    bottom += from * from;
  }
  const double per_s = top / bottom / cell_s;
  const double deviation = std::sqrt(record.slip_noise_percent2_s() / cell_s / bottom) / cell_s;
  if (mean(slip) - smallest_slip_percent_ > number::kBackupSlip_percent) return StopReason::kSlip;
  const double now = mean(slip) + per_s * middle * cell_s;
  const double soon = now + (per_s - 4.0 * deviation) * number::kBackupAhead_s;
  return soon > number::kBackupAhead_percent ? StopReason::kSlipRate : StopReason::kNone;
}

StopReason StopReference::step(const ExperimentRecord& record) {
  if (!record.force_line().valid || !record.torque_line().valid) return StopReason::kNone;
  follow_smallest_slip(record);
  if (smallest_slip_percent_ > 1e8) return StopReason::kNone;
  ++looks_;
  const double now_s = record.duration_s();
  if (level_ && now_s > level_until_s_) level_ = false;
  if (now_s < number::kSettle_s) return backup(record);
  seen_ = false;
  bool stops = false;
  double off_best = 1e9;
  double window_s = kShortest_s;
  for (std::size_t i = 0; i < kWindows && window_s < 0.5 * now_s; ++i, window_s *= kLonger) {
    const std::size_t every = window_s < 0.4 ? 1 : window_s < 1.6 ? 4 : 16;
    if ((looks_ + i) % every != 0) continue;
    const Look at = look(record, window_s);
    if (!at.counts) continue;
    seen_ = true;
    const double off = std::abs(at.gained_percent - 0.5);
    if (off < off_best) slope_ = at.k;
    off_best = std::min(off_best, off);
    const double hold_most = std::max(at.level, at.hold + 2.0 * at.hold_deviation);
    double wanted =
        number::kLevelDeviations + number::kLevelDeviationsPerE * std::log(hold_most / at.level);
    wanted = std::min(wanted, number::kLevelDeviationsMost);
    wanted /= std::max(1.0, at.gained_percent / number::kLargeGain_percent);
    const double from_percent = at.slip_percent - at.gained_percent;
    const bool is_level =
        at.k + wanted * at.k_deviation < at.level || at.hold + 2.0 * at.hold_deviation < at.level;
    if (is_level) {
      if (!level_) level_from_percent_ = from_percent;
      level_ = true;
      level_until_s_ = std::max(level_until_s_, now_s + at.duration_s);
    }
    // A friction curve is concave: what rises now was not level before.
    const bool rises = at.k - number::kEvident * at.k_deviation > at.level;
    if (level_ && from_percent >= level_from_percent_ && rises) {
      level_ = false;
      level_until_s_ = now_s;
    }
    const bool falls = at.k + std::max(number::kEvident, wanted) * at.k_deviation < 0.0;
    const double gains = number::kAhead_s * 2.0 * at.gained_percent / at.duration_s;
    const bool followed =
        level_ && at.slip_percent + gains > level_from_percent_ + number::kFollow_percent;
    stops = stops || falls || followed;
  }
  return stops ? StopReason::kSlope : backup(record);
}

}  // namespace beltgrip::test
