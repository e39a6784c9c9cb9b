// What is assumed where nobody has stated a constant of the variator or the accuracy of a sensor,
// and what that does to mu_max. The one table of such assumptions; defaults of a configuration are
// not knowledge.
//
// The constants are drawn from their distributions among real variators, the sensors' errors from
// normal ones, by one fixed low-discrepancy sequence: the same experiment gives the same answer.
#pragma once

#include <array>
#include <bitset>
#include <cstddef>
#include <span>
#include <string_view>
#include <vector>

#include "estimator/physics/parameters.h"

namespace beltgrip::estimator {

enum class Constant {
  kRadiusOverdrive,
  kRadiusLow,
  kPistonArea,
  kSpringForce,
  kCentrifugal,
  kPrimaryInertia
};
inline constexpr std::size_t kConstantCount = 6;
using ConstantSet = std::bitset<kConstantCount>;
inline bool has(const ConstantSet& set, Constant constant) {
  return set.test(static_cast<std::size_t>(constant));
}

// Uniform from least to most, of the value or of its logarithm.
struct Assumption {
  std::string_view key;  // in [variator]
  double VariatorParameters::*value;
  bool logarithmic;
  double least, most;
  std::string_view unit;
  std::string_view where;  // the number is found
  double quantile(double share) const noexcept;
};
const std::array<Assumption, kConstantCount>& assumptions() noexcept;  // in the order of Constant

// 1 sigma, of sensors as they are built into cars.
enum class Sensor { kSpeed, kPressure, kEngineTorque, kMeasuredTorque };
struct TypicalAccuracy {
  ChannelAccuracy accuracy;
  std::string_view where;  // the numbers are found
};
const TypicalAccuracy& typical_accuracy(Sensor sensor) noexcept;

// An experiment at its peak, as it was read under the configuration's constants.
struct PeakReading {
  EndStop end_stop = EndStop::kOverdrive;
  double mu = 0.0;
  double relative_noise = 0.0;  // standard deviation of mu without constants and sensors
  double clamp_force_N = 0.0;
  double torque_Nm = 0.0;  // magnitude
  double omega_s_rad_s = 0.0;
  // d(omega_p)/dt, positive where it adds to the magnitude of the torque's speed change: times the
  // torque's sign.
  double acceleration_rad_s2 = 0.0;
};

struct FrictionSpread {
  double median = 0.0, low = 0.0, high = 0.0;  // low .. high: 95 %
};

class AssumedConstants {
 public:
  // variator: the configuration's; those of `assumed` are no more than a place to begin.
  AssumedConstants(const VariatorParameters& variator, const SensorAccuracies& accuracies,
                   const ConstantSet& assumed);
  // Real-time thread, no allocation. The work is cut into bounded steps (some 10^4 instructions),
  // one a sample: begin, then step until it returns true.
  void begin(const PeakReading& reading) noexcept;
  bool step() noexcept;
  // Of the reading begun with, once step has returned true.
  const FrictionSpread& spread() const noexcept { return spread_; }

 private:
  static constexpr std::size_t kDraws = 1024;
  static constexpr std::size_t kDrawsPerStep = 64;
  struct Draw {
    VariatorParameters variator;
    double noise = 0.0, pressure_bias_Pa = 0.0, pressure_gain = 0.0;  // noise: standard normal
  };
  enum class Stage { kDraws, kMedian, kLow, kHigh, kDone };
  double value_of(const Draw& draw) const noexcept;
  // Where so large a share of the values lies below; [from, to): what is not yet in its order.
  double quantile(double share, std::size_t from, std::size_t to) noexcept;

  VariatorParameters variator_;
  SensorAccuracies accuracies_;
  std::vector<Draw> draws_;
  std::vector<double> values_;
  Stage stage_ = Stage::kDone;
  std::size_t next_ = 0;  // draw
  PeakReading reading_;
  double pressure_Pa_ = 0.0, deviation_ = 0.0;  // of the reading
  FrictionSpread spread_;
};

}  // namespace beltgrip::estimator
