#include "tools/sim/vehicle_driver.h"

#include <algorithm>

#include "tools/sim/random.h"

namespace beltgrip::sim {

namespace {

constexpr double kKmh = 1.0 / 3.6;
constexpr double kPedalPerSpeed_s_m = 0.25;  // the driver's gains
constexpr double kPedalPerWay_1_m = 0.05;
constexpr double kPedalMax = 0.9;

// Stretches between traffic lights: accelerate, hold, coast for a while or brake, stand, with
// hesitation, kick-downs and hard braking among them.
std::vector<DriverStep> city(double duration_s, std::uint64_t seed) {
  Random random(seed, "city");
  const auto between = [&random](double low, double high) {
    return low + (high - low) * random.uniform();
  };
  std::vector<DriverStep> steps;
  double t = 0.0;
  const auto add = [&](double hold_km_h, double accelerator, double brake, double for_s) {
    steps.push_back({t, hold_km_h * kKmh, accelerator, brake});
    t += for_s;
  };
  while (t < duration_s) {
    const double speed_km_h = between(25.0, 95.0);
    add(0.0, between(0.15, 0.6), 0.0, between(2.0, 6.0));
    add(speed_km_h, 0.0, 0.0, between(8.0, 40.0));
    const double kind = random.uniform();
    if (kind < 0.5) {
      add(0.0, 0.0, 0.0, between(1.0, 15.0));  // lifts the foot
    } else if (kind < 0.6) {
      add(0.0, 1.0, 0.0, between(0.5, 3.0));  // kick-down
    } else if (kind < 0.75) {
      for (int i = 0; i < 4; ++i) {
        add(0.0, 0.0, 0.0, between(0.2, 2.0));
        add(0.0, between(0.03, 0.3), 0.0, between(0.2, 1.0));
      }
    }
    if (random.uniform() < 0.6) {
      add(0.0, 0.0, random.uniform() < 0.1 ? 6.0 : between(0.5, 2.5), between(1.0, 12.0));
      add(0.0, 0.0, 2.0, between(0.5, 15.0));  // may stand
    }
  }
  return steps;
}

}  // namespace

VehicleDriver::VehicleDriver(const DriverParameters& parameters, double duration_s,
                             std::uint64_t seed)
    : steps_(parameters.pattern == DriverPattern::kCity ? city(duration_s, seed)
                                                        : parameters.steps) {}

DriverOutput VehicleDriver::step(double t_s, double speed_m_s, double step_s) {
  while (next_ < steps_.size() && steps_[next_].at_s <= t_s) {
    now_ = steps_[next_++];
  }
  if (now_.hold_speed_m_s <= 0.0) {
    integral_ = now_.accelerator;
    return {now_.accelerator, now_.brake_m_s2};
  }
  const double error = now_.hold_speed_m_s - speed_m_s;
  integral_ = std::clamp(integral_ + kPedalPerWay_1_m * error * step_s, 0.0, kPedalMax);
  return {std::clamp(integral_ + kPedalPerSpeed_s_m * error, 0.0, kPedalMax), now_.brake_m_s2};
}

}  // namespace beltgrip::sim
