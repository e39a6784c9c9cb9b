// Method "paper" against equations (10) and (16) to (21) written out here a second time, naively
// and without matrices: two passes over a window kept in full, two states in scalars. Fed with
// traces of slip and friction that are made here; Table I is typed in again.
#include "estimator/choice/make_estimator.h"
#include "estimator/paper/paper_estimator.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <deque>
#include <functional>
#include <memory>
#include <numbers>
#include <utility>
#include <vector>

#include "estimator/signal/excitation.h"

namespace beltgrip::estimator {
namespace {

// Table I.
constexpr double kT_s = 1.0, kQk = 5e-3, kQmu0 = 0.5, kCv = 0.05, kCm = 1e-3;

const VariatorParameters kVariator;

double variance_in_two_passes(const std::deque<double>& window) {
  double mean = 0.0;
  for (const double value : window) mean += value / static_cast<double>(window.size());
  double sum = 0.0;
  for (const double value : window) sum += (value - mean) * (value - mean);
  return sum / static_cast<double>(window.size());
}

// Deterministic noise of unit size, from a linear congruence.
class Noise {
 public:
  explicit Noise(std::uint64_t seed) : state_(seed) {}
  double operator()() {
    double sum = 0.0;
    for (int i = 0; i < 12; ++i) {
      state_ = state_ * 6364136223846793005ULL + 1442695040888963407ULL;
      sum += static_cast<double>(state_ >> 11) * 0x1p-53;
    }
    return sum - 6.0;
  }

 private:
  std::uint64_t state_;
};

TEST(Excitation, IsThePopulationVarianceOfTheLastSecond) {
  SlipExcitation excitation(kT_s, 200.0, kCv);
  std::deque<double> window;
  Noise noise(1);
  for (int i = 0; i < 3000; ++i) {
    // Rest, drift, a jump and a large offset.
    const double slip_percent =
        0.1 * noise() + (i > 800 ? 0.004 * (i - 800) : 0.0) + (i > 2000 ? 5000.0 : 0.0);
    excitation.step(slip_percent);
    window.push_back(slip_percent);
    if (window.size() > 200) window.pop_front();
    const double truth = window.size() < 200 ? 0.0 : variance_in_two_passes(window);
    EXPECT_NEAR(excitation.variance(), truth, 1e-7 + 1e-9 * truth) << i;
    EXPECT_EQ(excitation.open(), truth > kCv) << i;
  }
}

TEST(Excitation, TheGateOpensAboveTheThresholdOnly) {
  // Slip of +-a alternating has variance a^2: 0.25 and 0.0625 are exact in binary.
  for (const auto& [threshold, opens] : {std::pair{0.0625, false}, std::pair{0.0624, true}}) {
    SlipExcitation excitation(1.0, 100.0, threshold);
    int rising = 0;
    for (int i = 0; i < 500; ++i) {
      excitation.step(i % 2 == 0 ? 0.25 : -0.25);
      EXPECT_EQ(excitation.open(), opens && i >= 99) << i;
      if (excitation.opened()) {
        EXPECT_EQ(i, 99);
        ++rising;
      }
    }
    EXPECT_EQ(rising, opens ? 1 : 0);
  }
}

TEST(Excitation, ForgetsAtReset) {
  SlipExcitation excitation(1.0, 100.0, kCv);
  for (int i = 0; i < 150; ++i) excitation.step(i % 2);
  ASSERT_TRUE(excitation.open());
  excitation.reset();
  EXPECT_FALSE(excitation.open());
  EXPECT_EQ(excitation.variance(), 0.0);
  for (int i = 0; i < 99; ++i) {
    excitation.step(i % 2);
    ASSERT_EQ(excitation.variance(), 0.0) << i;
  }
  excitation.step(1.0);
  EXPECT_NEAR(excitation.variance(), 0.25, 1e-12);
}

// A curve as functions of time: slip in percent and mu*, at 105 rad/s in overdrive, with the torque
// held at 50 Nm in the given direction.
struct Trace {
  std::function<double(double)> slip_percent;
  std::function<double(double)> mu;
  double end_s = 10.0;
  double noise_slip_percent = 0.0;
  double sign = 1.0;
};

std::vector<VariatorSample> samples(const Trace& trace, double rate_hz) {
  std::vector<VariatorSample> out;
  Noise noise(7);
  for (int i = 0; i < static_cast<int>(trace.end_s * rate_hz); ++i) {
    const double t_s = i / rate_hz;
    const double slip_percent = trace.slip_percent(t_s) + trace.noise_slip_percent * noise();
    const double force_N =
        50.0 * std::cos(11.0 * std::numbers::pi / 180.0) / (2.0 * 0.0784 * trace.mu(t_s));
    out.push_back({.t_ns = std::lround(t_s * 1e9),
                   .omega_p_rad_s = 105.0,
                   .omega_s_rad_s = 105.0 * 2.25 * (1.0 - trace.sign * slip_percent / 100.0),
                   .secondary_pressure_Pa = (force_N - 500.0) / 0.0113,
                   .torque_Nm = trace.sign * 50.0,
                   .usable = true});
  }
  return out;
}

// The method again, from the published sigma* and mu* of each usable sample.
class Naive {
 public:
  explicit Naive(const EstimatorSettings& settings)
      : k(settings.initial_slope),
        settings_(settings),
        window_(static_cast<std::size_t>(std::lround(kT_s * settings.sample_rate_hz))),
        scale_(200.0 / settings.sample_rate_hz) {}

