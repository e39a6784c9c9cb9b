#include "tools/diagnose/infer/gain.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <numeric>

#include "estimator/statistics/interval.h"
#include "tools/diagnose/infer/forward.h"

namespace beltgrip::diagnose {
namespace {

using Eigen::ArrayXd;
using Eigen::Index;
using Eigen::VectorXd;

constexpr int kDraws = 2000;
constexpr double kBelow = 0.7, kAbout = 0.5;      // slip over slip at the peak
constexpr double kPeakFrom = 0.8, kPeakTo = 1.5;  // chosen, the same: about the peak
constexpr double kPeakSamplesMin = 5.0;           // chosen: of a mean about it
// Chosen: where slip moves the torque by less of its noise, no slip is read from it.
constexpr double kSteepMin = 0.2;
constexpr double kAlone = 25.0;   // times the variance of a size, without one experiment
constexpr double kStepMax = 0.5;  // in tolerances: what one experiment may move the fit by

double rms(const SignalErrors::Sum& sum) {
  return sum.count > 0.0 ? std::sqrt(sum.squares / sum.count) : 0.0;
}

class Draw {  // the same draws every time
 public:
  std::size_t operator()(std::size_t n) {
    state_ ^= state_ << 13;
    state_ ^= state_ >> 7;
    state_ ^= state_ << 17;
    return static_cast<std::size_t>(state_ % n);
  }

