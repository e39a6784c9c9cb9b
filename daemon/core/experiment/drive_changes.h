// Whether the driver, or the engine by itself, changes the torque while a request stands: the pedal
// leaves where it was held, or the torque's signal its own course, by more than noise. What the
// belt then does is no longer what the request did to it, and what is read within some ten
// milliseconds of another signal no longer belongs to it. Both signals as they come. SI. Real-time
// thread.
#pragma once

#include "daemon/core/base/mono_time.h"
#include "daemon/core/input/stop_cause.h"

namespace beltgrip::daemon {

class DriveChanges {
 public:
  struct Now {
    MonoTime t = MonoTime::origin();
    double accelerator = 0.0;  // 0 to 1
    double torque_Nm = 0.0;
    MonoTime torque_at = MonoTime::origin();  // when it came
  };
  // Every sample, also without a request: what is usual is known then.
  Stop step(const Now& now) noexcept;
  // At the last sample the torque moved by more than noise, if not by so much that this alone ends
  // a request: what ends it now may be this and not the belt.
  Stop unsettled() const noexcept { return moves_beyond(kUnsettled); }

 private:
  // Chosen: of the torque. What moves by the first within 0.3 s is off by 0.2 % of it where a stamp
  // is off by 20 ms; the second is what the noise of most engines leaves.
  static constexpr double kMoved = 0.03, kUnsettled = 0.01;
  void take_torque(const Now& now) noexcept;
  Stop moves_beyond(double share) const noexcept;

  bool begun_ = false;
  MonoTime last_, torque_at_;
  double accelerator_ = 0.0;  // as it is held
  double torque_Nm_ = 0.0;    // of the last readings,
  double course_Nm_ = 0.0;    // and of some more
  double scatter_Nm2_ = 0.0;  // square of how far one lies off torque_Nm_
  double scatter_Nm_ = 0.0;   // its root, before the last sample
};

}  // namespace beltgrip::daemon
