// beltgrip_panel: draws virtual variators, runs both methods over their traces and prints one table
// with the bounds beside it. --csv FILE writes one line per trace and method.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include "panel_run.h"

using namespace beltgrip;
using namespace beltgrip::panel;

namespace {

struct Row {
  Scenario scenario;
  Trace truth;  // without the samples
  Outcome outcome[2];
};

double percentile(std::vector<double> values, double share) {
  if (values.empty()) return std::nan("");
  const auto k = static_cast<std::size_t>(
      std::min(static_cast<double>(values.size() - 1), share * static_cast<double>(values.size())));
  std::nth_element(values.begin(), values.begin() + static_cast<std::ptrdiff_t>(k), values.end());
  return values[k];
}

void print_table(const std::vector<Row>& rows, int method) {
  std::printf("%s\n", method == 0 ? "paper" : "robust");
  std::printf(
      "  %-11s %5s %6s %6s %6s %6s | past peak p50   p90   p99   max | value%%  bias%%   sd%%  "
      "p95%%  cover | none: n  bound right  ratio p1 value\n",
      "noise", "n", "stop%", "early%", ">10%", "kinds");
  for (int noise = -1; noise < kNoiseClasses; ++noise) {
    int n = 0, stopped = 0, early = 0, beyond = 0, value = 0, covered = 0;
    int none = 0, none_right = 0, none_value = 0, none_bound = 0;
    std::vector<double> past, error, magnitude, ratio;
    double sum = 0.0, squares = 0.0;
    for (const Row& row : rows) {
      if (noise >= 0 && static_cast<int>(row.scenario.noise) != noise) continue;
      const Outcome& o = row.outcome[method];
      if (o.beyond_10_percent) ++beyond;
      if (row.truth.peak_reached) {
        ++n;
        if (o.stopped) ++stopped;
        if (o.early) ++early;
        if (row.scenario.ramp_N_per_s <= 300.0) past.push_back(o.slip_past_percent);
        if (o.peak.kind == estimator::PeakKind::kValue) {
          ++value;
          error.push_back(o.relative_error);
          magnitude.push_back(std::abs(o.relative_error));
          sum += o.relative_error;
          squares += o.relative_error * o.relative_error;
          const double truth = row.scenario.curve.mu_max;
          if (o.peak.ci95_low <= truth && truth <= o.peak.ci95_high) ++covered;
        }
      } else {
        ++none;
        if (o.peak.kind == estimator::PeakKind::kValue) ++none_value;
        if (o.peak.kind == estimator::PeakKind::kLowerBound) {
          ++none_bound;
          const double best = row.scenario.curve.family == Family::kMonotone
                                  ? row.scenario.curve.value(60.0)
                                  : row.scenario.curve.mu_max;
          if (o.peak.mu_max <= best) ++none_right;
          ratio.push_back(o.peak.mu_max / o.mu_reached);
        }
      }
    }
    const double values = std::max(1, value);
    const double mean = sum / values;
    std::printf(
        "  %-11s %5d %6.2f %6.2f %6.2f %6d | %14.2f %5.2f %5.2f %5.2f | %6.1f %6.2f %5.2f %5.2f  "
        "%5.1f | %7d %12.1f %9.3f %5d\n",
        noise < 0 ? "all" : noise_name(static_cast<NoiseClass>(noise)), n,
        100.0 * stopped / std::max(1, n), 100.0 * early / std::max(1, n),
        100.0 * beyond / std::max(1, n + none), value, percentile(past, 0.5), percentile(past, 0.9),
        percentile(past, 0.99),
        past.empty() ? std::nan("") : *std::max_element(past.begin(), past.end()),
        100.0 * value / std::max(1, n), 100.0 * mean,
        100.0 * std::sqrt(std::max(0.0, squares / values - mean * mean)),
        100.0 * percentile(magnitude, 0.95), 100.0 * covered / values, none,
        100.0 * none_right / std::max(1, none_bound), percentile(ratio, 0.01), none_value);
  }
}

}  // namespace

