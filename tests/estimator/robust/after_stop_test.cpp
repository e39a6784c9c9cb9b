// Which samples after the stop still belong to the friction curve: those before the clamp force
// comes back. And that they give a value where the curve up to the stop leaves its peak open.
#include "estimator/robust/after_stop.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "estimator/choice/make_estimator.h"
#include "estimator/method/slip_curve_estimator.h"
#include "tests/estimator/choice/rig_trace.h"

namespace beltgrip::estimator {
namespace {

constexpr double kRate_hz = 200.0;
constexpr double kForceNoise_N = 3.0;

class AfterTheStop : public testing::Test {
 protected:
  // A ramp of 50 N/s and slip that grows by 0.2 percent a second, 4 s long.
  AfterTheStop() {
    for (int i = 0; i < 800; ++i) record_.step(sample(i / kRate_hz, 0.0, 0.0));
    after_.begin(record_);
  }
  Cell sample(double t_s, double more_slip_percent, double more_force_N) {
    return {.t_s = t_s,
            .slip_percent = 1.0 + 0.2 * t_s + more_slip_percent + 0.02 * normal_(random_),
            .torque_Nm = 50.0 + 0.2 * normal_(random_),
            .clamp_force_N = 5000.0 - 50.0 * t_s + more_force_N + kForceNoise_N * normal_(random_),
            .omega_p_rad_s = 105.0};
  }
  // Slip runs on at this rate, the force comes back at that one after this time.
  void go_on(double slip_percent_per_s, double returns_after_s, double returns_N_per_s) {
    for (int i = 1; i <= 120; ++i) {
      const double after_s = i / kRate_hz;
      after_.step(sample(4.0 - 1.0 / kRate_hz + after_s, slip_percent_per_s * after_s,
                         returns_N_per_s * std::max(0.0, after_s - returns_after_s)),
                  0.0);
    }
  }
  // The same, the pressure read every so often and foretold in between from the ramp of before. The
  // newest reading is so old at the stop.
  void go_on_read(double period_s, double age_s, double returns_after_s, double returns_N_per_s) {
    for (int i = 1; i <= 120; ++i) {
      const double after_s = i / kRate_hz;
      const double ahead_s = std::fmod(after_s + age_s, period_s);
      const double read_s = after_s - ahead_s;
      after_.step(sample(4.0 - 1.0 / kRate_hz + after_s, 2.0 * after_s,
                         returns_N_per_s * std::max(0.0, read_s - returns_after_s)),
                  ahead_s);
    }
  }

