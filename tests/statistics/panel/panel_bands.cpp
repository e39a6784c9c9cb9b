#include "panel_bands.h"

#include <algorithm>
#include <cmath>
#include <string>

#include "percentile.h"

namespace beltgrip::panel {
namespace {

using estimator::PeakEstimate;
using estimator::PeakKind;

bool is_refused(const PeakEstimate& peak) { return peak.contradictory || peak.impossible; }

bool holds(const PeakEstimate& peak, double truth) {
  return peak.noise_low <= truth && truth <= peak.noise_high;
}

std::string band_name(int band) {
  const auto end = [](int i) {
    char text[16];
    std::snprintf(text, sizeof text, "%.1f", kBandEnds_percent[static_cast<std::size_t>(i)]);
    return std::string(text);
  };
  if (band == 0) return "below " + end(0);
  if (band == kBands - 1) return "above " + end(kBands - 2);
  return end(band - 1) + " to " + end(band);
}

}  // namespace

int band_of(double slip_peak_percent) {
  const auto* const end =
      std::upper_bound(kBandEnds_percent.begin(), kBandEnds_percent.end(), slip_peak_percent);
  return static_cast<int>(end - kBandEnds_percent.begin());
}

BandFigures band_figures(const std::vector<Judged>& traces, NoiseClass noise,
                         std::optional<int> band) {
  BandFigures f;
  int values = 0, narrow = 0, covered = 0, refused = 0;
  std::vector<double> error, rig, car;
  for (const Judged& trace : traces) {
    const Scenario& s = trace.scenario;
    if (!trace.has_peak || s.noise != noise) continue;
    if (band && band_of(s.curve.slip_peak_percent()) != *band) continue;
    const Outcome& o = trace.robust;
    ++f.traces;
    if (is_refused(o.peak)) ++refused;
    if (s.ramp_N_per_s <= kSlowRamp_N_per_s) {
      (is_car(s.plant) ? car : rig).push_back(o.slip_past_percent);
    }
    if (o.peak.kind != PeakKind::kValue) continue;
    ++values;
    error.push_back(std::abs(o.relative_error));
    if (holds(o.peak, trace.mu_max)) ++covered;
    if (o.peak.noise_high - o.peak.noise_low <= 2.0 * kValueWidth * o.peak.mu_max) ++narrow;
  }
  f.value = share(values, f.traces);
  f.narrow = share(narrow, f.traces);
  f.p95 = 100.0 * percentile(error, 0.95);
  f.covered = share(covered, values);
  f.rig_past_p90 = percentile(rig, 0.9);
  f.rig_past_p99 = percentile(rig, 0.99);
  f.car_past_p90 = percentile(car, 0.9);
  f.car_past_p99 = percentile(car, 0.99);
  f.refused = share(refused, f.traces);
  return f;
}

RisingFigures rising_figures(const std::vector<Judged>& traces, NoiseClass noise) {
  RisingFigures f;
  int values = 0, missed = 0, refused = 0;
  for (const Judged& trace : traces) {
    if (trace.scenario.curve.has_peak() || trace.scenario.noise != noise) continue;
    ++f.traces;
    const PeakEstimate& peak = trace.robust.peak;
    if (is_refused(peak)) ++refused;
    if (peak.kind != PeakKind::kValue) continue;
    ++values;
    if (!holds(peak, trace.mu_max)) ++missed;
  }
  f.value = share(values, f.traces);
  f.missed = share(missed, values);
  f.refused = share(refused, f.traces);
  return f;
}

void print_bands(std::FILE* out, const std::vector<Judged>& traces) {
  std::fprintf(out,
               "| noise | slip at the peak, %% | traces | value | narrow | p95 | in noise interval "
               "| rig past p90 / p99 | car past p90 / p99 | refused |\n"
               "|---|---|---|---|---|---|---|---|---|---|\n");
  for (int i = 0; i < kNoiseClasses; ++i) {
    const auto noise = static_cast<NoiseClass>(i);
    for (int band = -1; band < kBands; ++band) {
      const BandFigures f =
          band_figures(traces, noise, band < 0 ? std::nullopt : std::optional(band));
      std::fprintf(out,
                   "| %s | %s | %d | %.1f %% | %.1f %% | %.2f %% | %.1f %% | %.2f / %.2f | "
                   "%.2f / %.2f | %.1f %% |\n",
                   noise_name(noise), band < 0 ? "all" : band_name(band).c_str(), f.traces, f.value,
                   f.narrow, f.p95, f.covered, f.rig_past_p90, f.rig_past_p99, f.car_past_p90,
                   f.car_past_p99, f.refused);
    }
  }
  std::fprintf(out,
               "| noise | friction rises on | value | of the values, truth outside the noise "
               "interval | refused |\n|---|---|---|---|---|\n");
  for (int i = 0; i < kNoiseClasses; ++i) {
    const auto noise = static_cast<NoiseClass>(i);
    const RisingFigures f = rising_figures(traces, noise);
    std::fprintf(out, "| %s | %d | %.1f %% | %.1f %% | %.1f %% |\n", noise_name(noise), f.traces,
                 f.value, f.missed, f.refused);
  }
}

}  // namespace beltgrip::panel
