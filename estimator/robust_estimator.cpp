#include "estimator/robust_estimator.h"

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <vector>

#include "estimator/clamp_force.h"
#include "estimator/excitation.h"
#include "estimator/history.h"
#include "estimator/peak_fit.h"
#include "estimator/sensor_error.h"
#include "estimator/signal_chain.h"
#include "estimator/slip.h"
#include "estimator/trend.h"
#include "estimator/units.h"

namespace beltgrip::estimator {
namespace {

constexpr double kCutoff_hz = 8.0;  // of the values that are shown; decisions use unfiltered means
constexpr double kFinestCell_s = 0.01;
constexpr std::size_t kTrendCells = 4096;
constexpr double kForget_s = 1.0;  // lines may reach into the present by this much
constexpr double kSlipNoise_s = 0.2,
                 kTorqueNoise_s = 0.4;  // scatter over longer times is not noise
constexpr double kQuiet_s = 1.0;        // no decision before
constexpr double kExcitationWindow_s = 1.0, kExcitation_percent2 = 0.05;  // shown only

// Slope test, by windows of time that grow by this factor.
constexpr double kWindowFirst_s = 0.12, kWindowFactor = 1.3, kWindowShare = 0.5;
constexpr double kGained_percent = 0.2, kGainedDeviations = 6.0;
// Slopes in units of mu* per slip gained so far, d(ln mu*) / d(ln slip).
constexpr double kLevel = 0.03, kFall = -0.02;
constexpr double kLevelDeviations = 1.2, kDeviationsMaximum = 3.5, kFallDeviations = 2.0;
constexpr double kShortestSlip_percent = 0.5;
// Slip that must follow once the curve has levelled off, looking ahead by the reaction's time.
constexpr double kConfirm_percent = 0.35, kAhead_s = 0.1;

constexpr double kBackupSlip_percent = 8.0;  // above the smallest slip
constexpr double kBackupRate_percent_s = 30.0, kBackupRateDeviations = 6.0;
constexpr std::size_t kBackupRateCells = 20;

// Points for the fit.
constexpr std::size_t kCellsPerLevel = 64;
constexpr double kShortestPoint_s = 0.035, kLongestPoint_s = 1.0, kPointStep_percent = 0.04;
constexpr double kFitFrom = 0.9;  // of the largest mu*
constexpr std::size_t kFewestCells = 30;
constexpr double kBoundDeviations = 2.5;  // a lower bound is right in 99 %
constexpr double kMovedDeviations = 3.0;
constexpr double kSure = 0.95;
// What no form of the fit has in it, relative: mu_max of curves outside the family comes out 0.1 %
// low without noise (accuracy_test).
constexpr double kFormDeviation = 1e-3;

class RobustEstimator final : public SlipCurveEstimator {
 public:
  RobustEstimator(const EstimatorSettings& settings, const VariatorParameters& variator,
                  const SensorAccuracies& accuracies)
      : settings_(settings),
        variator_(variator),
        accuracies_(accuracies),
        chain_(settings, variator, std::min(kCutoff_hz, settings.sample_rate_hz / 4.0)),
        excitation_(kExcitationWindow_s, settings.sample_rate_hz, kExcitation_percent2),
        inertia_(settings.torque_is_engine ? variator.primary_inertia_kg_m2 : 0.0),
        history_(settings.sample_rate_hz, kFinestCell_s),
        force_trend_(kTrendCells),
        torque_trend_(kTrendCells),
        slip_trend_(kTrendCells),
        omega_trend_(kTrendCells),
        cells_(kCellsMaximum),
        lengths_(kCellsMaximum),
        points_(kCellsMaximum) {
    RobustEstimator::reset();
  }

