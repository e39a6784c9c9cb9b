// Slip and its rate from the speed ratio: lines by hand, noise of a known deviation.
#include "daemon/core/experiment/slip_course.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>
#include <utility>
#include <vector>

namespace beltgrip::daemon {
namespace {

constexpr double kRatio = 2.25;
constexpr double kOverrun_Nm = -30.0;  // slip raises the ratio
constexpr double kDrive_Nm = 30.0;
constexpr Duration kSample = 5 * kMillisecond;
constexpr double kRate_1_s = 0.025;
constexpr double kUnknown = std::numeric_limits<double>::infinity();

// Slip that grows by kRate_1_s from the start on, and noise on it.
struct Ramp {
  explicit Ramp(Duration sample, double noise = 0.0, unsigned seed = 1)
      : sample_(sample), noise_(noise), random_(seed) {
    course.begin(kRatio, kOverrun_Nm);
  }
  void run(int samples) {
    for (int i = 0; i < samples; ++i) {
      const double slip_share = kRate_1_s * seconds(t.since_origin()) + noise_ * normal_(random_);
      course.step(t, kRatio * (1.0 + slip_share));
      t += sample_;
    }
  }
  SlipCourse course;
  MonoTime t{};

 private:
  Duration sample_;
  double noise_;
  std::mt19937 random_;
  std::normal_distribution<double> normal_;
};

// The mean of the samples 0, 5, 10 and 15 ms old is the slip of 7.5 ms ago.
TEST(SlipCourse, ALineGivesItsRateAndItsMeanOver15Milliseconds) {
  Ramp ramp(kSample);
  ramp.run(201);  // the last at 1 s
  EXPECT_NEAR(ramp.course.slip_share(), kRate_1_s * 0.9925, 1e-12);
  EXPECT_NEAR(ramp.course.rate_1_s(), kRate_1_s, 1e-9);
  EXPECT_NEAR(ramp.course.rate_deviation_1_s(), 0.0, 1e-9);
}

TEST(SlipCourse, SlipLowersTheRatioInDriveAndRaisesItInOverrun) {
  SlipCourse course;
  course.begin(kRatio, kOverrun_Nm);
  EXPECT_NEAR(course.slip_share_at(1.02 * kRatio), 0.02, 1e-12);
  course.begin(kRatio, kDrive_Nm);
  EXPECT_NEAR(course.slip_share_at(1.02 * kRatio), -0.02, 1e-12);
  for (int i = 0; i < 40; ++i)
    course.step(MonoTime{i * kSample}, kRatio * (1.0 - 0.03 * seconds(i * kSample)));
  EXPECT_NEAR(course.rate_1_s(), 0.03, 1e-9);
}

// A rate after 50 ms, the first above 0.8 of 60. The change from a window to the next, which shares
// no sample with it, 65 ms later; the twentieth of these 95 ms after the first.
TEST(SlipCourse, SaysWhatItDoesNotKnowYet) {
  Ramp ramp(kSample);
  ramp.run(10);
  EXPECT_EQ(ramp.course.rate_1_s(), 0.0);
  ramp.run(1);
  EXPECT_NEAR(ramp.course.rate_1_s(), kRate_1_s, 1e-9);
  ramp.run(13 + 18);
  EXPECT_EQ(ramp.course.rate_deviation_1_s(), kUnknown);
  ramp.run(1);
  EXPECT_LT(ramp.course.rate_deviation_1_s(), 1e-9);
}

TEST(SlipCourse, ForgetsItsRateOverAGapAndEverythingAtTheNextBeginning) {
  Ramp ramp(kSample);
  ramp.run(100);
  ramp.t += 200 * kMillisecond;
  ramp.run(1);
  EXPECT_EQ(ramp.course.rate_1_s(), 0.0);
  ramp.course.begin(kRatio, kOverrun_Nm);
  EXPECT_EQ(ramp.course.slip_share(), 0.0);
  EXPECT_EQ(ramp.course.slip_max_share(), 0.0);
  EXPECT_EQ(ramp.course.rate_deviation_1_s(), kUnknown);
}

TEST(SlipCourse, KeepsTheLargestSlip) {
  SlipCourse course;
  course.begin(kRatio, kOverrun_Nm);
  for (int i = 0; i < 10; ++i) course.step(MonoTime{i * kSample}, 1.03 * kRatio);
  for (int i = 10; i < 20; ++i) course.step(MonoTime{i * kSample}, kRatio);
  EXPECT_NEAR(course.slip_share(), 0.0, 1e-12);
  EXPECT_NEAR(course.slip_max_share(), 0.03, 1e-12);
}

// A line that begins to slip: 60 ms later its rate is that of the new line alone, at 1000 Hz too.
TEST(SlipCourse, ItsRateIsThatOfTheLast60Milliseconds) {
  for (const Duration sample : {kMillisecond, kSample, 10 * kMillisecond}) {
    SlipCourse course;
    course.begin(kRatio, kOverrun_Nm);
    const MonoTime bend{300 * kMillisecond}, end = bend + SlipCourse::kRateOver;
    for (MonoTime t{}; t <= end; t += sample) {
      const double slip_share = t > bend ? 0.04 * seconds(t - bend) : 0.0;
      if (t == end) {
        EXPECT_LT(course.rate_1_s(), 0.04 - 1e-6) << sample;
      }
      course.step(t, kRatio * (1.0 + slip_share));
    }
    EXPECT_NEAR(course.rate_1_s(), 0.04, 1e-9) << sample;
  }
}

// The slope of n points dt apart, each off by s, is off by s / (dt sqrt(n (n^2 - 1) / 12)).
TEST(SlipCourse, KnowsHowMuchOfItsRateIsNoise) {
  constexpr double kNoise = 1e-4;
  constexpr unsigned kSeeds = 400;
  for (const Duration sample : {kMillisecond, kSample, 10 * kMillisecond}) {
    const double n = 1.0 + static_cast<double>(SlipCourse::kRateOver / sample);
    const double truth_1_s = kNoise / (seconds(sample) * std::sqrt(n * (n * n - 1.0) / 12.0));
    double square = 0.0, off_square = 0.0, off_mean = 0.0;
    unsigned two = 0, stop = 0;
    for (unsigned seed = 1; seed <= kSeeds; ++seed) {
      Ramp ramp(sample, kNoise, seed);
      ramp.run(static_cast<int>(kSecond / sample));
      const double deviation_1_s = ramp.course.rate_deviation_1_s();
      const double off_1_s = ramp.course.rate_1_s() - kRate_1_s;
      square += deviation_1_s * deviation_1_s / kSeeds;
      off_square += off_1_s * off_1_s / kSeeds;
      off_mean += off_1_s / kSeeds;
      two += std::abs(off_1_s) < 2.0 * deviation_1_s ? 1 : 0;
      stop += off_1_s > 4.5 * deviation_1_s ? 1 : 0;
    }
    EXPECT_NEAR(std::sqrt(square) / truth_1_s, 1.0, 0.1) << sample;
    EXPECT_NEAR(std::sqrt(off_square) / truth_1_s, 1.0, 0.12) << sample;  // 3 of 1 / sqrt(2 * 400)
    EXPECT_NEAR(off_mean, 0.0, 3.0 * truth_1_s / std::sqrt(kSeeds)) << sample;
    EXPECT_GT(two, kSeeds * 85 / 100) << sample;  // 95 %, were the deviation known and not measured
    EXPECT_EQ(stop, 0U) << sample;                // what a request takes for no noise
  }
}

// Slip, rate and deviation from all samples of a request, written anew.
struct ByHand {
  void step(MonoTime t, double slip_share) {
    samples.push_back({t, slip_share});
    double recent = 0.0, recent_n = 0.0, mean_s = 0.0, mean = 0.0, n = 0.0;
    const auto in_window = [&](const auto& use) {
      for (const auto& [at, value] : samples) {
        if (t - at <= 60 * kMillisecond) use(-seconds(t - at), value);
      }
    };
    for (const auto& [at, value] : samples) {
      if (t - at <= 15 * kMillisecond) recent += value, recent_n += 1.0;
    }
    mean_slip_share = recent / recent_n;
    double oldest_s = 0.0;
    in_window([&](double at_s, double value) {
      mean_s += at_s, mean += value, n += 1.0;
      oldest_s = std::min(oldest_s, at_s);
    });
    double tt = 0.0, tx = 0.0;
    in_window([&](double at_s, double value) {
      tt += (at_s - mean_s / n) * (at_s - mean_s / n);
      tx += (at_s - mean_s / n) * (value - mean / n);
    });
    rate = -oldest_s > 0.0485 ? tx / tt : 0.0;
    // The newest of the samples older than the window has the rate before.
    const auto before = static_cast<std::size_t>(n) + 1;
    if (rate != 0.0 && samples.size() >= before && rates.size() + 1 >= before) {
      const double last = rates[samples.size() - before];
      if (last != 0.0) {
        ++changes;
        const double count = std::min(changes, 100.0);
        square += ((rate - last) * (rate - last) - square) / count;
      }
    }
    rates.push_back(rate);
  }
  double deviation() const { return changes < 20.0 ? kUnknown : std::sqrt(0.5 * square); }
  std::vector<std::pair<MonoTime, double>> samples;
  std::vector<double> rates;
  double mean_slip_share = 0.0, rate = 0.0, square = 0.0, changes = 0.0;
};

TEST(SlipCourse, IsWhatSumsOverAllSamplesOfTheRequestSay) {
  std::mt19937 random(3);
  std::normal_distribution<double> normal;
  SlipCourse course;  // one request after the other, at instants that begin anew
  for (const Duration sample : {5 * kMillisecond, kMillisecond, 7 * kMillisecond}) {
    course.begin(kRatio, kOverrun_Nm);
    ByHand hand;
    for (int i = 0; i < 400; ++i) {
      const double slip_share = 0.02 + 1e-4 * i + (i < 250 ? 1e-4 : 1e-3) * normal(random);
      course.step(MonoTime{i * sample}, kRatio * (1.0 + slip_share));
      hand.step(MonoTime{i * sample}, slip_share);
      ASSERT_NEAR(course.slip_share(), hand.mean_slip_share, 1e-12) << sample << ' ' << i;
      ASSERT_NEAR(course.rate_1_s(), hand.rate, 1e-9) << sample << ' ' << i;
      if (hand.deviation() == kUnknown) {
        ASSERT_EQ(course.rate_deviation_1_s(), kUnknown) << sample << ' ' << i;
      } else {
        ASSERT_NEAR(course.rate_deviation_1_s(), hand.deviation(), 1e-9) << sample << ' ' << i;
      }
    }
  }
}

}  // namespace
}  // namespace beltgrip::daemon