  std::mt19937_64 random_{3};
  std::normal_distribution<double> normal_;
  ExperimentRecord record_{kRate_hz};
  AfterStop after_{kRate_hz};
};

TEST_F(AfterTheStop, SamplesAreKeptForAMoment) {
  go_on(2.0, 10.0, 0.0);
  EXPECT_TRUE(after_.over());
  EXPECT_NEAR(static_cast<double>(after_.size()) / kRate_hz, 0.5, 0.021);
}

TEST_F(AfterTheStop, NoneIsKeptFromWhereTheForceComesBack) {
  go_on(2.0, 0.06, 10000.0);
  EXPECT_TRUE(after_.over());
  ASSERT_GT(after_.size(), 0U);
  EXPECT_LE(after_[after_.size() - 1].t_s, 4.0 + 0.06);
}

// The force is back long before a reading shows it.
TEST_F(AfterTheStop, NoneIsKeptThatNoLaterReadingVouchesFor) {
  go_on_read(0.1, 0.03, 0.09, 10000.0);
  EXPECT_TRUE(after_.over());
  ASSERT_GT(after_.size(), 0U);
  EXPECT_LE(after_[after_.size() - 1].t_s, 4.0 + 0.075);  // the reading before it
}

TEST_F(AfterTheStop, SamplesAreKeptUpToTheLastReadingOfASlowPressure) {
  go_on_read(0.1, 0.03, 10.0, 0.0);
  EXPECT_TRUE(after_.over());
  EXPECT_GE(static_cast<double>(after_.size()) / kRate_hz, 0.4 - 0.03);
}

TEST_F(AfterTheStop, NoneIsKeptWhereSlipRunsAway) {
  go_on(30.0, 10.0, 0.0);
  EXPECT_TRUE(after_.over());
  for (std::size_t i = 0; i < after_.size(); ++i) EXPECT_LT(after_[i].slip_percent, 3.7);
}

TEST_F(AfterTheStop, NoneIsKeptWithoutAStop) {
  after_.reset();
  go_on(2.0, 10.0, 0.0);
  EXPECT_EQ(after_.size(), 0U);
}

// Slip that shot up by 1.2 percent in the last tenth of a second before the stop.
class AfterARise : public AfterTheStop {
 protected:
  static constexpr double kRise_percent = 1.2;
  AfterARise() {
    for (int i = 0; i < 20; ++i) {
      record_.step(sample(4.0 + i / kRate_hz, kRise_percent * (i + 1) / 20.0, 0.0));
    }
    after_.reset();
    after_.begin(record_);
  }
  // It stays for a time, then goes back at this rate; the force as above.
  void go_back(double stays_s, double returns_after_s, double returns_N_per_s) {
    for (int i = 1; i <= 100; ++i) {
      const double after_s = i / kRate_hz;
      const double back_percent = 100.0 * std::max(0.0, after_s - stays_s);
      after_.step(
          sample(4.1 - 1.0 / kRate_hz + after_s, std::max(-1.0, kRise_percent - back_percent),
                 returns_N_per_s * std::max(0.0, after_s - returns_after_s)),
          0.0);
    }
  }
};

TEST_F(AfterARise, SlipThatGoesBackByItselfHasSwung) {
  go_back(0.0, 10.0, 0.0);
  EXPECT_TRUE(after_.swung_back());
}

TEST_F(AfterARise, SlipThatStaysHasNot) {
  go_back(10.0, 10.0, 0.0);
  EXPECT_FALSE(after_.swung_back());
}

TEST_F(AfterARise, SlipThatTheReturningForceTakesBackHasNot) {
  go_back(0.04, 0.04, 50000.0);
  EXPECT_FALSE(after_.swung_back());
}

// The experiment ends with the stop, or goes on for so many samples.
PeakEstimate estimate(const std::vector<test::TracePoint>& trace, const test::Rig& rig,
                      std::size_t after, double value_width = 0.05) {
  EstimatorSettings settings = test::rig_settings(rig);
  settings.value_width = value_width;
  const auto estimator = make_slip_curve_estimator(settings, {}, {});
  std::size_t i = 0;
  while (i < trace.size() && estimator->step(trace[i++].sample).stop == StopReason::kNone) {
  }
  for (int call = 0; call < 10000 && !estimator->conclude(); ++call) {
    if (after > 0 && i < trace.size()) {
      estimator->step(trace[i++].sample);
      --after;
    }
  }
  return estimator->peak();
}

// What follows makes the interval narrow enough where it was not.
TEST(ValueAfterTheStop, IsFoundWhereTheCurveUpToTheStopLeavesThePeakOpen) {
  constexpr double kNarrow = 0.005;
  int cut = 0, whole = 0, whole_narrow = 0;
  for (const double noise : {1.0, 4.0}) {
    for (std::uint64_t seed = 1; seed <= 20; ++seed) {
      const test::Rig rig{.friction = test::tent(0.105, 4.0, 4e-4),
                          .ramp_N_per_s = 30.0,
                          .noise = noise,
                          .seed = seed};
      const auto trace = test::rig_trace(rig);
      cut += estimate(trace, rig, 0, kNarrow).kind == PeakKind::kValue;
      whole_narrow += estimate(trace, rig, 1000, kNarrow).kind == PeakKind::kValue;
      const PeakEstimate peak = estimate(trace, rig, 1000);
      if (peak.kind != PeakKind::kValue) continue;
      ++whole;
      EXPECT_NEAR(peak.mu_max, 0.105, 0.01 * 0.105) << seed;
    }
  }
  EXPECT_GE(whole, 38);
  EXPECT_GE(whole_narrow, cut + 3);
}

}  // namespace
}  // namespace beltgrip::estimator
