// Geometry of the pushbelt variator: belt-length closure and running radii. The one file that the
// simulation shares with the estimator. Pure functions, SI, any thread.
#pragma once

namespace beltgrip::estimator {

struct RunningRadii {
  double primary_m = 0.0;
  double secondary_m = 0.0;
};

// Length of a belt around two pulleys: L = 2 d cos(phi) + (pi + 2 phi) R_p + (pi - 2 phi) R_s,
// sin(phi) = (R_p - R_s) / d.
double belt_length_m(double primary_radius_m, double secondary_radius_m, double centre_distance_m);

// Radii for the geometric ratio r_g = R_p / R_s. Lengths > 0, ratio > 0; radii are 0 where no pair
// of radii closes the belt (too short, or a radius beyond the centre distance).
RunningRadii running_radii(double ratio, double wanted_length_m, double centre_distance_m);

}  // namespace beltgrip::estimator