  void reset() noexcept override {
    chain_.reset();
    out_ = {};
    peak_ = {};
    excitation_.reset();
    slip_min_ = std::numeric_limits<double>::max();
    alarm_ = false;
    alarm_until_ = 0.0;
    history_.reset();
    force_trend_.reset();
    torque_trend_.reset();
    slip_trend_.reset();
    omega_trend_.reset();
    first_t_ = -1;
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
    omega_s_rad_s_ = now.omega_s_rad_s;
    excitation_.step(now.slip_percent);
    out_.slip_variance = excitation_.variance();
    if (first_t_ < 0) first_t_ = sample.t_ns;
    const double t = static_cast<double>(sample.t_ns - first_t_) * kNanosecond_s;
    const double slip = slip_percent(chain_.point(), sample.omega_p_rad_s, sample.omega_s_rad_s);
    const double torque = chain_.point().sign * sample.torque_Nm;
    const double force =
        secondary_clamp_force_N(variator_, sample.secondary_pressure_Pa, sample.omega_s_rad_s);
    const double dt = 1.0 / settings_.sample_rate_hz;
    force_trend_.step(t, force, dt);
    torque_trend_.step(t, torque, dt);
    slip_trend_.step(t, slip, dt);
    omega_trend_.step(t, sample.omega_p_rad_s, dt);
    if (history_.step({t, slip, torque, force, chain_.point().sign * sample.omega_p_rad_s})) {
      decide(t);
    }
    return out_;
  }

  bool conclude() noexcept override {
    peak_ = {};
    if (history_.size(0) < kFewestCells) return true;
    gather_cells();
    make_points();
    choose_stretch();
    judge(fitter_.fit(stretch(), coefficient()));
    return true;
  }

  const PeakEstimate& peak() const noexcept override { return peak_; }

 private:
  static constexpr std::size_t kCellsMaximum = History::kLevels * kCellsPerLevel;

  // mu* = coefficient * T / F, eq. (5), magnitudes
  double coefficient() const noexcept {
    return traction_coefficient(variator_, chain_.point(), chain_.point().sign, 1.0);
  }
  std::span<const CurvePoint> stretch() const noexcept {
    return {points_.data() + first_, point_count_ - first_};
  }
  double mu_of(const CurvePoint& point) const noexcept {
    return coefficient() * point.torque_Nm / point.force_N;
  }
  double mu_weight(const CurvePoint& point) const noexcept {  // 1 / variance of mu*
    const double c = coefficient();
    return point.force_N * point.force_N / (c * c * point.variance);
  }

  // The whole past in cells that do not overlap, oldest first.
  void gather_cells() noexcept {
    cell_count_ = 0;
    double covered = std::numeric_limits<double>::max();  // begin of what is covered
    for (std::size_t level = 0; level < History::kLevels; ++level) {
      const double length = history_.cell_s(level);
      const std::size_t size = history_.size(level);
      std::size_t taken = 0;
      for (std::size_t age = 0; age < size && taken < kCellsPerLevel; ++age) {
        const Cell& cell = history_.cell(level, age);
        if (cell.t_s + 0.5 * length > covered + 1e-9) continue;
        cells_[cell_count_] = cell;
        lengths_[cell_count_] = length;
        covered = cell.t_s - 0.5 * length;
        ++cell_count_;
        ++taken;
      }
    }
    const auto count = static_cast<std::ptrdiff_t>(cell_count_);
    std::reverse(cells_.begin(), cells_.begin() + count);
    std::reverse(lengths_.begin(), lengths_.begin() + count);
    end_s_ = cells_[cell_count_ - 1].t_s;
    force_line_ = force_trend_.line(end_s_ + kForget_s);
    torque_line_ = torque_trend_.line(end_s_ + kForget_s);
  }

