// From many traces to the figures of the table: how often and when it stopped, how well mu_max came
// out, and what was possible. Shares and errors in percent, slip in percentage points.
#pragma once

#include <cstdio>
#include <functional>
#include <optional>
#include <vector>

#include "bound.h"
#include "panel_run.h"

namespace beltgrip::panel {

struct Judged {  // one trace
  Scenario scenario;
  bool has_peak = false;
  double mu_max = 0.0;  // the truth
  double omega_p_at_peak_rad_s = 0.0;
  Outcome paper, robust;
  double bound = 0.0;  // of the relative deviation of mu_max, from the data up to robust's stop
  double reached_bound = 0.0;  // the same of the largest mu*, where there is no peak
  DetectionBound detection;
};

struct JudgeOptions {
  bool biased = false;            // constant sensor errors, with their widths configured
  bool paper = true;              // run that method as well
  double confidence_width = 0.0;  // > 0: robust with stop = "confidence"
  Disturbance disturbance = Disturbance::kNone;
};

Judged judge(Scenario scenario, const JudgeOptions& options);
// Traces first .. first + count - 1, in order, on so many threads.
std::vector<Judged> judge_many(const std::function<Scenario(std::uint64_t)>& scenario,
                               std::uint64_t first, int count, int threads,
                               const JudgeOptions& options);

struct Figures {
  int peaks = 0, others = 0;  // traces
  double stopped = 0.0, early = 0.0;
  double beyond_10 = 0.0;                                 // of all traces
  double past_p50 = 0.0, past_p90 = 0.0, past_p99 = 0.0;  // ramps up to 300 N/s
  double detector_p90 = 0.0, detector_p99 = 0.0;          // what no detector can beat
  double delay_p50_s = 0.0, detector_delay_p50_s = 0.0;   // after the peak
  double value = 0.0;                                     // of the traces with a peak
  double bias = 0.0, sd = 0.0, p95 = 0.0, covered = 0.0;  // of the values
  double bound = 0.0;        // root mean square, of the values whose bound is below kBoundCounts
  double sd_by_bound = 0.0;  // root mean square of their errors, divided by it
  double bound_right = 0.0;  // of all lower bounds
  // Of the traces without a peak:
  double other_value = 0.0;     // wrongly a value
  double bound_share = 0.0;     // lower bounds of at least 0.97 of what was reached
  double bound_possible = 0.0;  // of the traces, what an efficient estimate's 99 % bounds come to
  double bound_share_carried = 0.0;  // bound_share where the data carry it in 99 %
  double bound_p1 = 0.0;             // bound / reached that 99 % exceed
  int carried = 0;
};

// Slip at the stop is judged on ramps up to this: the default of ramp_rate_max_N_per_s.
inline constexpr double kSlowRamp_N_per_s = 300.0;

// A stop at the very peak leaves data that do not determine mu_max at all.
inline constexpr double kBoundCounts = 0.05;

Figures figures(const std::vector<Judged>& traces, estimator::Method method,
                std::optional<NoiseClass> noise);
void print_table(std::FILE* out, const std::vector<Judged>& traces, bool paper);
// The stop of robust where the primary still turned, at the peak, as fast as the daemon asks in an
// experiment, and where it was pulled below that.
void print_stops_by_speed(std::FILE* out, const std::vector<Judged>& traces);
// Before the peak: how often, how right and how wide the interval was.
void print_forecasts(std::FILE* out, const std::vector<Judged>& traces);
struct ForecastFigures {
  int reached = 0;       // traces whose slip came there before a stop
  double said = 0.0;     // of them with an interval, percent
  double covered = 0.0;  // of those, percent
  double behind = 0.0;   // of those, the whole interval below what mu* has reached, percent
  double width_p50 = 0.0, error_p50 = 0.0;  // percent of mu_max
};
ForecastFigures forecast_figures(const std::vector<Judged>& traces, std::size_t at,
                                 std::optional<NoiseClass> noise);
// Of traces with a peak that were disturbed, percent.
struct DisturbedFigures {
  int traces = 0;
  double flagged = 0.0;   // the result says that its points contradict each other
  double no_value = 0.0;  // otherwise none
  double right = 0.0;     // a value with the truth in its interval
  double wrong = 0.0;     // a value, silently without it
  double far_off = 0.0;   // of these, by more than 3 %
};
DisturbedFigures disturbed_figures(const std::vector<Judged>& traces,
                                   std::optional<NoiseClass> noise);
void print_disturbed(std::FILE* out, const std::vector<Judged>& traces);
// With stop = "confidence": how often it ended so, where, and how right.
void print_confidence(std::FILE* out, const std::vector<Judged>& traces);
// One line per trace and method. False if it could not be written.
bool write_csv(const char* path, const std::vector<Judged>& traces, bool paper);

}  // namespace beltgrip::panel
