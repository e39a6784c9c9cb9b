// The panel's figures by where friction peaks: how often a value comes, how right it is, and how
// far the slip went; and what was said where friction rises on. Shares and errors in percent, slip
// in points.
#pragma once

#include <array>
#include <cstdio>
#include <optional>
#include <vector>

#include "panel_figures.h"

namespace beltgrip::panel {

// Ends of the bands of slip at the peak, percent; the last is open.
inline constexpr std::array<double, 4> kBandEnds_percent = {1.5, 2.5, 3.5, 4.5};
inline constexpr int kBands = static_cast<int>(kBandEnds_percent.size()) + 1;
int band_of(double slip_peak_percent);

// Half of the noise interval that a value may have, as a share of it: the default of value_width.
inline constexpr double kValueWidth = 0.05;

struct BandFigures {
  int traces = 0;        // with a peak or plateau that the slip went past
  double value = 0.0;    // of them
  double narrow = 0.0;   // of them: a value whose noise interval is at most 2 kValueWidth wide
  double p95 = 0.0;      // of the errors of the values
  double covered = 0.0;  // of the values: truth in the noise interval
  // Ramps up to 300 N/s.
  double rig_past_p90 = 0.0, rig_past_p99 = 0.0, car_past_p90 = 0.0, car_past_p99 = 0.0;
  double refused = 0.0;  // contradictory or impossible
};
// No band: all of them.
BandFigures band_figures(const std::vector<Judged>& traces, NoiseClass noise,
                         std::optional<int> band);

struct RisingFigures {
  int traces = 0;
  double value = 0.0;   // of them
  double missed = 0.0;  // of the values: truth outside the noise interval
  double refused = 0.0;
};
RisingFigures rising_figures(const std::vector<Judged>& traces, NoiseClass noise);

void print_bands(std::FILE* out, const std::vector<Judged>& traces);

}  // namespace beltgrip::panel
