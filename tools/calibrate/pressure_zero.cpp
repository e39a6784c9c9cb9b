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

// What the logs show while engine and pulleys rest.
struct AtRest {
  std::vector<double> means_Pa;  // of a second each
  double resolution_Pa = 0.0, lowest_Pa = std::numeric_limits<double>::infinity();
  double drift_Pa_s = 0.0, variance_Pa2 = 0.0;
  bool engine_known = false;

  double mean_Pa() const {
    double mean = 0.0;
    for (const double each : means_Pa) mean += each / static_cast<double>(means_Pa.size());
    return mean;
  }
  void add(double mean_of_second_Pa, double variance_of_second_Pa2) {
    if (!means_Pa.empty()) {
      drift_Pa_s = std::max(drift_Pa_s, std::abs(mean_of_second_Pa - means_Pa.back()) / kWindow_s);
    }
    means_Pa.push_back(mean_of_second_Pa);
    variance_Pa2 += (variance_of_second_Pa2 - variance_Pa2) / static_cast<double>(means_Pa.size());
  }
};

void read_at_rest(const diagnose::SignalTable& log, AtRest& out) {
  const Series engine(log[Role::kEngineSpeed]), primary(log[Role::kPrimarySpeed]),
      pressure(log[Role::kSecondaryPressure]);
  if (engine.empty() || primary.empty() || pressure.empty()) return;
  out.engine_known = true;
  out.resolution_Pa = std::max(out.resolution_Pa, pressure.resolution());
  for (const double each : log[Role::kSecondaryPressure].value) {
    out.lowest_Pa = std::min(out.lowest_Pa, each);
  }
  const double begin_s = std::max(pressure.begin_s(), engine.begin_s());
  const double end_s = std::min(pressure.end_s(), engine.end_s());
  // A log may begin with the key, drained; what has turned before must drain first.
  double still_since_s = begin_s;
  bool moved = false;
  for (double t = begin_s; t + kWindow_s < end_s; t += kWindow_s) {
    if (!still(engine, primary, t, t + kWindow_s)) {
      still_since_s = t + kWindow_s;
      moved = true;
      continue;
    }
    if (moved && t - still_since_s < kDrained_s) continue;
    if (const auto mean = pressure.mean(t, t + kWindow_s)) {
      out.add(*mean, pressure.variance(t, t + kWindow_s).value_or(0.0));
    }
  }
}

// Why these readings tell no offset; empty: they do.
std::string refusal(const AtRest& rest) {
  if (!rest.engine_known) {
    return "needs the role engine_speed: where the engine idles, the pump runs at a standstill";
  }
  if (rest.means_Pa.size() < 3) {
    return format(
        "%zu seconds with engine and pulleys at rest, needs 3: record from key-on, "
        "before the engine starts",
        rest.means_Pa.size());
  }
  const double mean_Pa = rest.mean_Pa();
  if (std::abs(mean_Pa) > kOffsetMax_Pa) {
    return format("reads %.0f kPa at rest: no offset of a sensor", 1e-3 * mean_Pa);
  }
  if (rest.drift_Pa_s > kDriftMax_Pa_s + rest.resolution_Pa) {
    return format("moves by %.1f kPa a second at rest: it has not drained", 1e-3 * rest.drift_Pa_s);
  }
  const bool clipped =
      mean_Pa <= rest.lowest_Pa && std::all_of(rest.means_Pa.begin(), rest.means_Pa.end(),
                                               [&](double each) { return each == mean_Pa; });
  if (clipped && mean_Pa == 0.0) {
    return "reads exactly 0 at rest, its lowest value: an offset below it would not be seen";
  }
  return {};
}

double standard_error_Pa(const AtRest& rest) {
  const double mean_Pa = rest.mean_Pa();
  double squares = 0.0;
  for (const double each : rest.means_Pa) squares += (each - mean_Pa) * (each - mean_Pa);
  const auto n = static_cast<double>(rest.means_Pa.size());
  const double scatter_Pa = std::sqrt(squares / (n - 1.0) / n) *
                            estimator::student_quantile(estimator::kUpper95, n - 1.0) /
                            estimator::kNormal95;
  // Rounded values that stand still may lie anywhere within their step; noise of more than a step
  // averages the rounding out, by exp(-2 pi^2 (noise / step)^2).
  const double step_square = rest.resolution_Pa * rest.resolution_Pa;
  const double noise_square = std::max(0.0, rest.variance_Pa2 - step_square / 12.0);
  const double averaged =
      step_square > 0.0
          ? std::exp(-2.0 * std::numbers::pi * std::numbers::pi * noise_square / step_square)
          : 0.0;
  return std::hypot(scatter_Pa, rest.resolution_Pa / std::sqrt(12.0) * averaged);
}

}  // namespace

Finding pressure_zero(std::span<const diagnose::SignalTable> logs) {
  Finding found;
  found.key = "signals.secondary_pressure";
  found.unit = "Pa";
  AtRest rest;
  for (const diagnose::SignalTable& log : logs) read_at_rest(log, rest);
  found.text = refusal(rest);
  if (!found.text.empty()) return found;
  found.value = rest.mean_Pa();
  found.std = standard_error_Pa(rest);
  found.text = format("%zu seconds with engine and pulleys at rest, steps of %.2g kPa",
                      rest.means_Pa.size(), 1e-3 * rest.resolution_Pa);
  return found;
}

}  // namespace beltgrip::calibrate
