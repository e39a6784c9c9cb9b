// A pressure that is read in steps of a tenth of the clamp force, and swings between them: slip and
// speed follow what the reading does not show. The recordings are the blind generator's.
#include <gtest/gtest.h>

#include "tests/tools/diagnose/recorded_runs.h"

namespace beltgrip::diagnose {
namespace {

// Ten ramps of a car, alike but for the oil.
blind::Trial coarse(double warmer_each_C) {
  blind::Trial trial;
  trial.seed = 43;
  trial.machine.setting = blind::Setting::kCar;
  trial.machine.sample_rate_hz = 200.0;
  trial.machine.noise_pressure_Pa = 600.0;
  trial.machine.pressure_step_Pa = 40e3;
  trial.machine.pressure_swings_Pa = 3e3;
  for (int i = 0; i < 10; ++i) {
    blind::PlannedRun run;
    run.torque_Nm = 33.0;
    run.ramp_N_s = 50.0;
    run.duration_s = 40.0;
    run.temperature_C = 60.0 + warmer_each_C * i;
    trial.plan.push_back(run);
  }
  return trial;
}

TEST(CoarsePressure, ThatSwingsInEqualRampsIsNoFunctionOfTheSpeed) {
  const Diagnosis answer = diagnose(request_of(coarse(0.0))).diagnosis;
  EXPECT_EQ(answer.verdict, Verdict::kNothingWrong);
}

TEST(CoarsePressure, HidesNoCauseThatIsLargerThanItsSteps) {
  blind::Trial trial = coarse(4.0);
  trial.planted.push_back({"friction_temperature", {{"per_K", -2e-3}}, {}});
  const Diagnosis answer = diagnose(request_of(trial)).diagnosis;
  EXPECT_NE(answer.verdict, Verdict::kNothingWrong);
}

}  // namespace
}  // namespace beltgrip::diagnose
