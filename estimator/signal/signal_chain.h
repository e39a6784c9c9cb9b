// From one sample to slip, traction coefficient and clamp force: common low-pass, inertia torque,
// operating point, and the checks that these are defined. Shared by the methods. Real-time thread;
// no allocation after construction.
//
// The operating point (direction, end stop) is taken from the mean of the first kAcquire_s in which
// the filtered torque stands outside its dead band, and then kept. What contradicts it later is a
// reason to stop, not a number: torque that has changed its sign or stays near zero (kTorque), a
// ratio that is no end stop's, or slip against the torque (kRatio), mu* that stays beyond any
// belt's (kInputs).
#pragma once

#include <cstdint>

#include "estimator/method/slip_curve_estimator.h"
#include "estimator/physics/parameters.h"
#include "estimator/physics/slip.h"
#include "estimator/physics/variator_sample.h"
#include "estimator/signal/input_filter.h"

namespace beltgrip::estimator {

inline constexpr double kAcquire_s = 0.25;
// Deformation, calibration of the end stop and slip that is there already stay below this; the
// next gear of a continuously variable transmission does not.
inline constexpr double kRatioTolerance_percent = 8.0;
// sigma* falls below its first value by deformation only; by more than this with a torque or a
// speed of the wrong sign or place.
inline constexpr double kSlipBelowFirst_percent = 4.0;

struct Measurement {  // filtered
  double omega_p_rad_s = 0.0;
  double omega_s_rad_s = 0.0;
  double torque_p_Nm = 0.0;  // on the belt, signed
  double clamp_force_N = 0.0;
  double slip_percent = 0.0;  // sigma*, in the direction of the torque
  double mu_star = 0.0;
  bool usable = false;
  StopReason stop = StopReason::kNone;  // kTorque, kRatio or kInputs
};

class SignalChain {
 public:
  SignalChain(const EstimatorSettings& settings, const VariatorParameters& variator,
              double lowpass_hz);
  void reset() noexcept;
  // A sample that is unusable, impossible (no number, standstill, beyond what any variator does) or
  // not later than the one before changes nothing; impossible ones for kAcquire_s are kInputs.
  const Measurement& step(const VariatorSample& sample) noexcept;
  const OperatingPoint& point() const noexcept { return point_; }

 private:
  void acquire(double ratio) noexcept;

  VariatorParameters variator_;
  RatioChoice choice_;
  double inertia_kg_m2_;
  double reading_reach_;
  std::int64_t acquire_samples_;
  LowPass omega_p_, omega_s_, pressure_, torque_;
  OperatingPoint point_;
  Measurement out_;
  std::int64_t last_t_ns_ = 0;
  std::int64_t acquired_ = 0;            // samples outside the dead band in a row, at the start
  std::int64_t dead_samples_ = 0;        // inside it in a row, later
  std::int64_t wrong_samples_ = 0;       // slip or mu* that cannot be, in a row
  std::int64_t impossible_samples_ = 0;  // that are no measurement, in a row
  double ratio_sum_ = 0.0;
  double first_slip_percent_ = 0.0;
  bool started_ = false, measured_ = false;
};

}  // namespace beltgrip::estimator
