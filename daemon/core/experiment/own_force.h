// Whether the controller has taken its force back after a request: to what it gave before, at no
// more than its share of the torque. A clamping law may rest on more than the torque, but not fall
// by more than the torque does; so a force that stays lower was kept by what asked for it, or its
// valve sticks. SI. Real-time thread.
#pragma once

#include "daemon/core/base/mono_time.h"

namespace beltgrip::daemon {

class OwnForce {
 public:
  struct Now {
    MonoTime t = MonoTime::origin();
    double force_N = 0.0;
    double torque_Nm = 0.0;  // on the belt
  };
  // Every sample without a request.
  void step(const Now& now) noexcept;
  // A request begins: what is read until now is the controller's own. And it ends.
  void begin() noexcept;
  void end() noexcept { begun_ = false; }

  bool back() const noexcept { return back_; }
  double force_N() const noexcept { return force_N_; }
  double least_N() const noexcept;  // that counts as back

 private:
  bool begun_ = false;
  bool back_ = true;  // once it was
  MonoTime last_;
  double force_N_ = 0.0, torque_Nm_ = 0.0;  // means of the last readings, magnitudes
  double own_N_ = 0.0, own_torque_Nm_ = 0.0;
};

}  // namespace beltgrip::daemon
