// The highest mu* that a belt has carried without slip, by direction and end stop, over all drives:
// what mu_max is at least, where nobody ever lowers the clamp. A lower bound, never a value. Takes
// windows (carried_window.h) in the order of their times; any thread but the real-time one.
#pragma once

#include <array>
#include <limits>
#include <optional>
#include <string>

#include "daemon/core/config/options/config.h"
#include "daemon/core/observe/carried_window.h"
#include "estimator/belt/belt_memory.h"
#include "estimator/physics/assumed_constants.h"

namespace beltgrip::daemon {

struct CarriedBound {
  double mu_star = 0.0;  // as read under the configuration's constants; 0: nothing yet
  // Of mu_max: less what sensors and assumed constants may have added, 97.5 % sure.
  double mu_max_least = 0.0;
  // Where it was.
  double time_s = 0.0;  // Unix time, or that of the log
  double torque_Nm = 0.0;
  double clamp_force_N = 0.0;
  double omega_p_rad_s = 0.0;
  double oil_degC = std::numeric_limits<double>::quiet_NaN();
  // Of all windows that were counted: those under the controller's own force.
  double held_s = 0.0;
  double force_N_s = 0.0;
  double used_N_s = 0.0;  // the same times mu*, as read
  double counted_until_s = -std::numeric_limits<double>::infinity();
  double refused_mu_star = 0.0;  // the highest that no belt can have carried; 0: none

  bool known() const noexcept { return mu_star > 0.0; }
};
using CarriedBounds = std::array<CarriedBound, estimator::kBeltGroups>;  // by belt_group()

// Of the clamping force in the windows: what would not have been needed had mu_max been no more
// than the highest mu* carried. It is more where mu_max is. Nothing: not known.
std::optional<double> reserve_share(const CarriedBound& bound) noexcept;

class CarriedRecord {
 public:
  explicit CarriedRecord(const Config& config);
  // What was kept of earlier drives.
  void restore(const CarriedBounds& bounds) { bounds_ = bounds; }
  // time_s: of the window's end. Windows before the newest that was counted raise the bound, but
  // are not counted twice. True: a bound is higher than before.
  bool take(const CarriedWindow& window, double time_s);
  const CarriedBounds& bounds() const noexcept { return bounds_; }

 private:
  double weighed(const CarriedWindow& window);

  estimator::VariatorParameters variator_;
  estimator::SensorAccuracies sensors_;
  std::optional<estimator::AssumedConstants> assumptions_;
  CarriedBounds bounds_{};
};

// Where none is known and something was refused: what that was, and what may be wrong.
std::string refused_text(const CarriedBound& bound);
// "mu_max is at least 0.0712: mu* 0.0791 was carried without slip at ..."; of a bound that is
// known.
std::string carried_text(const CarriedBound& bound);
// "drive, overdrive"
std::string group_text(std::size_t group);

}  // namespace beltgrip::daemon
