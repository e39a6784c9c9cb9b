// One method on one trace of the panel: what came out, judged against the truth.
#pragma once

#include <array>
#include <iterator>

#include "estimator/method/slip_curve_estimator.h"
#include "virtual_variator.h"

namespace beltgrip::panel {

// What was to be expected of mu_max when true slip first came to a share of that of the peak.
inline constexpr double kForecastAt[] = {0.5, 0.7, 0.9};
struct Expected {
  bool reached = false;                        // the slip, before a stop
  double mu_max = 0.0, low = 0.0, high = 0.0;  // 0: nothing said yet
  double mu_reached = 0.0;                     // largest true mu* so far
};

struct Outcome {
  bool has_peak = false;     // the true slip went past the peak somewhere in the trace
  bool peak_passed = false;  // before the stop
  bool stopped = false;
  bool early = false;
  bool beyond_10_percent = false;
  estimator::StopReason reason = estimator::StopReason::kNone;
  double stop_s = 0.0;
  double delay_s = 0.0;            // after the true peak
  double slip_past_percent = 0.0;  // sigma* at the stop beyond that of the peak (flat top: its end)
  double slip_past_peak_percent = 0.0;
  double mu_reached = 0.0;  // largest true mu* up to the stop
  estimator::PeakEstimate peak;
  double relative_error = 0.0;  // of mu_max, where the kind is a value and there is a peak
  int conclude_calls = 0;
  std::array<Expected, std::size(kForecastAt)> expected;
  double slip_share_at_stop = 0.0;  // true slip, of that of the peak
};

struct RunOptions {
  estimator::Method method = estimator::Method::kRobust;
  bool with_accuracies = false;   // [sensors] as the scenario says
  double confidence_width = 0.0;  // > 0: stop = "confidence" with this width
};

Outcome run(const Scenario& scenario, const Trace& trace, const RunOptions& options);

}  // namespace beltgrip::panel
