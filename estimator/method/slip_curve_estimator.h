// The common face of the estimation methods: samples in, slope, phase and stop decision out; at the
// end the maximum friction with its uncertainty. One object lives from start-up on; step and
// conclude are noexcept, allocate nothing and do bounded work. Real-time thread.
#pragma once

#include <cstdint>

#include "estimator/method/reading_status.h"
#include "estimator/method/stop_reason.h"
#include "estimator/physics/parameters.h"
#include "estimator/physics/variator_sample.h"

namespace beltgrip::estimator {

enum class Phase : std::uint8_t { kQuiet, kExcited, kPeak, kMacroSlip };  // wire values

// The state after one sample. mu_star and sigma_star_percent are positive in the direction of the
// torque.
struct CurveEstimate {
  std::int64_t t_ns = 0;
  double mu_star = 0.0;             // eq. (5)
  double sigma_star_percent = 0.0;  // eq. (3), percent
  double slip_variance = 0.0;       // v, eq. (10), (percent slip)^2
  double friction_slope = 0.0;      // k, 1 / percent slip; held while not excited
  double clamp_force_N = 0.0;       // F_s
  double torque_p_Nm = 0.0;         // T_p on the belt, inertia compensated, signed
  double slip_energy_J = 0.0;       // dissipated since the start
  // mu_max to be expected from the curve so far, with its 95 % interval; 0: not known yet.
  double mu_max_expected = 0.0;
  double mu_max_low = 0.0;
  double mu_max_high = 0.0;
  Phase phase = Phase::kQuiet;
  Direction direction = Direction::kDrive;
  EndStop end_stop = EndStop::kOverdrive;
  bool usable = false;                  // the values above are defined at this sample
  StopReason stop = StopReason::kNone;  // stays as it was first set until reset
};

enum class PeakKind : std::uint8_t { kNone, kValue, kLowerBound };  // wire values of MuMaxKind

struct PeakEstimate {
  PeakKind kind = PeakKind::kNone;
  double mu_max = 0.0;      // the value, or the lower bound
  double mu_max_std = 0.0;  // > 0 with kValue
  double ci95_low = 0.0;    // includes sensor accuracies, and constants that are assumed
  double ci95_high = 0.0;
  double sigma_peak_percent =
      0.0;                   // slip magnitude at the peak; with kLowerBound: where it was reached
  std::int64_t samples = 0;  // samples that carried the estimate
  // The experiment's own residuals say that its points lie on no one friction curve: there is no
  // value, and no bound.
  bool contradictory = false;
  // No belt has such friction (possible_friction.h): no value, and no bound either.
  bool impossible = false;
  double mu_refused = 0.0;  // that friction; or the top of contradictory points, if it is one
  double noise_low = 0.0;   // 95 % by noise and the form of the curve alone; with kValue
  double noise_high = 0.0;
  double clamp_force_N = 0.0;  // at the peak, or where the bound was reached
  double omega_s_rad_s = 0.0;  // there
  // Of the experiment, at its end. The paper's method judges none: unbound.
  ReadingStatuses readings{};
};

class SlipCurveEstimator {
 public:
  virtual ~SlipCurveEstimator() = default;
  // Forgets everything: a new experiment begins with the next sample.
  virtual void reset() noexcept = 0;
  // One sample. An unusable sample changes no state and yields usable = false.
  virtual const CurveEstimate& step(const VariatorSample& sample) noexcept = 0;
  // Whoever lowers the force has seen friction rise no more and ends there: the data hold the top,
  // whether it is flat or falls. Before conclude().
  virtual void ends_at_the_top() noexcept {}
  // After the last step (stop, end of trace, abort): call once per sample until it returns true.
  // Steps may follow: the curve goes on, the peak stays.
  virtual bool conclude() noexcept = 0;
  // Valid once conclude() has returned true.
  virtual const PeakEstimate& peak() const noexcept = 0;
};

}  // namespace beltgrip::estimator
