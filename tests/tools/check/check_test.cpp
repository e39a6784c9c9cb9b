// The small parts of a check, on cases computed by hand.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>

#include "tools/check/judge_across.h"
#include "tools/check/judge_constants.h"
#include "tools/check/text.h"
#include "tools/check/thinned.h"

namespace beltgrip::check {
namespace {

TEST(Thinned, KeepsAnEvenShareHoweverLongItIs) {
  Thinned<double> thinned;
  constexpr int kMany = 100'000;
  for (int i = 0; i < kMany; ++i) thinned.add(i);
  EXPECT_EQ(thinned.count(), 100'000U);
  EXPECT_LE(thinned.values().size(), Thinned<double>::kMost);
  EXPECT_GE(thinned.values().size(), Thinned<double>::kMost / 2);
  const double stride = thinned.values()[1];
  for (std::size_t i = 0; i < thinned.values().size(); ++i) {
    ASSERT_EQ(thinned.values()[i], stride * static_cast<double>(i));
  }
  EXPECT_NEAR(quantile(thinned.values(), 0.5), 0.5 * kMany, stride);
}

TEST(Text, Numbers) {
  EXPECT_EQ(grouped(7280.4), "7,280");
  EXPECT_EQ(grouped(-1234567.0), "-1,234,567");
  EXPECT_EQ(grouped(-0.2), "0");
  EXPECT_EQ(grouped(-9.5e300), "-9.5e+300");
  EXPECT_EQ(number(0.125), "0.125");
  EXPECT_EQ(number(28651.2), "28,651");
  EXPECT_EQ(number(0.00025), "0.00025");
}

// A car of the default variator: ratio from low to overdrive and back, 0.06 m a radian.
std::vector<Window> drive(bool swapped) {
  std::vector<Window> windows;
  for (int i = 0; i < 200; ++i) {
    Window window;
    window.mean.fill(std::numeric_limits<double>::quiet_NaN());
    window.change.fill(std::numeric_limits<double>::quiet_NaN());
    const double ratio = 0.41 + 1.83 * std::abs(i % 100 - 50) / 50.0;
    const double primary = 180.0, secondary = ratio * primary;
    const auto set = [&](Role role, double value) {
      window.mean[static_cast<std::size_t>(role)] = value;
    };
    set(Role::kPrimarySpeed, swapped ? secondary : primary);
    set(Role::kSecondarySpeed, swapped ? primary : secondary);
    set(Role::kVehicleSpeed, 0.06 * secondary);
    windows.push_back(window);
  }
  return windows;
}

TEST(Across, TheWheelsTellWhichPulleyIsWhich) {
  EXPECT_TRUE(judge_across(drive(false), {}).empty());
  const Findings found = judge_across(drive(true), {});
  ASSERT_EQ(found.size(), 1U);
  EXPECT_EQ(found[0].weight, Weight::kWrong);
  EXPECT_NE(found[0].text.find("swapped"), std::string::npos) << found[0].text;
}

// A coast-down at the overdrive stop of the default variator (2.25): the clamp is lowered, mu*
// rises from 0.05 to 0.10, and the belt slips by 9 %.
std::vector<Window> coast_that_slips(double torque_Nm) {
  std::vector<Window> windows;
  for (int i = 0; i < 60; ++i) {
    const double lowered = std::max(0.0, (i - 30) / 29.0), slip_share = 0.09 * lowered * lowered;
    Window window;
    window.mean.fill(std::numeric_limits<double>::quiet_NaN());
    window.change.fill(0.0);
    const auto set = [&](Role role, double value) {
      window.mean[static_cast<std::size_t>(role)] = value;
    };
    const double primary = 200.0 - i;
    set(Role::kPrimarySpeed, primary);
    set(Role::kSecondarySpeed, 2.25 / (1.0 - slip_share) * primary);
    set(Role::kPrimaryTorque, torque_Nm);
    set(Role::kAcceleratorPedal, 0.0);
    window.mu_star = 0.05 + 0.05 * lowered;
    window.slip_percent = (torque_Nm < 0.0 ? 100.0 : -100.0) * slip_share;
    windows.push_back(window);
  }
  return windows;
}

std::string all_of(const Findings& found) {
  std::string text;
  for (const Finding& each : found) text += each.text + "\n";
  return text;
}

TEST(Across, SlipInOverrunLiftsTheRatioAboveItsStop) {
  daemon::Config config;
  config.estimator.torque_is_engine = false;
  const Findings found = judge_across(coast_that_slips(-30.0), config);
  EXPECT_TRUE(found.empty()) << all_of(found);
}

TEST(Across, NothingSlipsAgainstTheTorque) {
  daemon::Config config;
  config.estimator.torque_is_engine = false;
  const Findings found = judge_across(coast_that_slips(30.0), config);
  EXPECT_NE(all_of(found).find("against the torque, never with it: sign of primary_torque"),
            std::string::npos)
      << all_of(found);
}

// The pressure is halved in the last fifth, and the belt slips by 22 %: the ratio is 28 % above the
// stop. Without that pressure it is a ratio beyond the stops and nothing else.
TEST(Across, WhatLiesBeyondAStopWithALoweredClampIsSlip) {
  daemon::Config config;
  config.estimator.torque_is_engine = false;
  const auto beyond = [](double pressure_there_Pa) {
    std::vector<Window> windows = coast_that_slips(-30.0);
    for (std::size_t i = 0; i < windows.size(); ++i) {
      const bool last = i >= 48;
      const auto set = [&](Role role, double value) {
        windows[i].mean[static_cast<std::size_t>(role)] = value;
      };
      const double primary = windows[i][Role::kPrimarySpeed];
      set(Role::kSecondarySpeed, 2.25 / (last ? 0.78 : 1.0) * primary);
      set(Role::kSecondaryPressure, last ? pressure_there_Pa : 0.8e6);
      windows[i].mu_star = std::numeric_limits<double>::quiet_NaN();
    }
    return windows;
  };
  const std::string slipped = all_of(judge_across(beyond(0.4e6), config));
  EXPECT_EQ(slipped.find("beyond them"), std::string::npos) << slipped;
  const std::string held = all_of(judge_across(beyond(0.8e6), config));
  EXPECT_NE(held.find("20 % of the time beyond them"), std::string::npos) << held;
}

// Slip of more than 3 % for four seconds at a third of the friction that belts have.
TEST(Across, AFrictionThatNoBeltHasWhileItSlips) {
  daemon::Config config;
  config.estimator.torque_is_engine = false;
  std::vector<Window> windows = coast_that_slips(-30.0);
  for (Window& window : windows) window.mu_star /= 3.0;
  const std::string found = all_of(judge_across(windows, config));
  EXPECT_NE(found.find("slips by 3 % and more where it is read as carrying a friction of 0.03"),
            std::string::npos)
      << found;
  EXPECT_NE(found.find("torque in percent"), std::string::npos) << found;
}

// On a bench in drive, at the overdrive stop (2.25): the pressure is halved and comes back, the
// belt slips by 6 % in between. The ratio has left its stop then: no mu* is known.
std::vector<Window> bench_that_slips(double torque_Nm, bool swapped) {
  std::vector<Window> windows;
  for (int i = 0; i < 60; ++i) {
    const double lowered = std::max(0.0, 1.0 - std::abs(i - 30) / 20.0);
    Window window;
    window.mean.fill(std::numeric_limits<double>::quiet_NaN());
    window.change.fill(0.0);
    const auto set = [&](Role role, double value) {
      window.mean[static_cast<std::size_t>(role)] = value;
    };
    const double primary = 150.0, secondary = 2.25 * primary * (1.0 - 0.06 * lowered);
    set(Role::kPrimarySpeed, swapped ? secondary : primary);
    set(Role::kSecondarySpeed, swapped ? primary : secondary);
    set(Role::kSecondaryPressure, 6e5 * (1.0 - 0.5 * lowered));
    set(Role::kPrimaryTorque, torque_Nm);
    windows.push_back(window);
  }
  return windows;
}

TEST(Across, ARatioThatLeavesItsStopTellsTheSignToo) {
  daemon::Config config;
  config.estimator.torque_is_engine = false;
  const std::string sign =
      "slips by 6.2 % against the torque, never with it: sign of primary_torque";
  const auto text = [&](double torque_Nm, bool swapped) {
    return all_of(judge_across(bench_that_slips(torque_Nm, swapped), config));
  };
  EXPECT_EQ(text(50.0, false), "");
  EXPECT_NE(text(-50.0, false).find(sign), std::string::npos) << text(-50.0, false);
  // The low stop of a variator that is as far out as in: swapped, it stands at the other one.
  config.variator.ratio_low = 1.0 / 2.25;
  EXPECT_EQ(text(50.0, false), "");
  EXPECT_NE(text(50.0, true).find(sign), std::string::npos) << text(50.0, true);
}

TEST(Across, APedalThatNeverMovesThoughTheTorqueTurns) {
  daemon::Config config;
  config.estimator.torque_is_engine = false;
  std::vector<Window> windows = coast_that_slips(-30.0);
  const auto torque = [&](std::size_t i) -> double& {
    return windows[i].mean[static_cast<std::size_t>(Role::kPrimaryTorque)];
  };
  for (std::size_t i = 0; i < 10; ++i) torque(i) = 30.0;  // cruise control, and then a coast-down
  EXPECT_EQ(all_of(judge_across(windows, config)).find("accelerator_pedal"), std::string::npos);
  for (std::size_t i = 0; i < 30; ++i) torque(i) = i / 5 % 2 == 0 ? 30.0 : -30.0;
  EXPECT_NE(all_of(judge_across(windows, config)).find("accelerator_pedal is always 0 %"),
            std::string::npos)
      << all_of(judge_across(windows, config));
}

daemon::Config with_engine_speed(bool bound) {
  daemon::Config config;
  if (bound) config.roles.emplace_back().role = Role::kEngineSpeed;
  return config;
}

calibrate::Finding finding(const char* key, std::optional<double> value, double std,
                           double configured) {
  return {key, value, std, configured, "", ""};
}

TEST(Constants, AreHeldAgainstTheConfigurationWhereTheyCanBeTrusted) {
  const std::vector<calibrate::Finding> measured{
      finding("variator.ratio_overdrive", 2.31, 0.001, 2.25),
      finding("variator.ratio_low", 0.406, 0.0002, 0.405),
      finding("variator.primary_inertia_kg_m2", 0.13, 0.005, 0.18),
      finding("delay.engine_torque", 0.03, 0.004, 0.0)};
  EXPECT_EQ(judge_constants(measured, with_engine_speed(true), {}).size(), 3U);
  // 30 ms are no delay of a signal that comes every 200 ms.
  Periods slow{};
  slow[static_cast<std::size_t>(Role::kEngineTorque)] = 0.2;
  EXPECT_EQ(judge_constants(measured, with_engine_speed(true), slow).size(), 2U);
  const Findings found = judge_constants(measured, with_engine_speed(false), {});
  ASSERT_EQ(found.size(), 1U);
  EXPECT_EQ(found[0].weight, Weight::kDoubt);
  EXPECT_EQ(found[0].text, "variator.ratio_overdrive reads as 2.31 +- 0.001, configured 2.25");
  // The inertia refused: its delay says nothing.
  const std::vector<calibrate::Finding> refused{
      finding("variator.primary_inertia_kg_m2", {}, 0.0, 0.18), measured[3]};
  EXPECT_TRUE(judge_constants(refused, with_engine_speed(true), {}).empty());
}

}  // namespace
}  // namespace beltgrip::check
