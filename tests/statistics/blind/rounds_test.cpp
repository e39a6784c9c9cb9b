// The loop closed by machine, two cases of it; the figures are those of the program rounds.
#include "tests/statistics/blind/rounds.h"

#include <gtest/gtest.h>

#include <stdexcept>
#include <string>

namespace beltgrip::blind {
namespace {

TEST(RunOf, IsWhatTheScenarioSays) {
  const PlannedRun run = run_of(
      "# to see it\nname = \"next\"\n\n[variator]\nratio = 0.405\n\n[driveline]\n"
      "primary_speed_rad_s = 130\nprimary_torque_Nm = 22\n\n[clamp]\nstart_force_N = 5000\n"
      "ramp_N_per_s = 200\n\n[run]\nduration_s = 60\noil_degC = 85\n");
  EXPECT_TRUE(run.low);
  EXPECT_EQ(run.speed_rad_s, 130.0);
  EXPECT_EQ(run.torque_Nm, 22.0);
  EXPECT_EQ(run.temperature_C, 85.0);
  EXPECT_EQ(run.ramp_N_s, 200.0);
  EXPECT_EQ(run.duration_s, 60.0);
  EXPECT_THROW(run_of("# nothing\n"), std::runtime_error);
}

// A loss behind the belt with two names in its place, and a ratio that is off as by a scale of a
// speed.
TEST(Rounds, WhatIsOpenIsFoundByTheRecommendedExperiment) {
  for (const std::uint64_t number : {5024U, 8152U}) {
    SCOPED_TRACE(number);
    const RoundsOfTrial played = play(number, 1);
    EXPECT_NE(played.first.standing, Standing::kAlone);
    ASSERT_EQ(played.followed.size(), 1U);
    EXPECT_EQ(played.followed.front().standing, Standing::kAlone) << played.first.next_why;
  }
}

// An offset of the pressure and a loss that grows with speed, each at one speed. A force of the
// turning oil and a gain of the torque of a fifth fit better there by how they weigh the noise.
TEST(Diagnosed, NoiseNamesNothing) {
  for (const std::uint64_t number : {8141U, 8074U}) {
    const Round first = diagnosed(draw_open_trial(number));
    EXPECT_TRUE(first.standing == Standing::kInClass || first.standing == Standing::kAlone)
        << number << ": " << first.answer;
  }
}

// A speed that is off, at one torque and in equal ramps: pulleys that give way to the square of the
// force stand in its place, on a machine whose own give way backwards.
TEST(Diagnosed, NoPulleysOpenWithLessForce) {
  EXPECT_EQ(diagnosed(draw_open_trial(8103)).standing, Standing::kInClass);
  EXPECT_NE(diagnosed(draw_open_trial(7013)).standing, Standing::kWrong);
}

// A loss of 8 Nm, one that grows with the speed, wear, and pulleys that give way to the square of
// the force, each at one torque. By what the noise of the balance and that of the clamp force count
// for in each hypothesis, and no less: else a gain of the torque, a force of the turning oil and a
// speed's scale stand in their place.
TEST(Diagnosed, NoNoiseIsDividedAway) {
  EXPECT_EQ(diagnosed(draw_open_trial(8296)).answer, "torque_loss");
  EXPECT_EQ(diagnosed(draw_open_trial(5007)).answer, "pulley_deformation");
  for (const std::uint64_t number : {8240U, 8144U}) {
    EXPECT_NE(diagnosed(draw_open_trial(number)).standing, Standing::kWrong) << number;
  }
}

// A torque that comes late by a quarter of a second, in ramps at one speed: what slip does of a
// shaft's speed is no delay of its sensor.
TEST(Diagnosed, NoSpeedIsLateThatSlipAloneMoves) {
  EXPECT_EQ(diagnosed(draw_open_trial(8064)).answer.find("channel_skew"), std::string::npos);
}

}  // namespace
}  // namespace beltgrip::blind