  // Cells put together until slip has moved on by a step, or time has.
  void make_points() noexcept {
    const double slip_density = slip_trend_.density(kSlipNoise_s);
    const double torque_density = torque_trend_.density(kTorqueNoise_s);
    point_count_ = 0;
    double slip_last = cells_[0].slip_percent;
    for (std::size_t i = 0; i < cell_count_;) {
      const std::size_t begin = i;
      double w = 0.0, slip = 0.0, torque = 0.0, force = 0.0, t = 0.0;
      while (i < cell_count_) {
        const double length = lengths_[i];
        w += length;
        slip += length * cells_[i].slip_percent;
        torque += length * cells_[i].torque_Nm;
        force += length * force_at(force_line_, cells_[i]);
        t += length * cells_[i].t_s;
        ++i;
        const double step = std::max(kPointStep_percent, 2.0 * std::sqrt(slip_density / w));
        if (w > kShortestPoint_s &&
            (std::abs(slip / w - slip_last) > step || w > kLongestPoint_s)) {
          break;
        }
      }
      slip_last = slip / w;
      CurvePoint& point = points_[point_count_++];
      point = {t / w, slip / w, torque / w, force / w, w, torque_density / w};
      if (inertia_ > 0.0) subtract_inertia(point, begin, i, torque_density);
      point.variance = std::max(point.variance, 1e-12);
    }
  }

  // T_b = T - J d(omega_p)/dt, from the speeds at the two ends of the point.
  void subtract_inertia(CurvePoint& point, std::size_t begin, std::size_t end,
                        double torque_density) const noexcept {
    const double omega_density = omega_trend_.density(kSlipNoise_s);
    struct Edge {
      double omega = 0.0, t = 0.0, length = 0.0;
    };
    const auto edge = [&](std::size_t at) {
      Edge sum;
      for (std::size_t i = at > 2 ? at - 2 : 0; i < std::min(cell_count_, at + 2); ++i) {
        sum.omega += lengths_[i] * cells_[i].omega_p_rad_s;
        sum.t += lengths_[i] * cells_[i].t_s;
        sum.length += lengths_[i];
      }
      return Edge{sum.omega / sum.length, sum.t / sum.length, sum.length};
    };
    const Edge from = edge(begin), to = edge(end);
    const double dt = std::max(to.t - from.t, 1e-3);
    const bool held = torque_line_.valid && point.t_s > torque_line_.begin_s;
    const double torque = held ? torque_line_.at(point.t_s) : point.torque_Nm;
    point.torque_Nm = torque - inertia_ * (to.omega - from.omega) / dt;
    point.variance =
        inertia_ * inertia_ * omega_density * (1.0 / from.length + 1.0 / to.length) / (dt * dt) +
        std::max(0.0, torque_trend_.density(1.0) - torque_density) / point.duration_s;
  }

  // Back to where mu* was so much of its largest value; there the noise of slip counts as well.
  void choose_stretch() noexcept {
    constexpr std::size_t kSide = 3;
    double mu_top = 0.0;
    std::size_t top = 0;
    for (std::size_t i = 0; i < point_count_; ++i) {
      double sum = 0.0, n = 0.0;
      for (std::size_t j = i > kSide ? i - kSide : 0; j < std::min(point_count_, i + kSide + 1);
           ++j) {
        const double w = mu_weight(points_[j]);
        sum += w * mu_of(points_[j]);
        n += w;
      }
      if (sum / n > mu_top) {
        mu_top = sum / n;
        top = i;
      }
    }
    first_ = top;
    const double c = coefficient();
    while (first_ > 0) {
      const CurvePoint& point = points_[first_];
      const Line torque = torque_trend_.line(point.t_s + 0.3);
      const double held = torque.valid ? torque.value : point.torque_Nm;
      if (c * held / point.force_N <= kFitFrom * mu_top) break;
      --first_;
    }
    const double slip_density = slip_trend_.density(kSlipNoise_s);
    constexpr std::size_t kSlopeSide = 4;
    for (std::size_t i = first_; i < point_count_; ++i) {
      const CurvePoint& before = points_[i > first_ + kSlopeSide ? i - kSlopeSide : first_];
      const CurvePoint& after = points_[std::min(point_count_ - 1, i + kSlopeSide)];
      const double moved = after.slip_percent - before.slip_percent;
      const double slope =
          std::clamp((mu_of(after) - mu_of(before)) / std::max(0.1, moved), 0.0, 0.1);
      const double torque_per_percent = slope * points_[i].force_N / c;
      points_[i].variance +=
          torque_per_percent * torque_per_percent * slip_density / points_[i].duration_s;
    }
  }

