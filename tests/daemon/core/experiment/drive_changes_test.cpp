// What the driver and the engine change while a request stands: told in the first sample that shows
// it, and not by noise.
#include "daemon/core/experiment/drive_changes.h"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <optional>
#include <random>

namespace beltgrip::daemon {
namespace {

using estimator::StopReason;

constexpr Duration kSample = 5 * kMillisecond;

struct Detected {
  Stop stop;
  double after_s = 0.0;
};

// 5 s of these, from 0 on something changes; the pedal and the torque come every 10 ms.
struct Drive {
  std::function<double(double t_s)> pedal = [](double) { return 0.2; };
  std::function<double(double t_s)> torque_Nm = [](double) { return 45.0; };
  double pedal_noise = 0.0, torque_noise_Nm = 0.0;
  double from_s = -3.0, to_s = 3.0;
};

std::optional<Detected> detect(const Drive& drive, unsigned seed = 1) {
  std::mt19937 random(seed);
  std::normal_distribution<double> normal;
  DriveChanges changes;
  DriveChanges::Now now;
  const auto from = static_cast<int>(std::lround(drive.from_s / 5e-3));
  const auto to = static_cast<int>(std::lround(drive.to_s / 5e-3));
  for (int i = from; i < to; ++i) {
    const double t_s = 5e-3 * i;
    now.t = MonoTime{10 * kSecond + i * kSample};
    if ((i - from) % 2 == 0) {
      now.accelerator = drive.pedal(t_s) + drive.pedal_noise * normal(random);
      now.torque_Nm = drive.torque_Nm(t_s) + drive.torque_noise_Nm * normal(random);
      now.torque_at = now.t;
    }
    // A request stands no sooner than some seconds after the daemon knows its inputs.
    if (const Stop stop = changes.step(now); stop && i > from + 400) return Detected{stop, t_s};
  }
  return std::nullopt;
}

TEST(DriveChanges, APedalThatStepsIsToldAtOnce) {
  for (const double step : {0.035, 0.05, 0.2, -0.05}) {
    const auto now = detect({.pedal = [=](double t_s) { return 0.2 + (t_s >= 0.0 ? step : 0.0); },
                             .pedal_noise = 1e-3,
                             .torque_noise_Nm = 0.3});
    ASSERT_TRUE(now) << step;
    EXPECT_EQ(now->stop.reason, StopReason::kDriver);
    EXPECT_EQ(now->stop.cause.role, Role::kAcceleratorPedal);
    EXPECT_NEAR(now->stop.cause.figure, 100.0 * std::abs(step), 0.5);
    EXPECT_EQ(now->stop.cause.limit, 3.0);
    EXPECT_EQ(now->after_s, 0.0) << step;
  }
}

TEST(DriveChanges, APedalThatIsHeldIsNoChange) {
  EXPECT_FALSE(detect({.pedal_noise = 5e-3}));
  EXPECT_FALSE(detect({.pedal = [](double t_s) { return t_s < 0.0 ? 0.2 : 0.229; }}));
  // A cruise control, by 2.5 points a second.
  EXPECT_FALSE(detect({.pedal = [](double t_s) { return 0.2 + 0.025 * std::max(0.0, t_s); }}));
}

// An engine that takes 0.12 s for it.
std::function<double(double)> rises_by(double step_Nm, double from_Nm = 45.0) {
  return [=](double t_s) { return from_Nm - step_Nm * std::expm1(-std::max(0.0, t_s) / 0.12); };
}

TEST(DriveChanges, ATorqueThatMovesIsToldSoon) {
  struct Case {
    double step_Nm, within_s;
  };
  for (const Case& c : {Case{8.0, 0.11}, Case{11.0, 0.08}, Case{-11.0, 0.08}, Case{40.0, 0.04}}) {
    const auto now = detect({.torque_Nm = rises_by(c.step_Nm), .torque_noise_Nm = 0.3});
    ASSERT_TRUE(now) << c.step_Nm;
    EXPECT_EQ(now->stop.reason, StopReason::kTorque);
    EXPECT_FALSE(now->stop.cause.role);
    EXPECT_GT(now->stop.cause.figure, now->stop.cause.limit);
    EXPECT_GE(now->after_s, 0.0);
    EXPECT_LE(now->after_s, c.within_s) << c.step_Nm;
  }
}

// 3 % of the torque, without noise: 1.35 Nm, of which the means over 20 ms and 0.3 s show 0.28 s.
TEST(DriveChanges, ATorqueThatDriftsIsNoChange) {
  for (const double torque_Nm : {45.0, -45.0}) {
    const auto drifts = [=](double rate_Nm_per_s) {
      return detect({.torque_Nm =
                         [=](double t_s) { return torque_Nm + rate_Nm_per_s * std::max(0.0, t_s); },
                     .to_s = 1.2})
          .has_value();
    };
    EXPECT_FALSE(drifts(4.0));
    EXPECT_FALSE(drifts(-4.0));
    EXPECT_TRUE(drifts(7.0));
    EXPECT_TRUE(drifts(-7.0));
  }
}

// A torque that moves by less than ends a request, with what else ends it.
TEST(DriveChanges, ATorqueIsUnsettledByLess) {
  for (const double step_Nm : {2.2, -2.2, 0.1}) {
    DriveChanges changes;
    std::mt19937 random(1);
    std::normal_distribution<double> normal;
    const auto torque_Nm = rises_by(step_Nm);
    int unsettled = 0;
    for (int i = -800; i < 60; ++i) {
      const MonoTime t{10 * kSecond + i * kSample};
      const Stop ends = changes.step({t, 0.2, torque_Nm(5e-3 * i) + 0.05 * normal(random), t});
      if (i < -400) continue;
      ASSERT_FALSE(ends) << i;
      if (i < 0) {
        ASSERT_FALSE(changes.unsettled()) << i;
      }
      unsettled += changes.unsettled() ? 1 : 0;
      if (i == 20 && std::abs(step_Nm) > 1.0) {
        EXPECT_EQ(changes.unsettled().reason, StopReason::kTorque);
      }
    }
    EXPECT_EQ(unsettled > 0, std::abs(step_Nm) > 1.0);
  }
}

TEST(DriveChanges, NoiseIsNoChange) {
  int alarms = 0;
  for (unsigned seed = 1; seed <= 200; ++seed) {
    for (const double noise_Nm : {0.1, 0.5, 2.0, 5.0}) {
      alarms += detect({.torque_noise_Nm = noise_Nm, .from_s = -5.0, .to_s = 5.0}, seed) ? 1 : 0;
    }
  }
  EXPECT_EQ(alarms, 0);
}

// One mean that follows, by hand.
void follow(double& mean, double value, double share) {
  mean += std::min(1.0, share) * (value - mean);
}

// What it says, sample for sample: readings every 10 ms and once after 100, with outliers; means
// over 20 ms and 0.3 s, six and a half times the scatter of those before, of which none counts for
// more than four times it or 0.2 % of the torque; the pedal's over a second.
TEST(DriveChanges, GoesByItsMeans) {
  std::mt19937 random(5);
  std::normal_distribution<double> normal;
  DriveChanges changes;
  double torque_Nm = 40.0, course_Nm = 40.0, scatter_Nm2 = 0.0, scatter_Nm = 0.0, pedal = 0.1;
  double read_Nm = 40.0;
  MonoTime t{kSecond}, read_at = t;
  EXPECT_FALSE(changes.step({t, pedal, read_Nm, read_at}));
  int moves = 0, steps = 0;
  for (int i = 1; i < 4000; ++i) {
    t += kSample;
    const double accelerator = 0.1 + 0.1 * std::sin(2e-3 * i) * std::sin(2e-3 * i);
    const bool comes = i % 2 == 0 && (i % 1000 == 0 || i % 1000 > 20);
    if (comes) {
      read_Nm = 40.0 + 15.0 * std::sin(0.02 * i) + (i > 2000 ? 0.3 : 0.02) * normal(random);
      if (i % 300 == 0) read_Nm += 8.0;
      const double over_s = 1e-9 * static_cast<double>((t - read_at).ns());
      read_at = t;
      scatter_Nm = std::sqrt(scatter_Nm2);
      follow(torque_Nm, read_Nm, over_s / 0.02);
      follow(course_Nm, read_Nm, over_s / 0.3);
      const double off_Nm = std::min(std::abs(read_Nm - torque_Nm),
                                     4.0 * std::max(scatter_Nm, 0.002 * std::abs(course_Nm)));
      follow(scatter_Nm2, off_Nm * off_Nm, over_s / 3.0);
    }
    follow(pedal, accelerator, 5e-3 / 1.0);
    const double pedal_percent = 100.0 * std::abs(accelerator - pedal);
    const double moved_Nm = std::abs(torque_Nm - course_Nm), noise_Nm = 6.5 * scatter_Nm;
    const Stop stop = changes.step({t, accelerator, read_Nm, read_at});
    const Stop unsettled = changes.unsettled();
    if (pedal_percent > 3.0) {
      ASSERT_EQ(stop.reason, StopReason::kDriver) << i;
      ASSERT_NEAR(stop.cause.figure, pedal_percent, 1e-9) << i;
      ++steps;
    } else {
      ASSERT_EQ(stop.reason, moved_Nm > 0.03 * std::abs(course_Nm) + noise_Nm ? StopReason::kTorque
                                                                              : StopReason::kNone)
          << i;
    }
    ASSERT_EQ(static_cast<bool>(unsettled), moved_Nm > 0.01 * std::abs(course_Nm) + noise_Nm) << i;
    if (!unsettled) continue;
    ASSERT_NEAR(unsettled.cause.figure, moved_Nm, 1e-9) << i;
    ASSERT_NEAR(unsettled.cause.limit, 0.01 * std::abs(course_Nm) + noise_Nm, 1e-9) << i;
    ++moves;
  }
  EXPECT_GT(moves, 500);
  EXPECT_GT(steps, 100);
}

// The first value is where both begin.
TEST(DriveChanges, BeginsWhereItFindsThem) {
  DriveChanges changes;
  EXPECT_FALSE(changes.step({MonoTime{kSecond}, 0.9, 200.0, MonoTime{kSecond}}));
  EXPECT_FALSE(
      changes.step({MonoTime{kSecond + kSample}, 0.9, 200.0, MonoTime{kSecond + kSample}}));
}

}  // namespace
}  // namespace beltgrip::daemon
