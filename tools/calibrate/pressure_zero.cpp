// The pressure while nothing turns: its offset.
#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "can_dbc/text/format.h"
#include "estimator/statistics/distributions.h"
#include "estimator/statistics/interval.h"
#include "tools/calibrate/calibrate.h"
#include "tools/calibrate/series.h"

namespace beltgrip::calibrate {

namespace {

using daemon::Role;

constexpr double kStandstill_rad_s = 0.5;
constexpr double kDrained_s = 3.0;  // after the last motion
constexpr double kWindow_s = 1.0;
constexpr double kOffsetMax_Pa = 500e3;
constexpr double kDriftMax_Pa_s = 2e3;

bool still(const Series& engine, const Series& primary, double from_s, double to_s) {
  constexpr double kStep_s = 0.1;
  for (double t = from_s; t <= to_s; t += kStep_s) {
    const auto e = engine.at(t);
    const auto p = primary.at(t);
    if (!e || !p || std::abs(*e) > kStandstill_rad_s || std::abs(*p) > kStandstill_rad_s) {
      return false;
    }
  }
  return true;
}

}  // namespace

Finding pressure_zero(std::span<const diagnose::SignalTable> logs) {
  Finding found;
  found.key = "signals.secondary_pressure";
  found.unit = "Pa";
  std::vector<double> means;
  double resolution_Pa = 0.0, lowest_Pa = std::numeric_limits<double>::infinity(), drift_Pa_s = 0.0,
         variance = 0.0;
  bool engine_known = false;
  for (const diagnose::SignalTable& log : logs) {
    const Series engine(log[Role::kEngineSpeed]), primary(log[Role::kPrimarySpeed]),
        pressure(log[Role::kSecondaryPressure]);
    if (engine.empty() || primary.empty() || pressure.empty()) continue;
    engine_known = true;
    resolution_Pa = std::max(resolution_Pa, pressure.resolution());
    for (const double each : log[Role::kSecondaryPressure].value) {
      lowest_Pa = std::min(lowest_Pa, each);
    }
    const double begin = std::max(pressure.begin_s(), engine.begin_s());
    const double end = std::min(pressure.end_s(), engine.end_s());
    // A log may begin with the key, drained; what has turned before must drain first.
    double still_since = begin;
    bool moved = false;
    for (double t = begin; t + kWindow_s < end; t += kWindow_s) {
      if (!still(engine, primary, t, t + kWindow_s)) {
        still_since = t + kWindow_s;
        moved = true;
        continue;
      }
      if (moved && t - still_since < kDrained_s) continue;
      const auto mean = pressure.mean(t, t + kWindow_s);
      if (!mean) continue;
      if (!means.empty())
        drift_Pa_s = std::max(drift_Pa_s, std::abs(*mean - means.back()) / kWindow_s);
      means.push_back(*mean);
      variance += (pressure.variance(t, t + kWindow_s).value_or(0.0) - variance) /
                  static_cast<double>(means.size());
    }
  }
  if (!engine_known) {
    found.text =
        "needs the role engine_speed: where the engine idles, the pump runs at a standstill";
    return found;
  }
  if (means.size() < 3) {
    found.text = format(
        "%zu seconds with engine and pulleys at rest, needs 3: record from key-on, "
        "before the engine starts",
        means.size());
    return found;
  }
  double mean = 0.0;
  for (const double each : means) mean += each / static_cast<double>(means.size());
  if (std::abs(mean) > kOffsetMax_Pa) {
    found.text = format("reads %.0f kPa at rest: no offset of a sensor", 1e-3 * mean);
    return found;
  }
  if (drift_Pa_s > kDriftMax_Pa_s + resolution_Pa) {
    found.text =
        format("moves by %.1f kPa a second at rest: it has not drained", 1e-3 * drift_Pa_s);
    return found;
  }
  const bool clipped = mean <= lowest_Pa && std::all_of(means.begin(), means.end(),
                                                        [&](double each) { return each == mean; });
  if (clipped && mean == 0.0) {
    found.text = "reads exactly 0 at rest, its lowest value: an offset below it would not be seen";
    return found;
  }
  double squares = 0.0;
  for (const double each : means) squares += (each - mean) * (each - mean);
  const auto n = static_cast<double>(means.size());
  const double scatter = std::sqrt(squares / (n - 1.0) / n) *
                         estimator::student_quantile(estimator::kUpper95, n - 1.0) /
                         estimator::kNormal95;
  // Rounded values that stand still may lie anywhere within their step; noise of more than a step
  // averages the rounding out, by exp(-2 pi^2 (noise / step)^2).
  const double step_square = resolution_Pa * resolution_Pa;
  const double noise_square = std::max(0.0, variance - step_square / 12.0);
  const double averaged =
      step_square > 0.0
          ? std::exp(-2.0 * std::numbers::pi * std::numbers::pi * noise_square / step_square)
          : 0.0;
  const double rounding = resolution_Pa / std::sqrt(12.0) * averaged;
  found.value = mean;
  found.std = std::hypot(scatter, rounding);
  found.text = format("%zu seconds with engine and pulleys at rest, steps of %.2g kPa",
                      means.size(), 1e-3 * resolution_Pa);
  return found;
}

}  // namespace beltgrip::calibrate
