#include "tools/diagnose/infer/line_test.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <numbers>
#include <vector>

#include "estimator/statistics/order.h"
#include "tools/diagnose/infer/rounding_swing.h"

namespace beltgrip::diagnose {
namespace {

using Eigen::ArrayXd;

// Below the first ramps and sweeps leave their own lines; above the second the grid's filter ends.
// Not varied.
constexpr double kLowest_Hz = 0.7, kHighest_Hz = 4.5;
// What 40 s resolve: half a step of 0.05 Hz beside the grid a line is gone. Measured: a ripple at
// 3.12 Hz stands 20 sigmas above the noise instead of 10. A fifth less or more: the same verdicts
// of six ripples (5.7 to 23) and seven healthy campaigns (2.3 to 4.3).
constexpr double kStep_Hz = 0.025;
// Of a line: counts as the same, as one step of the grid did before. A fifth less or more: the same
// verdicts.
constexpr double kBeside_Hz = 0.05;
constexpr double kAround_Hz = 0.6;  // the noise's level is the median so far about
// The level of the lowest is taken on both sides as well, down to what the slow course leaves: what
// is left of a friction curve falls with frequency, and its level above is too low. Measured, by
// the same residuals of 106 healthy campaigns of other make: strongest line 7.7 sigmas by a level
// from kLowest_Hz on, 4.7 by this. A quarter less or more: 6.9 instead of 7.1 in a ripple at 0.66
// Hz, the rest of 13 campaigns the same.
constexpr double kLevelFrom_Hz = 0.2;
// Slower courses are no line. Chosen. A fifth less or more: 23 of our own campaigns get the same
// verdict, names and causes.
constexpr double kSmooth_s = 2.0;
constexpr int kLineSamplesMin = 100;
constexpr double kLeast = 0.05;  // of the noise: less is rounding
constexpr double kClip = 4.0;    // sigmas
// Chosen, of the level about it: noise comes so far in 1 of 400. Tried on four healthy campaigns
// and a ripple: at 4 the same answers, at 9 the answer to the drive is a line again in one of them.
constexpr double kDriven = 6.0;
// Chosen, deviation over mean: four times what the noise of a torque comes to on the grid.
constexpr double kDrives = 0.01;

int half_window(double dt_s) { return static_cast<int>(0.5 * kSmooth_s / dt_s); }

// The residual's valid stretches without their slow course, outliers clipped; zero elsewhere.
ArrayXd fast_part(const ExperimentData& run, const ArrayXd& residual, int every) {
  const int half = half_window(run.dt_s);
  ArrayXd out = ArrayXd::Zero(residual.size());
  std::vector<double> sizes;
  for (int k = 0; k < run.size(); k += every) {
    if (!run.valid[static_cast<std::size_t>(k)] || residual[k] == 0.0) continue;
    double sum = 0.0;
    int count = 0;
    for (int i = std::max(0, k - half); i <= std::min(run.size() - 1, k + half); ++i) {
      if (!run.valid[static_cast<std::size_t>(i)] || residual[i] == 0.0) continue;
      sum += residual[i];
      ++count;
    }
    if (count < half / every) continue;
    out[k] = residual[k] - sum / count;
    sizes.push_back(out[k]);
  }
  const double bound = kClip * robust_sigma(sizes);
  if (!(bound > kClip * kLeast) || static_cast<int>(sizes.size()) < kLineSamplesMin) return {};
  return out.max(-bound).min(bound);
}

// What is left of a swing where the mean about each sample is taken off: more than all of it where
// the mean is against it, half as much again in power at 0.7 Hz.
double left_by_fast_part(double frequency_Hz, double dt_s) {
  const int half = half_window(dt_s);
  const double turn = 2.0 * std::numbers::pi * frequency_Hz * dt_s;
  double mean = 1.0;
  for (int i = 1; i <= half; ++i) mean += 2.0 * std::cos(turn * i);
  return 1.0 - mean / (2.0 * half + 1.0);
}

// Of a fast part, from kLevelFrom_Hz on: of what it was taken from.
std::vector<double> spectrum(const ArrayXd& values, double dt_s, double highest_Hz) {
  // All frequencies side by side, sample by sample.
  std::vector<double> left, cosine, sine;
  for (double f = kLevelFrom_Hz; f <= highest_Hz; f += kStep_Hz) {
    const double turn = 2.0 * std::numbers::pi * f * dt_s;
    left.push_back(left_by_fast_part(f, dt_s));
    cosine.push_back(std::cos(turn));
    sine.push_back(std::sin(turn));
  }
  const std::size_t count = left.size();
  std::vector<double> re(count, 1.0), im(count, 0.0), sum_re(count, 0.0), sum_im(count, 0.0);
  for (const double each : values) {
    for (std::size_t i = 0; i < count; ++i) {
      sum_re[i] += each * re[i];
      sum_im[i] += each * im[i];
      const double next = re[i] * cosine[i] - im[i] * sine[i];
      im[i] = re[i] * sine[i] + im[i] * cosine[i];
      re[i] = next;
    }
  }
  std::vector<double> out(count);
  for (std::size_t i = 0; i < count; ++i) {
    out[i] = (sum_re[i] * sum_re[i] + sum_im[i] * sum_im[i]) / (left[i] * left[i]);
  }
  return out;
}

// In units of the level about it, from a frequency on.
std::vector<double> levelled(const std::vector<double>& power, double from_Hz) {
  const int around = static_cast<int>(kAround_Hz / kStep_Hz);
  const int first = static_cast<int>(std::lround((from_Hz - kLevelFrom_Hz) / kStep_Hz));
  std::vector<double> out;
  for (int i = first; i < static_cast<int>(power.size()); ++i) {
    std::vector<double> near;
    for (int j = std::max(0, i - around);
         j <= std::min(static_cast<int>(power.size()) - 1, i + around); ++j) {
      near.push_back(power[static_cast<std::size_t>(j)]);
    }
    const double level = estimator::median(near) / std::numbers::ln2;  // of an exponential
    out.push_back(level > 0.0 ? power[static_cast<std::size_t>(i)] / level : 0.0);
  }
  return out;
}

struct Moments {
  double mean = 0.0, deviation = 0.0;
};
Moments moments(const ExperimentData& run, const ArrayXd& signal) {
  double sum = 0.0, squares = 0.0, count = 0.0;
  for (int k = 0; k < run.size(); ++k) {
    if (!run.valid[static_cast<std::size_t>(k)] || !std::isfinite(signal[k])) continue;
    sum += signal[k];
    squares += signal[k] * signal[k];
    count += 1.0;
  }
  const double mean = sum / std::max(count, 1.0);
  return {mean, std::sqrt(std::max(squares / std::max(count, 1.0) - mean * mean, 0.0))};
}

// Of a signal, over the valid samples: with a mean of zero and a variance of one.
ArrayXd swing(const ExperimentData& run, const ArrayXd& signal) {
  const auto [mean, deviation] = moments(run, signal);
  if (!(deviation > 0.0)) return ArrayXd::Zero(signal.size());
  return signal.isFinite().select((signal - mean) / deviation, 0.0);
}

// The pressure is driven always; a torque or a speed that hardly moves is not, and what it has of a
// line is its answer to one.
std::vector<ArrayXd> drives_of(const ExperimentData& run) {
  std::vector<ArrayXd> out{swing(run, run.pressure.value)};
  for (const ArrayXd& each : {std::cref(run.torque.value), std::cref(run.omega_p.value)}) {
    const auto [mean, deviation] = moments(run, each);
    if (deviation > kDrives * std::abs(mean)) out.push_back(swing(run, each));
  }
  return out;
}

}  // namespace

std::vector<bool> driven(const ExperimentData& run, std::size_t bins, double lowest_Hz,
                         double highest_Hz) {
  const std::vector<ArrayXd> drives = drives_of(run);
  std::vector<bool> out(bins, false);
  const auto look = [&](const ArrayXd& product) {
    const ArrayXd fast = fast_part(run, product, 1);
    if (fast.size() == 0) return;
    const std::vector<double> own = levelled(spectrum(fast, run.dt_s, highest_Hz), lowest_Hz);
    for (std::size_t i = 0; i < std::min(bins, own.size()); ++i) {
      out[i] = out[i] || own[i] > kDriven;
    }
  };
  for (std::size_t a = 0; a < drives.size(); ++a) {
    for (std::size_t b = 0; b < drives.size(); ++b) {
      const ArrayXd second = swing(run, drives[a] * drives[b]);
      if (b >= a) look(second);
      // Not of three times the same: that has the drive's own frequency.
      if (b != a) look(swing(run, swing(run, drives[a].square()) * drives[b]));
    }
  }
  return out;
}

namespace {

// A look at a residual. What swings in the friction, the ratio or the torque shows in it by as much
// as the sample answers to that: most of a ramp answers little, so each sample counts by its
// answer.
struct Look {
  const char* acts_on;
  ResidualKind kind;
  ArrayXd QuantityChange::*into;  // none: each sample counts alike
};
constexpr std::array<Look, 4> kLooks{{{"friction", kFrictionResidual, &QuantityChange::ln_capacity},
                                      {"ratio", kFrictionResidual, &QuantityChange::slip_share},
                                      {"torque", kFrictionResidual, &QuantityChange::torque},
                                      {"torque", kBalanceResidual, nullptr}}};

ArrayXd answer_to(const Campaign& campaign, const Residuals& at, const Look& look) {
  if (look.into == nullptr) return ArrayXd::Ones(at.foot.size());
  QuantityChange unit;
  unit.*look.into = ArrayXd::Ones(at.foot.size());
  ArrayXd answer = propagate(campaign, at, unit)[static_cast<std::size_t>(look.kind)];
  // None for more than those of a fifth of the samples: what runs away in half a second is no line.
  std::vector<double> sizes;
  for (const double each : answer) {
    if (each != 0.0) sizes.push_back(std::abs(each));
  }
  if (sizes.empty()) return answer;
  const double most = estimator::at_rank(sizes, sizes.size() * 4 / 5);
  return answer.max(-most).min(most);
}

// Of the swings that rounding may leave, where the fast part is told.
double power_of(const std::vector<ResidualColumns>& swings, ResidualKind kind, const ArrayXd& fast,
                const ArrayXd& answer) {
  double out = 0.0;
  for (const ResidualColumns& each : swings) {
    const ArrayXd& column = each[static_cast<std::size_t>(kind)];
    if (column.size() == 0) continue;
    const double half = 0.5 * (fast != 0.0).select(column * answer, 0.0).abs().sum();
    out += half * half;
  }
  return out;
}

}  // namespace

SpectralLine strongest_line(const Campaign& campaign, const ModelState& state) {
  struct Pool {
    std::vector<double> sum;
    int runs = 0;
  };
  std::array<Pool, kLooks.size()> pools;
  for (std::size_t e = 0; e < campaign.runs.size(); ++e) {
    const ExperimentData& run = campaign.runs[e];
    if (run.valid_count < kLineSamplesMin) continue;
    Residuals at = residuals_of(campaign, static_cast<int>(e), state);
    move_to_foot(campaign, static_cast<int>(e), at);
    const std::vector<ResidualColumns> rounding =
        rounding_swings(campaign, static_cast<int>(e), at);
    std::array<std::vector<bool>, kResidualKinds> is_driven;
    for (std::size_t l = 0; l < kLooks.size(); ++l) {
      const auto kind = static_cast<std::size_t>(kLooks[l].kind);
      if (at.value[kind].size() == 0) continue;
      const int every = kLooks[l].kind == kBalanceResidual ? kBalanceStep : 1;
      const ArrayXd fast = fast_part(run, at.value[kind], every);
      if (fast.size() == 0) continue;
      const double highest_Hz = std::min(kHighest_Hz, 0.45 / (run.dt_s * every));
      const ArrayXd answer = answer_to(campaign, at, kLooks[l]);
      const std::vector<double> power = spectrum(fast * answer, run.dt_s, highest_Hz);
      std::vector<double> own = levelled(power, kLowest_Hz);
      const double of_rounding = power_of(rounding, kLooks[l].kind, fast, answer);
      const std::size_t skipped = power.size() - own.size();
      if (is_driven[kind].empty())
        is_driven[kind] = driven(run, own.size(), kLowest_Hz, highest_Hz);
      for (std::size_t i = 0; i < own.size(); ++i) {
        if (is_driven[kind][i] || power[skipped + i] < of_rounding)
          own[i] = std::min(own[i], 1.0);  // as noise has it
      }
      Pool& pool = pools[l];
      pool.sum.resize(std::max(pool.sum.size(), own.size()), 0.0);
      for (std::size_t i = 0; i < own.size(); ++i) pool.sum[i] += own[i];
      ++pool.runs;
    }
  }
  const auto beside = static_cast<std::size_t>(std::lround(kBeside_Hz / kStep_Hz));
  SpectralLine out;
  for (std::size_t q = 0; q < pools.size(); ++q) {
    const Pool& pool = pools[q];
    if (pool.runs == 0 || pool.sum.size() < 10) continue;
    double whole = 0.0;
    for (const double each : pool.sum) whole += each;
    for (std::size_t i = 0; i < pool.sum.size(); ++i) {
      // Wilson and Hilferty: a sum of exponential variables as a normal one.
      const double n = pool.runs;
      const double excess =
          (std::cbrt(pool.sum[i] / n) - (1.0 - 1.0 / (9.0 * n))) * 3.0 * std::sqrt(n);
      if (excess <= out.excess) continue;
      double line = 0.0;
      for (std::size_t j = i > beside ? i - beside : 0;
           j <= std::min(i + beside, pool.sum.size() - 1); ++j) {
        line += pool.sum[j];
      }
      out = {kLooks[q].acts_on, kLowest_Hz + kStep_Hz * static_cast<double>(i), excess,
             line / whole};
    }
  }
  return out;
}

}  // namespace beltgrip::diagnose
