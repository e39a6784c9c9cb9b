// A scenario driven once in closed loop, kept as what the pipeline was given, so that a second
// pipeline can be measured on the same frames and instants without the vehicle around it.
#pragma once

#include <vector>

#include "daemon/core/base/port.h"
#include "daemon/core/config/options/config.h"
#include "daemon/core/experiment/experiment.h"
#include "tools/sim/vehicle_parameters.h"

namespace beltgrip::test {

struct DriveStep {
  bool is_frame = false;
  daemon::RxFrame frame;
  daemon::MonoTime t{};  // of a sample, and the state that it led to
  daemon::State state{};
};

std::vector<DriveStep> record_drive(const sim::VehicleScenario& scenario,
                                    const daemon::Config& config);

}  // namespace beltgrip::test
