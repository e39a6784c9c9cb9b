// What swings slower than ramps and sweeps leave lines of their own: told from their course, and
// from an answer to what drives the machine.
#include "tools/diagnose/infer/slow_line.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "tests/tools/diagnose/noise.h"
#include "tests/tools/diagnose/rig_table.h"
#include "tools/diagnose/decide/criticism.h"
#include "tools/diagnose/decide/namer.h"
#include "tools/diagnose/decide/thresholds.h"

namespace beltgrip::diagnose {
namespace {

constexpr double kSwing_Hz = 0.4;

// What swings in the machine: shares of the clamp force, unseen by the pressure's sensor, and, half
// as fast, of the torque, which its sensor sees.
struct Swings {
  double force_share = 0.0, torque_share = 0.0;
};

// A rig of its own equations, friction 2x / (1 + x^2); each ramp's swing has a phase of its own.
SignalTable ramp(const estimator::VariatorParameters& variator, const Swings& swings, int number,
                 Noise& noise) {
  constexpr double kOmega_rad_s = 100.0, kMuMax = 0.1, kPeakSlip_share = 0.02;
  SignalTable out = rig_table(2600, 0.01, [&](double t_s) {
    const double turn =
        2.0 * std::numbers::pi * kSwing_Hz * t_s + 2.4 * static_cast<double>(number);
    const double swing = std::sin(turn), drive = std::cos(0.5 * turn);
    const double told_N = 7000.0 - 140.0 * t_s;
    const double force_N = told_N * (1.0 + swings.force_share * swing);
    const double belt_Nm = (number % 2 == 0 ? 50.0 : 44.0) * (1.0 + swings.torque_share * drive);
    const double capacity_Nm = 2.0 * variator.primary_radius_overdrive_m * kMuMax * force_N /
                               std::cos(variator.half_wedge_angle_rad);
    const double y = std::min(belt_Nm / capacity_Nm, 1.0);
    const double slip = kPeakSlip_share * (1.0 - std::sqrt(1.0 - y * y)) / y;
    const double ratio = variator.ratio_overdrive * (1.0 - 1e-6 * force_N);
    return RigSample{.omega_p_rad_s = kOmega_rad_s * (1.0 + 5e-5 * noise()),
                     .omega_s_rad_s = kOmega_rad_s * ratio * (1.0 - slip) * (1.0 + 5e-5 * noise()),
                     .pressure_Pa = (told_N - variator.secondary_spring_force_N) /
                                        variator.secondary_piston_area_m2 +
                                    800.0 * noise(),
                     .torque_Nm = belt_Nm + 1.0 + 5e-5 * force_N + 0.1 * noise()};
  });
  out.name = "ramp" + std::to_string(number);
  return out;
}

Engine fitted(const Swings& swings) {
  const estimator::VariatorParameters variator;
  Noise noise;
  std::vector<ExperimentData> runs;
  for (int number = 0; number < 8; ++number) {
    runs.push_back(prepare(ramp(variator, swings, number, noise), variator));
  }
  Engine engine(make_campaign(std::move(runs), nominal_model(variator)));
  engine.fit_machine();
  engine.update_noise();
  return engine;
}

TEST(SlowLine, IsNoneInARampsOwnCourse) {
  EXPECT_LT(slow_line(fitted({})).excess, 0.8 * thresholds::kSlowLine);
}

TEST(SlowLine, OfTheClampForceIsToldAtItsFrequency) {
  const SpectralLine line = slow_line(fitted({.force_share = 0.004}));
  EXPECT_GT(line.excess, thresholds::kSlowLine);
  EXPECT_NEAR(line.frequency_Hz, kSwing_Hz, 0.03);
  EXPECT_EQ(line.acts_on, "clamp_force");
}

// The same swing at twice the frequency of the torque's: a bent curve answers to that there.
TEST(SlowLine, IsNoneWhereTheMachineIsDrivenSo) {
  const SpectralLine line = slow_line(fitted({.force_share = 0.02, .torque_share = 0.1}));
  EXPECT_LT(line.excess, thresholds::kSlowLine);
}

TEST(SlowLine, DecidesUnlessReadingsMoveInSteps) {
  const Engine engine = fitted({.force_share = 0.004});
  const Criticism fine = criticise(engine, Steps::kFine);
  EXPECT_FALSE(fine.test("slow_line").passed());
  const Unexplained told = what_is_left(fine, false);
  EXPECT_EQ(told.kind, MisfitKind::kLine);
  EXPECT_NEAR(told.frequency_Hz.value_or(0.0), kSwing_Hz, 0.03);
  EXPECT_TRUE(criticise(engine, Steps::kLeak).test("slow_line").passed());
}

}  // namespace
}  // namespace beltgrip::diagnose
