// One set of inputs, aligned to one instant by the sampler. SI, not filtered.
#pragma once

#include <cstdint>

namespace beltgrip::estimator {

struct VariatorSample {
  std::int64_t t_ns = 0;               // strictly increasing, one sample period apart
  double omega_p_rad_s = 0.0;          // primary pulley speed, > 0 where usable
  double omega_s_rad_s = 0.0;          // secondary pulley speed
  double secondary_pressure_Pa = 0.0;  // p_s, as measured
  double torque_Nm = 0.0;              // engine or primary torque, + = drive, - = overrun
  bool usable = false;                 // every field fresh, finite and in range
  // By so much t_ns lies beyond the newest reading of the pressure: from there on p_s is foretold
  // by its course. 0: read on both sides, or not known.
  std::int64_t pressure_ahead_ns = 0;
};

}  // namespace beltgrip::estimator
