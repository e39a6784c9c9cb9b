#include "tools/diagnose/infer/planned_run.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace beltgrip::diagnose {
namespace {

using Eigen::ArrayXd;
using Eigen::Index;

constexpr double kPeriod_s = 0.1;        // of the grid on which everything is judged
constexpr double kShallow_share = 0.01;  // chosen: slip to begin with; any will do
// Chosen: each pass leaves some thousandths of what is off (the oil that turns with the speed);
// what four leave is no hundredth of the noise, which a test holds.
constexpr int kPasses = 4;

GridSignal held(double value, Index n) {
  GridSignal out;
  out.value = out.slow = out.sharp = ArrayXd::Constant(n, value);
  out.slope = out.slow_slope = out.sharp_slope = ArrayXd::Zero(n);
  out.present = true;
  return out;
}

// Without noise every copy is the signal itself.
void set(GridSignal& signal, const ArrayXd& value) {
  const Index n = value.size();
  ArrayXd slope = ArrayXd::Zero(n);
  for (Index k = 0; k < n; ++k) {
    const Index before = std::max<Index>(k - 1, 0), after = std::min(k + 1, n - 1);
    if (after > before) {
      slope[k] = (value[after] - value[before]) / (kPeriod_s * static_cast<double>(after - before));
    }
  }
  signal.value = signal.slow = signal.sharp = value;
  signal.slope = signal.slow_slope = signal.sharp_slope = slope;
  signal.present = true;
}

// The mean of what a channel read in the others; nothing where it was never recorded.
double mean_over(const Campaign& campaign, GridSignal ExperimentData::*channel) {
  double sum = 0.0, count = 0.0;
  for (const ExperimentData& run : campaign.runs) {
    const GridSignal& signal = run.*channel;
    for (Index k = 0; signal.present && k < signal.value.size(); ++k) {
      if (!run.valid[static_cast<std::size_t>(k)] || !std::isfinite(signal.value[k])) continue;
      sum += signal.value[k];
      count += 1.0;
    }
  }
  return count > 0.0 ? sum / count : 0.0;
}

bool is_recorded(const Campaign& campaign, GridSignal ExperimentData::*channel) {
  return std::any_of(campaign.runs.begin(), campaign.runs.end(), [&](const ExperimentData& run) {
    return run.valid_count > 0 && (run.*channel).present;
  });
}

// Slip over that at the peak at which the curve carries this share of its peak, below the peak.
double place_of(const CurveShape& curve, double share) {
  double low = 0.0, high = 1.0;
  for (int i = 0; i < 50; ++i) {
    const double middle = 0.5 * (low + high);
    (curve.evaluate(middle).value < share ? low : high) = middle;
  }
  return 0.5 * (low + high);
}

class Planner {
 public:
  Planner(const Campaign& campaign, const Ramp& ramp, const ModelState& state)
      : like_(campaign),
        ramp_(ramp),
        state_(state),
        number_(static_cast<int>(campaign.runs.size())) {
    like_.runs = {};
  }

  ExperimentData run(const Campaign& made) {
    std::vector<double> force_N;
    const auto hold = static_cast<int>(kRecipeHold_s / kPeriod_s);
    force_N.assign(static_cast<std::size_t>(hold), ramp_.start_force_N);
    const double least_N = like_.variator.secondary_spring_force_N;
    const auto most = static_cast<std::size_t>(kRecipeLength_s / kPeriod_s);
    for (double at_N = ramp_.start_force_N; at_N > least_N && force_N.size() < most;
         at_N -= ramp_.ramp_N_s * kPeriod_s) {
      force_N.push_back(at_N);
    }
    prepare(made, force_N);
    settle();
    // Where the belt would run away: there it turns.
    const auto count =
        static_cast<std::size_t>(std::find(grips_.begin(), grips_.end(), false) - grips_.begin());
    if (count < force_N.size() && count < static_cast<std::size_t>(hold)) return nothing_of();
    force_N.resize(count);
    for (double at_N = force_N.back() + ramp_.grip_step_N;
         at_N < ramp_.start_force_N && force_N.size() < most;
         at_N += kRecipeRestore_N_s * kPeriod_s) {
      force_N.push_back(at_N);
    }
    prepare(made, force_N);
    settle();
    mark();
    return std::move(run_);
  }

