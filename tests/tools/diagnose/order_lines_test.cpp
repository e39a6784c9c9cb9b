// The amplitude of what a speed does once per revolution, at any speed and sample rate: what the
// smoothing beside it takes away is given back; the belt's passage between the orders; lines in a
// channel's own samples.
#include "tools/diagnose/data/order_lines.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <random>

#include "tools/diagnose/data/signal_table.h"
#include "tools/diagnose/data/spectral_lines.h"

namespace beltgrip::diagnose {
namespace {

// A shaft at omega_rad_s whose sensor's wheel runs out; no noise but the resolution.
Channel speed_with_ripple(double omega_rad_s, double amplitude, double period_s) {
  Channel out;
  for (int i = 0; i < static_cast<int>(60.0 / period_s); ++i) {
    const double t = i * period_s;
    const double value = omega_rad_s * (1.0 + amplitude * std::sin(omega_rad_s * t + 0.4));
    out.t_s.push_back(t);
    out.value.push_back(std::round(value / 0.001) * 0.001);
  }
  return out;
}

TEST(OrderLine, AmplitudeIsThatOfTheSensorAtEverySpeed) {
  constexpr double kAmplitude = 1.4e-3;
  for (const double period_s : {0.01, 0.005}) {
    for (const double omega_rad_s : {27.3, 52.0, 78.0, 81.7, 104.0, 131.0, 236.0}) {
      const OrderLine line = order_line(speed_with_ripple(omega_rad_s, kAmplitude, period_s));
      ASSERT_GE(line.pieces, 10) << omega_rad_s;
      // An unfinished revolution of a piece of four seconds leaks.
      const double share = 0.003 + 0.5 / (4.0 * omega_rad_s);
      EXPECT_NEAR(line.amplitude(), kAmplitude, share * kAmplitude)
          << omega_rad_s << " rad/s, every " << period_s << " s";
    }
  }
}

// Uniform, -1 to 1, the same on every machine.
class UniformNoise {
 public:
  double operator()() { return static_cast<double>(generator_()) / 2147483648.0 - 1.0; }

 private:
  std::mt19937 generator_{1};
};

// A shaft whose speed swings, sampled so that its line folds back to about 0 Hz on the way, has
// there only its own course: no ripple, where none is; and none is lost where it does not.
TEST(OrderLine, IsNotLookedForWhereItFoldsBackToZero) {
  constexpr double kPeriod_s = 0.02, kAmplitude = 5e-4;
  const auto line_at = [&](double mean_Hz, double amplitude) {
    Channel speed;
    UniformNoise noise;
    constexpr double kSwing = 0.066, kSwing_rad_s = 2.0 * std::numbers::pi * 0.23;
    const double mean_rad_s = 2.0 * std::numbers::pi * mean_Hz;
    for (int i = 0; i < 3000; ++i) {
      const double t = kPeriod_s * i;
      const double omega = mean_rad_s * (1.0 + kSwing * std::sin(kSwing_rad_s * t));
      const double angle = mean_rad_s * (t - kSwing / kSwing_rad_s * std::cos(kSwing_rad_s * t));
      speed.t_s.push_back(t);
      speed.value.push_back(omega * (1.0 + amplitude * std::sin(angle) + 1e-4 * noise()));
    }
    return order_line(speed);
  };
  const OrderLine folded = line_at(47.0, 0.0);
  EXPECT_EQ(folded.pieces, 0);
  EXPECT_GE(folded.folded, 10);
  EXPECT_EQ(folded.chi2(), 0.0);
  for (const double mean_Hz : {38.0, 60.0}) {
    SCOPED_TRACE(mean_Hz);
    const OrderLine line = line_at(mean_Hz, kAmplitude);
    EXPECT_EQ(line.folded, 0);
    EXPECT_NEAR(line.amplitude(), kAmplitude, 0.05 * kAmplitude);
    EXPECT_LT(std::sqrt(line_at(mean_Hz, 0.0).chi2()), 3.0);
  }
}

// 105 rad/s, a belt of 0.703 m on a radius of 0.0784 m: 11.7 Hz. 1.5 % beside the order that is
// looked for, as a radius is off.
TEST(BeltLines, ShowThePassageAndNotTheShaft) {
  constexpr double kOmega_rad_s = 105.0, kOrder = 0.7007, kAmplitude = 1e-3;
  const auto most_at = [&](double order) {
    Channel speed;
    UniformNoise noise;
    for (int i = 0; i < 6000; ++i) {
      const double t = 0.01 * i;
      speed.t_s.push_back(t);
      speed.value.push_back(
          kOmega_rad_s * (1.0 + kAmplitude * std::sin(order * kOmega_rad_s * t) + 3e-4 * noise()));
    }
    double most = 0.0;
    for (const OrderLine& line : belt_lines(speed, kOrder)) {
      most = std::max(most, std::sqrt(line.chi2()));
    }
    return most;
  };
  EXPECT_GT(most_at(1.015 * kOrder), 20.0);
  EXPECT_LT(most_at(1.0), 3.0);
}

TEST(NarrowLine, StandsOverNoiseAndNotOverASlope) {
  const auto channel_of = [](double amplitude) {
    Channel out;
    UniformNoise noise;
    double slow = 0.0;
    for (int i = 0; i < 12000; ++i) {
      const double t = 0.005 * i;
      slow = 0.99 * slow + 0.1 * noise();  // its power falls with the frequency
      out.t_s.push_back(t);
      out.value.push_back(50.0 + slow + amplitude * std::sin(2.0 * std::numbers::pi * 6.25 * t) +
                          0.3 * noise());
    }
    return out;
  };
  const NarrowLine line = narrow_line(pooled_spectrum(channel_of(0.5), kChannelMost_Hz));
  EXPECT_NEAR(line.frequency_Hz, 6.25, 0.05);
  EXPECT_GT(line.over_level, 30.0);
  EXPECT_GT(line.share, 0.3);
  EXPECT_LT(narrow_line(pooled_spectrum(channel_of(0.0), kChannelMost_Hz)).over_level, 5.0);
}

// A shaft that noise moves at its own frequency, damped: white noise through two poles.
TEST(Hump, OfAShaftThatSwingsAndNotOfASlope) {
  const auto channel_of = [](double strength) {
    Channel out;
    UniformNoise noise;
    const double turn = 2.0 * std::numbers::pi * 3.0 * 0.01, keep = std::exp(-0.06 * turn);
    double slow = 0.0, swing = 0.0, before = 0.0;
    for (int i = 0; i < 40000; ++i) {
      slow = 0.97 * slow + 0.1 * noise();  // its power falls with the frequency
      const double next = 2.0 * keep * std::cos(turn) * swing - keep * keep * before + noise();
      before = swing;
      swing = next;
      out.t_s.push_back(0.01 * i);
      out.value.push_back(50.0 + slow + strength * swing + 0.3 * noise());
    }
    return out;
  };
  const Hump hump = strongest_hump(pooled_spectrum(channel_of(0.01), kSwingMost_Hz));
  EXPECT_NEAR(hump.frequency_Hz, 3.0, 0.3);
  EXPECT_GT(hump.excess, 8.0);
  EXPECT_GT(hump.share, 0.0);
  EXPECT_LT(strongest_hump(pooled_spectrum(channel_of(0.0), kSwingMost_Hz)).excess, 4.0);
}

}  // namespace
}  // namespace beltgrip::diagnose
