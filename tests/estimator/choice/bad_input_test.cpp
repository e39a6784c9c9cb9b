// Inputs that are wrong on the way from the sensor to the estimator: no value comes of them, and
// the stop says why.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <memory>
#include <ostream>
#include <string>
#include <utility>

#include "estimator/choice/make_estimator.h"
#include "estimator/method/slip_curve_estimator.h"
#include "tests/estimator/choice/rig_trace.h"

namespace beltgrip::estimator {
namespace {

using test::Rig;

struct Fault {
  const char* name;
  std::function<void(VariatorSample&)> apply;  // from the first sample on
  StopReason reason;
};
void PrintTo(const Fault& fault, std::ostream* out) { *out << fault.name; }

class BadInput : public testing::TestWithParam<Fault> {};

TEST_P(BadInput, GivesNoValueAndTheReason) {
  for (const std::uint64_t seed : {1U, 2U}) {
    const Rig rig = {.friction = test::round_peak(0.105, 2.5), .seed = seed};
    const auto estimator = make_slip_curve_estimator(rig_settings(rig), {}, {});
    StopReason stop = StopReason::kNone;
    for (auto& point : rig_trace(rig)) {
      GetParam().apply(point.sample);
      stop = estimator->step(point.sample).stop;
      if (stop != StopReason::kNone) break;
    }
    for (int i = 0; i < 10000 && !estimator->conclude(); ++i) {
    }
    EXPECT_EQ(stop, GetParam().reason) << seed;
    EXPECT_NE(estimator->peak().kind, PeakKind::kValue) << seed;
  }
}

constexpr double kRpm = 9.549296585513721;  // per rad/s
constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

INSTANTIATE_TEST_SUITE_P(
    Faults, BadInput,
    testing::Values(
        Fault{"NoNumber", [](VariatorSample& s) { s.torque_Nm = kNaN; }, StopReason::kInputs},
        Fault{"PressureBeyondAnyVariator",
              [](VariatorSample& s) { s.secondary_pressure_Pa = 1e30; }, StopReason::kInputs},
        Fault{"PressureThousandfold", [](VariatorSample& s) { s.secondary_pressure_Pa *= 1000.0; },
              StopReason::kInputs},
        Fault{"PressureATenth", [](VariatorSample& s) { s.secondary_pressure_Pa *= 0.1; },
              StopReason::kInputs},
        Fault{"PressureInPsiForBar", [](VariatorSample& s) { s.secondary_pressure_Pa *= 0.0689; },
              StopReason::kInputs},
        Fault{"SpeedsSwapped",
              [](VariatorSample& s) { std::swap(s.omega_p_rad_s, s.omega_s_rad_s); },
              StopReason::kRatio},
        Fault{"OneSpeedInRpm", [](VariatorSample& s) { s.omega_s_rad_s *= kRpm; },
              StopReason::kRatio},
        Fault{"RatioOffItsEndStop", [](VariatorSample& s) { s.omega_s_rad_s *= 0.85; },
              StopReason::kRatio},
        Fault{"TorqueOfTheWrongSign", [](VariatorSample& s) { s.torque_Nm = -s.torque_Nm; },
              StopReason::kRatio},
        Fault{"SpeedOfTheWrongSign", [](VariatorSample& s) { s.omega_s_rad_s = -s.omega_s_rad_s; },
              StopReason::kRatio},
        Fault{"PressureInKilopascal", [](VariatorSample& s) { s.secondary_pressure_Pa /= 1000.0; },
              StopReason::kInputs},
        Fault{"PressureTenfold", [](VariatorSample& s) { s.secondary_pressure_Pa *= 10.0; },
              StopReason::kInputs},
        Fault{"TorqueOfAThird", [](VariatorSample& s) { s.torque_Nm *= 0.3; }, StopReason::kInputs},
        Fault{"TorqueStuck", [](VariatorSample& s) { s.torque_Nm = 50.0; }, StopReason::kInputs},
        Fault{"TorqueTenfold", [](VariatorSample& s) { s.torque_Nm *= 10.0; }, StopReason::kInputs},
        Fault{"PressureAndTorqueStuck",
              [](VariatorSample& s) {
                s.secondary_pressure_Pa = 300e3;
                s.torque_Nm = 50.0;
              },
              StopReason::kInputs},
        Fault{"PressureStuck", [](VariatorSample& s) { s.secondary_pressure_Pa = 300e3; },
              StopReason::kInputs},
        Fault{"NoTorque", [](VariatorSample& s) { s.torque_Nm = 0.0; }, StopReason::kNone}),
    [](const auto& each) { return std::string(each.param.name); });

TEST(BadInput, TorqueThatGoesToZeroEndsTheExperiment) {
  const Rig rig = {.friction = test::round_peak(0.105, 2.5)};
  const auto estimator = make_slip_curve_estimator(rig_settings(rig), {}, {});
  StopReason stop = StopReason::kNone;
  const auto trace = rig_trace(rig);
  const auto fades_ns = trace.front().sample.t_ns + 10'000'000'000;
  for (auto point : trace) {
    if (point.sample.t_ns > fades_ns) point.sample.torque_Nm = 0.5;
    stop = estimator->step(point.sample).stop;
    if (stop != StopReason::kNone) break;
  }
  for (int i = 0; i < 10000 && !estimator->conclude(); ++i) {
  }
  EXPECT_EQ(stop, StopReason::kTorque);
  EXPECT_NE(estimator->peak().kind, PeakKind::kValue);
}

// A reading that goes to another level in the midst of the ramp, and perhaps comes back.
struct Jump {
  const char* name;
  double VariatorSample::*channel;
  double factor;
  double lasts_s;
  double takes_s = 0.0;  // from one frame to the next
};
void PrintTo(const Jump& jump, std::ostream* out) { *out << jump.name; }

class ReadingThatJumps : public testing::TestWithParam<Jump> {};

TEST_P(ReadingThatJumps, GivesNoValueAndIsSaid) {
  for (const std::uint64_t seed : {1U, 2U, 3U}) {
    const Rig rig = {.friction = test::round_peak(0.105, 2.5), .seed = seed};
    const auto estimator = make_slip_curve_estimator(rig_settings(rig), {}, {});
    double jumps_s = -1.0;
    for (auto& point : rig_trace(rig)) {
      const double t_s = 1e-9 * static_cast<double>(point.sample.t_ns);
      if (jumps_s < 0.0 && point.mu > 0.09) jumps_s = t_s;
      if (jumps_s >= 0.0 && t_s < jumps_s + GetParam().lasts_s) {
        const double share =
            GetParam().takes_s > 0.0 ? std::min(1.0, (t_s - jumps_s) / GetParam().takes_s) : 1.0;
        point.sample.*GetParam().channel *= 1.0 + share * (GetParam().factor - 1.0);
      }
      if (estimator->step(point.sample).stop != StopReason::kNone) break;
    }
    for (int i = 0; i < 10000 && !estimator->conclude(); ++i) {
    }
    EXPECT_NE(estimator->peak().kind, PeakKind::kValue) << seed;
    EXPECT_TRUE(estimator->peak().contradictory) << seed;
  }
}

INSTANTIATE_TEST_SUITE_P(
    Jumps, ReadingThatJumps,
    testing::Values(
        Jump{"PressureUp", &VariatorSample::secondary_pressure_Pa, 1.1, 1e9},
        Jump{"PressureDown", &VariatorSample::secondary_pressure_Pa, 0.93, 1e9},
        Jump{"SecondaryUpForAFifthOfASecond", &VariatorSample::omega_s_rad_s, 1.02, 0.2},
        Jump{"SecondaryDownFromFrameToFrame", &VariatorSample::omega_s_rad_s, 0.95, 0.2, 0.02},
        Jump{"PrimaryUpFromFrameToFrame", &VariatorSample::omega_p_rad_s, 1.05, 1e9, 0.02},
        Jump{"SecondaryDown", &VariatorSample::omega_s_rad_s, 0.98, 1e9},
        Jump{"PrimaryDownForAFifthOfASecond", &VariatorSample::omega_p_rad_s, 0.98, 0.2}),
    [](const auto& each) { return std::string(each.param.name); });

// A channel that stands still from some instant of the ramp on, its frames still arriving.
struct Frozen {
  const char* name;
  double VariatorSample::*channel;
};
void PrintTo(const Frozen& frozen, std::ostream* out) { *out << frozen.name; }

class FrozenChannel : public testing::TestWithParam<Frozen> {};

TEST_P(FrozenChannel, GivesNoValueAndTheReason) {
  for (const double share : {0.3, 0.6, 0.8}) {  // of the ramp up to the peak, 32 s
    const Rig rig = {.friction = test::round_peak(0.105, 2.5)};
    const auto estimator = make_slip_curve_estimator(rig_settings(rig), {}, {});
    StopReason stop = StopReason::kNone;
    double held = 0.0;
    for (auto& point : rig_trace(rig)) {
      double& value = point.sample.*GetParam().channel;
      if (static_cast<double>(point.sample.t_ns) * 1e-9 < 2.0 + 32.0 * share) held = value;
      value = held;
      stop = estimator->step(point.sample).stop;
      if (stop != StopReason::kNone) break;
    }
    for (int i = 0; i < 10000 && !estimator->conclude(); ++i) {
    }
    EXPECT_EQ(stop, StopReason::kInputs) << share;
    EXPECT_EQ(estimator->peak().kind, PeakKind::kNone) << share;
  }
}

INSTANTIATE_TEST_SUITE_P(Channels, FrozenChannel,
                         testing::Values(Frozen{"Pressure", &VariatorSample::secondary_pressure_Pa},
                                         Frozen{"Torque", &VariatorSample::torque_Nm}),
                         [](const auto& each) { return std::string(each.param.name); });

// A third of a second before the stop is enough to be seen; without the speed that tells of slip
// there may be no stop at all, and nothing that was seen later counts.
TEST(BadInput, AChannelThatFreezesLateOrTellsOfNoSlipLeavesNothing) {
  struct Late {
    double VariatorSample::*channel;
    double from_s;
  };
  const auto ends = [](const Late& late) {
    const Rig rig = {.friction = test::round_peak(0.105, 2.5)};
    const auto estimator = make_slip_curve_estimator(rig_settings(rig), {}, {});
    double held = 0.0, stop_s = 0.0;
    for (auto& point : rig_trace(rig)) {
      double& value = point.sample.*late.channel;
      stop_s = static_cast<double>(point.sample.t_ns) * 1e-9;
      if (stop_s < late.from_s) held = value;
      value = held;
      if (estimator->step(point.sample).stop != StopReason::kNone) break;
    }
    for (int i = 0; i < 10000 && !estimator->conclude(); ++i) {
    }
    return std::pair(stop_s, estimator->peak().kind);
  };
  const auto [stop_s, kind] = ends({&VariatorSample::secondary_pressure_Pa, 1e9});
  ASSERT_EQ(kind, PeakKind::kValue);
  EXPECT_EQ(ends({&VariatorSample::secondary_pressure_Pa, stop_s - 0.35}).second, PeakKind::kNone);
  for (const double from_s : {20.0, stop_s - 0.35}) {
    for (double VariatorSample::*speed :
         {&VariatorSample::omega_p_rad_s, &VariatorSample::omega_s_rad_s}) {
      EXPECT_EQ(ends({speed, from_s}).second, PeakKind::kNone) << from_s;
    }
  }
}

// Readings that are wrong for 20 ms in mid ramp: a bad frame or two.
class BadFrame : public testing::TestWithParam<Fault> {};

TEST_P(BadFrame, ChangesNothing) {
  const Rig rig = {.friction = test::round_peak(0.105, 2.5)};
  const auto estimator = make_slip_curve_estimator(rig_settings(rig), {}, {});
  StopReason stop = StopReason::kNone;
  double slip_percent = 0.0;
  for (auto& point : rig_trace(rig)) {
    const double t_s = static_cast<double>(point.sample.t_ns) * 1e-9;
    if (t_s > 20.0 && t_s < 20.02) GetParam().apply(point.sample);
    stop = estimator->step(point.sample).stop;
    slip_percent = point.slip_percent;
    if (stop != StopReason::kNone) break;
  }
  for (int i = 0; i < 10000 && !estimator->conclude(); ++i) {
  }
  EXPECT_EQ(stop, GetParam().reason);
  EXPECT_GT(slip_percent, 2.4);
  ASSERT_EQ(estimator->peak().kind, PeakKind::kValue);
  EXPECT_NEAR(estimator->peak().mu_max, 0.105, 0.0003);
}

INSTANTIATE_TEST_SUITE_P(
    Readings, BadFrame,
    testing::Values(
        Fault{"SpeedTooHigh", [](VariatorSample& s) { s.omega_p_rad_s *= 1.01; },
              StopReason::kSlope},
        Fault{"SpeedTooLow", [](VariatorSample& s) { s.omega_s_rad_s *= 0.97; },
              StopReason::kSlope},
        Fault{"NoSpeed", [](VariatorSample& s) { s.omega_p_rad_s = 0.0; }, StopReason::kSlope},
        Fault{"NoTorque", [](VariatorSample& s) { s.torque_Nm = 0.0; }, StopReason::kSlope},
        Fault{"TorqueTwice", [](VariatorSample& s) { s.torque_Nm *= 2.0; }, StopReason::kSlope}),
    [](const auto& each) { return std::string(each.param.name); });

TEST(BadInput, ForceThatComesBackBeforeThePeakLeavesALowerBound) {
  for (const std::uint64_t seed : {1U, 2U, 3U}) {
    const Rig rig = {.friction = test::round_peak(0.105, 2.5),
                     .ramp_N_per_s = 70.0,
                     .restore_s = 11.0,
                     .end_s = 12.0,
                     .seed = seed};
    const auto estimator = make_slip_curve_estimator(rig_settings(rig), {}, {});
    double reached = 0.0;
    for (const auto& point : rig_trace(rig)) {
      reached = std::max(reached, point.mu);
      ASSERT_EQ(estimator->step(point.sample).stop, StopReason::kNone);
    }
    for (int i = 0; i < 10000 && !estimator->conclude(); ++i) {
    }
    EXPECT_FALSE(estimator->peak().contradictory) << seed;
    EXPECT_EQ(estimator->peak().kind, PeakKind::kLowerBound) << seed;
    EXPECT_GT(estimator->peak().mu_max, 0.97 * reached) << seed;
    EXPECT_LT(estimator->peak().mu_max, 0.105) << seed;
  }
}

}  // namespace
}  // namespace beltgrip::estimator
