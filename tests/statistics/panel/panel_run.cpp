#include "panel_run.h"

#include <algorithm>

#include "estimator/choice/make_estimator.h"

namespace beltgrip::panel {

estimator::EstimatorSettings settings_of(const Scenario& scenario, estimator::Method method) {
  estimator::EstimatorSettings settings;
  settings.method = method;
  settings.ratio = estimator::RatioChoice::kEither;
  settings.torque_is_engine = scenario.plant == PlantKind::kCarEngine;
  settings.sample_rate_hz = scenario.sample_rate_hz;
  return settings;
}

Outcome run(const Scenario& scenario, const Trace& trace, const RunOptions& options) {
  estimator::EstimatorSettings settings = settings_of(scenario, options.method);
  if (options.confidence_width > 0.0) {
    settings.stop_rule = estimator::StopRule::kConfidence;
    settings.confidence_width = options.confidence_width;
  }
  const auto estimator = estimator::make_slip_curve_estimator(
      settings, scenario.variator,
      options.with_accuracies ? scenario.accuracies : estimator::SensorAccuracies{});
  Outcome out;
  out.has_peak = trace.peak_reached;
  const double sample_s = 1.0 / scenario.sample_rate_hz;
  std::size_t last = 0;
  for (std::size_t i = 0; i < trace.samples.size(); ++i) {
    last = i;
    const estimator::CurveEstimate& now = estimator->step(trace.samples[i]);
    out.mu_reached = std::max(out.mu_reached, trace.mu[i]);
    for (std::size_t k = 0; k < std::size(kForecastAt); ++k) {
      if (!out.has_peak || out.expected[k].reached ||
          trace.slip_percent[i] < kForecastAt[k] * scenario.curve.slip_peak_percent()) {
        continue;
      }
      out.expected[k] = {true, now.mu_max_expected, now.mu_max_low, now.mu_max_high,
                         out.mu_reached};
    }
    if (now.stop != estimator::StopReason::kNone) {
      out.stopped = true;
      out.reason = now.stop;
      break;
    }
  }
  out.stop_s = static_cast<double>(last) * sample_s;
  out.slip_share_at_stop = trace.slip_percent[last] / scenario.curve.slip_peak_percent();
  out.peak_passed = trace.peak_reached && out.stop_s >= trace.t_peak_s;
  out.delay_s = out.stop_s - trace.t_peak_s;
  out.early = out.stopped && out.stop_s < trace.t_reached_s;
  out.beyond_10_percent =
      trace.slip_star_percent[last] > 10.0 + std::max(0.0, trace.slip_star_percent[0]);
  out.slip_past_peak_percent = trace.slip_star_percent[last] - trace.slip_star_peak_percent;
  out.slip_past_percent = scenario.curve.family() == Family::kPlateau
                              ? trace.slip_star_percent[last] - trace.slip_star_leave_percent
                              : out.slip_past_peak_percent;
  do {
    ++out.conclude_calls;
    if (++last < trace.samples.size()) estimator->step(trace.samples[last]);
  } while (!estimator->conclude() && out.conclude_calls < 1000000);
  out.peak = estimator->peak();
  if (out.peak.kind == estimator::PeakKind::kValue) {
    out.relative_error = out.peak.mu_max / trace.mu_max - 1.0;
  }
  return out;
}

}  // namespace beltgrip::panel
