// What the monitor makes of frames and time: values, experiments, silence, what cannot be believed.
#include "tools/monitor/bus_model.h"

#include <gtest/gtest.h>

#include "daemon/core/publish/own_frames.h"

namespace beltgrip::monitor {
namespace {

using daemon::kMillisecond;
using daemon::kSecond;
using daemon::MonoTime;

class Model : public testing::Test {
 protected:
  void state(MonoTime t, daemon::State state, daemon::Outcome outcome = daemon::Outcome::kNone,
             estimator::StopReason reason = estimator::StopReason::kNone,
             std::uint32_t faults = 0) {
    model_.on_frame(
        t, frames_.pack(daemon::StatusValues{state, outcome, reason, faults}, next(status_)));
  }
  void slip(MonoTime t, double sigma_percent, double mu,
            estimator::Phase phase = estimator::Phase::kExcited, bool stop = false) {
    model_.on_frame(t, frames_.pack(daemon::SlipValues{stop, phase, true, mu, sigma_percent, 0.02},
                                    next(slip_)));
  }
  void estimate(MonoTime t, double mu_max, std::uint8_t count) {
    daemon::EstimateValues values;
    values.kind = mu_max > 0.0 ? estimator::PeakKind::kValue : estimator::PeakKind::kNone;
    values.mu_max = mu_max;
    values.mu_max_std = mu_max > 0.0 ? 0.002 : 0.0;
    values.experiment_count = count;
    values.min_clamp_force_N = 2536.0;
    model_.on_frame(t, frames_.pack(values, next(estimate_)));
  }
  View view(MonoTime t) {
    View view;
    model_.show(view, t);
    return view;
  }
  static std::uint8_t next(std::uint8_t& counter) {
    const std::uint8_t now = counter;
    counter = can::e2e::next_counter(counter);
    return now;
  }

