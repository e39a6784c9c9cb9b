// The drives that the saving is measured on. Half an hour each, one seed a drive.
#pragma once

#include <cstdint>

#include "tools/sim/vehicle_scenario.h"

namespace beltgrip::saving {

enum class Cycle { kCity, kMixed };
const char* cycle_name(Cycle cycle);

// kCity: the shipped scenario, its driver drawn by the simulation's own seed. kMixed: ten minutes
// each of town, country road and motorway in the same car, drawn here.
sim::VehicleScenario drive_scenario(Cycle cycle, double pressure_floor_Pa, std::uint64_t seed);

}  // namespace beltgrip::saving
