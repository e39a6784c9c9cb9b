// Inputs that are wrong on the way from the sensor to the estimator: no value comes of them, and
// the stop says why.
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <limits>
#include <memory>
#include <ostream>
#include <string>
#include <utility>

#include "estimator/slip_curve_estimator.h"
#include "tests/estimator/rig_trace.h"

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
        // Nothing that could be used ever comes: no stop, no result.
        Fault{"NoNumber", [](VariatorSample& s) { s.torque_Nm = kNaN; }, StopReason::kNone},
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

}  // namespace
}  // namespace beltgrip::estimator
