// Takes out of the inputs what a model file says is wrong with them: afterwards a sample is what an
// ideal machine with the configured [variator] would have shown. Real-time thread; all memory is
// taken at construction.
//
//   T     = (T_measured - bias) / (1 + gain), less the losses between shaft and belt and J d(w)/dt
//   p     = such that A p + spring + c w_s^2 is the force on the belt: offset, gain, lag, further
//           forces and the play of the cylinder counted
//   w_s   = such that w_s / (w_p r_g0) is 1 - slip: scales, end stop, deformation and tilt counted
// What was learned without a name is one of these, as large as its function says at the moment.
// Beyond the box in which a function was learned there is no corrected sample: it is not usable.
// What changes the friction is no error of the inputs.
// A channel that comes late makes all others wait for it: the corrected sample is as old as the
// largest delay of the model (latency_s), and so is every decision on it.
#pragma once

#include <array>
#include <span>
#include <vector>

#include "estimator/physics/learned_effects.h"
#include "estimator/physics/machine_effects.h"
#include "estimator/physics/parameters.h"
#include "estimator/physics/variator_sample.h"

namespace beltgrip::estimator {

class InputCorrection {
 public:
  InputCorrection(const MachineEffects& effects, const VariatorParameters& variator,
                  double sample_rate_hz, std::span<const LearnedTerm> learned = {});
  // Unusable samples pass as they are and begin the histories anew.
  // now: what the sample does not tell of what functions depend on.
  const VariatorSample& correct(const VariatorSample& measured,
                                LearnedConditions now = {}) noexcept;
  // The term whose box did not hold the last sample, which is then not usable; nullptr: none.
  const LearnedTerm* uncovered() const noexcept { return uncovered_; }
  double uncovered_at() const noexcept { return uncovered_at_; }  // no number: not known
  // Force on the belt less the force as measured, at the last sample: what a force in the
  // transmission's own measure lacks.
  double force_error_N() const noexcept { return force_error_N_; }
  double latency_s() const noexcept { return latency_s_; }

 private:
  // One channel's last samples, read between them.
  class Delay {
   public:
    Delay(double delay_s, double sample_rate_hz);
    void reset(double value) noexcept;
    double step(double value) noexcept;

   private:
    std::vector<double> past_;  // a ring
    std::size_t now_ = 0;
    std::size_t whole_ = 0;
    double share_ = 0.0;
  };
  void begin(const VariatorSample& measured) noexcept;

  MachineEffects effects_;
  std::vector<LearnedTerm> learned_;  // none of the friction
  VariatorParameters variator_;
  double rate_hz_;
  double keep_;  // of the lag, per sample
  double latency_s_;
  std::array<Delay, 4> delays_;  // omega_p, omega_s, pressure, torque
  const LearnedTerm* uncovered_ = nullptr;
  double uncovered_at_ = 0.0;
  VariatorSample out_;
  double acting_Pa_ = 0.0, input_Pa_ = 0.0;
  double play_N_ = 0.0;
  double omega_p_rad_s_ = 0.0, acceleration_rad_s2_ = 0.0;
  double force_error_N_ = 0.0;
  bool started_ = false;
};

}  // namespace beltgrip::estimator
