// The transmission controller: its own clamping law, and the receiver of BeltGripClamp as
// daemon/CLAMP_CONTRACT.md asks for it.
#pragma once

#include <deque>
#include <optional>
#include <string>

#include "tests/system/vcan/other_vehicle/frames.h"

namespace beltgrip::other {

class Controller {
 public:
  // Own force from the torque asked for and the torque there is; every 10 ms.
  void judge_torque(double t_s, double requested_Nm, double actual_Nm);
  void hear(double t_s, const Bytes& clamp_frame);
  // What the valve is told now. Also ends a request that has fallen silent.
  double command_N(double t_s, double secondary_rad_s);

  bool obeys_now() const { return asked_N_.has_value(); }

  bool permits = true;
  bool deaf = false;         // one that does not obey
  bool holds_on = false;     // one that does not take its force back
  double given_share = 1.0;  // one that gives less than was asked for
  double stays_share = 1.0;  // after a request, one that comes back to less of its own force

 private:
  void begin_or_follow(double t_s, double force_N);
  void give_back(double t_s);

  std::deque<std::pair<double, double>>
      torques_Nm_;  // with their times, as far back as they are held
  double own_N_ = 0.0;
  std::optional<double> asked_N_;
  double own_at_begin_N_ = 0.0;
  double given_N_ = 0.0;
  double heard_s_ = 0.0;
  double ended_s_ = -1e9;
  std::optional<unsigned> counter_;
  bool idle_seen_ = false;
  bool has_given_ = false;
};

// Force of the own clamping law for this torque.
double own_force_N(double torque_Nm);

}  // namespace beltgrip::other
