// From signals to slip, friction and clamp force: equations (3) and (5) at the paper's rig point by
// hand, both directions and end stops, the low-pass against its textbook response, the inertia
// torque, the checks of the signal chain, and what sensor errors do.
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <numbers>
#include <utility>

#include "estimator/physics/clamp_force.h"
#include "estimator/physics/sensor_error.h"
#include "estimator/physics/slip.h"
#include "estimator/signal/input_filter.h"
#include "estimator/signal/signal_chain.h"

namespace beltgrip::estimator {
namespace {

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
const VariatorParameters kVariator;  // the paper's: 11 degrees, 2.25, 78.4 mm, 0.0113 m^2, 500 N

TEST(ClampForce, IsPistonPlusSpringPlusCentrifugal) {
  // 0.0113 m^2 * 2.194690 bar = 2480 N
  EXPECT_NEAR(secondary_clamp_force_N(kVariator, 219469.0, 236.0), 2980.0, 0.01);
  VariatorParameters variator;
  variator.secondary_centrifugal_N_s2 = 0.0095;
  EXPECT_NEAR(secondary_clamp_force_N(variator, 219469.0, 105.0), 2980.0 + 104.7375, 0.01);
  EXPECT_NEAR(secondary_clamp_force_N(variator, 0.0, 400.0), 500.0 + 1520.0, 1e-9);
}

TEST(Traction, OfTheRigIsThePapersPeak) {
  // 50 Nm * 0.981627 / (2 * 0.0784 m * 2980 N) = 49.08136 / 467.264
  const OperatingPoint drive = operating_point(kVariator, EndStop::kOverdrive, Direction::kDrive);
  EXPECT_NEAR(traction_coefficient(kVariator, drive, 50.0, 2980.0), 0.105040, 1e-6);
  EXPECT_NEAR(traction_coefficient(kVariator, drive, -50.0, 2980.0), -0.105040, 1e-6);
  const OperatingPoint overrun =
      operating_point(kVariator, EndStop::kOverdrive, Direction::kOverrun);
  EXPECT_NEAR(traction_coefficient(kVariator, overrun, -50.0, 2980.0), 0.105040, 1e-6);
  // In low the same torque needs 78.4 / 32.4 times the force.
  const OperatingPoint low = operating_point(kVariator, EndStop::kLow, Direction::kDrive);
  EXPECT_NEAR(traction_coefficient(kVariator, low, 50.0, 2980.0 * 78.4 / 32.4), 0.105040, 1e-6);
}

TEST(Slip, IsPercentAndPositiveInTheDirectionOfTheTorque) {
  const OperatingPoint drive = operating_point(kVariator, EndStop::kOverdrive, Direction::kDrive);
  const OperatingPoint overrun =
      operating_point(kVariator, EndStop::kOverdrive, Direction::kOverrun);
  // 105 rad/s * 2.25 = 236.25 rad/s; 2 % less is 231.525, 2 % more 240.975.
  EXPECT_NEAR(slip_percent(drive, 105.0, 236.25), 0.0, 1e-12);
  EXPECT_NEAR(slip_percent(drive, 105.0, 231.525), 2.0, 1e-12);
  EXPECT_NEAR(slip_percent(drive, 105.0, 240.975), -2.0, 1e-12);
  EXPECT_NEAR(slip_percent(overrun, 105.0, 240.975), 2.0, 1e-12);
  const OperatingPoint low = operating_point(kVariator, EndStop::kLow, Direction::kDrive);
  EXPECT_NEAR(slip_percent(low, 105.0, 105.0 * 0.405 * 0.97), 3.0, 1e-12);
}

TEST(Slip, NearestEndStopIsByFactor) {
  // sqrt(0.405 * 2.25) = 0.9546
  EXPECT_EQ(nearest_end_stop(kVariator, 0.954), EndStop::kLow);
  EXPECT_EQ(nearest_end_stop(kVariator, 0.955), EndStop::kOverdrive);
}

// Amplitude at the output for a sine of amplitude 1, once it has settled.
double gain(double cutoff_hz, double rate_hz, double frequency_hz) {
  LowPass filter(cutoff_hz, rate_hz);
  filter.reset(0.0);
  const double step = 2.0 * std::numbers::pi * frequency_hz / rate_hz;
  const auto periods = static_cast<int>(40.0 * rate_hz / frequency_hz);
  double in_phase = 0.0, quadrature = 0.0, count = 0.0;
  for (int i = 0; i < periods; ++i) {
    const double out = filter.step(std::sin(step * i));
    if (2 * i < periods) continue;
    in_phase += out * std::sin(step * i);
    quadrature += out * std::cos(step * i);
    count += 0.5;
  }
  return std::hypot(in_phase, quadrature) / count;
}

TEST(LowPass, IsAButterworthOfSecondOrder) {
  for (const double rate_hz : {100.0, 200.0, 1000.0}) {
    EXPECT_NEAR(gain(5.0, rate_hz, 5.0), std::numbers::sqrt2 / 2.0, 1e-3) << rate_hz;
  }
  // Far above the sample rate's warping: 1 / sqrt(1 + (f / f_c)^4).
  EXPECT_NEAR(gain(5.0, 1000.0, 2.5), 1.0 / std::sqrt(1.0 + 1.0 / 16.0), 1e-3);
  EXPECT_NEAR(gain(5.0, 1000.0, 20.0), 1.0 / std::sqrt(1.0 + 256.0), 1e-3);
}

TEST(LowPass, FollowsARampWithItsSlopeAndALag) {
  LowPass filter(5.0, 200.0);
  filter.reset(3.0);
  double input = 3.0;
  for (int i = 0; i < 400; ++i) {
    input = 3.0 + 7.0 * (i + 1) / 200.0;
    filter.step(input);
  }
  EXPECT_NEAR(filter.derivative(), 7.0, 1e-9);
  // The lag of a second-order Butterworth: sqrt(2) / (2 pi f_c), 45 ms.
  EXPECT_NEAR((input - filter.value()) / 7.0, std::numbers::sqrt2 / (10.0 * std::numbers::pi),
              1e-3);
}

// A trace with constant acceleration of the primary, no slip, and what the chain says at its end.
struct Steady {
  double torque_Nm = 50.0, acceleration_rad_s2 = 0.0, ratio = 2.25, pressure_Pa = 219469.0;
};
Measurement settled(const Steady& steady, const EstimatorSettings& settings,
                    const VariatorParameters& variator, double seconds = 2.0) {
  SignalChain chain(settings, variator, 5.0);
  Measurement last;
  for (int i = 0; i < static_cast<int>(seconds * settings.sample_rate_hz); ++i) {
    const double t_s = i / settings.sample_rate_hz;
    const double omega_p = 105.0 + steady.acceleration_rad_s2 * t_s;
    last = chain.step({.t_ns = std::lround(t_s * 1e9),
                       .omega_p_rad_s = omega_p,
                       .omega_s_rad_s = omega_p * steady.ratio,
                       .secondary_pressure_Pa = steady.pressure_Pa,
                       .torque_Nm = steady.torque_Nm,
                       .usable = true});
  }
  return last;
}

TEST(SignalChain, TakesTheInertiaTorqueFromEngineTorqueOnly) {
  VariatorParameters variator;
  variator.primary_inertia_kg_m2 = 0.18;
  EstimatorSettings settings;
  // Drive, the primary speeds up by 20 rad/s^2: 3.6 Nm stay in the engine.
  EXPECT_NEAR(settled({.acceleration_rad_s2 = 20.0}, settings, variator).torque_p_Nm, 46.4, 1e-6);
  // Overrun, the engine slows down: 3.6 Nm of its 20 Nm come out of its own inertia.
  const Measurement overrun =
      settled({.torque_Nm = -20.0, .acceleration_rad_s2 = -20.0}, settings, variator);
  EXPECT_NEAR(overrun.torque_p_Nm, -16.4, 1e-6);
  // 16.4 * 0.981627 / (2 * 0.0784 * 2980)
  EXPECT_NEAR(overrun.mu_star, 0.034453, 1e-6);
  settings.torque_is_engine = false;
  EXPECT_NEAR(settled({.acceleration_rad_s2 = 20.0}, settings, variator).torque_p_Nm, 50.0, 1e-9);
}

TEST(SignalChain, PublishesTheRigPoint) {
  const Measurement rig = settled({.ratio = 2.25 * 0.98}, {}, kVariator);
  ASSERT_TRUE(rig.usable);
  EXPECT_EQ(rig.stop, StopReason::kNone);
  EXPECT_NEAR(rig.clamp_force_N, 2980.0, 0.01);
  EXPECT_NEAR(rig.mu_star, 0.105040, 1e-6);
  EXPECT_NEAR(rig.slip_percent, 2.0, 1e-9);
}

TEST(SignalChain, ChoosesTheEndStopItIsTold) {
  EstimatorSettings settings;
  const auto stop = [&](RatioChoice choice, double ratio) {
    settings.ratio = choice;
    return settled({.ratio = ratio}, settings, kVariator);
  };
  EXPECT_TRUE(stop(RatioChoice::kEither, 0.405).usable);
  EXPECT_TRUE(stop(RatioChoice::kEither, 2.25).usable);
  EXPECT_TRUE(stop(RatioChoice::kLow, 0.405).usable);
  for (const auto& [choice, ratio] :
       {std::pair{RatioChoice::kEither, 1.0}, std::pair{RatioChoice::kOverdrive, 0.405},
        std::pair{RatioChoice::kLow, 2.25}, std::pair{RatioChoice::kOverdrive, 1.9}}) {
    const Measurement off = stop(choice, ratio);
    EXPECT_FALSE(off.usable) << ratio;
    EXPECT_EQ(off.stop, StopReason::kRatio) << ratio;
  }
}

TEST(SignalChain, SaysNothingWithoutTorqueOrForce) {
  for (const double torque : {0.0, 2.9, -2.9}) {
    EXPECT_FALSE(settled({.torque_Nm = torque}, {}, kVariator).usable) << torque;
  }
  EXPECT_TRUE(settled({.torque_Nm = 3.1}, {}, kVariator).usable);
  // The spring's 500 N are gone at -44248 Pa.
  EXPECT_FALSE(settled({.pressure_Pa = -44300.0}, {}, kVariator).usable);
}

TEST(SignalChain, RefusesWhatNoVariatorDoes) {
  for (const double value : {0.0, 0.9, -105.0, 1.1e4, 1e300, kNaN}) {
    SignalChain chain({}, kVariator, 5.0);
    VariatorSample sample = {.t_ns = 0,
                             .omega_p_rad_s = 105.0,
                             .omega_s_rad_s = 232.0,
                             .secondary_pressure_Pa = 219469.0,
                             .torque_Nm = 50.0,
                             .usable = true};
    for (int i = 0; i < 100; ++i) {
      sample.t_ns += 5'000'000;
      chain.step(sample);
    }
    const double before = chain.step(sample).mu_star;
    ASSERT_GT(before, 0.1);
    sample.t_ns += 5'000'000;
    sample.omega_p_rad_s = value;
    const Measurement& refused = chain.step(sample);
    EXPECT_FALSE(refused.usable) << value;
    EXPECT_EQ(refused.mu_star, before) << value;
    EXPECT_EQ(refused.stop, StopReason::kNone) << value;
  }
}

TEST(SensorError, IsTheRootOfTheSumOfSquares) {
  // torque 1 % and 0.5 %, pressure bias 29.8 N of 2980 N, gain 1 % of 2480 N of 2980 N
  SensorAccuracies accuracies;
  EXPECT_EQ(relative_sensor_deviation(kVariator, accuracies, 50.0, 2980.0, 236.0), 0.0);
  accuracies.torque = {.bias = 0.5, .gain = 0.005};
  EXPECT_NEAR(relative_sensor_deviation(kVariator, accuracies, 50.0, 2980.0, 236.0), 0.0111803,
              1e-7);
  accuracies.secondary_pressure = {.bias = 29.8 / 0.0113, .gain = 0.01};
  // sqrt(0.01^2 + 0.005^2 + 0.01^2 + 0.00832215^2)
  EXPECT_NEAR(relative_sensor_deviation(kVariator, accuracies, 50.0, 2980.0, 236.0), 0.0171540,
              1e-7);
}

TEST(SignalChain, AnUnusableSampleChangesNothing) {
  const VariatorSample good = {.t_ns = 0,
                               .omega_p_rad_s = 105.0,
                               .omega_s_rad_s = 232.0,
                               .secondary_pressure_Pa = 219469.0,
                               .torque_Nm = 50.0,
                               .usable = true};
  SignalChain plain({}, kVariator, 5.0);
  SignalChain disturbed({}, kVariator, 5.0);
  for (int i = 0; i < 200; ++i) {
    VariatorSample sample = good;
    sample.t_ns = i * 5'000'000L;
    sample.torque_Nm += 0.1 * (i % 7);
    VariatorSample bad = sample;
    bad.t_ns -= 2'000'000;
    bad.torque_Nm = -1000.0;
    switch (i % 4) {
      case 0:
        bad.usable = false;
        break;
      case 1:
        bad.omega_s_rad_s = kNaN;
        break;
      case 2:
        bad.secondary_pressure_Pa = std::numeric_limits<double>::infinity();
        break;
      default:
        bad.t_ns = sample.t_ns - 5'000'000L;  // not later than the one before
    }
    EXPECT_FALSE(disturbed.step(bad).usable);
    const Measurement& with = disturbed.step(sample);
    const Measurement& without = plain.step(sample);
    EXPECT_EQ(with.usable, without.usable) << i;
    EXPECT_EQ(with.mu_star, without.mu_star) << i;
    EXPECT_EQ(with.slip_percent, without.slip_percent) << i;
    EXPECT_EQ(with.clamp_force_N, without.clamp_force_N) << i;
  }
}

}  // namespace
}  // namespace beltgrip::estimator
