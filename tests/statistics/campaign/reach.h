// Could a belt be brought over its peak of friction and caught again, at some instant of a drive?
// Read off the drive as the simulation knows it, without the daemon and with none of its code; by
// equations for the slip past the peak, its energy and the fall that is still caught:
//   w = T / (J omega), a = w fall / mu, y = v / w: share of force on its way at slip rate v
//   caught   (x_d + w y / a) e^(a t_d) - w y / a < (mu / fall) [g / (1 + a lag) - y],
//            g = F_own / F_pk - 1 + y, t_d = decision, frame and dead time
//   energy   T omega s_pk (x_id / v + t_d + lag)
// SI; slip as a fraction.
#pragma once

#include <array>
#include <cstdint>
#include <string_view>

#include "tools/sim/vehicle_parameters.h"

namespace beltgrip::test {

// What stands in the way of a crossing, in the order in which it is asked; kNone: it is in reach.
enum class Wall : std::uint8_t { kNoPeak, kFloor, kSlipSpeed, kEnergy, kFall, kTime, kNone };
inline constexpr std::array<std::string_view, 7> kWallNames{
    "no peak", "floor", "slip speed", "energy", "fall", "time", "none"};
constexpr std::string_view wall_name(Wall wall) {
  return kWallNames.at(static_cast<std::size_t>(wall));
}

// What a user has said of a request, and may not be passed however the car is.
struct RequestKeys {
  double pressure_floor_Pa = 0.0;
  double ramp_rate_max_N_per_s = 0.0;
  double fall_max_per_percent = 0.0;
};

// One instant of a drive. Magnitudes.
struct ReachPoint {
  double torque_Nm = 0.0;  // on the belt
  double omega_p_rad_s = 0.0;
  double primary_radius_m = 0.0;
  double wedge_cosine = 1.0;
  double inertia_kg_m2 = 0.0;  // that runs away
  double own_force_N = 0.0;
  double floor_N = 0.0;  // of the force on the belt
  double mu_max = 0.0;
  double peak_slip_share = 0.0;
  double fall = 0.0;  // that must be caught, of mu per unit of slip
  double dead_time_s = 0.0;
  double lag_s = 0.0;
};
double reach_peak_force_N(const ReachPoint& point);
bool caught(const ReachPoint& point);
double crossing_energy_J(const ReachPoint& point);
// The first of floor, slip speed, energy and fall that stands in the way there.
Wall wall_at(const ReachPoint& point);

// The noise of slip, by the classes of the panel.
enum class NoiseBand : std::uint8_t { kLab, kProduction, kHarsh };
inline constexpr std::array<std::string_view, 3> kNoiseBandNames{"lab", "production", "harsh"};

// White noise in rad/s and ripple as a share, of one speed.
struct SpeedNoise {
  double white_rad_s = 0.0, ripple = 0.0;
};
// Of slip, read from one sample of both.
double slip_noise_percent2_s(const SpeedNoise& primary, const SpeedNoise& secondary,
                             double omega_p_rad_s, double omega_s_rad_s);

struct Reach {
  Wall wall = Wall::kNoPeak;        // of the instant that comes furthest
  double from_s = 0.0, to_s = 0.0;  // in reach: the longest time on end
  double peak_slip_percent = 0.0;
  double slip_noise_percent = 0.0;  // of one reading of both speeds, ripple counted
  NoiseBand noise = NoiseBand::kLab;
};
// Of a drive with the foot off the pedal.
Reach reach_of(const sim::VehicleScenario& scenario, const RequestKeys& keys, std::uint64_t seed);

}  // namespace beltgrip::test