int main(int argc, char** argv) {
  int count = 1000;
  int threads = 2;
  std::uint64_t first = 1;
  const char* csv = nullptr;
  bool paper_traces = false, biased = false, skip_paper = false;
  for (int i = 1; i < argc; ++i) {
    const auto is = [&](const char* name) { return std::strcmp(argv[i], name) == 0; };
    if (is("--traces") && i + 1 < argc)
      count = std::atoi(argv[++i]);
    else if (is("--first") && i + 1 < argc)
      first = std::strtoull(argv[++i], nullptr, 10);
    else if (is("--threads") && i + 1 < argc)
      threads = std::atoi(argv[++i]);
    else if (is("--csv") && i + 1 < argc)
      csv = argv[++i];
    else if (is("--paper-rig"))
      paper_traces = true;
    else if (is("--biased"))
      biased = true;
    else if (is("--robust-only"))
      skip_paper = true;
    else {
      std::fprintf(stderr, "beltgrip_panel: unknown option %s\n", argv[i]);
      return 64;
    }
  }
  std::vector<Row> rows(static_cast<std::size_t>(count));
  std::mutex mutex;
  std::size_t next = 0;
  const auto work = [&] {
    for (;;) {
      std::size_t index;
      {
        const std::scoped_lock lock(mutex);
        if (next == rows.size()) return;
        index = next++;
      }
      Row& row = rows[index];
      const std::uint64_t seed = first + index;
      row.scenario =
          paper_traces ? paper_scenario(seed, index % 2 == 0 ? 0.105 : 0.100) : draw_scenario(seed);
      if (biased) plant_sensor_errors(row.scenario);
      Trace trace = simulate(row.scenario);
      for (int method = skip_paper ? 1 : 0; method < 2; ++method) {
        row.outcome[method] =
            run(row.scenario, trace,
                {.method = method == 0 ? estimator::Method::kPaper : estimator::Method::kRobust,
                 .with_accuracies = biased});
      }
      trace.samples.clear();
      row.truth.peak_reached = trace.peak_reached;
      row.truth.t_peak_s = trace.t_peak_s;
      row.truth.t_reached_s = trace.t_reached_s;
      row.truth.slip_star_peak = trace.slip_star_peak;
      row.truth.slip_star_leave = trace.slip_star_leave;
    }
  };
  std::vector<std::thread> pool;
  for (int i = 0; i < threads; ++i) pool.emplace_back(work);
  for (std::thread& thread : pool) thread.join();
  for (int method = skip_paper ? 1 : 0; method < 2; ++method) print_table(rows, method);
  if (csv != nullptr) {
    std::FILE* file = std::fopen(csv, "w");
    if (file == nullptr) {
      std::fprintf(stderr, "beltgrip_panel: cannot write %s\n", csv);
      return 73;
    }
    std::fprintf(file,
                 "seed,method,family,noise,plant,overrun,low,torque,ramp,mu,slip_peak,has_peak,"
                 "stopped,reason,early,delay,past,past_peak,kind,mu_hat,std,lo,hi,err,sigma_peak,"
                 "true_sigma_peak,t_peak,stop_s,mu_reached,desc\n");
    for (const Row& row : rows) {
      for (int method = skip_paper ? 1 : 0; method < 2; ++method) {
        const Outcome& o = row.outcome[method];
        const Scenario& s = row.scenario;
        std::fprintf(file,
                     "%llu,%s,%s,%s,%s,%d,%d,%.2f,%.1f,%.5f,%.3f,%d,%d,%d,%d,%.3f,%.3f,%.3f,%d,%."
                     "6f,%.6f,%.6f,%.6f,%.6f,%.3f,%.3f,%.3f,%.3f,%.5f,%s\n",
                     static_cast<unsigned long long>(s.seed), method == 0 ? "paper" : "robust",
                     family_name(s.curve.family), noise_name(s.noise), plant_name(s.plant),
                     s.overrun, s.low, s.torque_Nm, s.ramp_N_per_s, s.curve.mu_max,
                     s.curve.slip_peak, row.truth.peak_reached, o.stopped,
                     static_cast<int>(o.reason), o.early, o.delay_s, o.slip_past_percent,
                     o.slip_past_peak_percent, static_cast<int>(o.peak.kind), o.peak.mu_max,
                     o.peak.mu_max_std, o.peak.ci95_low, o.peak.ci95_high, o.relative_error,
                     o.peak.sigma_peak_percent, row.truth.slip_star_peak, row.truth.t_peak_s,
                     o.stop_s, o.mu_reached, describe(s).c_str());
      }
    }
    std::fclose(file);
  }
  return 0;
}