  // A value where the data hold the peak: the forms agree that it lies inside, slip has moved
  // beyond it, and mu* has come down from it, or the slope said so. Else what was reached is a
  // lower bound.
  void judge(const PeakFit& fit) noexcept {
    const std::span<const CurvePoint> points = stretch();
    double duration_s = 0.0, torque = 0.0, force = 0.0;
    double moved = 0.0, slip_variance = 0.0;
    for (const CurvePoint& point : points) {
      duration_s += point.duration_s;
      torque += point.torque_Nm * point.duration_s;
      force += point.force_N * point.duration_s;
      if (point.slip_percent <= fit.slip_percent) continue;
      if (point.slip_percent - fit.slip_percent > moved) {
        moved = point.slip_percent - fit.slip_percent;
        slip_variance = slip_trend_.density(kSlipNoise_s) / point.duration_s;
      }
    }
    const double sensors = relative_sensor_deviation(variator_, accuracies_, torque / duration_s,
                                                     force / duration_s, omega_s_rad_s_);
    peak_.samples = std::llround(duration_s * settings_.sample_rate_hz);
    double lines = force_line_.variance_at(end_s_) / square(force_line_.at(end_s_));
    if (inertia_ > 0.0) lines += torque_line_.variance_at(end_s_) / square(torque_line_.at(end_s_));
    if (!(fit.mu > 0.0) || !std::isfinite(fit.mu + fit.variance + fit.slip_percent + lines)) {
      bound_by_last(sensors);
      return;
    }
    const double deviation =
        std::max(kSmallestStd,
                 std::sqrt(fit.variance +
                           fit.mu * fit.mu * (lines + sensors * sensors + square(kFormDeviation))));
    peak_.sigma_peak_percent = fit.slip_percent;
    // After another stop than the slope's the fit alone must be sure, on slip that has really
    // moved.
    const double slip_noise = std::sqrt(slip_variance);
    const bool turned = out_.stop == StopReason::kSlope
                            ? fit.inside > 0.5 && moved > kMovedDeviations * slip_noise
                            : fit.inside > kSure &&
                                  moved > std::max(kGained_percent, kGainedDeviations * slip_noise);
    if (turned) {
      peak_.kind = PeakKind::kValue;
      peak_.mu_max = fit.mu;
      peak_.mu_max_std = deviation;
      peak_.ci95_low = fit.mu - kNormal95 * deviation;
      peak_.ci95_high = fit.mu + kNormal95 * deviation;
    } else {
      peak_.kind = PeakKind::kLowerBound;
      peak_.mu_max = std::max(0.0, fit.mu - kBoundDeviations * deviation);
    }
  }

  // Too little for a form: what the last points had reached.
  void bound_by_last(double sensors) noexcept {
    constexpr std::size_t kLast = 8;
    double sum = 0.0, n = 0.0;
    for (std::size_t i = point_count_ > kLast ? point_count_ - kLast : 0; i < point_count_; ++i) {
      sum += mu_weight(points_[i]) * mu_of(points_[i]);
      n += mu_weight(points_[i]);
    }
    const double reached = sum / n;
    if (!std::isfinite(reached) || reached <= 0.0) return;
    peak_.kind = PeakKind::kLowerBound;
    peak_.sigma_peak_percent = points_[point_count_ - 1].slip_percent;
    peak_.mu_max =
        std::max(0.0, reached - kBoundDeviations * std::sqrt(1.0 / n + square(reached * sensors)));
  }

  static double square(double x) noexcept { return x * x; }

