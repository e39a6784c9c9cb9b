// What a clamp force may rest on, from results given by hand.
#include "daemon/core/estimate/known_friction.h"

#include <gtest/gtest.h>

#include "tests/daemon/test_vehicle.h"

namespace beltgrip::daemon {
namespace {

using estimator::PeakKind;

estimator::PeakEstimate value(double mu_max) {
  estimator::PeakEstimate peak;
  peak.kind = PeakKind::kValue;
  peak.mu_max = mu_max;
  peak.mu_max_std = 0.01 * mu_max;
  peak.ci95_low = peak.noise_low = 0.98 * mu_max;
  peak.ci95_high = peak.noise_high = 1.02 * mu_max;
  return peak;
}

estimator::PeakEstimate bound(double mu_max) {
  estimator::PeakEstimate peak;
  peak.kind = PeakKind::kLowerBound;
  peak.mu_max = mu_max;
  return peak;
}

class Known : public testing::Test {
 protected:
  Known() {
    curve_.usable = true;
    curve_.torque_p_Nm = 50.0;
  }
  KnownFriction::Taken take(const estimator::PeakEstimate& peak, bool keeps_better = true) {
    return known_.take(peak, ended_, peak.mu_max, keeps_better);
  }
  bool doubtful() const {
    FaultSet faults;
    known_.raise_faults(MonoTime::of_ns(1), curve_, faults);
    return faults.has(Fault::kResultDoubtful);
  }

  Config config_ = test::vehicle_config();
  KnownFriction known_{config_};
  EndedExperiment ended_;
  estimator::CurveEstimate curve_;  // of the same direction and end stop
};

TEST_F(Known, NothingAtTheStart) {
  EXPECT_EQ(known_.newest().kind, PeakKind::kNone);
  EXPECT_EQ(known_.to_rest_on(curve_), 0.0);
  EXPECT_FALSE(known_.min_clamp_force_N(curve_).has_value());
  EXPECT_EQ(known_.peak_as_read(curve_, 0.1), 0.0);
  EXPECT_FALSE(doubtful());
}

TEST_F(Known, AValueIsWhatAForceRestsOn) {
  EXPECT_TRUE(take(value(0.09)).changed);
  EXPECT_EQ(known_.to_rest_on(curve_), 0.09);
  EXPECT_EQ(known_.peak_as_read(curve_, 0.085), 0.085);
  const auto force = known_.min_clamp_force_N(curve_);
  ASSERT_TRUE(force.has_value());
  take(value(0.045));
  EXPECT_NEAR(*known_.min_clamp_force_N(curve_), 2.0 * *force, 1e-9 * *force);
  EXPECT_EQ(known_.newest().experiment_count, 2);
}

TEST_F(Known, ABoundBelowAValueSaysNothing) {
  take(value(0.09));
  EXPECT_FALSE(take(bound(0.08)).changed);
  EXPECT_EQ(known_.newest().kind, PeakKind::kValue);
  EXPECT_TRUE(take(bound(0.08), false).changed);
  EXPECT_EQ(known_.newest().kind, PeakKind::kLowerBound);
  EXPECT_EQ(known_.to_rest_on(curve_), 0.09);
}

// What the next request may rest on where there is no value.
TEST_F(Known, WhatWasCarriedIsTheLastBoundAndAValueTakesItsPlace) {
  EXPECT_EQ(known_.carried(), 0.0);
  take(bound(0.09));
  EXPECT_EQ(known_.carried(), 0.09);
  take(bound(0.11));
  EXPECT_EQ(known_.carried(), 0.11);
  take(value(0.12));
  EXPECT_EQ(known_.carried(), 0.0);
}

TEST_F(Known, OnlyAValueSettlesADoubt) {
  estimator::PeakEstimate none;
  none.contradictory = true;
  take(none);
  EXPECT_TRUE(doubtful());
  take(bound(0.08));
  EXPECT_TRUE(doubtful());
  take(value(0.09));
  EXPECT_FALSE(doubtful());
}

TEST_F(Known, ABeltThatSlippedWithLessMayBeLoadedNoMore) {
  take(value(0.09));
  ended_.ended_by_slip = true;
  ended_.mu_star_most = 0.087;  // a stop comes before the very top
  EXPECT_FALSE(take(bound(0.06)).slipped);
  EXPECT_EQ(known_.to_rest_on(curve_), 0.09);
  ended_.mu_star_most = 0.07;
  EXPECT_TRUE(take(bound(0.06)).slipped);
  EXPECT_NEAR(known_.to_rest_on(curve_), 0.07, 1e-12);
  // A request may come once more; a second belt that slips so is believed, until a value.
  EXPECT_NEAR(known_.peak_as_read(curve_, 0.09), 0.09, 1e-12);
  EXPECT_TRUE(take(bound(0.06)).slipped);
  EXPECT_NEAR(known_.peak_as_read(curve_, 0.09), 0.07, 1e-12);
  EXPECT_TRUE(doubtful());
  take(value(0.075));
  EXPECT_EQ(known_.to_rest_on(curve_), 0.075);
  EXPECT_FALSE(doubtful());
  ended_.mu_star_most = 0.06;
  EXPECT_TRUE(take(bound(0.05)).slipped);
  EXPECT_NEAR(known_.peak_as_read(curve_, 0.075), 0.075, 1e-12);
}

// Of all experiments, as the history has them.
estimator::LearnedFriction learned_of(double mu_max) {
  estimator::LearnedFriction learned;
  estimator::FusedFriction& fused = learned.groups[estimator::LearnedFriction::index(
      estimator::Direction::kDrive, estimator::EndStop::kOverdrive)];
  fused.known = true;
  fused.mu_max = mu_max;
  fused.mu_max_std = 0.01 * mu_max;
  fused.ci95_low = 0.98 * mu_max;
  fused.ci95_high = 1.02 * mu_max;
  fused.repeatability_percent = 1.0;
  return learned;
}

TEST_F(Known, ALastValueWithinTheNoiseOfAllCountsAsAll) {
  known_.learn(learned_of(0.09));
  take(value(0.0905));
  EXPECT_EQ(known_.to_rest_on(curve_), 0.09);
}

TEST_F(Known, OfALastValueAndTheOthersTheLowerOneCounts) {
  known_.learn(learned_of(0.09));
  take(value(0.08));
  EXPECT_EQ(known_.to_rest_on(curve_), 0.08);
  take(value(0.1));
  EXPECT_EQ(known_.to_rest_on(curve_), 0.09);
}

TEST_F(Known, UnderAnotherConfigurationOnlyTheCountGoesOn) {
  take(value(0.09));
  KnownFriction next(config_);
  next.go_on_from(known_, false);
  EXPECT_EQ(next.newest().experiment_count, 1);
  EXPECT_EQ(next.to_rest_on(curve_), 0.0);
  next.go_on_from(known_, true);
  EXPECT_EQ(next.to_rest_on(curve_), 0.09);
}

}  // namespace
}  // namespace beltgrip::daemon