  void step(double slip_percent, double mu) {
    slips_percent_.push_back(slip_percent);
    if (slips_percent_.size() > window_) slips_percent_.pop_front();
    v = slips_percent_.size() == window_ ? variance_in_two_passes(slips_percent_) : 0.0;
    const bool was_open = open;
    open = v > kCv;
    if (open && !was_open) ++rising;
    const bool paused = settings_.reopening == Reopening::kPaused && rising > 1;
    if (open && !was_open && !paused) {
      if (settings_.reopening == Reopening::kInitialSlope) k = settings_.initial_slope;
      mu0 = mu - k * slip_percent;
      p11 = p22 = settings_.initial_variance;
      p12 = 0.0;
    } else if (open) {
      const double s11 = p11 + kQk * scale_, s22 = p22 + kQmu0 * scale_, s12 = p12;  // (16), (21)
      const double innovation =
          slip_percent * (slip_percent * s11 + s12) + (slip_percent * s12 + s22) + 1.0;
      const double gain_k = (slip_percent * s11 + s12) / innovation;  // (17), R = 1
      const double gain_mu0 = (slip_percent * s12 + s22) / innovation;
      const double error = mu - slip_percent * k - mu0;
      k += gain_k * error;  // (18)
      mu0 += gain_mu0 * error;
      p11 = (1.0 - gain_k * slip_percent) * s11 - gain_k * s12;  // (19)
      p12 = (1.0 - gain_k * slip_percent) * s12 - gain_k * s22;
      p22 = -gain_mu0 * slip_percent * s12 + (1.0 - gain_mu0) * s22;
    }
    largest = std::max(largest, mu);
    if (stopped || !open) return;
    const bool inside = std::abs(k) < kCm;
    if (inside && !was_inside && settings_.peak_samples == PeakSamples::kLast) near_peak.clear();
    if (inside) near_peak.push_back(mu);
    was_inside = inside;
    stopped = k < settings_.stop_slope;
  }
  double mean() const {
    double sum = 0.0;
    for (const double mu : near_peak) sum += mu;
    return sum / static_cast<double>(near_peak.size());
  }
  double deviation() const {
    double sum = 0.0;
    for (const double mu : near_peak) sum += (mu - mean()) * (mu - mean());
    return std::sqrt(sum / static_cast<double>(near_peak.size()));
  }

  double v = 0.0, k, mu0 = 0.0, p11 = 0.0, p12 = 0.0, p22 = 0.0, largest = 0.0;
  bool open = false, stopped = false, was_inside = false;
  int rising = 0;
  std::vector<double> near_peak;

