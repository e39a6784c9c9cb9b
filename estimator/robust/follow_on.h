// Was it macro slip? What the belt does in the half second after the stop. Slip in percent.
// Real-time thread; sums only.
//
// Past its peak a belt slips faster and faster until it is clamped again. Where it goes on carrying
// what was taken for its peak, and yet slips on at less than half the pace, it was none: the ratio,
// or the reading of a speed, had moved. Where the clamp force comes back meanwhile, that proves
// nothing: it slows the belt down, and while it still slips mu* stays at its peak.
#pragma once

#include "estimator/record/experiment_record.h"

namespace beltgrip::estimator {

class FollowOn {
 public:
  void reset() noexcept { *this = {}; }
  // The stop has been decided, with this record.
  void begin(const ExperimentRecord& record) noexcept;
  // One sample after it.
  void step(const Cell& sample) noexcept;
  // Samples to come are of use.
  bool waits() const noexcept { return begun_ && after_s_ < kTo_s; }
  // mu: of the peak that was found. c: cos(theta) / (2 R_p); inertia 0: the belt's torque is
  // measured.
  bool stood_still(double mu, double traction_per_Nm_N, double inertia_kg_m2) const noexcept;

 private:
  struct Mean {
    double n = 0.0, t_s = 0.0, slip_percent = 0.0, clamp_force_N = 0.0;  // sums
    void add(double after_s, const Cell& cell) noexcept;
    double at_s() const noexcept { return t_s / n; }
    double mean_slip_percent() const noexcept { return slip_percent / n; }
    double force_N() const noexcept { return clamp_force_N / n; }
  };
  // Slip is compared around kMiddle_s and at kTo_s, in means over kMean_s.
  static constexpr double kMiddle_s = 0.2, kTo_s = 0.5, kMean_s = 0.1;
  bool clamped_again() const noexcept;
  double carried(double traction_per_Nm_N, double inertia_kg_m2) const noexcept;

  bool begun_ = false;
  double stop_t_s_ = 0.0, after_s_ = 0.0;
  double slip_noise_percent2_s_ = 0.0, before_cells_s_ = 0.0;
  double force_variance_N2_ = 0.0;  // of a mean over kMean_s
  Mean before_, middle_, late_;
  // From kMiddle_s on.
  double n_ = 0.0, t_ = 0.0, tt_ = 0.0, omega_ = 0.0, omega_t_ = 0.0, torque_ = 0.0, force_ = 0.0;
};

}  // namespace beltgrip::estimator
