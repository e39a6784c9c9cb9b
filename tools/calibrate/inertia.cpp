// The inertia between engine and belt, and the delay of the torque, from steps of the torque.
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <optional>
#include <utility>

#include "can_dbc/text/format.h"
#include "tools/calibrate/calibrate.h"
#include "tools/calibrate/cluster_fit.h"
#include "tools/calibrate/series.h"

namespace beltgrip::calibrate {

namespace {

using daemon::Role;

constexpr double kSlowCell_s = 0.1;
constexpr double kShapeGrid_s = 0.01;
constexpr int kPerCell = 10;
constexpr double kBefore_s = 0.8, kAfter_s = 1.2;  // of a step
constexpr double kStep_Nm = 15.0;
constexpr double kStepTime_s = 0.3;
constexpr int kEventsMin = 6;
constexpr double kRelativeStdMax = 0.2;
constexpr double kDelayFirst_s = -0.05, kDelayLast_s = 0.2;
constexpr double kInertiaDelayStdMax_s = 0.01;
constexpr double kInertiaSpeedMin_rad_s = 60.0;
constexpr double kLocked_rad_s = 5.0;  // between engine and pulley: the clutch is closed

// One step of the torque on a grid: from kBefore_s before it to kAfter_s after, the torque on a
// finer one that reaches as far as the delays that are tried.
struct Event {
  std::vector<double> primary, secondary, torque;
};
constexpr double kFine_s = 0.005;

bool grid(const Series& series, double from_s, double step_s, int count,
          std::vector<double>& values) {
  for (int i = 0; i < count; ++i) {
    const auto value = series.at(from_s + i * step_s);
    if (!value) return false;
    values.push_back(*value);
  }
  return true;
}

bool usable(const Series& primary, const Series& engine, const Series& torque, const Series& brake,
            double from_s, double to_s) {
  for (double t = from_s; t <= to_s; t += 5.0 * kShapeGrid_s) {
    const auto p = primary.at(t);
    if (!p || *p < kInertiaSpeedMin_rad_s || !torque.at(t)) return false;
    // A load that comes and goes as fast as the torque passes for an inertia.
    if (!brake.empty() && brake.at(t).value_or(0.0) > 0.0) return false;
    if (engine.empty()) continue;
    const auto e = engine.at(t);
    if (!e || std::abs(*e - *p) > kLocked_rad_s) return false;
  }
  return true;
}

std::vector<Event> events(std::span<const diagnose::SignalTable> logs) {
  std::vector<Event> found;
  for (const diagnose::SignalTable& log : logs) {
    const Series primary(log[Role::kPrimarySpeed]), secondary(log[Role::kSecondarySpeed]),
        torque(log[Role::kEngineTorque]), engine(log[Role::kEngineSpeed]),
        brake(log[Role::kBrakePressed]);
    if (primary.empty() || secondary.empty() || torque.empty()) continue;
    double next = torque.begin_s() + kBefore_s;
    for (double t = next; t + kAfter_s + kDelayLast_s < torque.end_s(); t += 2.0 * kShapeGrid_s) {
      if (t < next) continue;
      const auto before = torque.at(t - 0.5 * kStepTime_s);
      const auto after = torque.at(t + 0.5 * kStepTime_s);
      if (!before || !after || std::abs(*after - *before) < kStep_Nm) continue;
      if (!usable(primary, engine, torque, brake, t - kBefore_s, t + kAfter_s)) continue;
      Event event;
      const int count = static_cast<int>(std::lround((kBefore_s + kAfter_s) / kShapeGrid_s));
      const double reach_s = kBefore_s + kAfter_s + kDelayLast_s - kDelayFirst_s;
      if (!grid(primary, t - kBefore_s, kShapeGrid_s, count, event.primary) ||
          !grid(secondary, t - kBefore_s, kShapeGrid_s, count, event.secondary) ||
          !grid(torque, t - kBefore_s + kDelayFirst_s, kFine_s,
                static_cast<int>(std::lround(reach_s / kFine_s)) + 1, event.torque)) {
        continue;
      }
      found.push_back(std::move(event));
      next = t + kBefore_s + kAfter_s;
    }
  }
  return found;
}

// The torque as it was `delay` later on the bus.
std::vector<double> delayed(const Event& event, double delay_s) {
  std::vector<double> values;
  for (std::size_t i = 0; i < event.primary.size(); ++i) {
    const double place =
        (static_cast<double>(i) * kShapeGrid_s + delay_s - kDelayFirst_s) / kFine_s;
    const auto before = std::min(static_cast<std::size_t>(place), event.torque.size() - 2);
    const double share = place - static_cast<double>(before);
    values.push_back(event.torque[before] +
                     share * (event.torque[before + 1] - event.torque[before]));
  }
  return values;
}

double mean(const std::vector<double>& values, int cell) {
  double sum = 0.0;
  for (int i = 0; i < kPerCell; ++i)
    sum += values[static_cast<std::size_t>(cell) * kPerCell + static_cast<std::size_t>(i)];
  return sum / kPerCell;
}

// The difference of two neighbouring cells' means over their distance is the derivative under a
// triangle as wide as both; the torque is weighted likewise, so that both see the same time.
double under_triangle(const std::vector<double>& values, int cell) {
  double sum = 0.0;
  for (int i = 0; i < 2 * kPerCell; ++i) {
    const double weight = kPerCell - std::abs(i + 0.5 - kPerCell);
    sum += weight * values[static_cast<std::size_t>(cell) * kPerCell + static_cast<std::size_t>(i)];
  }
  return sum / (kPerCell * kPerCell);
}

// Of the scatter of a channel from point to point, about the line through its neighbours.
double noise_variance(const std::vector<double>& values) {
  std::vector<double> squares;
  for (std::size_t i = 2; i + 2 < values.size(); i += 1) {
    const double d = values[i] - 0.5 * (values[i - 1] + values[i + 1]);
    squares.push_back(d * d / 1.5);
  }
  double sum = 0.0;
  for (const double each : squares) sum += each / static_cast<double>(squares.size());
  return sum;
}

struct Fitted {
  ClusterFit fit;
  double squares = std::numeric_limits<double>::infinity();  // of the residuals
  double ratio_low = std::numeric_limits<double>::infinity(), ratio_high = 0.0;
};

// Every event takes off its own constant and slope: the load, which changes slowly and comes
// through the ratio.
Fitted fit_all(const std::vector<Event>& all, double delay_s) {
  Observations data;
  Eigen::MatrixXd noise = Eigen::MatrixXd::Zero(2, 2);
  Fitted result;
  for (std::size_t e = 0; e < all.size(); ++e) {
    const Event& event = all[e];
    const std::vector<double> torque = delayed(event, delay_s);
    const int cells = static_cast<int>(event.primary.size()) / kPerCell - 1;
    Eigen::MatrixXd x(cells, 2), load(cells, 2);
    Eigen::VectorXd y(cells);
    double ratio_square = 0.0;
    for (int i = 0; i < cells; ++i) {
      // Where the derivatives are: at the joint of both cells. Half a cell beside it, a ratio that
      // moves passes for an inertia.
      const double ratio = (mean(event.secondary, i) + mean(event.secondary, i + 1)) /
                           (mean(event.primary, i) + mean(event.primary, i + 1));
      result.ratio_low = std::min(result.ratio_low, ratio);
      result.ratio_high = std::max(result.ratio_high, ratio);
      x(i, 0) = (mean(event.primary, i + 1) - mean(event.primary, i)) / kSlowCell_s;
      x(i, 1) = ratio * (mean(event.secondary, i + 1) - mean(event.secondary, i)) / kSlowCell_s;
      y[i] = under_triangle(torque, i);
      load(i, 0) = ratio;
      load(i, 1) = ratio * (i - 0.5 * (cells - 1));
      ratio_square += ratio * ratio / cells;
    }
    load.col(1) -= load.col(0) * (load.col(0).dot(load.col(1)) / load.col(0).squaredNorm());
    const Eigen::VectorXd norm = load.colwise().squaredNorm();
    for (Eigen::Index j = 0; j < 2; ++j) {
      const Eigen::VectorXd column = load.col(j);
      x -= column * (column.transpose() * x) / norm[j];
      y -= column * (column.dot(y) / norm[j]);
    }
    for (int i = 0; i < cells; ++i) data.add(y[i], x.row(i).transpose(), static_cast<int>(e));
    const double per_cell = 2.0 / (kPerCell * kSlowCell_s * kSlowCell_s) * (cells - 2);
    noise(0, 0) += per_cell * noise_variance(event.primary);
    noise(1, 1) += per_cell * noise_variance(event.secondary) * ratio_square;
  }
  const Eigen::VectorXd none =
      Eigen::VectorXd::Constant(2, std::numeric_limits<double>::infinity());
  result.fit = fit(data, Eigen::VectorXd::Zero(2), none, noise);
  if (!result.fit.solved) return result;
  result.squares = 0.0;
  for (const double each : result.fit.residual) result.squares += each * each;
  return result;
}

struct BestDelay {
  double delay_s = 0.0;
  Fitted fitted;
  std::vector<double> squares;  // of each delay tried
};

BestDelay best_delay(const std::vector<Event>& all, double step_s) {
  BestDelay best;
  const int steps = static_cast<int>(std::lround((kDelayLast_s - kDelayFirst_s) / step_s));
  for (int i = 0; i <= steps; ++i) {
    const double delay_s = kDelayFirst_s + i * step_s;
    Fitted here = fit_all(all, delay_s);
    best.squares.push_back(here.squares);
    if (here.squares < best.fitted.squares) {
      best.fitted = std::move(here);
      best.delay_s = delay_s;
    }
  }
  return best;
}

// Between the delays tried: the parabola through the best and its neighbours. None: the best is
// the first or the last.
std::optional<double> between_delays_s(const BestDelay& best) {
  const auto at =
      static_cast<std::size_t>(std::lround((best.delay_s - kDelayFirst_s) / kShapeGrid_s));
  if (at == 0 || at + 1 == best.squares.size()) return std::nullopt;
  const double before = best.squares[at - 1], after = best.squares[at + 1];
  const double curvature = before - 2.0 * best.squares[at] + after;
  const double shift = curvature > 0.0 ? 0.5 * (before - after) / curvature : 0.0;
  return best.delay_s + std::clamp(shift, -0.5, 0.5) * kShapeGrid_s;
}

// The events one half against the other: what the delay is worth.
double delay_std_s(const std::vector<Event>& all) {
  std::array<double, 2> halves_s{};
  for (std::size_t half = 0; half < 2; ++half) {
    std::vector<Event> some;
    for (std::size_t i = half; i < all.size(); i += 2) some.push_back(all[i]);
    halves_s[half] = best_delay(some, 0.5 * kShapeGrid_s).delay_s;
  }
  return std::hypot(0.5 * (halves_s[0] - halves_s[1]), 0.5 * kShapeGrid_s);
}

}  // namespace

std::vector<Finding> inertia(std::span<const diagnose::SignalTable> logs,
                             const daemon::Config& config) {
  Finding found, delay;
  found.key = "variator.primary_inertia_kg_m2";
  found.unit = "kg m2";
  found.configured = config.variator.primary_inertia_kg_m2;
  delay.key = "delay.engine_torque";
  delay.unit = "s";
  const auto refuse = [&](const std::string& why) {
    found.text = delay.text = why;
    return std::vector{found, delay};
  };
  if (!config.estimator.torque_is_engine) {
    return refuse("primary_torque is measured at the pulley: no inertia lies between");
  }
  const std::vector<Event> all = events(logs);
  if (static_cast<int>(all.size()) < kEventsMin) {
    return refuse(
        format("%zu steps of the engine torque by %.0f Nm with the clutch closed, needs %d",
               all.size(), kStep_Nm, kEventsMin));
  }
  const BestDelay tried = best_delay(all, kShapeGrid_s);
  if (!tried.fitted.fit.solved) return refuse("the steps do not determine an inertia");
  delay.value = between_delays_s(tried);
  if (!delay.value) {
    return refuse(format("no delay of the torque between %.0f and %.0f ms fits",
                         1e3 * kDelayFirst_s, 1e3 * kDelayLast_s));
  }
  const Fitted best = fit_all(all, *delay.value);
  if (!best.fit.solved) return refuse("the steps do not determine an inertia");
  const bool brake_known = std::any_of(
      logs.begin(), logs.end(), [](const auto& log) { return !log[Role::kBrakePressed].empty(); });
  const std::string basis =
      format("%d steps of the torque at ratios %.2f to %.2f, scatter %.1f Nm, vehicle %.2f kg m2",
             best.fit.clusters, best.ratio_low, best.ratio_high, best.fit.residual_std,
             best.fit.value[1]) +
      (brake_known ? "" : ", brakes unknown: the role brake_pressed leaves their steps out");
  delay.std = delay_std_s(all);
  delay.text = "after the speeds; " + basis;
  if (delay.std > kInertiaDelayStdMax_s) {
    delay.value.reset();
    delay.text = format("known to %.0f ms only, %.0f ms would do (", 1e3 * delay.std,
                        1e3 * kInertiaDelayStdMax_s) +
                 basis + ")";
  }
  const double value = best.fit.value[0];
  const double std = best.fit.std[0];
  if (!(value > 0.0) || std > kRelativeStdMax * value) {
    found.text = format("%.3f +- %.3f kg m2, known to %.0f %% would do (", value, std,
                        100.0 * kRelativeStdMax) +
                 basis + "); lift and press the pedal at low ratios too, and while the ratio moves";
    return {found, delay};
  }
  found.value = value;
  found.std = std;
  found.text = basis;
  return {found, delay};
}

std::vector<Finding> calibrate(std::span<const diagnose::SignalTable> logs,
                               const daemon::Config& config) {
  const Finding zero = pressure_zero(logs);
  std::vector<Finding> all =
      end_stops(logs, config,
                zero.value ? PressureError{*zero.value, zero.std}
                           : PressureError{0.0, config.sensors.secondary_pressure.bias});
  all.push_back(zero);
  for (Finding& each : inertia(logs, config)) all.push_back(std::move(each));
  return all;
}

}  // namespace beltgrip::calibrate
