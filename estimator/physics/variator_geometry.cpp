#include "estimator/physics/variator_geometry.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace beltgrip::estimator {

double belt_length_m(double primary_radius_m, double secondary_radius_m, double centre_distance_m) {
  const double sine = (primary_radius_m - secondary_radius_m) / centre_distance_m;
  const double phi = std::asin(sine);
  return 2.0 * centre_distance_m * std::cos(phi) +
         (std::numbers::pi + 2.0 * phi) * primary_radius_m +
         (std::numbers::pi - 2.0 * phi) * secondary_radius_m;
}

RunningRadii running_radii(double ratio, double wanted_length_m, double centre_distance_m) {
  // The length grows with the secondary radius: bisection between no radius and the largest that
  // keeps |R_p - R_s| below the centre distance.
  double low = 0.0;
  double high = centre_distance_m / std::max(std::abs(ratio - 1.0), 1e-3);
  high = std::min(high, wanted_length_m);
  if (wanted_length_m <= 2.0 * centre_distance_m ||
      belt_length_m(ratio * high, high, centre_distance_m) < wanted_length_m) {
    return {};
  }
  for (int i = 0; i < 100; ++i) {
    const double middle = 0.5 * (low + high);
    (belt_length_m(ratio * middle, middle, centre_distance_m) < wanted_length_m ? low : high) =
        middle;
  }
  const double secondary = 0.5 * (low + high);
  return {ratio * secondary, secondary};
}

}  // namespace beltgrip::estimator
