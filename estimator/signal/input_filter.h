// The one low-pass that all channels pass, so that slip and friction keep their common time, and
// its derivative for the inertia torque. Real-time thread; no allocation.
//
// The paper says "a low-pass filter with a cut-off frequency of 5 Hz" and no more. Taken here:
// second order, Butterworth, causal, as a state-variable filter (trapezoidal integration with the
// cut-off warped, so that it sits where it is said at any sample rate). Second order, because the
// derivative of the primary speed is needed too and is then a filtered signal itself.
#pragma once

namespace beltgrip::estimator {

class LowPass {
 public:
  // cutoff is limited to 0.45 of the sample rate.
  LowPass(double cutoff_hz, double sample_rate_hz);
  // As if the input had stood at value for ever.
  void reset(double value) noexcept;
  // Takes one sample in; returns the filtered value.
  double step(double input) noexcept;
  double value() const noexcept { return value_; }
  double derivative() const noexcept { return derivative_; }  // of the filtered value, 1/s

 private:
  double g_;           // tan(pi f_c / f_s)
  double cutoff_rad_;  // the integrators' gain, rad/s
  double band_ = 0.0;  // integrator states
  double low_ = 0.0;
  double value_ = 0.0;
  double derivative_ = 0.0;
};

}  // namespace beltgrip::estimator
