// What slip beyond the peak of friction does to the belt. Where the peak lies is not known before:
// slip counts as beyond it while friction is not above its best before, and what was counted is
// forgotten as it rises again: a quarter by every 0.15 %. Slip before the peak is what every such
// belt does all day. SI; slip as a fraction. Real-time thread.
#pragma once

#include "daemon/core/base/mono_time.h"

namespace beltgrip::daemon {

class SlipDamage {
 public:
  struct Now {
    MonoTime t = MonoTime::origin();
    double slip_share = 0.0;
    double mu_star = 0.0;  // magnitude
    double power_W = 0.0;  // |T| omega_p slip
    double slip_speed_m_s = 0.0;
    bool grows = false;  // slip, or the force that could hold it is as low as it goes
  };
  void begin(MonoTime t, double mu_star) noexcept;
  void step(const Now& now) noexcept;

  // Since friction rose last: its peak, as it seems.
  bool beyond() const noexcept { return beyond_s_ > 0.0; }
  // And what is not forgotten of before.
  double energy_J() const noexcept { return energy_J_; }
  double fast_s() const noexcept { return fast_s_; }    // faster than kRequestFast_m_s
  double mu_best() const noexcept { return mu_best_; }  // the largest that was carried
  double slip_at_best_share() const noexcept { return slip_at_best_share_; }

 private:
  MonoTime last_;
  double mu_first_ = 0.0, mu_mean_ = 0.0;  // a lag behind another
  double mu_best_ = 0.0;
  double slip_at_best_share_ = 0.0;
  double beyond_s_ = 0.0;
  double fast_s_ = 0.0;
  double energy_J_ = 0.0;
};

}  // namespace beltgrip::daemon