  void decide(double t_now) noexcept {
    const double slip_density = slip_trend_.density(kSlipNoise_s);
    if (out_.stop != StopReason::kNone) {
      // The belt has caught again once slip is back below where it stopped.
      if (history_.cell(0, 0).slip_percent < 0.5 * stop_slip_) out_.phase = Phase::kQuiet;
      return;
    }
    if (t_now < kQuiet_s) return;
    update_slip_min(slip_density);
    const Line force = force_trend_.line(t_now + kForget_s);
    const Line engine = torque_trend_.line(t_now + kForget_s);
    if (force.valid && engine.valid) test_slope(t_now, force, engine, slip_density);
    if (out_.stop == StopReason::kNone) out_.stop = backup(slip_density);
    if (out_.stop != StopReason::kNone) {
      stop_slip_ = history_.cell(0, 0).slip_percent;
      out_.phase = Phase::kMacroSlip;
    }
  }

  StopReason backup(double slip_density) const noexcept {
    if (history_.size(2) > 1 &&
        history_.cell(2, 0).slip_percent - slip_min_ > kBackupSlip_percent) {
      return StopReason::kSlip;
    }
    if (history_.size(0) > kBackupRateCells) {
      const double over_s = kBackupRateCells * history_.cell_s(0);
      const double gained =
          history_.cell(0, 0).slip_percent - history_.cell(0, kBackupRateCells).slip_percent;
      const double noise = std::sqrt(2.0 * slip_density / history_.cell_s(0));
      if (gained > std::max(kBackupRate_percent_s * over_s, kBackupRateDeviations * noise)) {
        return StopReason::kSlipRate;
      }
    }
    return StopReason::kNone;
  }

