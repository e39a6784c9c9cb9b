// One seeded case of the fault campaign: a shipped scenario, a vehicle and sensors drawn around it,
// and up to three faults of the catalogue (rows B, E, V, T, X), among them a belt that loses grip,
// as the text of a scenario file, so that a case worth keeping can be kept as a file.
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "tests/statistics/campaign/reach.h"
#include "tools/sim/vehicle_parameters.h"

namespace beltgrip::test {

struct CampaignCase {
  std::uint64_t seed = 0;
  std::string base;                 // shipped scenario
  std::string toml;                 // laid on it
  std::vector<std::string> faults;  // names of their kinds
  sim::VehicleScenario scenario;
  // Promise G1 is for single faults, and not against a controller that never lets go.
  bool guaranteed = true;
};

// With a class of noise: the speeds' noise and ripple of the same case, made larger or smaller
// alike until slip has the noise of that class. Without: as drawn, nearly always harsh.
CampaignCase draw_case(std::uint64_t seed, std::optional<NoiseBand> noise = std::nullopt);
// The same from any source of numbers in [0, 1); the seed is that of the vehicle's noise.
using Uniform = std::function<double()>;
CampaignCase draw_case(std::uint64_t seed, const Uniform& uniform,
                       const Uniform& uniform_of_surprise,
                       std::optional<NoiseBand> noise = std::nullopt);
// A long drive: one car that coasts down every 34 s for so many hours, and in each coast-down, but
// for the last tenth, a fault; none that leaves the controller or the daemon beyond help.
CampaignCase draw_soak(double hours, std::uint64_t seed);
// A kept case: file text whose first line is "# base NAME seed N".
CampaignCase read_case(const std::string& text, const std::string& name);

}  // namespace beltgrip::test
