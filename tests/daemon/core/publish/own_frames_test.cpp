// Published frames against the interface's examples, the DBC and each other; the gate lets pass
// everything that is packed.
#include "daemon/core/publish/own_frames.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <set>

#include "daemon/core/guard/tx_gate.h"
#include "daemon/core/publish/names.h"

namespace beltgrip::daemon {
namespace {

using estimator::PeakKind;
using estimator::Phase;
using estimator::StopReason;

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
constexpr double kInfinity = std::numeric_limits<double>::infinity();

const OwnFrames& frames() {
  static const OwnFrames instance{FrameIdentifiers{}};
  return instance;
}

const can::SignalDef& signal_of(const can::CanFrame& frame, const std::string& name) {
  return *own_database().find_message(frame.id)->find_signal(name);
}
std::uint64_t raw_of(const can::CanFrame& frame, const std::string& name) {
  return can::SignalCodec(signal_of(frame, name)).raw(frame.payload());
}
double value_of(const can::CanFrame& frame, const std::string& name) {
  return can::SignalCodec(signal_of(frame, name)).decode(frame.payload());
}
std::string text_of(const can::CanFrame& frame, const std::string& name) {
  const auto& values = signal_of(frame, name).values;
  const auto at = values.find(static_cast<std::int64_t>(raw_of(frame, name)));
  return at == values.end() ? "" : at->second;
}
bool passes(const can::CanFrame& frame) {
  TxGate gate(FrameIdentifiers{}, Control::kCommand, {0.0, 65535.0, 1U << 30, 0});
  return gate.permits(frame);
}

TEST(OwnFrames, ExamplesOfTheInterface) {
  // id 0x6A2, bytes 1 to 7 05 01 A6 0B 00 00 00 -> Crc 0x0E
  const can::CanFrame clamp = frames().pack(ClampValues{true, 2982.0}, 5);
  EXPECT_EQ(clamp.id, (can::CanId{0x6A2, false}));
  EXPECT_EQ(clamp.length, 8);
  const std::array<std::uint8_t, 8> expected{0x0E, 0x05, 0x01, 0xA6, 0x0B, 0, 0, 0};
  EXPECT_TRUE(std::equal(expected.begin(), expected.end(), clamp.data.begin()));
}

TEST(OwnFrames, EstimateOfEachKind) {
  EstimateValues values;
  values.mu_max = 0.10512;
  values.mu_max_std = 0.00034;
  values.experiment_count = 7;
  values.min_clamp_force_N = 3877.2;
  can::CanFrame frame = frames().pack(values, 3);
  EXPECT_EQ(text_of(frame, "MuMaxKind"), "None");
  EXPECT_EQ(value_of(frame, "MuMaxValid"), 0.0);
  EXPECT_EQ(value_of(frame, "MuMax"), 0.0);
  EXPECT_EQ(value_of(frame, "MinClampForce"), 3880.0);  // from the history
  EXPECT_EQ(value_of(frame, "Counter"), 3.0);
  EXPECT_TRUE(passes(frame));

  values.kind = PeakKind::kValue;
  frame = frames().pack(values, 14);
  EXPECT_EQ(text_of(frame, "MuMaxKind"), "Value");
  EXPECT_EQ(value_of(frame, "MuMaxValid"), 1.0);
  EXPECT_NEAR(value_of(frame, "MuMax"), 0.10512, 0.5e-5);
  EXPECT_NEAR(value_of(frame, "MuMaxStd"), 0.00034, 2e-5);
  EXPECT_EQ(value_of(frame, "ExperimentCount"), 7.0);
  EXPECT_EQ(value_of(frame, "MinClampForce"), 3880.0);  // rounded up
  EXPECT_TRUE(passes(frame));

  values.min_clamp_force_N.reset();
  EXPECT_EQ(text_of(frames().pack(values, 0), "MinClampForce"), "NotAvailable");

  values.kind = PeakKind::kLowerBound;
  values.min_clamp_force_N = 3877.2;
  frame = frames().pack(values, 0);
  EXPECT_EQ(text_of(frame, "MuMaxKind"), "LowerBound");
  EXPECT_EQ(value_of(frame, "MuMaxValid"), 0.0);
  EXPECT_NEAR(value_of(frame, "MuMax"), 0.10512, 0.5e-5);
  EXPECT_EQ(value_of(frame, "MuMaxStd"), 0.0);
  EXPECT_EQ(value_of(frame, "MinClampForce"), 3880.0);  // from the history
  EXPECT_TRUE(passes(frame));
}

TEST(OwnFrames, DeviationAndForceAreRoundedUpNeverDown) {
  EstimateValues values;
  values.kind = PeakKind::kValue;
  values.mu_max = 0.1;
  for (int i = 1; i <= 4000; ++i) {
    values.mu_max_std = i * 1.7e-6;
    values.min_clamp_force_N = i * 3.3;
    const can::CanFrame frame = frames().pack(values, 0);
    ASSERT_GE(value_of(frame, "MuMaxStd"), values.mu_max_std * (1 - 1e-12));
    ASSERT_LE(value_of(frame, "MuMaxStd"), values.mu_max_std + 2.0001e-5);
    ASSERT_GE(value_of(frame, "MinClampForce"), *values.min_clamp_force_N * (1 - 1e-12));
    ASSERT_LE(value_of(frame, "MinClampForce"), *values.min_clamp_force_N + 4.0001);
  }
}

TEST(OwnFrames, WhatIsNotFiniteNeverLeavesAsANumber) {
  for (const double bad : {kNan, kInfinity, -kInfinity, 0.0, -0.1}) {
    EstimateValues values;
    values.kind = PeakKind::kValue;
    values.mu_max = bad;
    values.mu_max_std = 0.001;
    EXPECT_EQ(text_of(frames().pack(values, 0), "MuMaxKind"), "None") << bad;
    EXPECT_EQ(value_of(frames().pack(values, 0), "MuMaxValid"), 0.0) << bad;
    values.mu_max = 0.1;
    values.mu_max_std = bad;
    EXPECT_EQ(text_of(frames().pack(values, 0), "MuMaxKind"), "None") << bad;
    values.kind = PeakKind::kLowerBound;
    EXPECT_EQ(text_of(frames().pack(values, 0), "MuMaxKind"), "LowerBound") << bad;
  }
  for (const double bad : {kNan, kInfinity, -kInfinity}) {
    EstimateValues values;
    values.kind = PeakKind::kValue;
    values.mu_max = 0.1;
    values.mu_max_std = 0.001;
    values.min_clamp_force_N = bad;
    EXPECT_EQ(text_of(frames().pack(values, 0), "MinClampForce"), "NotAvailable");
    SlipValues slip;
    slip.available = true;
    slip.mu_star = bad;
    slip.sigma_star_percent = bad;
    slip.friction_slope = bad;
    const can::CanFrame frame = frames().pack(slip, 0);
    EXPECT_EQ(text_of(frame, "MuStar"), "NotAvailable");
    EXPECT_EQ(text_of(frame, "SigmaStar"), "NotAvailable");
    EXPECT_EQ(text_of(frame, "FrictionSlope"), "NotAvailable");
    EXPECT_EQ(value_of(frames().pack(ClampValues{true, bad}, 0), "RequestActive"), 0.0);
  }
}

TEST(OwnFrames, ValuesBeyondTheRangeAreItsEnds) {
  SlipValues values;
  values.available = true;
  values.mu_star = 1.0;
  values.sigma_star_percent = 1000.0;
  values.friction_slope = 9.0;
  can::CanFrame frame = frames().pack(values, 0);
  EXPECT_EQ(value_of(frame, "MuStar"), 0.32767);
  EXPECT_EQ(value_of(frame, "SigmaStar"), 32.767);
  EXPECT_EQ(value_of(frame, "FrictionSlope"), 0.32767);
  values.mu_star = values.sigma_star_percent = values.friction_slope = -1000.0;
  frame = frames().pack(values, 0);
  EXPECT_EQ(value_of(frame, "MuStar"), -0.32767);  // not the code for "not available"
  EXPECT_EQ(value_of(frame, "SigmaStar"), -32.767);
  EXPECT_EQ(value_of(frame, "FrictionSlope"), -0.32767);
  EXPECT_TRUE(passes(frame));
}

TEST(OwnFrames, SlipOfEachPhase) {
  const std::array<std::string, 4> names{"Quiet", "Excited", "Peak", "MacroSlip"};
  for (std::size_t i = 0; i < names.size(); ++i) {
    for (const bool stop : {false, true}) {
      SlipValues values{stop, static_cast<Phase>(i), true, 0.0987, -1.234, -0.0021};
      const can::CanFrame frame = frames().pack(values, 9);
      EXPECT_EQ(text_of(frame, "Phase"), names[i]);
      EXPECT_EQ(value_of(frame, "MacroSlipStop"), stop ? 1.0 : 0.0);
      EXPECT_NEAR(value_of(frame, "MuStar"), 0.0987, 0.5e-5);
      EXPECT_NEAR(value_of(frame, "SigmaStar"), -1.234, 0.5e-3);
      EXPECT_NEAR(value_of(frame, "FrictionSlope"), -0.0021, 0.5e-5);
      EXPECT_TRUE(passes(frame));
    }
  }
}

TEST(OwnFrames, StatusNamesEveryCode) {
  for (unsigned state = 0; state < kStateCount; ++state) {
    for (unsigned reason = 0; reason < estimator::kStopReasonCount; ++reason) {
      for (unsigned outcome = 0; outcome < 4; ++outcome) {
        const StatusValues values{static_cast<State>(state), static_cast<Outcome>(outcome),
                                  static_cast<StopReason>(reason), 0};
        const can::CanFrame frame = frames().pack(values, 0);
        ASSERT_EQ(text_of(frame, "State"), state_name(values.state));
        ASSERT_EQ(text_of(frame, "Outcome"), outcome_name(values.outcome));
        ASSERT_EQ(text_of(frame, "StopReason"), stop_reason_name(values.stop_reason));
        ASSERT_TRUE(passes(frame));
      }
    }
  }
}

TEST(OwnFrames, EachFaultHasItsBit) {
  for (std::size_t i = 0; i < kFaultCount; ++i) {
    StatusValues values;
    values.faults = std::uint32_t{1} << i;
    const can::CanFrame frame = frames().pack(values, 0);
    for (std::size_t j = 0; j < kFaultCount; ++j) {
      EXPECT_EQ(value_of(frame, "Fault" + std::string(kFaults[j].name)), i == j ? 1.0 : 0.0);
    }
    EXPECT_TRUE(passes(frame));
  }
  StatusValues all;
  all.faults = (std::uint32_t{1} << kFaultCount) - 1;
  EXPECT_TRUE(passes(frames().pack(all, 0)));
}

// The gate's own constants, the names of the faults and the DBC say the same.
TEST(OwnFrames, TheDbcIsWhatTheInterfacePromises) {
  const can::Database& database = own_database();
  ASSERT_EQ(database.messages.size(), 4U);
  const std::array<std::pair<const char*, double>, 4> promised{
      std::pair{"BeltGripEstimate", 100.0}, std::pair{"BeltGripSlip", 100.0},
      std::pair{"BeltGripClamp", 10.0}, std::pair{"BeltGripStatus", 1000.0}};
  for (std::size_t i = 0; i < promised.size(); ++i) {
    const can::MessageDef& message = database.messages[i];
    EXPECT_EQ(message.name, promised[i].first);
    EXPECT_EQ(message.cycle_ms, promised[i].second);
    EXPECT_EQ(message.id, (can::CanId{own_data_id(static_cast<OwnMessage>(i)), false}));
    EXPECT_EQ(message.length, kOwnFrameLength);
    const can::SignalDef* crc = message.find_signal("Crc");
    const can::SignalDef* counter = message.find_signal("Counter");
    ASSERT_TRUE(crc != nullptr && counter != nullptr);
    EXPECT_TRUE(crc->start_bit == 0 && crc->length == 8);
    EXPECT_TRUE(counter->start_bit == 8 && counter->length == 4);
    // No bit twice.
    std::set<std::uint32_t> bits;
    for (const can::SignalDef& signal : message.signals) {
      EXPECT_EQ(signal.byte_order, can::ByteOrder::kLittle);
      for (std::uint32_t bit = 0; bit < signal.length; ++bit) {
        EXPECT_TRUE(bits.insert(signal.start_bit + bit).second) << signal.name;
      }
    }
    EXPECT_LT(*bits.rbegin(), 64U);
  }
  std::size_t faults = 0;
  for (const can::SignalDef& signal : database.messages[3].signals) {
    if (signal.name.starts_with("Fault")) ++faults;
  }
  EXPECT_EQ(faults, kFaultCount);
}

TEST(OwnFrames, ConfiguredIdentifiersKeepTheDataIds) {
  const OwnFrames moved{FrameIdentifiers{0x10, 0x11, 0x12, 0x13}};
  const can::CanFrame there = moved.pack(SlipValues{}, 4);
  const can::CanFrame here = frames().pack(SlipValues{}, 4);
  EXPECT_EQ(there.id, (can::CanId{0x11, false}));
  EXPECT_EQ(there.data, here.data);
}

}  // namespace
}  // namespace beltgrip::daemon
