#include "tests/statistics/saving/drives.h"

#include <stdexcept>

#include "tools/sim/random.h"

namespace beltgrip::saving {
namespace {

constexpr double kKmh = 1.0 / 3.6;
constexpr double kPart_s = 600.0;  // of three

struct Road {
  double slowest_km_h, fastest_km_h;
  double hold_least_s, hold_most_s;
  bool stops;
};
constexpr Road kRoads[] = {{25.0, 55.0, 10.0, 35.0, true},
                           {55.0, 95.0, 20.0, 60.0, false},
                           {95.0, 130.0, 30.0, 120.0, false}};

std::vector<sim::DriverStep> mixed(std::uint64_t seed) {
  sim::Random random(seed, "mixed");
  const auto between = [&random](double low, double high) {
    return low + (high - low) * random.uniform();
  };
  std::vector<sim::DriverStep> steps;
  double t_s = 0.0;
  const auto add = [&](double hold_km_h, double accelerator, double brake_m_s2, double for_s) {
    steps.push_back({t_s, hold_km_h * kKmh, accelerator, brake_m_s2});
    t_s += for_s;
  };
  double part_end_s = 0.0;
  for (const Road& road : kRoads) {
    part_end_s += kPart_s;
    while (t_s < part_end_s) {
      add(between(road.slowest_km_h, road.fastest_km_h), 0.0, 0.0,
          between(road.hold_least_s, road.hold_most_s));
      const double what = random.uniform();
      if (what < 0.3) {
        add(0.0, 0.0, 0.0, between(2.0, 10.0));  // lifts the foot
      } else if (what < 0.45) {
        add(0.0, between(0.4, 1.0), 0.0, between(1.0, 4.0));  // overtakes
      } else if (what < 0.75 && road.stops) {
        add(0.0, 0.0, between(1.0, 2.5), between(5.0, 15.0));
      }
    }
  }
  return steps;
}

}  // namespace

const char* cycle_name(Cycle cycle) { return cycle == Cycle::kCity ? "city" : "mixed"; }

sim::VehicleScenario drive_scenario(Cycle cycle, double pressure_floor_Pa, std::uint64_t seed) {
  const sim::VehicleScenarioResult city = sim::shipped_vehicle_scenario("city");
  if (!city.errors.empty()) throw std::runtime_error(city.errors.front());
  sim::VehicleScenario scenario = city.scenario;
  scenario.hydraulics.pressure_floor_Pa = pressure_floor_Pa;
  if (cycle == Cycle::kCity) return scenario;
  scenario.name = "mixed";
  scenario.faults.clear();
  scenario.driver.pattern = sim::DriverPattern::kSteps;
  scenario.driver.steps = mixed(seed);
  return scenario;
}

}  // namespace beltgrip::saving