  daemon::OwnFrames frames_{daemon::FrameIdentifiers{}};
  BusModel model_{daemon::FrameIdentifiers{}};
  std::uint8_t status_ = 0, slip_ = 0, estimate_ = 0;
};

TEST_F(Model, SaysWhatTheFramesSay) {
  state(MonoTime{kSecond}, daemon::State::kRamping, daemon::Outcome::kNone,
        estimator::StopReason::kNone, daemon::fault_bit(daemon::Fault::kInputStale));
  slip(MonoTime{kSecond}, 1.25, 0.0875, estimator::Phase::kPeak, true);
  daemon::ClampValues clamp{true, 2058.0};
  model_.on_frame(MonoTime{kSecond}, frames_.pack(clamp, 0));
  const View seen = view(MonoTime{kSecond});
  EXPECT_EQ(seen.state, "ramping");
  EXPECT_EQ(seen.phase, "peak");
  EXPECT_TRUE(seen.stop);
  EXPECT_NEAR(seen.mu_star.value(), 0.0875, 1e-9);
  EXPECT_NEAR(seen.sigma_star_percent.value(), 1.25, 1e-9);
  EXPECT_NEAR(seen.force_asked_N.value(), 2058.0, 1e-9);
  ASSERT_EQ(seen.faults.size(), 1U);
  EXPECT_EQ(seen.faults[0].name, "InputStale");
  EXPECT_EQ(seen.faults[0].means, "it came and has stopped");
  clamp.request_active = false;
  model_.on_frame(MonoTime{kSecond}, frames_.pack(clamp, 1));
  EXPECT_FALSE(view(MonoTime{kSecond}).force_asked_N);
}

TEST_F(Model, WhatIsNotAvailableIsNoNumber) {
  daemon::SlipValues none;
  none.available = false;
  model_.on_frame(MonoTime{}, frames_.pack(none, 0));
  model_.on_frame(MonoTime{}, frames_.pack(daemon::EstimateValues{}, 0));
  EXPECT_FALSE(view(MonoTime{}).mu_star);
  EXPECT_FALSE(view(MonoTime{}).sigma_star_percent);
  EXPECT_FALSE(view(MonoTime{}).force_least_N);
}

TEST_F(Model, TheCurveIsThatOfTheExperiment) {
  state(MonoTime{}, daemon::State::kIdle);
  slip(MonoTime{10 * kMillisecond}, 0.3, 0.03);
  EXPECT_TRUE(view(MonoTime{kSecond}).curve.empty());
  state(MonoTime{20 * kMillisecond}, daemon::State::kRamping);
  slip(MonoTime{30 * kMillisecond}, 0.5, 0.05);
  slip(MonoTime{40 * kMillisecond}, 1.0, 0.08, estimator::Phase::kPeak);
  state(MonoTime{50 * kMillisecond}, daemon::State::kReleasing);
  slip(MonoTime{60 * kMillisecond}, 3.0, 0.07, estimator::Phase::kMacroSlip);  // on its way back
  const View seen = view(MonoTime{kSecond});
  ASSERT_EQ(seen.curve.size(), 2U);
  EXPECT_NEAR(seen.curve[1].sigma_star_percent, 1.0, 1e-9);
  EXPECT_EQ(seen.curve[1].phase, estimator::Phase::kPeak);
  state(MonoTime{70 * kMillisecond}, daemon::State::kCooldown);
  EXPECT_EQ(view(MonoTime{kSecond}).curve.size(), 2U) << "it stays to look at";
  state(MonoTime{80 * kMillisecond}, daemon::State::kRamping);
  EXPECT_TRUE(view(MonoTime{kSecond}).curve.empty()) << "the next one begins anew";
}

TEST_F(Model, AResultIsARowWithItsOutcomeAndItsMostSlip) {
  estimate(MonoTime{}, 0.0, 0);
  state(MonoTime{}, daemon::State::kRamping);
  slip(MonoTime{10 * kMillisecond}, 3.4, 0.1);
  // The estimate may come before the status of the same instant.
  estimate(MonoTime{kSecond}, 0.1068, 1);
  state(MonoTime{kSecond + kMillisecond}, daemon::State::kReleasing, daemon::Outcome::kCompleted,
        estimator::StopReason::kSlope);
  const View seen = view(MonoTime{kSecond + kMillisecond});
  ASSERT_EQ(seen.experiments.size(), 1U);
  EXPECT_EQ(seen.experiments[0].outcome, "completed");
  EXPECT_EQ(seen.experiments[0].reason, "slope");
  EXPECT_NEAR(seen.experiments[0].friction.mu_max, 0.1068, 1e-9);
  EXPECT_NEAR(seen.experiments[0].sigma_most_percent, 3.4, 1e-9);
  EXPECT_NEAR(seen.friction.low(), 0.1068 - 1.96 * 0.002, 1e-9);
  EXPECT_EQ(seen.reason_means, "friction no longer rises with slip");
}

TEST_F(Model, WhoComesLateKnowsNoEarlierExperiment) {
  estimate(MonoTime{}, 0.1, 7);
  EXPECT_TRUE(view(MonoTime{}).experiments.empty());
  EXPECT_EQ(view(MonoTime{}).experiment_count, 7U);
}

TEST_F(Model, SilenceIsTold) {
  EXPECT_FALSE(view(MonoTime{}).silence_s);
  can::CanFrame other;
  other.id = {0x123, false};
  model_.on_frame(MonoTime{}, other);
  View seen;
  model_.show(seen, MonoTime{3 * kSecond});
  EXPECT_FALSE(seen.silence_s);
  EXPECT_TRUE(is_silent(seen));
  slip(MonoTime{3 * kSecond}, 1.0, 0.1);
  EXPECT_FALSE(is_silent(view(MonoTime{5 * kSecond})));
  EXPECT_NEAR(view(MonoTime{6 * kSecond}).silence_s.value(), 3.0, 1e-9);
  EXPECT_TRUE(is_silent(view(MonoTime{6 * kSecond})));
}

TEST_F(Model, WhatCannotBeBelievedIsShownAndNotTaken) {
  slip(MonoTime{}, 1.0, 0.1);
  can::CanFrame wrong = frames_.pack(daemon::SlipValues{true, {}, true, 0.2, 2.0, 0.0}, 1);
  wrong.data[5] ^= 1;
  model_.on_frame(MonoTime::of_ns(1), wrong);
  EXPECT_EQ(view(MonoTime::of_ns(2)).distrust.wrong_crc, 1U);
  EXPECT_EQ(view(MonoTime::of_ns(2)).distrust.last, "0x6A1: wrong CRC");
  EXPECT_FALSE(view(MonoTime::of_ns(2)).stop);
  EXPECT_NEAR(view(MonoTime::of_ns(2)).mu_star.value(), 0.1, 1e-9);
  model_.on_frame(MonoTime::of_ns(3), frames_.pack(daemon::SlipValues{}, 9));  // after 0
  EXPECT_EQ(view(MonoTime::of_ns(4)).distrust.wrong_sequence, 1U);
  can::CanFrame longer = frames_.pack(daemon::SlipValues{}, 10);
  longer.length = 12;
  longer.fd = true;
  model_.on_frame(MonoTime::of_ns(5), longer);
  EXPECT_EQ(view(MonoTime::of_ns(6)).distrust.foreign_version, 1U);
  EXPECT_NE(view(MonoTime::of_ns(6)).distrust.last.find("12 bytes of CAN FD, not 8"),
            std::string::npos);
}

// The interface was gone, or another daemon begins: no two senders.
TEST_F(Model, BehindASilenceCountersBeginAnew) {
  slip(MonoTime{}, 1.0, 0.1);
  model_.on_frame(MonoTime{400 * kMillisecond}, frames_.pack(daemon::SlipValues{}, 9));
  EXPECT_EQ(view(MonoTime{kSecond}).distrust.wrong_sequence, 1U) << "so soon it is another sender";
  model_.on_frame(MonoTime{kSecond}, frames_.pack(daemon::SlipValues{}, 3));
  EXPECT_EQ(view(MonoTime{kSecond}).distrust.wrong_sequence, 1U);
  model_.on_frame(MonoTime{kSecond + 100 * kMillisecond}, frames_.pack(daemon::SlipValues{}, 4));
  EXPECT_EQ(view(MonoTime{2 * kSecond}).distrust.wrong_sequence, 1U);
}

// A later version may have one state and one fault more.
TEST_F(Model, ALaterVersionsValuesAreNumbers) {
  can::CanFrame frame = frames_.pack(daemon::StatusValues{}, 0);
  frame.data[1] = static_cast<std::uint8_t>(0x0B << 4);  // State = 11
  frame.data[7] = 0x80;                                  // a bit beyond the faults
  can::e2e::protect(frame, 0x6A3, 0);
  model_.on_frame(MonoTime{}, frame);
  EXPECT_EQ(view(MonoTime{}).state, "11 (unknown here)");
  EXPECT_EQ(view(MonoTime{}).distrust.foreign_version, 1U);
}

TEST_F(Model, TheLoadIsThatOfTheLastSecond) {
  can::CanFrame frame;
  frame.id = {0x123, false};
  frame.length = 8;
  EXPECT_EQ(frame_bits(frame), 111);  // 44 + 64 bits, 3 of pause
  for (int i = 0; i < 500; ++i) model_.on_frame(MonoTime{i * 10 * kMillisecond}, frame);
  EXPECT_NEAR(view(MonoTime{5 * kSecond}).traffic.frames_per_s, 100.0, 0.1);
  EXPECT_NEAR(view(MonoTime{5 * kSecond}).traffic.bit_per_s, 11'100.0, 10.0);
  EXPECT_NEAR(view(MonoTime{5 * kSecond + 500 * kMillisecond}).traffic.frames_per_s, 50.0, 0.1);
  EXPECT_EQ(view(MonoTime{7 * kSecond}).traffic.frames_per_s, 0.0);
}

}  // namespace
}  // namespace beltgrip::monitor