  // Is d mu* / d slip still positive? Over windows from short to long that end now, mu* = m1 + k x
  // is fitted to torque and force by moments, with what is known of the time before as a prior for
  // m1; the noise of each channel is taken from its own scatter. Where torque is the engine's, the
  // inertia's part enters by partial integration, without differentiating noise.
  void test_slope(double t_now, const Line& force, const Line& engine,
                  double slip_density) noexcept {
    const double c = coefficient();
    const double omega_density = omega_trend_.density(kSlipNoise_s);
    if (t_now > alarm_until_) alarm_ = false;
    bool first = true;
    out_.phase = Phase::kQuiet;
    for (double window = kWindowFirst_s; window < kWindowShare * t_now; window *= kWindowFactor) {
      std::size_t level = 0;
      while (level + 1 < History::kLevels && history_.cell_s(level) * 48.0 < window) ++level;
      const double cell = history_.cell_s(level);
      const auto cells = static_cast<std::size_t>(window / cell);
      if (history_.size(level) < 2 * cells + 1) break;
      const double n = static_cast<double>(cells);
      const double W = cell * n;
      // Slip at the window's begin and over its last quarter.
      const std::size_t quarter = std::max<std::size_t>(1, cells / 4);
      double s1 = 0.0, s2 = 0.0;
      for (std::size_t i = 0; i < quarter; ++i) {
        s2 += history_.cell(level, i).slip_percent;
        s1 += history_.cell(level, cells - quarter / 2 + i).slip_percent;
      }
      s1 /= static_cast<double>(quarter);
      s2 /= static_cast<double>(quarter);
      const double gained = s2 - s1;
      const double var_gained = 2.0 * slip_density / (static_cast<double>(quarter) * cell);
      if (gained < kGained_percent ||
          gained * gained < kGainedDeviations * kGainedDeviations * var_gained) {
        continue;
      }

      const Cell& begin = history_.cell(level, cells);
      const double t1 = begin.t_s + 0.5 * cell;
      double before = 0.0, before_F = 0.0, before_omega = 0.0, turn = 0.0;
      for (std::size_t i = cells; i < 2 * cells; ++i) {
        const double T = history_.cell(level, i).torque_Nm;
        before += T / n;
        turn += (2 * i + 1 < 3 * cells ? T : -T) / (0.5 * n);
      }
      for (std::size_t i = cells - quarter / 2; i < cells - quarter / 2 + quarter; ++i) {
        before_F += history_.cell(level, i).clamp_force_N / static_cast<double>(quarter);
      }
      before_omega =
          (begin.omega_p_rad_s - history_.cell(level, 2 * cells - 1).omega_p_rad_s) / (W - cell);
      const double f1 = t1 >= force.begin_s ? force.at(t1) : before_F;
      const double torque_density = torque_trend_.density(W);
      const double noise_density = torque_trend_.density(kTorqueNoise_s);
      // Torque while it is held: the line, or the readings, or what lies between, by their
      // variances.
      const double excess_density = std::max(0.0, torque_density - noise_density);
      const double v_line = excess_density / W + engine.variance_at(t_now) + 1e-12;
      const double v_raw = noise_density / W + 1e-12;
      const double line_share = t1 >= engine.begin_s ? v_raw / (v_raw + v_line) : 0.0;
      const double hold_variance =
          line_share * line_share * v_line + (1 - line_share) * (1 - line_share) * v_raw;
      const double hold = line_share * engine.at(t1) + (1.0 - line_share) * before;
      // Two moments of c T_b = F (m1 + k x), weighted over the window.
      Eigen::Matrix2d A = Eigen::Matrix2d::Zero(), N = Eigen::Matrix2d::Zero();
      Eigen::Vector2d y = Eigen::Vector2d::Zero(), sw = Eigen::Vector2d::Zero();
      double kf_top = 0.0, kf_bottom = 0.0;
      const double omega_ref = history_.cell(level, cells / 2).omega_p_rad_s;
      for (std::size_t i = 0; i < cells; ++i) {
        const Cell& a = history_.cell(level, cells - 1 - i);
        const double tau = (static_cast<double>(i) + 0.5) / n;
        const double F = force_at(force, a);
        const double x = a.slip_percent - s1;
        Eigen::Vector2d w;
        if (inertia_ > 0.0) {
          w << tau * (1.0 - tau) * (1.0 - tau), tau * tau * (1.0 - tau);
          // minus the integral of w domega/dt is the integral of w' omega: no derivative of noise
          const Eigen::Vector2d dw =
              Eigen::Vector2d(1.0 - 4.0 * tau + 3.0 * tau * tau, 2.0 * tau - 3.0 * tau * tau) / W;
          const double T = line_share * engine.at(a.t_s) + (1.0 - line_share) * a.torque_Nm;
          y += c * (w * T + inertia_ * dw * (a.omega_p_rad_s - omega_ref));
          N += c * c *
               (inertia_ * inertia_ * omega_density * dw * dw.transpose() +
                (line_share * line_share * excess_density +
                 (1.0 - line_share) * (1.0 - line_share) * noise_density) *
                    w * w.transpose()) /
               cell;
        } else {
          w << 1.0, tau * tau;
          y += c * w * a.torque_Nm;
          N += c * c * torque_density / cell * w * w.transpose();
        }
        sw += w;
        A.col(0) += w * F;
        A.col(1) += w * F * x;
        kf_top += tau * tau * (1.0 - F / f1);
        kf_bottom += tau * tau * F * x;
      }
      if (inertia_ > 0.0)
        N += c * c * line_share * line_share * engine.variance_at(t_now) * sw * sw.transpose();
      double m1 = c * (inertia_ > 0.0 ? hold : before) / f1;
      double v1 = c * c / (f1 * f1) *
                  (torque_density / W + std::max(0.0, turn * turn - 4.0 * torque_density / W));
      if (inertia_ > 0.0) {
        const double after = (history_.cell(level, 0).omega_p_rad_s - begin.omega_p_rad_s) / W;
        m1 -= c * inertia_ * before_omega / f1;
        v1 = c * c / (f1 * f1) *
             (hold_variance +
              inertia_ * inertia_ *
                  (std::pow(after - before_omega, 2) + 12.0 * omega_density / (W * W * W)));
      }
      Eigen::Matrix2d info = A.transpose() * N.inverse() * A;
      Eigen::Vector2d rhs = A.transpose() * N.inverse() * y;
      info(0, 0) += 1.0 / v1;
      rhs(0) += m1 / v1;
      const Eigen::Matrix2d cov = info.inverse();
      const Eigen::Vector2d theta = cov * rhs;
      const double k = theta(1);
      const double scale = c * hold / f1;
      const double kf = scale * f1 * kf_top / kf_bottom;
      const double rel_gained = var_gained / (gained * gained);
      const double var_f = std::pow(scale * W / (f1 * gained), 2) * force.slope_variance;
      const double var_k = cov(1, 1) + k * k * rel_gained + var_f;
      const double var_kf =
          kf * kf * rel_gained + var_f + c * c / (f1 * f1) * hold_variance / (gained * gained);
      const double rel = s1 + gained - slip_min_;
      const double unit = scale / std::max(rel, kShortestSlip_percent);
      const double limit = kLevel * unit;
      const double sd = std::sqrt(var_k);
      if (!std::isfinite(k) || !std::isfinite(sd)) continue;
      if (first) show(k, sd);
      first = false;
      const double kf_up = std::max(limit, kf + 2.0 * std::sqrt(var_kf));
      const double z = 1.0 + kLevelDeviations * std::log(kf_up / limit);
      const bool level_off =
          k + std::min(z, kDeviationsMaximum) * sd < limit || kf + 2.0 * std::sqrt(var_kf) < limit;
      if (level_off) {
        if (!alarm_) alarm_slip_ = s2;
        alarm_ = true;
        alarm_until_ = std::max(alarm_until_, t_now + W);
      }
      const bool down = k + std::clamp(z, kFallDeviations, kDeviationsMaximum) * sd < kFall * unit;
      const double rate = 2.0 * gained / W;
      if (down || (alarm_ && s2 + kAhead_s * rate > alarm_slip_ + kConfirm_percent)) {
        out_.stop = StopReason::kSlope;
        out_.friction_slope = k;
        return;
      }
    }
  }

