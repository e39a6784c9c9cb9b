// The driver: a list of steps, or a city drawn by seed. Simulation only.
#pragma once

#include <cstdint>

#include "tools/sim/vehicle_parameters.h"

namespace beltgrip::sim {

struct DriverOutput {
  double accelerator = 0.0;  // 0 to 1
  double brake_m_s2 = 0.0;
};

class VehicleDriver {
 public:
  VehicleDriver(const DriverParameters& parameters, double duration_s, std::uint64_t seed);
  DriverOutput step(double t_s, double speed_m_s, double step_s);
  const std::vector<DriverStep>& steps() const { return steps_; }

 private:
  std::vector<DriverStep> steps_;
  std::size_t next_ = 0;
  DriverStep now_;
  double integral_ = 0.0;  // of the speed controller, pedal
};

}  // namespace beltgrip::sim
