// One experiment on a uniform grid: every channel through the same local linear fit with Gaussian
// weights, so that sums, ratios and derivatives of channels stay consistent, and the mask of the
// samples that may carry a conclusion. The mask depends on data only, never on a hypothesis.
#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "estimator/physics/parameters.h"
#include "tools/diagnose/data/order_lines.h"
#include "tools/diagnose/data/rounding.h"
#include "tools/diagnose/data/signal_table.h"
#include "tools/diagnose/data/slip_swing.h"
#include "tools/diagnose/data/spectral_lines.h"

namespace beltgrip::diagnose {

enum EndStopIndex : int { kOverdriveStop = 0, kLowStop = 1, kNoStop = -1 };
inline constexpr int kStops = 2;

// One sigma of constant errors of the channels, by role, where somebody stated it; else 0.
using Accuracies = std::array<estimator::ChannelAccuracy, daemon::kRoleCount>;

// A channel on the grid; NaN where the channel has no data.
struct GridSignal {
  Eigen::ArrayXd value;
  Eigen::ArrayXd slope;        // per second, of the same fit
  Eigen::ArrayXd slow;         // smoother copy: what a shift, lag or play changes is taken from it,
  Eigen::ArrayXd slow_slope;   // else such an effect would win by averaging the channel's noise
  Eigen::ArrayXd sharp;        // what a shift, lag or play is computed from: the slow copy; of the
  Eigen::ArrayXd sharp_slope;  // pressure one that is not rounded where it turns or steps
  double age_s = 0.0;          // by how much a value may be older than its stamp
  bool is_read = false;        // the recording has samples of it
  bool present = false;        // enough of them, without gaps, to stand on the grid
};

// Neighbouring samples, all of them valid, before and behind which is none.
struct Stretch {
  int begin = 0, end = 0;  // end: behind the last
};

// The same on one step of a reading. What comes back as it is read, as a torque, rests there again,
// off by the same; of the pressure the course between its steps is found, each time anew.
struct Rest : Stretch {
  long step = 0;
};

// Chosen. Beyond: the run-away, where ratios of derivatives tell nothing of statics.
inline constexpr double kSlipRateMax_1_s = 0.03;

// Where a stretch of valid samples ends because the belt runs away.
struct RunAway {
  int last = 0;        // of the stretch
  double gap_s = 0.0;  // from there to the first that is too fast
};

struct ExperimentData {
  std::string name;
  double dt_s = 0.1;
  Eigen::ArrayXd t_s;  // from the first sample of the experiment
  GridSignal omega_p, omega_s, pressure, torque, torque_s, pressure_p, command, temperature;
  OrderLine line_p, line_s;  // once per revolution, primary and secondary speed
  BeltLines belt_p, belt_s;  // at the belt's passage, in the same
  double belt_Hz = 0.0;      // of that, mean
  PooledSpectrum torque_spectrum, torque_s_spectrum;
  PooledSpectrum unbalanced_spectrum;  // of the torque that does not arrive behind the belt
  SlipSpectra slip_spectra;
  bool torque_is_engine = false;
  std::vector<int> stop;  // EndStopIndex per sample
  // By how much the slip varies within what one sample is the mean of, squared shares: a curve that
  // is bent has another mean there than at the mean slip.
  Eigen::ArrayXd slip_spread_share2;
  std::vector<bool> valid;         // may carry a conclusion
  std::vector<Stretch> stretches;  // the valid samples
  std::vector<RunAway> run_aways;
  int valid_count = 0;
  bool saturated_pressure = false;
  double rounding_slip_share =
      0.0;  // one sigma of what the rounding of the speeds leaves in the slip
  double rounding_pressure_Pa = 0.0, rounding_torque_Nm = 0.0, rounding_torque_s_Nm = 0.0;  // same
  // Of the pressure's: what is left of it in the course that was found from the samples, where it
  // passes its steps.
  double left_of_rounding_Pa = 0.0;
  // Where a reading rests on one of its steps and goes back to where it came from, or begins or
  // ends there: off by the same all along, and nothing says by how much. One that it passes on its
  // way is off by nothing in the mean.
  std::vector<Rest> rests_pressure, rests_torque, rests_torque_s;
  std::vector<std::string> notes;
  int size() const { return static_cast<int>(t_s.size()); }
};

// Never throws: what cannot be used is masked, and said in notes. sensors: by all experiments with
// the same ones, this among them; what one of them goes beyond is no bound in another.
ExperimentData prepare(const SignalTable& table, const estimator::VariatorParameters& variator,
                       const Sensors& sensors);
// By this experiment alone.
ExperimentData prepare(const SignalTable& table, const estimator::VariatorParameters& variator);

// What a channel reads within an experiment, over its valid samples.
struct Spread {
  double low = 0.0, middle = 0.0, high = 0.0;  // 5 %, 50 % and 95 %
  // A belt that begins to slip moves a torque that is held by less, and so does the noise of a
  // pressure.
  bool moves() const;
};
Spread spread_of(const ExperimentData& run, const GridSignal& signal);

// Who moves the speed moves both shafts. One that is held gives way a little where the belt begins
// to slip, and the other one by the slip. False without valid samples.
bool shafts_move(const ExperimentData& run);

// Both slow copies, from value.
void add_slow(GridSignal& signal, double dt_s);

// Slow copies over the widest of some windows that agrees with all narrower ones within their
// noise: a signal that moves on straight lines is left with next to none of its noise. sharp is the
// same from the samples on.
void widen_slow(GridSignal& signal, double dt_s);

// sharp(t + shift), cubic; held at the ends. Seconds. slow_slope, linear.
Eigen::ArrayXd shifted(const GridSignal& signal, double dt_s, double shift_s);
Eigen::ArrayXd shifted_slope(const GridSignal& signal, double dt_s, double shift_s);

}  // namespace beltgrip::diagnose
