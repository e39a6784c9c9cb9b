// Wear from end to end: virtual belts, five experiments before and five after a drop of mu_max,
// each simulated, read through the sensors of a noise class and judged by method robust; then the
// test of wear on what came out.
#pragma once

#include <cstdint>

#include "virtual_variator.h"

namespace beltgrip::panel {

struct WearRates {
  int belts = 0;
  int judged = 0;        // with at least two values on both sides
  int found = 0;         // of these
  double values = 0.0;   // experiments that gave a value, percent
  double scatter = 0.0;  // of the values of one side about their mean, median of belts, percent
};

// Belts first .. first + count - 1 under equal conditions: of one belt's experiments only noise,
// load and duration differ. drop: relative.
WearRates wear_rates(std::uint64_t first, int count, NoiseClass noise, double drop, int threads);

}  // namespace beltgrip::panel