 private:
  EstimatorSettings settings_;
  std::deque<double> slips_percent_;
  std::size_t window_;
  double scale_;
};

struct Outcome {
  Naive naive;
  PeakEstimate peak;
  int usable = 0, held = 0;
  StopReason stop = StopReason::kNone;
};

// Steps both and compares them at every sample.
Outcome compare(const Trace& trace, double rate_hz, EstimatorSettings settings = {},
                const SensorAccuracies& accuracies = {}) {
  settings.method = Method::kPaper;
  settings.sample_rate_hz = rate_hz;
  settings.torque_is_engine = false;
  const double stop_slope = settings.stop_slope;
  const auto estimator = make_slip_curve_estimator(settings, kVariator, accuracies);
  Outcome run = {.naive = Naive(settings), .peak = {}};
  double k_before = settings.initial_slope;
  for (const VariatorSample& sample : samples(trace, rate_hz)) {
    const CurveEstimate& now = estimator->step(sample);
    EXPECT_EQ(now.t_ns, sample.t_ns);
    if (!now.usable) continue;
    ++run.usable;
    const bool was_open = run.naive.open;
    run.naive.step(now.sigma_star_percent, now.mu_star);
    EXPECT_NEAR(now.slip_variance, run.naive.v, 1e-9) << now.t_ns;
    EXPECT_NEAR(now.friction_slope, run.naive.k, 1e-9) << now.t_ns;
    if (!run.naive.open) {
      EXPECT_EQ(now.friction_slope, k_before) << "held while the gate is closed";
      EXPECT_EQ(now.phase, Phase::kQuiet);
      run.held += k_before != settings.initial_slope;
    } else {
      const bool anew = run.naive.rising == 1 || settings.reopening == Reopening::kInitialSlope;
      if (!was_open && anew) {
        EXPECT_EQ(now.friction_slope, settings.initial_slope) << "the rising edge";
      }
      EXPECT_EQ(now.phase, run.naive.k > kCm          ? Phase::kExcited
                           : run.naive.k < stop_slope ? Phase::kMacroSlip
                                                      : Phase::kPeak)
          << now.t_ns;
    }
    k_before = now.friction_slope;
    EXPECT_EQ(now.stop, run.naive.stopped ? StopReason::kSlope : StopReason::kNone) << now.t_ns;
    run.stop = now.stop;
    if (testing::Test::HasFailure()) break;  // one is enough
  }
  EXPECT_TRUE(estimator->conclude());
  run.peak = estimator->peak();
  return run;
}

// Slip at rest, then faster and faster over a round peak of 0.105 at 4 %, as on the rig.
double rig_slip_percent(double t_s) {
  return t_s < 4.0 ? 0.5 : 0.5 + 0.3 * (t_s - 4.0) * (t_s - 4.0);
}
double rig_mu(double t_s) {
  const double from_peak = rig_slip_percent(t_s) - 4.0;
  return 0.105 - 0.0025 * from_peak * from_peak / (1.0 + std::abs(from_peak) / 2.0);
}

TEST(Paper, IsTheRecursionOfThePaperOverARigTrace) {
  for (const double sign : {1.0, -1.0}) {
    const Outcome run = compare({rig_slip_percent, rig_mu, 11.0, 0.02, sign}, 200.0);
    ASSERT_GT(run.usable, 2000);
    EXPECT_EQ(run.naive.rising, 1);
    EXPECT_EQ(run.stop, StopReason::kSlope);
    ASSERT_EQ(run.peak.kind, PeakKind::kValue);
    ASSERT_GT(run.naive.near_peak.size(), 10U);
    EXPECT_NEAR(run.peak.mu_max, run.naive.mean(), 1e-12);
    EXPECT_EQ(run.peak.samples, static_cast<std::int64_t>(run.naive.near_peak.size()));
    EXPECT_NEAR(run.peak.mu_max_std, run.naive.deviation(), 1e-9);
    EXPECT_NEAR(run.peak.ci95_low, run.naive.mean() - 1.96 * run.naive.deviation(), 1e-6);
    EXPECT_NEAR(run.peak.ci95_high, run.naive.mean() + 1.96 * run.naive.deviation(), 1e-6);
  }
}

TEST(Paper, ScalesTheWalkWithTheSampleRate) {
  for (const double rate_hz : {100.0, 50.0, 400.0}) {
    const Outcome run = compare({rig_slip_percent, rig_mu, 11.0, 0.02}, rate_hz);
    EXPECT_EQ(run.naive.rising, 1) << rate_hz;
    EXPECT_EQ(run.stop, StopReason::kSlope) << rate_hz;
    EXPECT_NEAR(run.peak.mu_max, run.naive.mean(), 1e-12) << rate_hz;
  }
}

TEST(Paper, SamplesBetweenTheBandAndTheStopAreOfThePeaksPhaseButNotOfItsMean) {
  EstimatorSettings later;
  later.stop_slope = -1.5e-3;
  const Outcome run = compare({rig_slip_percent, rig_mu, 11.0, 0.02}, 200.0, later);
  EXPECT_EQ(run.stop, StopReason::kSlope);
  EXPECT_NEAR(run.peak.mu_max, run.naive.mean(), 1e-12);
  const Outcome early = compare({rig_slip_percent, rig_mu, 11.0, 0.02}, 200.0);
  EXPECT_EQ(run.peak.samples, early.peak.samples);  // k only falls: the band is left once
}

// Strokes of slip with rest between them, up and down over a round peak of 0.1 at 2 %.
TEST(Paper, ReadingsThatTheTextLeavesOpen) {
  const auto slip_percent = [](double t_s) {
    const double part = std::fmod(t_s, 6.0);
    return 1.0 + (part < 3.0 ? 0.0 : std::min(1.0, part - 3.0) * 1.5);
  };
  const auto mu = [&](double t_s) {
    return 0.1 - 0.002 * (slip_percent(t_s) - 2.0) * (slip_percent(t_s) - 2.0);
  };
  std::vector<double> slopes;
  int left_the_band = 0;
  for (const Reopening reopening :
       {Reopening::kHeldSlope, Reopening::kInitialSlope, Reopening::kPaused}) {
    for (const auto& [slope, variance] : {std::pair{0.02, 1e4}, std::pair{0.0, 100.0}}) {
      EstimatorSettings settings;
      settings.reopening = reopening;
      settings.initial_slope = slope;
      settings.initial_variance = variance;
      settings.stop_slope = -1.0;
      const Outcome all = compare({slip_percent, mu, 20.0}, 200.0, settings);
      settings.peak_samples = PeakSamples::kLast;
      const Outcome last = compare({slip_percent, mu, 20.0}, 200.0, settings);
      for (const Outcome& run : {all, last}) {
        EXPECT_GE(run.naive.rising, 3);
        EXPECT_GT(run.held, 1000);
        ASSERT_FALSE(run.naive.near_peak.empty());
        EXPECT_NEAR(run.peak.mu_max, run.naive.mean(), 1e-12);
      }
      EXPECT_EQ(all.naive.k, last.naive.k);
      EXPECT_LE(last.peak.samples, all.peak.samples);
      left_the_band += last.peak.samples < all.peak.samples ? 1 : 0;
      slopes.push_back(all.naive.k);
    }
  }
  EXPECT_GE(left_the_band, 2);
  // Every reading of the filter is another one.
  std::sort(slopes.begin(), slopes.end());
  EXPECT_EQ(std::adjacent_find(slopes.begin(), slopes.end()), slopes.end());
}

TEST(Paper, NoSampleNearThePeakMeansALowerBound) {
  // Slip at rest: the gate never opens, and the largest mu* that was seen is the bound.
  const Outcome run = compare(
      {[](double) { return 1.0; }, [](double t_s) { return 0.06 + 0.002 * t_s; }, 8.0}, 200.0);
  EXPECT_EQ(run.naive.rising, 0);
  EXPECT_EQ(run.stop, StopReason::kNone);
  EXPECT_EQ(run.peak.kind, PeakKind::kLowerBound);
  EXPECT_NEAR(run.peak.mu_max, run.naive.largest, 1e-15);
  // 0.076 at the end less the low-pass's lag of 45 ms
  EXPECT_NEAR(run.peak.mu_max, 0.076 - 0.002 * 0.045, 5e-5);
  EXPECT_NEAR(run.peak.sigma_peak_percent, 1.0, 1e-9);
}

TEST(Paper, SlipIsInPercent) {
  // A drift of s' per second has v = s'^2 T^2 / 12: c_v = 0.05 lies at 0.7746 percent per second.
  // In fractions neither would come near the gate.
  for (const auto& [rate_percent_s, opens] : {std::pair{0.76, 0}, std::pair{0.79, 1}}) {
    const Outcome run = compare({[rate = rate_percent_s](double t_s) { return -1.0 + rate * t_s; },
                                 [](double) { return 0.08; }, 8.0},
                                200.0);
    EXPECT_EQ(run.naive.rising, opens) << rate_percent_s;
    EXPECT_NEAR(run.naive.v, rate_percent_s * rate_percent_s / 12.0, 1e-5);
  }
}

TEST(Paper, SensorAccuracyWidensTheInterval) {
  SensorAccuracies accuracies;
  accuracies.torque = {.bias = 1.0, .gain = 0.0};  // 2 % of 50 Nm
  const Outcome run = compare({rig_slip_percent, rig_mu, 11.0, 0.02}, 200.0, {}, accuracies);
  const double std = std::hypot(run.naive.deviation(), 0.02 * run.naive.mean());
  EXPECT_NEAR(run.peak.mu_max_std, std, 1e-7);
  EXPECT_NEAR(run.peak.ci95_high - run.peak.ci95_low, 2.0 * 1.96 * std, 1e-6);
}

TEST(Paper, ResetForgetsEverything) {
  EstimatorSettings settings;
  settings.method = Method::kPaper;
  settings.torque_is_engine = false;
  const auto estimator = make_slip_curve_estimator(settings, kVariator, {});
  const auto trace = samples({rig_slip_percent, rig_mu, 11.0, 0.02}, 200.0);
  std::vector<double> first, second;
  for (std::vector<double>* slopes : {&first, &second}) {
    for (const VariatorSample& sample : trace) {
      const CurveEstimate& now = estimator->step(sample);
      slopes->insert(slopes->end(), {now.friction_slope, now.slip_variance, now.slip_energy_J,
                                     static_cast<double>(now.stop), now.mu_star});
    }
    while (!estimator->conclude()) {
    }
    slopes->insert(slopes->end(), {estimator->peak().mu_max, estimator->peak().mu_max_std});
    estimator->reset();
  }
  EXPECT_EQ(first, second);
}

}  // namespace
}  // namespace beltgrip::estimator