 private:
  // A belt that does not grip at the start: no sample says anything.
  ExperimentData nothing_of() {
    grips_.assign(grips_.size(), false);
    mark();
    return std::move(run_);
  }
  void prepare(const Campaign& made, const std::vector<double>& force_N) {
    const auto n = static_cast<Index>(force_N.size());
    const estimator::VariatorParameters& v = like_.variator;
    run_ = {};
    run_.name = "planned";
    run_.dt_s = kPeriod_s;
    run_.t_s = ArrayXd::LinSpaced(n, 0.0, kPeriod_s * static_cast<double>(n - 1));
    run_.torque_is_engine =
        std::any_of(made.runs.begin(), made.runs.end(),
                    [](const ExperimentData& each) { return each.torque_is_engine; });
    run_.stop.assign(force_N.size(), ramp_.is_low ? kLowStop : kOverdriveStop);
    run_.slip_spread_share2 = ArrayXd::Zero(n);
    run_.omega_p = held(ramp_.speed_rad_s, n);
    const double ratio = ramp_.is_low ? v.ratio_low : v.ratio_overdrive;
    set(run_.omega_s, ArrayXd::Constant(n, ramp_.speed_rad_s * ratio * (1.0 - kShallow_share)));
    ArrayXd pressure_Pa(n);
    for (Index k = 0; k < n; ++k) {
      pressure_Pa[k] = (force_N[static_cast<std::size_t>(k)] - v.secondary_spring_force_N) /
                       v.secondary_piston_area_m2;
    }
    set(run_.pressure, pressure_Pa);
    run_.torque = held(ramp_.torque_Nm, n);
    if (is_recorded(made, &ExperimentData::temperature)) {
      run_.temperature = held(ramp_.oil_C, n);
    }
    if (is_recorded(made, &ExperimentData::pressure_p)) {
      run_.pressure_p = held(mean_over(made, &ExperimentData::pressure_p), n);
    }
    if (like_.has_balance) run_.torque_s = held(ramp_.torque_Nm / ratio, n);
    if (like_.has_tracking) set(run_.command, pressure_Pa);
  }

  // What stands behind the belt, until the model sees no residual.
  void settle() {
    const auto n = static_cast<Index>(run_.size());
    grips_.assign(static_cast<std::size_t>(n), true);
    for (int pass = 0; pass < kPasses; ++pass) {
      const Quantities q = quantities(like_, run_, number_, state_);
      const std::array<CurveShape, kStops> curve = shapes(state_.nuisance, q);
      ArrayXd omega_s = run_.omega_s.value;
      for (Index k = 0; k < n; ++k) {
        const auto i = static_cast<std::size_t>(k);
        const auto stop = static_cast<std::size_t>(run_.stop[i]);
        const double share = std::abs(q.belt_torque[k]) / q.capacity[k];
        grips_[i] = share < curve[stop].evaluate(1.0).value;
        const double slip_share = std::copysign(
            std::exp(q.ln_peak_slip[stop]) * place_of(curve[stop], share), q.belt_torque[k]);
        omega_s[k] *= (1.0 - slip_share) / (1.0 - q.slip_share[k]);
      }
      set(run_.omega_s, omega_s);
      if (run_.torque_s.present) {
        set(run_.torque_s, run_.torque_s.value + q.balance / q.ratio);
      }
      if (run_.command.present) set(run_.command, run_.command.value + q.tracking);
    }
  }

  void mark() {
    run_.valid.assign(static_cast<std::size_t>(run_.size()), false);
    for (int k = 0; k < run_.size(); ++k) {
      const auto i = static_cast<std::size_t>(k);
      if (!grips_[i]) continue;
      run_.valid[i] = true;
      ++run_.valid_count;
      if (k == 0 || !grips_[i - 1]) run_.stretches.push_back({k, k});
      run_.stretches.back().end = k + 1;
    }
  }

  Campaign like_;  // the machine and its sensors, no data
  Ramp ramp_;
  const ModelState& state_;
  int number_;
  ExperimentData run_;
  std::vector<bool> grips_;
};

}  // namespace

Campaign planned_next(const Campaign& campaign, const Ramp& ramp, const ModelState& state) {
  std::vector<ExperimentData> runs(campaign.runs.size());
  runs.push_back(Planner(campaign, ramp, state).run(campaign));
  Campaign out = campaign;
  out.runs = std::move(runs);
  out.slip_noise_share.clear();
  return out;
}

}  // namespace beltgrip::diagnose
