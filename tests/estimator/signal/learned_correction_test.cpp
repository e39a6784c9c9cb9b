// What was learned without a name, taken out of the inputs: by hand for each point, and refused
// beyond the box.
#include <gtest/gtest.h>

#include <cmath>

#include "estimator/physics/learned_effects.h"
#include "estimator/signal/input_correction.h"

namespace beltgrip::estimator {
namespace {

constexpr double kSampleRate_hz = 200.0;

// From 1 to 3 units over 40 to 80.
LearnedTerm rising(LearnedPoint point, LearnedVariable variable, double unit) {
  LearnedTerm out;
  out.point = point;
  out.variable = variable;
  out.count = 3;
  out.knot = {40.0, 50.0, 80.0};
  out.value = {1.0 * unit, 2.0 * unit, 3.0 * unit};
  return out;
}

VariatorSample sample() {
  VariatorSample out;
  out.omega_p_rad_s = 100.0;
  out.omega_s_rad_s = 220.0;
  out.secondary_pressure_Pa = 2e5;
  out.torque_Nm = 50.0;
  out.usable = true;
  return out;
}

LearnedConditions oil(double degC) {
  LearnedConditions out;
  out.oil_temperature_degC = degC;
  return out;
}

VariatorSample corrected(LearnedPoint point, double unit, double oil_degC) {
  const LearnedTerm term = rising(point, LearnedVariable::kOilTemperature, unit);
  InputCorrection correction({}, {}, kSampleRate_hz, {&term, 1});
  return correction.correct(sample(), oil(oil_degC));
}

TEST(LearnedTerm, IsStraightBetweenKnotsAndHeldBeyond) {
  const LearnedTerm term = rising(LearnedPoint::kTorque, LearnedVariable::kOilTemperature, 1.0);
  EXPECT_DOUBLE_EQ(term.at(45.0), 1.5);
  EXPECT_DOUBLE_EQ(term.at(65.0), 2.5);
  EXPECT_DOUBLE_EQ(term.at(50.0), 2.0);
  EXPECT_DOUBLE_EQ(term.at(20.0), 1.0);
  EXPECT_DOUBLE_EQ(term.at(90.0), 3.0);
  EXPECT_EQ(term.at(std::nan("")), 0.0);
  EXPECT_TRUE(term.covers(40.0) && term.covers(80.0));
  EXPECT_FALSE(term.covers(39.9) || term.covers(80.1) || term.covers(std::nan("")));
  EXPECT_EQ(LearnedTerm{}.at(1.0), 0.0);
  EXPECT_FALSE(LearnedTerm{}.covers(1.0));
}

TEST(LearnedCorrection, TakesEachPointOut) {
  EXPECT_NEAR(corrected(LearnedPoint::kTorque, 1.0, 65.0).torque_Nm, 47.5, 1e-9);
  EXPECT_NEAR(corrected(LearnedPoint::kTorqueGain, 0.1, 50.0).torque_Nm, 50.0 / 1.2, 1e-9);
  const VariatorParameters variator;
  EXPECT_NEAR(corrected(LearnedPoint::kClampForce, 100.0, 50.0).secondary_pressure_Pa,
              2e5 + 200.0 / variator.secondary_piston_area_m2, 1e-6);
  EXPECT_NEAR(corrected(LearnedPoint::kRatio, 1e-3, 50.0).omega_s_rad_s, 220.0 / 1.002, 1e-9);
}

TEST(LearnedCorrection, LeavesFrictionAsItIs) {
  for (const double degC : {65.0, 200.0}) {
    const VariatorSample out = corrected(LearnedPoint::kFriction, 0.1, degC);
    EXPECT_TRUE(out.usable);
    EXPECT_EQ(out.torque_Nm, 50.0);
  }
}

TEST(LearnedCorrection, RefusesBeyondTheBox) {
  EXPECT_TRUE(corrected(LearnedPoint::kTorque, 1.0, 79.9).usable);
  EXPECT_FALSE(corrected(LearnedPoint::kTorque, 1.0, 80.1).usable);
  EXPECT_FALSE(corrected(LearnedPoint::kTorque, 1.0, 39.0).usable);
  EXPECT_FALSE(corrected(LearnedPoint::kTorque, 1.0, std::nan("")).usable);
}

// Of the sample itself: speed and torque need no further signal.
TEST(LearnedCorrection, FollowsWhatTheSampleHas) {
  LearnedTerm term = rising(LearnedPoint::kTorque, LearnedVariable::kPrimarySpeed, 1.0);
  term.knot = {50.0, 100.0, 150.0};
  InputCorrection correction({}, {}, kSampleRate_hz, {&term, 1});
  EXPECT_NEAR(correction.correct(sample()).torque_Nm, 48.0, 1e-9);
  VariatorSample fast = sample();
  fast.omega_p_rad_s = 151.0;
  EXPECT_FALSE(correction.correct(fast).usable);
  ASSERT_NE(correction.uncovered(), nullptr);
  EXPECT_EQ(correction.uncovered()->variable, LearnedVariable::kPrimarySpeed);
  EXPECT_EQ(correction.uncovered_at(), 151.0);
  EXPECT_TRUE(correction.correct(sample()).usable);
  EXPECT_EQ(correction.uncovered(), nullptr);

  term.variable = LearnedVariable::kSecondaryPressure;
  term.knot = {1e5, 2e5, 3e5};
  InputCorrection over_pressure({}, {}, kSampleRate_hz, {&term, 1});
  EXPECT_NEAR(over_pressure.correct(sample()).torque_Nm, 48.0, 1e-9);
  VariatorSample light = sample();
  light.secondary_pressure_Pa = 0.9e5;
  EXPECT_FALSE(over_pressure.correct(light).usable);
}

}  // namespace
}  // namespace beltgrip::estimator