 private:
  std::uint64_t state_ = 0x9E3779B97F4A7C15ULL;
};

// Share of all choices of signs for which the sum is as large as it is: what chance would do if
// every experiment were as likely to gain as to lose.
double sign_flip_p(const std::vector<double>& gains) {
  const double seen = std::accumulate(gains.begin(), gains.end(), 0.0);
  const std::size_t patterns = std::size_t{1} << gains.size();
  std::size_t as_large = 0;
  for (std::size_t pattern = 0; pattern < patterns; ++pattern) {
    double sum = 0.0;
    for (std::size_t e = 0; e < gains.size(); ++e) {
      sum += ((pattern >> e) & 1U) != 0 ? gains[e] : -gains[e];
    }
    as_large += sum >= seen ? 1 : 0;
  }
  return static_cast<double>(as_large) / static_cast<double>(patterns);
}

// Sum of what each experiment gains and its 95 % interval, experiments drawn with replacement;
// where they are few, zero lies outside only if the exact test says so too.
Interval sum_over_experiments(const std::vector<double>& gains) {
  constexpr std::size_t kFew = 8;
  constexpr double kChance = 0.05;
  Interval out{std::accumulate(gains.begin(), gains.end(), 0.0), 0.0, 0.0};
  if (gains.empty()) return out;
  Draw draw;
  std::vector<double> sums;
  for (int i = 0; i < kDraws; ++i) {
    double sum = 0.0;
    for (std::size_t e = 0; e < gains.size(); ++e) sum += gains[draw(gains.size())];
    sums.push_back(sum);
  }
  std::sort(sums.begin(), sums.end());
  out.low = sums[kDraws / 40];
  out.high = sums[kDraws - 1 - kDraws / 40];
  if (gains.size() < kFew && sign_flip_p(gains) > kChance) out.low = std::min(out.low, 0.0);
  return out;
}

// Before, after and the 95 % interval of the difference, experiments drawn with replacement.
Gain compare(const std::vector<SignalErrors>& before, const std::vector<SignalErrors>& after) {
  Gain out;
  Draw draw;
  std::map<std::string, std::vector<std::size_t>> holders;
  for (std::size_t e = 0; e < before.size(); ++e) {
    for (const auto& [name, sum] : before[e].signal) {
      // What one of the two cannot judge says nothing of the other.
      const auto other = after[e].signal.find(name);
      if (sum.count > 0.0 && other != after[e].signal.end() && other->second.count > 0.0) {
        holders[name].push_back(e);
      }
    }
  }
  for (const auto& [name, runs] : holders) {
    const auto total = [&](const std::vector<SignalErrors>& errors,
                           const std::vector<std::size_t>& which) {
      SignalErrors::Sum sum;
      for (const std::size_t e : which) {
        const auto& each = errors[e].signal.at(name);
        sum.squares += each.squares;
        sum.count += each.count;
      }
      return rms(sum);
    };
    BeforeAfter result{total(before, runs), total(after, runs)};
    std::vector<double> differences;
    for (int i = 0; i < kDraws; ++i) {
      std::vector<std::size_t> drawn(runs.size());
      for (std::size_t& e : drawn) e = runs[draw(runs.size())];
      differences.push_back(total(before, drawn) - total(after, drawn));
    }
    std::sort(differences.begin(), differences.end());
    result.low = differences[kDraws / 40];
    result.high = differences[kDraws - 1 - kDraws / 40];
    out.signals[name] = result;
  }
  // Friction at the peak: rms over experiments of the mean departure.
  std::vector<std::pair<double, double>> peaks;
  for (std::size_t e = 0; e < before.size(); ++e) {
    if (before[e].ln_mu_count < kPeakSamplesMin || after[e].ln_mu_count < kPeakSamplesMin) continue;
    peaks.emplace_back(before[e].ln_mu_sum / before[e].ln_mu_count,
                       after[e].ln_mu_sum / after[e].ln_mu_count);
  }
  if (peaks.size() >= 2) {
    const auto errors = [&](const std::vector<std::pair<double, double>>& of) {
      double b = 0.0, a = 0.0;
      for (const auto& [x, y] : of) {
        b += x * x;
        a += y * y;
      }
      const auto n = static_cast<double>(of.size());
      return std::pair{std::sqrt(b / n), std::sqrt(a / n)};
    };
    const auto [b, a] = errors(peaks);
    std::vector<double> differences;
    for (int i = 0; i < kDraws; ++i) {
      std::vector<std::pair<double, double>> drawn(peaks.size());
      for (auto& each : drawn) each = peaks[draw(peaks.size())];
      const auto [x, y] = errors(drawn);
      differences.push_back(x - y);
    }
    std::sort(differences.begin(), differences.end());
    out.mu_max = MuMaxError{b, a, differences[kDraws / 40], differences[kDraws - 1 - kDraws / 40]};
  }
  return out;
}

std::string torque_name(const Campaign& campaign) {
  for (const ExperimentData& run : campaign.runs) {
    if (run.valid_count > 0) return run.torque_is_engine ? "engine_torque" : "primary_torque";
  }
  return "primary_torque";
}

// Both states' errors per experiment.
Gain judge(const Campaign& campaign, const std::vector<ModelState>& before,
           const std::vector<ModelState>& after, const std::vector<bool>& which = {}) {
  std::vector<SignalErrors> errors_before, errors_after, forward_before, forward_after;
  for (std::size_t e = 0; e < campaign.runs.size(); ++e) {
    const int run = static_cast<int>(e);
    if (!which.empty() && !which[e]) continue;
    errors_before.push_back(signal_errors(campaign, run, before[e]));
    errors_after.push_back(signal_errors(campaign, run, after[e]));
    ForwardErrors forward = forward_errors(campaign, run, before[e], after[e]);
    forward_before.push_back(std::move(forward.before));
    forward_after.push_back(std::move(forward.after));
  }
  Gain out = compare(errors_before, errors_after);
  out.forward = compare(forward_before, forward_after).signals;
  return out;
}

}  // namespace

bool Gain::better() const {
  constexpr double kTrifle = 0.03, kClear = 0.05;  // of the error
  const bool all_at_once = density && density->low > 0.0;
  return std::any_of(signals.begin(), signals.end(), [&](const auto& each) {
    const BeforeAfter& signal = each.second;
    const double removed = 1.0 - signal.after / std::max(signal.before, 1e-300);
    return (signal.low > 0.0 && removed > kTrifle) || (all_at_once && removed > kClear);
  });
}

bool is_clearly_worse(const BeforeAfter& change, double noise_floor) {
  constexpr double kWorse = 1.1;
  return change.high < 0.0 && change.after > kWorse * std::max(change.before, noise_floor);
}

bool Gain::worse(const std::map<std::string, double>& noise_floor) const {
  return std::any_of(signals.begin(), signals.end(), [&](const auto& each) {
    const auto& [name, signal] = each;
    const auto floor = noise_floor.find(name);
    const double level = floor == noise_floor.end() ? 0.0 : floor->second;
    return is_clearly_worse(signal, level);
  });
}

namespace {

LeftOut leave_one_out(const Engine& engine, const Campaign& campaign, const Whitening& whitening,
                      const ModelState& state, const std::vector<int>& slots) {
  const std::vector<int> parameters = engine.with_nuisances(slots);
  VectorXd scales(static_cast<Index>(parameters.size()));
  std::vector<int> columns;
  for (Index j = 0; j < scales.size(); ++j) {
    scales[j] = engine.scale(parameters[static_cast<std::size_t>(j)]);
    columns.push_back(static_cast<int>(j));
  }
  std::vector<Summary> summaries;
  summaries.reserve(campaign.runs.size());
  for (std::size_t e = 0; e < campaign.runs.size(); ++e) {
    summaries.push_back(
        summarise(campaign, static_cast<int>(e), state, parameters, scales, whitening));
  }
  const Prior prior = engine.prior(parameters, state);
  std::vector<Summary> used;
  for (const Summary& each : summaries) {
    if (each.samples > 0) used.push_back(each);
  }
  const Fit all = fit_linear(used, columns, prior, engine.first_scatter(), 10);
  const Scatter& scatter = all.scatter;
  LeftOut out;
  struct Without {
    VectorXd size, variance;  // of the slots, scaled
  };
  std::vector<Without> sizes;
  for (std::size_t e = 0; e < campaign.runs.size(); ++e) {
    std::vector<Summary> others;
    for (std::size_t i = 0; i < summaries.size(); ++i) {
      if (i != e && summaries[i].samples > 0) others.push_back(summaries[i]);
    }
    ModelState without = state;
    if (!others.empty()) {
      const Fit fit = fit_linear(others, columns, prior, scatter, 0);
      const VectorXd& step = fit.step;
      const auto count = static_cast<Index>(slots.size());
      if (summaries[e].samples > 0) {
        sizes.push_back({step.tail(count), fit.covariance.diagonal().tail(count)});
      }
      const double largest = step.cwiseAbs().maxCoeff();
      engine.move(parameters, step, std::min(1.0, kStepMax / std::max(largest, 1e-12)), without);
    }
    out.states.push_back(std::move(without));
  }
  for (std::size_t i = 0; i < slots.size(); ++i) {
    const auto j = static_cast<Index>(i);
    const double variance = all.covariance.diagonal().tail(static_cast<Index>(slots.size()))[j];
    // Without the one experiment that shows it, nothing is left that could agree or not.
    std::vector<double> seen;
    for (const Without& each : sizes) {
      if (each.variance[j] < kAlone * variance) seen.push_back(each.size[j]);
    }
    const auto n = static_cast<double>(seen.size());
    double mean = 0.0, squares = 0.0;
    for (const double each : seen) mean += each / n;
    for (const double each : seen) squares += (each - mean) * (each - mean);
    out.spread.push_back(n > 1.0 ? std::sqrt((n - 1.0) / n * squares) *
                                       engine.scale(kNuisanceCount + slots[i])
                                 : 0.0);
    const double size = state.effects[slots[i]] / engine.scale(kNuisanceCount + slots[i]);
    const auto there = std::count_if(sizes.begin(), sizes.end(), [&](const Without& each) {
      return (size + each.size[j]) * std::copysign(1.0, size) >
             estimator::kNormal95 * std::sqrt(each.variance[j]);
    });
    out.stability.push_back(static_cast<double>(there) /
                            std::max(1.0, static_cast<double>(sizes.size())));
  }
  return out;
}

}  // namespace

LeftOut leave_one_out(const Engine& engine, const ModelState& state,
                      const std::vector<int>& slots) {
  return leave_one_out(engine, engine.campaign(), engine.whitening(), state, slots);
}

SignalErrors signal_errors(const Campaign& campaign, int run, const ModelState& state) {
  const ExperimentData& data = campaign.runs[static_cast<std::size_t>(run)];
  SignalErrors out;
  if (data.valid_count == 0) return out;
  const Residuals at = residuals_of(campaign, run, state);
  auto& speed = out.signal["secondary_speed"];
  auto& torque = out.signal[torque_name(campaign)];
  const double slip_sigma_share = campaign.slip_noise_share_of(run),
               torque_sigma = campaign.noise.torque_Nm;
  for (int k = 0; k < data.size(); ++k) {
    if (!data.valid[static_cast<std::size_t>(k)]) continue;
    const double x = std::abs(at.foot[k]);
    // The distance vector runs along (slope s_slip^2, -s_torque^2); its ends on the axes are the
    // errors of one signal given the other.
    const double distance = at.value[kFrictionResidual][k] / at.weight[k];  // Nm, at given slip
    if (x < kBelow && at.slope[k] > 0.0 &&
        at.slope[k] * slip_sigma_share > kSteepMin * torque_sigma) {
      const double slip_error_share = distance / at.slope[k];
      const double omega_s_error = data.omega_s.value[k] * slip_error_share;
      speed.squares += omega_s_error * omega_s_error;
      speed.count += 1.0;
    }
    if (x > kAbout) {
      torque.squares += distance * distance;
      torque.count += 1.0;
    }
    if (x > kPeakFrom && x < kPeakTo) {
      out.ln_mu_sum += distance / at.model_Nm[k];
      out.ln_mu_count += 1.0;
    }
    if (at.balance_weight[k] > 0.0 && data.torque_s.present) {
      const double ratio = data.omega_s.value[k] / data.omega_p.value[k];
      const double error = at.value[kBalanceResidual][k] / at.balance_weight[k] / ratio;
      auto& sum = out.signal["secondary_torque"];
      sum.squares += error * error;
      sum.count += 1.0;
    }
    if (campaign.has_tracking && data.command.present) {
      const double error = at.value[kTrackingResidual][k] * campaign.noise.tracking_Pa;
      auto& sum = out.signal["secondary_pressure"];
      sum.squares += error * error;
      sum.count += 1.0;
    }
  }
  return out;
}

std::map<std::string, double> noise_floors(const Campaign& campaign, const ModelState& state) {
  std::map<std::string, double> out;
  double omega_s = 0.0, balance = 0.0, balance_count = 0.0, count = 0.0, leverage = 0.0;
  for (std::size_t e = 0; e < campaign.runs.size(); ++e) {
    const ExperimentData& data = campaign.runs[e];
    if (data.valid_count == 0) continue;
    const Residuals at = residuals_of(campaign, static_cast<int>(e), state);
    for (int k = 0; k < data.size(); ++k) {
      if (!data.valid[static_cast<std::size_t>(k)]) continue;
      omega_s += data.omega_s.value[k];
      if (campaign.has_balance && at.balance_weight[k] > 0.0) {
        const double noise_Nm =
            data.omega_p.value[k] / data.omega_s.value[k] / at.balance_weight[k];
        balance += noise_Nm * noise_Nm;
        balance_count += 1.0;
      }
      leverage += 1.0 / (at.weight[k] * at.weight[k]);
      count += 1.0;
    }
  }
  if (count == 0.0) return out;
  out["secondary_speed"] = omega_s / count * campaign.noise.slip_share;
  out[torque_name(campaign)] = std::sqrt(leverage / count);
  if (campaign.has_balance) {
    out["secondary_torque"] = std::sqrt(balance / std::max(balance_count, 1.0));
  }
  if (campaign.has_tracking) out["secondary_pressure"] = campaign.noise.tracking_Pa;
  return out;
}

ForwardErrors forward_errors(const Campaign& campaign, int run, const ModelState& before,
                             const ModelState& after) {
  ForwardErrors out;
  const Forward one = run_forward(campaign, run, before), other = run_forward(campaign, run, after);
  for (std::size_t i = 0; i < one.signals.size(); ++i) {
    const std::string name(one.signals[i].name);
    for (std::size_t k = 0; k < one.grips.size(); ++k) {
      if (!one.grips[k] || !other.grips[k]) continue;
      const auto add = [&](const ForwardSignal& signal, SignalErrors& to) {
        const auto at = static_cast<Index>(k);
        const double error = signal.measured[at] - signal.simulated[at];
        SignalErrors::Sum& sum = to.signal[name];
        sum.squares += error * error;
        sum.count += 1.0;
      };
      add(one.signals[i], out.before);
      add(other.signals[i], out.after);
    }
  }
  return out;
}

std::map<std::string, SimulatedSignal> simulated_signals(const Campaign& campaign,
                                                         const ModelState& nominal) {
  constexpr Index kApart = 4;  // samples: nearer ones share those of the local fit
  std::map<std::string, SignalErrors::Sum> sums;
  std::map<std::string, std::vector<double>> differences;
  for (std::size_t e = 0; e < campaign.runs.size(); ++e) {
    for (const ForwardSignal& signal :
         run_forward(campaign, static_cast<int>(e), nominal).signals) {
      const std::string name(signal.name);
      const ArrayXd error = signal.measured - signal.simulated;
      for (Index k = 0; k < error.size(); ++k) {
        if (!std::isfinite(error[k])) continue;
        sums[name].squares += error[k] * error[k];
        sums[name].count += 1.0;
        if (k < kApart || k + kApart >= error.size()) continue;
        const double bend = error[k - kApart] - 2.0 * error[k] + error[k + kApart];
        if (std::isfinite(bend)) differences[name].push_back(bend / std::sqrt(6.0));
      }
    }
  }
  std::map<std::string, SimulatedSignal> out;
  for (const auto& [name, sum] : sums) {
    out[name] = {rms(sum), robust_sigma(differences[name]), std::nullopt};
  }
  return out;
}

namespace {
// Every state is fitted by the same measure: the noise that covers the nominal machine's misfit, or
// the sensors' own, correlations counted.
std::vector<ModelState> fits_without_each(const Engine& engine, const Nominal& nominal,
                                          const ModelState& state, const std::vector<int>& slots) {
  Campaign campaign = engine.campaign();
  campaign.noise = nominal.noise;
  const Whitening whitening =
      nominal.is_covered ? engine.whitening() : identity_whitening(campaign);
  return leave_one_out(engine, campaign, whitening, state, slots).states;
}
}  // namespace

Gain left_out_gain(const Engine& engine, const Nominal& nominal,
                   const std::vector<ModelState>& extended, const std::vector<bool>& which) {
  return judge(engine.campaign(), fits_without_each(engine, nominal, nominal.state, {}), extended,
               which);
}

Gain left_out_gain(const Engine& engine, const Nominal& nominal, const ModelState& extended,
                   const std::vector<int>& slots) {
  const std::vector<ModelState> before = fits_without_each(engine, nominal, nominal.state, {});
  const std::vector<ModelState> after =
      slots.empty() ? before : fits_without_each(engine, nominal, extended, slots);
  Gain out = judge(engine.campaign(), before, after);
  if (!slots.empty()) out.density = sum_over_experiments(engine.left_out_gains());
  return out;
}

Gain held_out_gain(const Campaign& held_out, const ModelState& nominal,
                   const ModelState& extended) {
  const auto runs = held_out.runs.size();
  return judge(held_out, std::vector<ModelState>(runs, nominal),
               std::vector<ModelState>(runs, extended));
}

}  // namespace beltgrip::diagnose