  void show(double slope, double deviation) noexcept {
    out_.friction_slope = slope;
    out_.phase = slope > deviation          ? Phase::kExcited
                 : slope < -2.0 * deviation ? Phase::kMacroSlip
                                            : Phase::kPeak;
  }

  // The smallest slip so far, as the mean over a time that makes its noise small.
  void update_slip_min(double slip_density) noexcept {
    std::size_t level = 3;
    while (level + 1 < History::kLevels && slip_density / history_.cell_s(level) > 0.0025) ++level;
    if (history_.size(level) > 0) {
      slip_min_ = std::min(slip_min_, history_.cell(level, 0).slip_percent);
    }
  }

  double force_at(const Line& line, const Cell& cell) const noexcept {
    return cell.t_s >= line.begin_s - 0.05 ? line.at(cell.t_s) : cell.clamp_force_N;
  }

  EstimatorSettings settings_;
  VariatorParameters variator_;
  SensorAccuracies accuracies_;
  SignalChain chain_;
  SlipExcitation excitation_;
  double inertia_;
  History history_;
  Trend force_trend_, torque_trend_, slip_trend_, omega_trend_;
  double slip_min_ = 0.0, alarm_slip_ = 0.0, alarm_until_ = 0.0, stop_slip_ = 0.0;
  double omega_s_rad_s_ = 0.0;
  bool alarm_ = false;
  std::int64_t first_t_ = -1;
  // The past for conclude(), from old to new.
  std::vector<Cell> cells_;
  std::vector<double> lengths_;
  std::size_t cell_count_ = 0;
  std::vector<CurvePoint> points_;
  std::size_t point_count_ = 0, first_ = 0;
  double end_s_ = 0.0;
  Line force_line_, torque_line_;
  PeakFitter fitter_;
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
