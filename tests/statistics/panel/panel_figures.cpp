#include "panel_figures.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <iterator>
#include <thread>

#include "drawing.h"
#include "percentile.h"

namespace beltgrip::panel {
namespace {

using estimator::Method;
using estimator::PeakKind;

constexpr double kLeastSpeed_rad_s = 0.85 * 105.0;  // the daemon's, by default; slower: it ends
constexpr double kBoundWanted = 0.97;
constexpr double kOneSided99 = 2.326;
constexpr std::size_t kOnePoint = static_cast<std::size_t>(1.0 / kPastStep_percent + 0.5);

const Outcome& outcome(const Judged& trace, Method method) {
  return method == Method::kPaper ? trace.paper : trace.robust;
}

}  // namespace

Judged judge(Scenario scenario, const JudgeOptions& options) {
  if (options.biased) plant_sensor_errors(scenario);
  if (options.disturbance != Disturbance::kNone) plant_disturbance(scenario, options.disturbance);
  const Trace trace = simulate(scenario);
  const RunOptions robust{.method = Method::kRobust,
                          .with_accuracies = options.biased,
                          .confidence_width = options.confidence_width};
  const RunOptions paper{.method = Method::kPaper, .with_accuracies = options.biased};
  Judged out;
  out.has_peak = trace.peak_reached;
  out.mu_max = trace.mu_max;
  if (out.has_peak) {
    const auto at = static_cast<std::size_t>(trace.t_peak_s * scenario.sample_rate_hz);
    out.omega_p_at_peak_rad_s = trace.samples[std::min(at, trace.samples.size() - 1)].omega_p_rad_s;
  }
  out.robust = run(scenario, trace, robust);
  if (options.paper) out.paper = run(scenario, trace, paper);
  out.bound = mu_max_bound(scenario, trace, out.robust.stop_s);
  if (!out.has_peak) out.reached_bound = reached_bound(scenario, trace, out.robust.stop_s);
  out.detection = detection_bound(scenario, trace);
  out.scenario = std::move(scenario);
  return out;
}

std::vector<Judged> judge_many(const std::function<Scenario(std::uint64_t)>& scenario,
                               std::uint64_t first, int count, int threads,
                               const JudgeOptions& options) {
  std::vector<Judged> out(static_cast<std::size_t>(count));
  std::atomic<std::size_t> next = 0;
  const auto work = [&] {
    for (std::size_t i = next++; i < out.size(); i = next++) {
      out[i] = judge(scenario(first + i), options);
    }
  };
  std::vector<std::thread> pool;
  for (int i = 1; i < threads; ++i) pool.emplace_back(work);
  work();
  for (std::thread& thread : pool) thread.join();
  return out;
}

Figures figures(const std::vector<Judged>& traces, Method method, std::optional<NoiseClass> noise) {
  Figures f;
  int stopped = 0, early = 0, beyond = 0, values = 0, covered = 0, counted = 0;
  int other_values = 0, all_bounds = 0, bounds = 0, right = 0, close = 0, carried_close = 0;
  double possible = 0.0;
  std::vector<double> past, delay, detector_delay, magnitude, ratio;
  std::array<double, kPastSteps> detector{};  // sum of probabilities
  double sum = 0.0, squares = 0.0, counted_squares = 0.0, bound_squares = 0.0;
  for (const Judged& trace : traces) {
    if (noise && trace.scenario.noise != *noise) continue;
    const Outcome& o = outcome(trace, method);
    if (o.beyond_10_percent) ++beyond;
    if (o.peak.kind == PeakKind::kLowerBound) {
      ++all_bounds;
      if (o.peak.mu_max <= std::max(trace.mu_max, o.mu_reached)) ++right;
    }
    if (!trace.has_peak) {
      ++f.others;
      if (o.peak.kind == PeakKind::kValue) ++other_values;
      if (o.peak.kind != PeakKind::kLowerBound) continue;
      ++bounds;
      const bool is_close = o.peak.mu_max >= kBoundWanted * o.mu_reached;
      if (is_close) ++close;
      // A bound at 99 % lies 2.3 deviations below an estimate that itself scatters by one.
      const double room = (1.0 - kBoundWanted) / trace.reached_bound - kOneSided99;
      possible += 0.5 * std::erfc(-room / std::sqrt(2.0));
      if (room > kOneSided99) {
        ++f.carried;
        if (is_close) ++carried_close;
      }
      ratio.push_back(o.peak.mu_max / o.mu_reached);
      continue;
    }
    ++f.peaks;
    if (o.stopped) ++stopped;
    if (o.early) ++early;
    if (trace.scenario.ramp_N_per_s <= kSlowRamp_N_per_s) {
      past.push_back(o.slip_past_percent);
      delay.push_back(o.delay_s);
      for (std::size_t i = 0; i < kPastSteps; ++i) detector[i] += trace.detection.stopped[i];
      detector_delay.push_back(trace.detection.delay_s);
    }
    if (o.peak.kind != PeakKind::kValue) continue;
    ++values;
    const double truth = trace.mu_max;
    if (o.peak.ci95_low <= truth && truth <= o.peak.ci95_high) ++covered;
    magnitude.push_back(std::abs(o.relative_error));
    sum += o.relative_error;
    squares += o.relative_error * o.relative_error;
    if (trace.bound > 0.0 && trace.bound < kBoundCounts) {
      ++counted;
      counted_squares += o.relative_error * o.relative_error;
      bound_squares += trace.bound * trace.bound;
    }
  }
  f.stopped = share(stopped, f.peaks);
  f.early = share(early, f.peaks);
  f.beyond_10 = share(beyond, f.peaks + f.others);
  f.past_p50 = percentile(past, 0.5);
  f.past_p90 = percentile(past, 0.9);
  f.past_p99 = percentile(past, 0.99);
  const auto past_bound = [&](double wanted) {
    std::size_t i = 0;
    while (i + 1 < kPastSteps && detector[i] < wanted * static_cast<double>(past.size())) ++i;
    return kPastStep_percent * static_cast<double>(i);
  };
  f.detector_p90 = past_bound(0.9);
  f.detector_p99 = past_bound(0.99);
  f.delay_p50_s = percentile(delay, 0.5);
  f.detector_delay_p50_s = percentile(detector_delay, 0.5);
  f.value = share(values, f.peaks);
  const double n = std::max(1, values);
  f.bias = 100.0 * sum / n;
  f.sd = 100.0 * std::sqrt(std::max(0.0, squares / n - sum * sum / (n * n)));
  f.p95 = 100.0 * percentile(magnitude, 0.95);
  f.covered = share(covered, values);
  f.bound = 100.0 * std::sqrt(bound_squares / std::max(1, counted));
  f.sd_by_bound = std::sqrt(counted_squares / std::max(1e-12, bound_squares));
  f.other_value = share(other_values, f.others);
  f.bound_right = share(right, all_bounds);
  f.bound_share = share(close, bounds);
  f.bound_possible = bounds > 0 ? 100.0 * possible / bounds : 0.0;
  f.bound_share_carried = share(carried_close, f.carried);
  f.bound_p1 = percentile(ratio, 0.01);
  return f;
}

void print_table(std::FILE* out, const std::vector<Judged>& traces, bool paper) {
  std::fprintf(
      out,
      "| method | noise | peaks | stop | early | past the peak p50 / p90 / p99 (no detector below "
      "p90 / p99) | > 10 %% | delay p50 (bound) | value | bias | sd | p95 | bound | rms / "
      "bound | in ci95 | no peak | value | bound right | >= 0.97 "
      "(possible) | where the data carry it |\n"
      "|---|---|---|---|---|---|---|---|---|---|---|---|---|---|---|---|---|---|---|---|\n");
  for (const Method method : {Method::kPaper, Method::kRobust}) {
    if (method == Method::kPaper && !paper) continue;
    for (int i = -1; i < kNoiseClasses; ++i) {
      const auto noise = static_cast<NoiseClass>(std::max(0, i));
      const Figures f = figures(traces, method, i < 0 ? std::nullopt : std::optional(noise));
      std::fprintf(out,
                   "| %s | %s | %d | %.1f %% | %.1f %% | %.2f / %.2f / %.2f (%.2f / %.2f) | %.1f "
                   "%% | %.2f s (%.2f s) | %.1f %% | %+.2f %% | %.2f %% | %.2f %% | %.2f %% | %.2f "
                   "| %.1f %% | %d | %.1f %% | %.1f %% | %.1f %% (%.1f %%) | %.1f %% of %d |\n",
                   method == Method::kPaper ? "paper" : "robust", i < 0 ? "all" : noise_name(noise),
                   f.peaks, f.stopped, f.early, f.past_p50, f.past_p90, f.past_p99, f.detector_p90,
                   f.detector_p99, f.beyond_10, f.delay_p50_s, f.detector_delay_p50_s, f.value,
                   f.bias, f.sd, f.p95, f.bound, f.sd_by_bound, f.covered, f.others, f.other_value,
                   f.bound_right, f.bound_share, f.bound_possible, f.bound_share_carried,
                   f.carried);
    }
  }
}

void print_stops_by_speed(std::FILE* out, const std::vector<Judged>& traces) {
  std::fprintf(
      out,
      "| primary at the peak | noise | peaks | stop | early | past the peak p50 / p90 / p99 "
      "| > 10 %% |\n|---|---|---|---|---|---|---|\n");
  for (const bool fast : {true, false}) {
    std::vector<Judged> some;
    std::copy_if(traces.begin(), traces.end(), std::back_inserter(some), [fast](const Judged& t) {
      return t.has_peak && (t.omega_p_at_peak_rad_s >= kLeastSpeed_rad_s) == fast;
    });
    for (int i = -1; i < kNoiseClasses; ++i) {
      const auto noise = static_cast<NoiseClass>(std::max(0, i));
      const Figures f = figures(some, Method::kRobust, i < 0 ? std::nullopt : std::optional(noise));
      std::fprintf(
          out, "| %s %.0f rad/s | %s | %d | %.1f %% | %.1f %% | %.2f / %.2f / %.2f | %.1f %% |\n",
          fast ? "from" : "below", kLeastSpeed_rad_s, i < 0 ? "all" : noise_name(noise), f.peaks,
          f.stopped, f.early, f.past_p50, f.past_p90, f.past_p99, f.beyond_10);
    }
  }
}

ForecastFigures forecast_figures(const std::vector<Judged>& traces, std::size_t at,
                                 std::optional<NoiseClass> noise) {
  ForecastFigures f;
  int said = 0, covered = 0, behind = 0;
  std::vector<double> width, error;
  for (const Judged& trace : traces) {
    const Expected& e = trace.robust.expected[at];
    if (!e.reached || (noise && trace.scenario.noise != *noise)) continue;
    ++f.reached;
    if (e.mu_max <= 0.0) continue;
    ++said;
    const double truth = trace.mu_max;
    if (e.low <= truth && truth <= e.high) ++covered;
    if (e.high < e.mu_reached) ++behind;
    width.push_back(100.0 * (e.high - e.low) / truth);
    error.push_back(100.0 * std::abs(e.mu_max / truth - 1.0));
  }
  f.said = share(said, f.reached);
  f.covered = share(covered, said);
  f.behind = share(behind, said);
  f.width_p50 = percentile(width, 0.5);
  f.error_p50 = percentile(error, 0.5);
  return f;
}

void print_forecasts(std::FILE* out, const std::vector<Judged>& traces) {
  std::fprintf(out,
               "| slip, of that at the peak | noise | traces | with an interval | truth in it | "
               "below what was reached | width p50 | error p50 |\n"
               "|---|---|---|---|---|---|---|---|\n");
  for (std::size_t at = 0; at < std::size(kForecastAt); ++at) {
    for (int i = -1; i < kNoiseClasses; ++i) {
      const auto noise = static_cast<NoiseClass>(std::max(0, i));
      const ForecastFigures f =
          forecast_figures(traces, at, i < 0 ? std::nullopt : std::optional(noise));
      std::fprintf(out, "| %.0f %% | %s | %d | %.1f %% | %.1f %% | %.1f %% | %.1f %% | %.1f %% |\n",
                   100.0 * kForecastAt[at], i < 0 ? "all" : noise_name(noise), f.reached, f.said,
                   f.covered, f.behind, f.width_p50, f.error_p50);
    }
  }
}

DisturbedFigures disturbed_figures(const std::vector<Judged>& traces,
                                   std::optional<NoiseClass> noise) {
  DisturbedFigures f;
  int flagged = 0, none = 0, right = 0, wrong = 0, far = 0;
  for (const Judged& trace : traces) {
    if (!trace.has_peak || (noise && trace.scenario.noise != *noise)) continue;
    ++f.traces;
    const estimator::PeakEstimate& peak = trace.robust.peak;
    const double truth = trace.mu_max;
    if (peak.contradictory) {
      ++flagged;
    } else if (peak.kind != PeakKind::kValue) {
      ++none;
    } else if (peak.ci95_low <= truth && truth <= peak.ci95_high) {
      ++right;
    } else {
      ++wrong;
      if (std::abs(peak.mu_max / truth - 1.0) > 0.03) ++far;
    }
  }
  f.flagged = share(flagged, f.traces);
  f.no_value = share(none, f.traces);
  f.right = share(right, f.traces);
  f.wrong = share(wrong, f.traces);
  f.far_off = share(far, f.traces);
  return f;
}

void print_disturbed(std::FILE* out, const std::vector<Judged>& traces) {
  std::fprintf(out,
               "| disturbance | noise | traces | flagged | else no value | truth in ci95 | value "
               "without it | off by 3 %% |\n|---|---|---|---|---|---|---|---|\n");
  for (int i = -1; i < kNoiseClasses; ++i) {
    const auto noise = static_cast<NoiseClass>(std::max(0, i));
    const DisturbedFigures f =
        disturbed_figures(traces, i < 0 ? std::nullopt : std::optional(noise));
    std::fprintf(out, "| %s | %s | %d | %.1f %% | %.1f %% | %.1f %% | %.1f %% | %.1f %% |\n",
                 disturbance_name(traces.front().scenario.disturbance),
                 i < 0 ? "all" : noise_name(noise), f.traces, f.flagged, f.no_value, f.right,
                 f.wrong, f.far_off);
  }
}

void print_confidence(std::FILE* out, const std::vector<Judged>& traces) {
  std::fprintf(
      out,
      "| noise | ended by confidence | of these before the peak | slip there, of the "
      "peak's, p50 / p90 | error p50 / p95 | truth in ci95 |\n|---|---|---|---|---|---|\n");
  for (int i = -1; i < kNoiseClasses; ++i) {
    const auto noise = static_cast<NoiseClass>(std::max(0, i));
    int peaks = 0, ended = 0, before = 0, covered = 0;
    std::vector<double> slip_percent, error;
    for (const Judged& trace : traces) {
      if (!trace.has_peak || (i >= 0 && trace.scenario.noise != noise)) continue;
      ++peaks;
      const Outcome& o = trace.robust;
      if (o.reason != estimator::StopReason::kConfidence) continue;
      ++ended;
      if (o.slip_share_at_stop < 1.0) ++before;
      slip_percent.push_back(100.0 * o.slip_share_at_stop);
      error.push_back(100.0 * std::abs(o.relative_error));
      const double truth = trace.mu_max;
      if (o.peak.ci95_low <= truth && truth <= o.peak.ci95_high) ++covered;
    }
    std::fprintf(out,
                 "| %s | %.1f %% | %.1f %% | %.0f %% / %.0f %% | %.1f %% / %.1f %% | %.1f %% |\n",
                 i < 0 ? "all" : noise_name(noise), share(ended, peaks), share(before, ended),
                 percentile(slip_percent, 0.5), percentile(slip_percent, 0.9),
                 percentile(error, 0.5), percentile(error, 0.95), share(covered, ended));
  }
}

bool write_csv(const char* path, const std::vector<Judged>& traces, bool paper) {
  std::FILE* file = std::fopen(path, "w");
  if (file == nullptr) return false;
  std::fprintf(file,
               "seed,method,family,noise,plant,overrun,low,torque,ramp,mu,slip_peak,has_peak,"
               "stopped,reason,early,delay,past,past_peak,kind,mu_hat,std,lo,hi,err,sigma_peak,"
               "stop_s,mu_reached,bound,reached_bound,det_stopped_1_point,det_delay,desc\n");
  for (const Judged& trace : traces) {
    for (const Method method : {Method::kPaper, Method::kRobust}) {
      if (method == Method::kPaper && !paper) continue;
      const Outcome& o = outcome(trace, method);
      const Scenario& s = trace.scenario;
      std::fprintf(
          file,
          "%llu,%s,%s,%s,%s,%d,%d,%.2f,%.1f,%.5f,%.3f,%d,%d,%d,%d,%.3f,%.3f,%.3f,%d,%.6f,%.6f,"
          "%.6f,%.6f,%.6f,%.3f,%.3f,%.5f,%.6f,%.6f,%.3f,%.3f,%s\n",
          static_cast<unsigned long long>(s.seed), method == Method::kPaper ? "paper" : "robust",
          family_name(s.curve.family()), noise_name(s.noise), plant_name(s.plant), s.overrun, s.low,
          s.torque_Nm, s.ramp_N_per_s, trace.mu_max, s.curve.slip_peak_percent(), trace.has_peak,
          o.stopped, static_cast<int>(o.reason), o.early, o.delay_s, o.slip_past_percent,
          o.slip_past_peak_percent, static_cast<int>(o.peak.kind), o.peak.mu_max, o.peak.mu_max_std,
          o.peak.ci95_low, o.peak.ci95_high, o.relative_error, o.peak.sigma_peak_percent, o.stop_s,
          o.mu_reached, trace.bound, trace.reached_bound, trace.detection.stopped[kOnePoint],
          trace.detection.delay_s, describe(s).c_str());
    }
  }
  return std::fclose(file) == 0;
}

}  // namespace beltgrip::panel
