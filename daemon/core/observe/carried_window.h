// What a belt carries without slip while nobody lowers the clamp: windows of steady driving at an
// end stop. Real-time thread; pure, no allocation.
//
// A window is kBlocks means of mu* over kBlock each, one after the other. What it says was carried
// is the lowest of them: noise lifts one mean above the truth as often as not, all kBlocks of them
// once in 2^kBlocks windows. A mean over the window would be too high half of the time, and the
// highest of many windows would nearly always be. No shape of the noise is assumed, and a load that
// rises and falls within the window counts with its lowest.
#pragma once

#include <cstddef>
#include <limits>

#include "daemon/core/base/mono_time.h"
#include "daemon/core/base/spsc_ring.h"
#include "daemon/core/loop/sample_report.h"

namespace beltgrip::daemon {

struct CarriedWindow {
  MonoTime end = MonoTime::origin();
  estimator::Direction direction = estimator::Direction::kDrive;
  estimator::EndStop end_stop = estimator::EndStop::kOverdrive;
  double mu_star_held = 0.0;  // the lowest of its means
  // Means of the window.
  double mu_star = 0.0;
  double clamp_force_N = 0.0;
  double torque_Nm = 0.0;  // on the belt, signed
  double omega_p_rad_s = 0.0;
  double omega_s_rad_s = 0.0;
  double acceleration_rad_s2 = 0.0;                            // of the primary
  double oil_degC = std::numeric_limits<double>::quiet_NaN();  // no number: not known
  bool lowered = false;  // the force was a request's for a part of it, not the controller's own
};

// To the helper thread; a minute's worth.
using CarriedRing = SpscRing<CarriedWindow, 32>;

class CarriedWatch {
 public:
  // commands: its experiments lower the force.
  explicit CarriedWatch(bool commands) : commands_(commands) {}

  // Derived: signals come every 10 to 20 ms and the filters pass 5 Hz; means over 100 ms hold
  // several frames and hardly know of each other.
  static constexpr Duration kBlock = 100 * kMillisecond;
  // Chosen: an hour has 1,800 windows; noise lifts one of them in 600 h of steady driving.
  static constexpr std::size_t kBlocks = 20;
  static constexpr Duration kWindow = kBlock * kBlocks;
  // Chosen: slip that the second half of a window may have more than the first; a belt that lets go
  // gains its peak's 2 % in less than a second, creep under a torque that rises by half gains 0.2.
  static constexpr double kSlipGrowth_percent = 0.25;

  // Every sample, in an experiment or not. The window that is complete with it; nullptr: none is.
  const CarriedWindow* step(const SampleReport& report) noexcept;

 private:
  // Sums over the samples of a block, or of the window.
  struct Sums {
    double samples = 0.0;
    double mu_star = 0.0, sigma_percent = 0.0, clamp_force_N = 0.0, torque_Nm = 0.0;
    double omega_p_rad_s = 0.0, omega_s_rad_s = 0.0;
    void add(const Sums& other) noexcept;
  };
  void restart(const SampleReport& report) noexcept;
  bool end_block(const SampleReport& report) noexcept;

  bool commands_;
  bool runs_ = false;
  bool lowered_ = false;
  MonoTime last_;           // sample
  MonoTime block_since_;    // first sample of the block
  std::size_t blocks_ = 0;  // complete
  Sums block_, halves_[2];
  double lowest_ = 0.0;
  double omega_p_first_rad_s_ = 0.0;  // mean of the first block
  CarriedWindow window_;
};

}  // namespace beltgrip::daemon
