// What the configuration says of a role, and what becomes of it: bus, identifier, source, delay,
// step, range, unit, period; frames and diagnostic answers; and what is asked of a role afterwards.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <bit>
#include <memory>
#include <utility>
#include <vector>

#include "daemon/core/input/input_monitor.h"

namespace beltgrip::daemon {

using estimator::ReadingVerdict;
namespace {

can::SignalDef signal_def(std::uint32_t length, double scale = 1.0, double offset = 0.0) {
  can::SignalDef signal;
  signal.length = length;
  signal.scale = scale;
  signal.offset = offset;
  return signal;
}

// 16 bits in a message of two bytes every 10 ms, unless a test says otherwise.
RoleBinding bound(Role role, can::CanId id, const can::SignalDef& signal = signal_def(16)) {
  RoleBinding binding;
  binding.role = role;
  binding.id = id;
  binding.message_length = 2;
  binding.codec = can::SignalCodec(signal);
  binding.period_ms = 10.0;
  return binding;
}

struct Bench {
  explicit Bench(std::vector<RoleBinding> roles, Trigger trigger = Trigger::kAlways)
      : monitor(config_of(std::move(roles), trigger)) {}
  static Config config_of(std::vector<RoleBinding> roles, Trigger trigger) {
    Config config;
    config.trigger = trigger;
    config.roles = std::move(roles);
    return config;
  }
  FrameUse tell(can::CanId id, std::uint64_t raw, MonoTime t, std::uint8_t length = 2,
                std::uint8_t bus = 0) {
    RxFrame frame;
    frame.t = t;
    frame.bus = bus;
    frame.frame.id = id;
    frame.frame.length = length;
    for (std::size_t i = 0; i < 8; ++i) {
      frame.frame.data[i] = static_cast<std::uint8_t>(raw >> 8 * i);
    }
    return monitor.on_frame(frame, faults);
  }
  double value(Role role) const { return monitor.history(role).newest_value(); }
  bool has(Role role) const { return !monitor.history(role).empty(); }
  InputMonitor monitor;
  FaultSet faults;
};

constexpr can::CanId kId{0x100, false};

TEST(Roles, WhatIsBoundIsMissingUntilItComes) {
  const Bench bench({bound(Role::kOilTemperature, kId)});
  EXPECT_EQ(bench.monitor.verdict(Role::kOilTemperature), ReadingVerdict::kMissing);
  EXPECT_EQ(bench.monitor.verdict(Role::kEngineSpeed), ReadingVerdict::kUnbound);
}

TEST(Roles, AnExperimentOfAnotherNeedsItsSignal) {
  for (const bool by_signal : {false, true}) {
    const Bench bench({}, by_signal ? Trigger::kSignal : Trigger::kCoastDown);
    const auto required = bench.monitor.required();
    EXPECT_EQ(required.size(), by_signal ? 5U : 4U);
    EXPECT_EQ(std::count(required.begin(), required.end(), Role::kExperimentActive),
              by_signal ? 1 : 0);
  }
}

// SI = factor * (scale * raw + offset) + shift; a step is factor * scale, whatever the offset.
TEST(Roles, UnitStepAndDelay) {
  RoleBinding binding = bound(Role::kPrimarySpeed, kId, signal_def(16, 0.25, 5.0));
  binding.factor = -2.0;
  binding.shift = 7.0;
  binding.delay_ms = 2.5;
  Bench bench({binding});
  EXPECT_EQ(bench.monitor.course(Role::kPrimarySpeed).resolution(), 0.5);
  EXPECT_EQ(bench.monitor.delay(Role::kPrimarySpeed), 2500 * kMicrosecond);
  bench.tell(kId, 100, MonoTime::of_ns(1));
  EXPECT_EQ(bench.value(Role::kPrimarySpeed), -2.0 * (0.25 * 100.0 + 5.0) + 7.0);
}

// Up to four of these steps from where it lies a value is no spike.
TEST(Roles, ASpikeIsMeasuredInSteps) {
  for (const auto& [steps, taken] : {std::pair{4U, true}, std::pair{5U, false}}) {
    RoleBinding binding = bound(Role::kPrimarySpeed, kId, signal_def(16, 0.5, 40.0));
    binding.factor = 20.0;
    Bench bench({binding});
    MonoTime t{kSecond};
    for (int i = 0; i < 100; ++i) bench.tell(kId, 1000, t += 10 * kMillisecond);
    bench.tell(kId, 1000 + steps, t += 10 * kMillisecond);
    EXPECT_EQ(bench.value(Role::kPrimarySpeed) != 20.0 * (0.5 * 1000.0 + 40.0), taken) << steps;
  }
}

// So many spikes are left out as come in 60 ms, to the nearest; three at the most, one at the
// least.
TEST(Roles, SpikesForSixtyMilliseconds) {
  struct Case {
    double period_ms;
    int left_out;
  };
  for (const Case& c : {Case{1.0, 3}, Case{10.0, 3}, Case{24.0, 3}, Case{25.0, 2}, Case{40.0, 2},
                        Case{41.0, 1}, Case{60.0, 1}, Case{500.0, 1}}) {
    RoleBinding binding = bound(Role::kSecondaryPressure, kId);
    binding.period_ms = c.period_ms;
    Bench bench({binding});
    const auto period = Duration::of_ms(c.period_ms);
    MonoTime t{kSecond};
    for (int i = 0; i < 100; ++i) bench.tell(kId, 1000, t += period);
    int left_out = 0;
    while (left_out < 10) {
      bench.tell(kId, 2000, t += period);
      if (bench.value(Role::kSecondaryPressure) == 2000.0) break;
      ++left_out;
    }
    EXPECT_EQ(left_out, c.left_out) << c.period_ms;
  }
}

// 0.1 is no binary number: 299999992 steps of it are 4e-9 more than the DBC's 29999999.2.
TEST(Roles, TheLastStepOfARangeIsInside) {
  RoleBinding binding = bound(Role::kSecondaryPressure, kId, signal_def(32, 0.1));
  binding.message_length = 4;
  binding.minimum = 0.0;
  binding.maximum = 29999999.2;
  Bench bench({binding});
  bench.tell(kId, 299'999'992, MonoTime::of_ns(1), 4);
  EXPECT_TRUE(bench.has(Role::kSecondaryPressure));
  bench.tell(kId, 299'999'993, MonoTime::of_ns(2), 4);
  EXPECT_TRUE(bench.faults.has(Fault::kInputRange));
  EXPECT_EQ(bench.monitor.history(Role::kSecondaryPressure).newest(), MonoTime::of_ns(1));
}

TEST(Roles, AValueThatIsTooLargeForItsUnit) {
  can::SignalDef signal = signal_def(64);
  signal.type = can::ValueType::kFloat64;
  RoleBinding binding = bound(Role::kSecondaryPressure, kId, signal);
  binding.message_length = 8;
  binding.factor = 1e5;
  Bench bench({binding});
  bench.tell(kId, std::bit_cast<std::uint64_t>(1e304), MonoTime::of_ns(1), 8);
  EXPECT_FALSE(bench.has(Role::kSecondaryPressure));
  EXPECT_TRUE(bench.faults.has(Fault::kInputNotFinite));
}

// --- which message ---

TEST(Roles, TheFirstAndTheLastStandardIdentifier) {
  Bench bench({bound(Role::kEngineSpeed, {0, false}), bound(Role::kVehicleSpeed, {0x7FF, false})});
  EXPECT_EQ(bench.tell({0, false}, 7, MonoTime::of_ns(1)), FrameUse::kTaken);
  EXPECT_EQ(bench.value(Role::kEngineSpeed), 7.0);
  EXPECT_EQ(bench.tell({0x7FF, false}, 8, MonoTime::of_ns(2)), FrameUse::kTaken);
  EXPECT_EQ(bench.value(Role::kVehicleSpeed), 8.0);
  EXPECT_EQ(bench.tell({0x800, false}, 9, MonoTime::of_ns(3)),
            FrameUse::kForeign);  // 11 bits end before
  EXPECT_EQ(bench.tell({0, true}, 9, MonoTime::of_ns(3)), FrameUse::kForeign);
}

TEST(Roles, TheSameIdentifierOnTwoBuses) {
  RoleBinding other = bound(Role::kVehicleSpeed, kId);
  other.bus = 1;
  Bench bench({bound(Role::kEngineSpeed, kId), other});
  EXPECT_EQ(bench.tell(kId, 7, MonoTime::of_ns(1), 2, 0), FrameUse::kTaken);
  EXPECT_EQ(bench.value(Role::kEngineSpeed), 7.0);
  EXPECT_FALSE(bench.has(Role::kVehicleSpeed));
  EXPECT_EQ(bench.tell(kId, 8, MonoTime::of_ns(2), 2, 1), FrameUse::kTaken);
  EXPECT_EQ(bench.value(Role::kEngineSpeed), 7.0);
  EXPECT_EQ(bench.value(Role::kVehicleSpeed), 8.0);
  EXPECT_EQ(bench.tell(kId, 9, MonoTime::of_ns(3), 2, 2),
            FrameUse::kForeign);  // a bus that is not there
  // Each bus has its own time.
  EXPECT_EQ(bench.tell(kId, 9, MonoTime::of_ns(1), 2, 0), FrameUse::kTaken);
  EXPECT_FALSE(bench.faults.has(Fault::kTimeStamp));
}

TEST(Roles, TwoStampsMayBeTheSame) {
  Bench bench({bound(Role::kEngineSpeed, kId)});
  bench.tell(kId, 7, MonoTime::of_ns(5));
  bench.tell(kId, 8, MonoTime::of_ns(5));
  EXPECT_EQ(bench.faults.bits(), 0U);
}

// Identifiers that fall onto the same place of the table, its last among them.
TEST(Roles, ExtendedIdentifiersThatFallTogether) {
  const std::array<std::uint32_t, 8> ids{0x18FF0089, 0x18FF0098, 0x18FF00A7, 0x18FF00B6,
                                         0x18FF0065, 0x18FF0074, 0x18FF0083, 0x18FF0092};
  std::vector<RoleBinding> roles;
  for (std::size_t i = 0; i < ids.size(); ++i) {
    roles.push_back(bound(static_cast<Role>(i), {ids[i], true}));
  }
  Bench bench(roles);
  for (std::size_t i = 0; i < ids.size(); ++i) {
    EXPECT_EQ(bench.tell({ids[i], true}, 100 + i, MonoTime::of_ns(1)), FrameUse::kTaken);
    EXPECT_EQ(bench.value(static_cast<Role>(i)), 100.0 + static_cast<double>(i));
  }
  EXPECT_EQ(bench.tell({0x18FF00C5, true}, 1, MonoTime::of_ns(2)), FrameUse::kForeign);
  EXPECT_EQ(bench.tell({0x18FF00A1, true}, 1, MonoTime::of_ns(2)), FrameUse::kForeign);
}

// --- J1939: which of several sources ---

RoleBinding by_group(Role role, std::uint32_t dbc_source) {
  RoleBinding binding = bound(role, {0x0CF00400 | dbc_source, true});
  binding.sources.set();
  return binding;
}
constexpr can::CanId from(std::uint32_t source) { return {0x0CF00400 | source, true}; }

TEST(Sources, ThatOfTheDbcComesFirstUnlessItIsTheNullAddress) {
  struct Case {
    std::uint32_t dbc_source;
    bool comes_first;
  };
  for (const Case& c : {Case{0x00, true}, Case{0xC8, true}, Case{0xFD, true}, Case{0xFE, false},
                        Case{0xFF, false}}) {
    Bench bench({by_group(Role::kVehicleSpeed, c.dbc_source)});
    bench.tell(from(0x31), 10, MonoTime{1 * kMillisecond});
    bench.tell(from(c.dbc_source), 20, MonoTime{2 * kMillisecond});
    EXPECT_EQ(bench.value(Role::kVehicleSpeed), c.comes_first ? 20.0 : 10.0) << c.dbc_source;
  }
}

TEST(Sources, AShortFrameOfTheFollowedOneIsBad) {
  Bench bench({by_group(Role::kVehicleSpeed, 0xFE)});
  bench.tell(from(0x31), 10, MonoTime::of_ns(1));
  EXPECT_EQ(bench.tell(from(0x31), 10, MonoTime::of_ns(2), 1), FrameUse::kBad);
  EXPECT_TRUE(bench.faults.has(Fault::kInputFrame));
}

// The course of its values, what is no spike, and its period: of the new source alone.
TEST(Sources, NothingOfTheFormerOneStays) {
  Bench bench({by_group(Role::kPrimarySpeed, 0x00)});
  MonoTime t{kSecond};
  for (int i = 0; i < 100; ++i) bench.tell(from(0x31), 1000, t += 10 * kMillisecond);
  bench.tell(from(0x00), 3000, t += 10 * kMillisecond);
  EXPECT_EQ(bench.value(Role::kPrimarySpeed), 3000.0);

  Bench same({by_group(Role::kPrimarySpeed, 0x00)});
  for (int i = 0; i < 10; ++i) same.tell(from(0x31), 1000, t += 10 * kMillisecond);
  same.tell(from(0x00), 1000, t += 10 * kMillisecond);
  EXPECT_EQ(same.monitor.course(Role::kPrimarySpeed).since(), t);

  RoleBinding learning = by_group(Role::kPrimarySpeed, 0x00);
  learning.period_ms.reset();
  Bench learns({learning});
  for (int i = 0; i < 5; ++i) learns.tell(from(0x31), 1000, t += 10 * kMillisecond);
  for (int i = 0; i < 9; ++i) {
    EXPECT_FALSE(learns.monitor.period(Role::kPrimarySpeed)) << i;
    learns.tell(from(0x00), 1000, t += 20 * kMillisecond);
  }
  EXPECT_EQ(learns.monitor.period(Role::kPrimarySpeed), 20 * kMillisecond);
}

// --- how often ---

// Five times too often. Pages of a multiplexer and several sources have no rate of their own.
TEST(Rate, IsJudgedWhereItIsKnown) {
  RoleBinding paged = bound(Role::kVehicleSpeed, kId);
  can::SignalDef selector = signal_def(8);
  selector.start_bit = 8;
  paged.mux.push_back({can::SignalCodec(selector), {{0, 255}}});
  struct Case {
    RoleBinding binding;
    can::CanId id;
    bool wrong;
  };
  for (const Case& c : {Case{bound(Role::kVehicleSpeed, kId), kId, true}, Case{paged, kId, false},
                        Case{by_group(Role::kVehicleSpeed, 0xFE), from(0x31), false}}) {
    Bench bench({c.binding});
    MonoTime t{kSecond};
    for (int i = 0; i < 50; ++i) {
      EXPECT_EQ(bench.tell(c.id, 7, t += 2 * kMillisecond), FrameUse::kTaken);
    }
    EXPECT_EQ(bench.faults.has(Fault::kInputRate), c.wrong);
    EXPECT_EQ(bench.monitor.suspect(), c.wrong);
  }
}

class Learning : public testing::Test {
 protected:
  static RoleBinding unknown_period() {
    RoleBinding binding = bound(Role::kPrimarySpeed, kId);
    binding.period_ms.reset();
    return binding;
  }
  void tell(std::vector<int> intervals_ms) {
    for (const int each : intervals_ms) {
      EXPECT_FALSE(bench_->monitor.period(Role::kPrimarySpeed));
      bench_->tell(kId, 1000, t_ += each * kMillisecond);
      bench_->monitor.update(t_, bench_->faults);
    }
  }
  std::optional<Duration> period() const { return bench_->monitor.period(Role::kPrimarySpeed); }
  std::unique_ptr<Bench> bench_ = std::make_unique<Bench>(std::vector{unknown_period()});
  MonoTime t_{kSecond};
};

// Nine values have eight intervals between them; two stamps that are the same have none.
TEST_F(Learning, TheMiddleOfEightIntervals) {
  tell({0, 40, 0, 44, 39, 200, 41, 0, 1, 43, 42});
  EXPECT_EQ(period(), 42 * kMillisecond);
  for (int i = 0; i < 20; ++i) bench_->tell(kId, 1000, t_ += 10 * kMillisecond);
  EXPECT_EQ(period(), 42 * kMillisecond);  // once for all
}

TEST_F(Learning, OfPagesTheLongestButOne) {
  RoleBinding paged = unknown_period();
  can::SignalDef selector = signal_def(8);
  selector.start_bit = 8;
  paged.mux.push_back({can::SignalCodec(selector), {{0, 255}}});
  bench_ = std::make_unique<Bench>(std::vector{paged});
  tell({0, 10, 70, 20, 80, 30, 60, 40, 50});
  EXPECT_EQ(period(), 70 * kMillisecond);
}

TEST_F(Learning, IsStaleAfterASecondAndBeginsAnew) {
  tell({0, 40, 40, 40, 40, 40});
  const auto verdict_after = [&](Duration silence) {
    bench_->monitor.update(t_ + silence, bench_->faults);
    return bench_->monitor.verdict(Role::kPrimarySpeed);
  };
  EXPECT_EQ(verdict_after(kSecond), ReadingVerdict::kLearning);
  EXPECT_EQ(verdict_after(kSecond + kNanosecond), ReadingVerdict::kStale);
  t_ += 2 * kSecond;
  tell({0, 20, 20, 20, 20, 20, 20});  // with the silence seven intervals
  EXPECT_FALSE(period());
  tell({20});
  EXPECT_EQ(period(), 20 * kMillisecond);
}

// --- diagnostic answers ---

constexpr can::CanId kRequest{0x7E1, false}, kResponse{0x7E9, false};

RoleBinding asked(Role role, std::uint32_t start_bit) {
  can::SignalDef signal = signal_def(8);
  signal.start_bit = start_bit;
  RoleBinding binding = bound(role, {0, false}, signal);
  binding.uds = UdsSource{.request = kRequest, .response = kResponse, .identifier = 0x1101};
  return binding;
}

// One answer for two roles: each takes its byte of the data after the identifier.
TEST(Diagnostic, AnAnswerIsTakenForEachRoleThatItHolds) {
  const std::vector<RoleBinding> roles{asked(Role::kOilTemperature, 0),
                                       asked(Role::kVehicleSpeed, 8)};
  Bench bench(roles);
  EXPECT_EQ(bench.tell({0, false}, 7, MonoTime::of_ns(1)),
            FrameUse::kForeign);  // it has no message
  EXPECT_EQ(bench.tell(kResponse, 0x17'2A'01'11'62'05, MonoTime::of_ns(1), 8), FrameUse::kTaken);
  EXPECT_EQ(bench.value(Role::kOilTemperature), 42.0);
  EXPECT_EQ(bench.value(Role::kVehicleSpeed), 23.0);
  EXPECT_EQ(bench.faults.bits(), 0U);
  EXPECT_EQ(bench.tell({0x123, false}, 7, MonoTime::of_ns(1)), FrameUse::kForeign);

  Bench shorter(roles);
  EXPECT_EQ(shorter.tell(kResponse, 0x2A'01'11'62'04, MonoTime::of_ns(1), 8), FrameUse::kBad);
  EXPECT_EQ(shorter.value(Role::kOilTemperature), 42.0);
  EXPECT_FALSE(shorter.has(Role::kVehicleSpeed));
  EXPECT_TRUE(shorter.faults.has(Fault::kInputFrame));
}

// --- what is asked of a role ---

TEST(Roles, TheNewestValueOrAnother) {
  Bench bench({bound(Role::kOilTemperature, kId)});
  const auto ask = [&](Role role) {
    bool fresh = true;
    const double value = bench.monitor.value_or(role, -1.0, fresh);
    return std::pair{value, fresh};
  };
  EXPECT_EQ(ask(Role::kVehicleSpeed), std::pair(-1.0, true));     // no such role: nothing is lost
  EXPECT_EQ(ask(Role::kOilTemperature), std::pair(-1.0, false));  // none has come
  bench.tell(kId, 80, MonoTime{kSecond});
  bench.monitor.update(MonoTime{kSecond}, bench.faults);
  EXPECT_EQ(ask(Role::kOilTemperature), std::pair(80.0, true));
  EXPECT_EQ(bench.monitor.value_if_known(Role::kOilTemperature), 80.0);
  EXPECT_EQ(bench.monitor.value_if_known(Role::kVehicleSpeed), 0.0);
  bool fresh = false;  // what is not fresh does not become so
  bench.monitor.value_or(Role::kOilTemperature, 0.0, fresh);
  EXPECT_FALSE(fresh);
  bench.monitor.update(MonoTime{2 * kSecond}, bench.faults);
  EXPECT_EQ(ask(Role::kOilTemperature), std::pair(80.0, false));  // the last, and old
  EXPECT_EQ(bench.monitor.value_if_known(Role::kOilTemperature), 0.0);
}

}  // namespace
}  // namespace beltgrip::daemon
