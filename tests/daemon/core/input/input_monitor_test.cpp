// What is taken from a frame and what is not: every kind and length, every raw value, multiplexing,
// not-a-number, staleness, learned periods, frozen speeds, stamps that run backwards.
#include "daemon/core/input/input_monitor.h"

#include <gtest/gtest.h>

#include <bit>
#include <cmath>
#include <deque>
#include <limits>

#include "tests/daemon/test_vehicle.h"

namespace beltgrip::daemon {

using estimator::ReadingVerdict;
namespace {

RxFrame at(MonoTime t, const can::CanFrame& frame) { return {.t = t, .frame = frame}; }

// A configuration of one message (id 0x100, 8 bytes unless said) with one signal for a role.
Config one_signal(Role role, const can::SignalDef& signal, std::uint32_t length = 8,
                  std::optional<double> period_ms = 10.0) {
  Config config;
  config.trigger = Trigger::kAlways;
  RoleBinding binding;
  binding.role = role;
  binding.id = {0x100, false};
  binding.message_length = length;
  binding.codec = can::SignalCodec(signal);
  binding.minimum = signal.usage->minimum;
  binding.maximum = signal.usage->maximum;
  binding.period_ms = period_ms;
  config.roles.push_back(binding);
  return config;
}

can::SignalDef signal_def(std::uint32_t length, can::ValueType type, double scale = 1.0,
                          double offset = 0.0, double minimum = 0.0, double maximum = 0.0) {
  can::SignalDef signal;
  signal.length = length;
  signal.type = type;
  signal.scale = scale;
  signal.offset = offset;
  static std::deque<can::SignalUsage> usages;  // as long as the signals
  signal.usage = &usages.emplace_back(can::SignalUsage{minimum, maximum, {}});
  return signal;
}

can::CanFrame raw_frame(std::uint64_t raw, std::uint8_t length = 8) {
  can::CanFrame frame;
  frame.id = {0x100, false};
  frame.length = length;
  for (std::size_t i = 0; i < 8; ++i) frame.data[i] = static_cast<std::uint8_t>(raw >> 8 * i);
  return frame;
}

struct Bench {
  explicit Bench(const Config& config) : monitor(config) {}
  InputMonitor monitor;
  FaultSet faults;
};

TEST(InputMonitor, EveryIdentifierLengthAndKind) {
  const Config config = test::vehicle_config();
  enum Kind { kStandard, kExtended, kRemote, kError, kFd };
  for (std::uint32_t id = 0; id <= can::kStandardIdMax; ++id) {
    for (std::uint8_t length = 0; length <= 8; ++length) {
      for (const Kind kind : {kStandard, kExtended, kRemote, kError, kFd}) {
        static Bench bench(config);
        can::CanFrame frame;
        frame.id = {id, kind == kExtended};
        frame.length = length;
        frame.remote = kind == kRemote;
        frame.error = kind == kError;
        frame.fd = kind == kFd;
        const bool named =
            (id == 0x100 || id == 0x101 || id == 0x103) && kind != kExtended && kind != kError;
        const std::uint8_t right = id == 0x100 ? 8 : id == 0x101 ? 4 : 2;
        const FrameUse expected = !named                                 ? FrameUse::kForeign
                                  : kind == kStandard && length == right ? FrameUse::kTaken
                                                                         : FrameUse::kBad;
        ASSERT_EQ(bench.monitor.on_frame(at(MonoTime::of_ns(1), frame), bench.faults), expected)
            << id << " " << int{length} << " " << kind;
      }
    }
  }
}

// Of a role's message, so that a value that never came has a cause.
TEST(InputMonitor, WhatFramesCame) {
  const Config config = one_signal(Role::kOilTemperature, signal_def(8, can::ValueType::kUnsigned));
  Bench bench(config);
  const auto came = [&bench](std::optional<can::CanFrame> frame) {
    if (frame) bench.monitor.on_frame(at(MonoTime::of_ns(1), *frame), bench.faults);
    return bench.monitor.frames_came(Role::kOilTemperature);
  };
  EXPECT_EQ(came({}), FramesCame::kNone);
  can::CanFrame other = raw_frame(1);
  other.id.value = 0x101;
  EXPECT_EQ(came(other), FramesCame::kNone);
  EXPECT_EQ(came(raw_frame(1, 7)), FramesCame::kOfOtherKind);
  EXPECT_EQ(came(raw_frame(1)), FramesCame::kTaken);
  EXPECT_EQ(came(raw_frame(1, 7)), FramesCame::kTaken);
  EXPECT_EQ(bench.monitor.frames_came(Role::kEngineSpeed), FramesCame::kNone);

  Config guarded = config;
  guarded.protections.push_back(
      {.id = {0x100, false}, .counter = {}, .crc = CrcProtection{.byte = 0, .data_id = 0x100}});
  Bench refusing(guarded);
  for (int i = 0; i < 9; ++i) {
    refusing.monitor.on_frame(at(MonoTime::of_ns(10'000'000 * i), raw_frame(0xAA)),
                              refusing.faults);
  }
  EXPECT_EQ(refusing.monitor.frames_came(Role::kOilTemperature), FramesCame::kRefused);
}

TEST(InputMonitor, ExtendedIdentifiersAreFoundAmongMany) {
  Config config;
  config.trigger = Trigger::kAlways;
  for (std::uint32_t i = 0; i < kRoleCount; ++i) {
    RoleBinding binding;
    binding.role = static_cast<Role>(i);
    binding.id = {0x18FF0000 + (i << 16 & 0x70000) + i * 64, true};
    binding.message_length = 8;
    binding.codec = can::SignalCodec(signal_def(8, can::ValueType::kUnsigned));
    config.roles.push_back(binding);
  }
  Bench bench(config);
  for (const RoleBinding& binding : config.roles) {
    can::CanFrame frame = raw_frame(1);
    frame.id = binding.id;
    EXPECT_EQ(bench.monitor.on_frame(at(MonoTime::of_ns(1), frame), bench.faults),
              FrameUse::kTaken);
    frame.id.value ^= 0x1000000;
    EXPECT_EQ(bench.monitor.on_frame(at(MonoTime::of_ns(1), frame), bench.faults),
              FrameUse::kForeign);
  }
}

// J1939's electronic engine controller 1 (group 0xF004): one signal, known from this source.
Config one_group_signal(std::uint32_t dbc_source) {
  Config config = one_signal(Role::kEngineSpeed,
                             signal_def(8, can::ValueType::kUnsigned, 1.0, 0.0, 0.0, 250.0));
  config.roles[0].id = {0x0CF00400 | dbc_source, true};
  config.roles[0].sources.set();
  return config;
}

struct GroupBench : Bench {
  using Bench::Bench;
  FrameUse from(std::uint32_t source, std::uint64_t raw, MonoTime t,
                std::uint32_t id = 0x18F00400) {
    can::CanFrame frame = raw_frame(raw);
    frame.id = {id | source, true};
    return monitor.on_frame(at(t, frame), faults);
  }
  double value() const { return monitor.history(Role::kEngineSpeed).newest_value(); }
  bool has_value() const { return !monitor.history(Role::kEngineSpeed).empty(); }
};

TEST(InputMonitor, J1939FramesAreTakenByParameterGroup) {
  GroupBench bench(one_group_signal(0xFE));
  EXPECT_EQ(bench.from(0x00, 7, MonoTime::of_ns(1), 0x0CF00300),
            FrameUse::kForeign);  // another group
  EXPECT_EQ(bench.from(0x00, 7, MonoTime::of_ns(1), 0x0DF00400),
            FrameUse::kForeign);  // another data page
  EXPECT_FALSE(bench.has_value());
  EXPECT_EQ(bench.from(0x31, 7, MonoTime::of_ns(2), 0x0CF00400), FrameUse::kTaken);
  EXPECT_EQ(bench.value(), 7.0);
  EXPECT_EQ(bench.from(0x31, 8, MonoTime::of_ns(3), 0x18F00400),
            FrameUse::kTaken);  // another priority
  EXPECT_EQ(bench.value(), 8.0);
}

TEST(InputMonitor, J1939DestinationsDoNotCount) {
  Config config = one_group_signal(0x03);
  config.roles[0].id = {0x0C000003, true};  // TSC1, to address 0x00
  GroupBench bench(config);
  EXPECT_EQ(bench.from(0x03, 5, MonoTime::of_ns(1), 0x0C00FF00), FrameUse::kTaken);
  EXPECT_EQ(bench.from(0x03, 5, MonoTime::of_ns(2), 0x0C01FF00), FrameUse::kForeign);
}

TEST(InputMonitor, J1939FollowsTheFirstSourceThatGivesAValueUntilItIsStale) {
  GroupBench bench(one_group_signal(0xFE));
  bench.from(0x0F, 0xFF, MonoTime{});  // not available
  EXPECT_FALSE(bench.has_value());
  bench.from(0x31, 10, MonoTime{1 * kMillisecond});
  bench.from(0x0F, 20, MonoTime{2 * kMillisecond});
  EXPECT_EQ(bench.value(), 10.0);
  bench.monitor.update(MonoTime{100 * kMillisecond}, bench.faults);
  ASSERT_EQ(bench.monitor.verdict(Role::kEngineSpeed), ReadingVerdict::kStale);
  bench.from(0x0F, 0xFF, MonoTime{101 * kMillisecond});  // not available: nothing to follow
  EXPECT_EQ(bench.value(), 10.0);
  bench.from(0x0F, 21, MonoTime{102 * kMillisecond});
  EXPECT_EQ(bench.value(), 21.0);
  bench.from(0x31, 11, MonoTime{103 * kMillisecond});  // back again: too late
  EXPECT_EQ(bench.value(), 21.0);
  double before = 0.0;  // nothing of the former source is left
  EXPECT_FALSE(bench.monitor.history(Role::kEngineSpeed)
                   .value_at(MonoTime{50 * kMillisecond}, kMillisecond, before));
}

TEST(InputMonitor, J1939SourceOfTheDbcComesBeforeOthers) {
  GroupBench bench(one_group_signal(0x00));
  bench.from(0x31, 10, MonoTime{1 * kMillisecond});
  EXPECT_EQ(bench.value(), 10.0);  // any source will do while it is the only one
  bench.from(0x00, 20, MonoTime{2 * kMillisecond});
  bench.from(0x31, 11, MonoTime{3 * kMillisecond});
  EXPECT_EQ(bench.value(), 20.0);
}

TEST(InputMonitor, J1939SourceThatIsNotFollowedCausesNoFaults) {
  GroupBench bench(one_group_signal(0xFE));
  bench.from(0x31, 10, MonoTime{1 * kMillisecond});
  bench.from(0x0F, 0xFF, MonoTime{2 * kMillisecond});
  can::CanFrame shorter = raw_frame(1, 4);
  shorter.id = {0x18F0040F, true};
  EXPECT_EQ(bench.monitor.on_frame(at(MonoTime{3 * kMillisecond}, shorter), bench.faults),
            FrameUse::kForeign);
  EXPECT_EQ(bench.faults.bits(), 0U);
  bench.from(0x31, 0xFF, MonoTime{4 * kMillisecond});
  EXPECT_TRUE(bench.faults.has(Fault::kInputRange));
}

TEST(InputMonitor, J1939SourcesOfAnotherMessageAreNotThisOnes) {
  Config config = one_group_signal(0x00);
  config.roles[0].sources.reset(0x31);
  config.roles.push_back(config.roles[0]);
  config.roles[1].role = Role::kVehicleSpeed;
  config.roles[1].id = {0x0CF00431, true};
  config.roles[1].sources.reset();
  config.roles[1].sources.set(0x31);
  GroupBench bench(config);
  bench.from(0x31, 10, MonoTime::of_ns(1));
  EXPECT_FALSE(bench.has_value());
  EXPECT_EQ(bench.monitor.history(Role::kVehicleSpeed).newest_value(), 10.0);
  bench.from(0x05, 20, MonoTime::of_ns(2));
  EXPECT_EQ(bench.value(), 20.0);
  EXPECT_EQ(bench.monitor.history(Role::kVehicleSpeed).newest_value(), 10.0);
}

TEST(InputMonitor, FdLengthsAreThoseOfTheWire) {
  for (std::uint32_t length = 1; length <= 64; ++length) {
    Config config =
        one_signal(Role::kPrimarySpeed, signal_def(8, can::ValueType::kUnsigned), length);
    config.roles[0].message_fd = true;
    std::uint8_t wire = 64;
    for (const int each : {48, 32, 24, 20, 16, 12, 8, 7, 6, 5, 4, 3, 2, 1}) {
      if (each >= static_cast<int>(length)) wire = static_cast<std::uint8_t>(each);
    }
    for (std::uint8_t sent = 0; sent <= 64; ++sent) {
      Bench bench(config);
      can::CanFrame frame = raw_frame(1, sent);
      frame.fd = true;
      EXPECT_EQ(bench.monitor.on_frame(at(MonoTime::of_ns(1), frame), bench.faults),
                sent == wire ? FrameUse::kTaken : FrameUse::kBad)
          << length << " " << int{sent};
    }
  }
}

// Every raw value of a 16-bit signal with a range, at once: inside it is taken, outside not.
TEST(InputMonitor, EveryRawValueAgainstTheRange) {
  for (const auto& [scale, offset] : {std::pair{0.125, 0.0}, std::pair{0.1, -40.0}}) {
    const double minimum = 10 * scale + offset, maximum = 64000 * scale + offset;
    Bench bench(one_signal(Role::kSecondaryPressure, signal_def(16, can::ValueType::kUnsigned,
                                                                scale, offset, minimum, maximum)));
    for (std::uint32_t raw = 0; raw <= 0xFFFF; ++raw) {
      const MonoTime t{raw * kMillisecond};
      bench.faults = {};
      bench.monitor.on_frame(at(t, raw_frame(raw)), bench.faults);
      const bool inside = raw >= 10 && raw <= 64000;
      const SignalHistory& history = bench.monitor.history(Role::kSecondaryPressure);
      ASSERT_EQ(!history.empty() && history.newest() == t, inside) << raw;
      ASSERT_EQ(bench.faults.has(Fault::kInputRange), !inside) << raw;
      if (inside) {
        ASSERT_EQ(history.newest_value(), static_cast<double>(raw) * scale + offset);
      }
    }
  }
}

TEST(InputMonitor, AllOnesWithoutARangeIsNotAvailable) {
  for (const std::uint32_t length : {2U, 8U, 12U, 16U, 32U, 63U}) {
    const std::uint64_t ones = (std::uint64_t{1} << length) - 1;
    Bench bench(
        one_signal(Role::kSecondaryPressure, signal_def(length, can::ValueType::kUnsigned)));
    bench.monitor.on_frame(at(MonoTime::of_ns(1), raw_frame(ones)), bench.faults);
    EXPECT_TRUE(bench.faults.has(Fault::kInputRange)) << length;
    EXPECT_TRUE(bench.monitor.history(Role::kSecondaryPressure).empty());
    bench.monitor.on_frame(at(MonoTime::of_ns(2), raw_frame(ones - 1)), bench.faults);
    EXPECT_FALSE(bench.monitor.history(Role::kSecondaryPressure).empty());
    // In a range that includes it, it is a value; in a signed signal it is -1.
    Bench ranged(one_signal(
        Role::kSecondaryPressure,
        signal_def(length, can::ValueType::kUnsigned, 1.0, 0.0, 0.0, static_cast<double>(ones))));
    ranged.monitor.on_frame(at(MonoTime::of_ns(1), raw_frame(ones)), ranged.faults);
    EXPECT_FALSE(ranged.monitor.history(Role::kSecondaryPressure).empty()) << length;
    Bench negative(
        one_signal(Role::kSecondaryPressure, signal_def(length, can::ValueType::kSigned)));
    negative.monitor.on_frame(at(MonoTime::of_ns(1), raw_frame(ones)), negative.faults);
    ASSERT_FALSE(negative.monitor.history(Role::kSecondaryPressure).empty()) << length;
    EXPECT_EQ(negative.monitor.history(Role::kSecondaryPressure).newest_value(), -1.0);
  }
}

TEST(InputMonitor, FloatsThatAreNoNumbers) {
  Bench bench(one_signal(Role::kPrimarySpeed, signal_def(64, can::ValueType::kFloat64)));
  MonoTime t{};
  for (const double value :
       {1.5, std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity(),
        -std::numeric_limits<double>::infinity(), -0.0,
        std::numeric_limits<double>::denorm_min()}) {
    bench.faults = {};
    bench.monitor.on_frame(at(t += kNanosecond, raw_frame(std::bit_cast<std::uint64_t>(value))),
                           bench.faults);
    EXPECT_EQ(bench.faults.has(Fault::kInputNotFinite), !std::isfinite(value)) << value;
    const SignalHistory& history = bench.monitor.history(Role::kPrimarySpeed);
    EXPECT_EQ(history.newest() == t, std::isfinite(value)) << value;
  }
}

TEST(InputMonitor, FlagsAreZeroOrOne) {
  for (std::uint64_t raw = 0; raw < 4; ++raw) {
    Bench bench(one_signal(Role::kExperimentActive,
                           signal_def(2, can::ValueType::kUnsigned, 1.0, 0.0, 0.0, 3.0)));
    bench.monitor.on_frame(at(MonoTime::of_ns(1), raw_frame(raw)), bench.faults);
    EXPECT_EQ(bench.monitor.history(Role::kExperimentActive).empty(), raw > 1) << raw;
    EXPECT_EQ(bench.faults.has(Fault::kInputRange), raw > 1) << raw;
  }
}

TEST(InputMonitor, MultiplexedSignalsAreTakenWhereTheyAreSelected) {
  Config config = one_signal(Role::kPrimarySpeed, signal_def(16, can::ValueType::kUnsigned));
  can::SignalDef selector = signal_def(8, can::ValueType::kUnsigned);
  selector.start_bit = 32;
  can::SignalDef outer = signal_def(4, can::ValueType::kUnsigned);
  outer.start_bit = 40;
  config.roles[0].mux.push_back({can::SignalCodec(selector), {{3, 5}, {9, 9}}});
  config.roles[0].mux.push_back({can::SignalCodec(outer), {{1, 1}}});
  for (std::uint64_t inner = 0; inner < 256; ++inner) {
    for (std::uint64_t page = 0; page < 16; ++page) {
      Bench bench(config);
      const auto frame = raw_frame(1000 | inner << 32 | page << 40);
      EXPECT_EQ(bench.monitor.on_frame(at(MonoTime::of_ns(1), frame), bench.faults),
                FrameUse::kTaken);
      const bool selected = page == 1 && ((inner >= 3 && inner <= 5) || inner == 9);
      ASSERT_EQ(!bench.monitor.history(Role::kPrimarySpeed).empty(), selected);
      EXPECT_EQ(bench.faults.bits(), 0U);
    }
  }
}

TEST(InputMonitor, StaleAfterFiftyMillisecondsOrTwoAndAHalfPeriods) {
  for (const auto& [period_ms, limit_ms] :
       {std::pair{1.0, 50.0}, std::pair{10.0, 50.0}, std::pair{20.0, 50.0}, std::pair{40.0, 100.0},
        std::pair{1000.0, 2500.0}}) {
    Bench bench(
        one_signal(Role::kPrimarySpeed, signal_def(16, can::ValueType::kUnsigned), 8, period_ms));
    bench.monitor.update(MonoTime{}, bench.faults);
    EXPECT_EQ(bench.monitor.verdict(Role::kPrimarySpeed), ReadingVerdict::kMissing);
    EXPECT_EQ(bench.monitor.verdict(Role::kSecondarySpeed), ReadingVerdict::kUnbound);
    bench.monitor.on_frame(at(MonoTime::of_ns(100), raw_frame(5)), bench.faults);
    const auto limit = Duration::of_ms(limit_ms);
    bench.monitor.update(MonoTime::of_ns(100) + limit, bench.faults);
    EXPECT_EQ(bench.monitor.verdict(Role::kPrimarySpeed), ReadingVerdict::kValid) << period_ms;
    EXPECT_FALSE(bench.faults.has(Fault::kInputStale));
    bench.monitor.update(MonoTime::of_ns(101) + limit, bench.faults);
    EXPECT_EQ(bench.monitor.verdict(Role::kPrimarySpeed), ReadingVerdict::kStale) << period_ms;
    EXPECT_TRUE(bench.faults.has(Fault::kInputStale));
    EXPECT_TRUE(bench.monitor.any_lost());
    bench.monitor.on_frame(at(MonoTime::of_ns(102) + limit, raw_frame(5)), bench.faults);
    bench.monitor.update(MonoTime::of_ns(102) + limit, bench.faults);
    EXPECT_EQ(bench.monitor.verdict(Role::kPrimarySpeed), ReadingVerdict::kValid);
  }
}

TEST(InputMonitor, WhatNeverComesIsMissingAfterTenPeriods) {
  Bench bench(one_signal(Role::kPrimarySpeed, signal_def(16, can::ValueType::kUnsigned)));
  const MonoTime start{5 * kSecond};
  bench.monitor.update(start, bench.faults);
  bench.monitor.update(start + 100 * kMillisecond - kNanosecond, bench.faults);
  EXPECT_FALSE(bench.faults.has(Fault::kInputMissing));
  bench.monitor.update(start + 100 * kMillisecond, bench.faults);
  EXPECT_TRUE(bench.faults.has(Fault::kInputMissing));
  EXPECT_FALSE(bench.monitor.any_lost());  // what was never there cannot be lost
}

TEST(InputMonitor, ThePeriodIsLearnedFromTheMiddleOfEightIntervals) {
  Bench bench(one_signal(Role::kPrimarySpeed, signal_def(16, can::ValueType::kUnsigned), 8, {}));
  MonoTime t{};
  int frames = 0;
  for (const int interval : {0, 40, 44, 39, 200, 41, 1, 40, 40}) {
    EXPECT_FALSE(bench.monitor.period(Role::kPrimarySpeed).has_value()) << frames;
    t += interval * kMillisecond;
    bench.monitor.on_frame(at(t, raw_frame(static_cast<std::uint64_t>(++frames))), bench.faults);
    bench.monitor.update(t, bench.faults);
    if (frames < 9) {
      EXPECT_EQ(bench.monitor.verdict(Role::kPrimarySpeed), ReadingVerdict::kLearning);
    }
  }
  EXPECT_EQ(bench.monitor.period(Role::kPrimarySpeed), 40 * kMillisecond);
  EXPECT_EQ(bench.monitor.verdict(Role::kPrimarySpeed), ReadingVerdict::kValid);
  bench.monitor.update(t + 100 * kMillisecond, bench.faults);
  EXPECT_EQ(bench.monitor.verdict(Role::kPrimarySpeed), ReadingVerdict::kValid);
  bench.monitor.update(t + 101 * kMillisecond, bench.faults);
  EXPECT_EQ(bench.monitor.verdict(Role::kPrimarySpeed), ReadingVerdict::kStale);
}

TEST(InputMonitor, StampsThatRunBackwardsAreCountedAndHeldBack) {
  Bench bench(one_signal(Role::kPrimarySpeed, signal_def(16, can::ValueType::kUnsigned)));
  bench.monitor.on_frame(at(MonoTime{10 * kSecond}, raw_frame(1)), bench.faults);
  EXPECT_FALSE(bench.faults.has(Fault::kTimeStamp));
  for (const Duration back : {1 * kMillisecond, 10 * kSecond}) {
    bench.faults = {};
    bench.monitor.on_frame(at(MonoTime{10 * kSecond - back}, raw_frame(2)), bench.faults);
    EXPECT_TRUE(bench.faults.has(Fault::kTimeStamp));
    EXPECT_EQ(bench.monitor.history(Role::kPrimarySpeed).newest(), MonoTime{10 * kSecond});
    EXPECT_EQ(bench.monitor.history(Role::kPrimarySpeed).newest_value(), 2.0);
  }
  // Later than the one that ran back, and still not in turn.
  bench.faults = {};
  bench.monitor.on_frame(at(MonoTime{10 * kSecond - kMillisecond}, raw_frame(3)), bench.faults);
  EXPECT_TRUE(bench.faults.has(Fault::kTimeStamp));
}

// --- frozen speeds ---

struct Speeds {
  Speeds() : bench(test::vehicle_config()) {}
  // Advances by 10 ms with these speeds.
  void drive(double primary, double secondary) {
    t += 10 * kMillisecond;
    bench.monitor.on_frame(at(t, test::speeds_frame(primary, secondary)), bench.faults);
    bench.monitor.update(t, bench.faults);
  }
  ReadingVerdict primary() const { return bench.monitor.verdict(Role::kPrimarySpeed); }
  ReadingVerdict secondary() const { return bench.monitor.verdict(Role::kSecondarySpeed); }
  Bench bench;
  MonoTime t{};
};

TEST(InputMonitor, ASpeedThatStandsStillWhileTheOtherMovesIsFrozen) {
  Speeds speeds;
  for (int i = 0; i < 100; ++i) speeds.drive(105.0 + 0.1 * (i % 3), 236.0 + 0.2 * (i % 5));
  EXPECT_EQ(speeds.primary(), ReadingVerdict::kValid);
  MonoTime frozen_at{};
  const MonoTime from = speeds.t;
  for (int i = 0; i < 100 && frozen_at == MonoTime{}; ++i) {
    speeds.drive(105.0, 236.0 - 4.0 * i);  // gone down by 15 % after 9 steps
    if (speeds.primary() == ReadingVerdict::kFrozen) frozen_at = speeds.t;
  }
  EXPECT_LE(frozen_at - from, 220 * kMillisecond);
  EXPECT_EQ(speeds.secondary(), ReadingVerdict::kValid);
  EXPECT_TRUE(speeds.bench.monitor.any_lost());
  EXPECT_TRUE(speeds.bench.faults.has(Fault::kInputFrozen));
  speeds.drive(105.5, 100.0);
  EXPECT_EQ(speeds.primary(), ReadingVerdict::kValid);
}

TEST(InputMonitor, AConstantSpeedIsNotFrozenInAnExperiment) {
  Speeds speeds;  // a rig that holds the primary speed, while the belt slips by 12 %
  for (int i = 0; i < 500; ++i) {
    speeds.drive(105.0, 236.0 * (1.0 - 0.12 * i / 500.0));
    ASSERT_EQ(speeds.primary(), ReadingVerdict::kValid) << i;
  }
  Speeds standing;
  for (int i = 0; i < 500; ++i) {
    standing.drive(0.0, 0.0);
    ASSERT_EQ(standing.primary(), ReadingVerdict::kValid) << i;
  }
}

TEST(InputMonitor, AllValidNeedsEveryRequiredRole) {
  const std::array<can::CanFrame, 3> frames{test::speeds_frame(105.0, 236.0),
                                            test::pressure_frame(3e5), test::torque_frame(50.0)};
  for (unsigned word = 0; word < 8; ++word) {
    Bench one(test::vehicle_config());
    for (std::size_t i = 0; i < 3; ++i) {
      if ((word >> i & 1U) != 0)
        one.monitor.on_frame(at(MonoTime::of_ns(1), frames[i]), one.faults);
    }
    one.monitor.update(MonoTime::of_ns(2), one.faults);
    EXPECT_EQ(one.monitor.all_valid(), word == 7) << word;
  }
}

// A speed of 2000 rpm in steps of 0.25, with noise of two steps either way, every 10 ms.
class Spikes : public testing::Test {
 protected:
  static constexpr double kSpeed = 2000.0;
  Spikes()
      : bench_(one_signal(Role::kPrimarySpeed, signal_def(16, can::ValueType::kUnsigned, 0.25))) {}
  double tell(double value) {
    t_ += 10 * kMillisecond;
    const auto raw = static_cast<std::uint64_t>(std::lround(4.0 * value));
    EXPECT_EQ(bench_.monitor.on_frame(at(t_, raw_frame(raw)), bench_.faults), FrameUse::kTaken);
    bench_.monitor.update(t_, bench_.faults);
    return bench_.monitor.history(Role::kPrimarySpeed).newest_value();
  }
  double noise() {
    state_ = state_ * 6364136223846793005U + 1442695040888963407U;
    return static_cast<double>(state_ >> 33U) / 2147483648.0 - 0.5;
  }
  void run_steady(int frames) {
    for (int i = 0; i < frames; ++i) tell(kSpeed + noise());
  }
  Bench bench_;
  MonoTime t_{kSecond};
  std::uint64_t state_ = 1;
};

TEST_F(Spikes, AreLeftOutWhereverTheyGo) {
  run_steady(100);
  for (const double spike : {1.01, 0.99, 1.03, 1.3, 0.5, 0.0}) {
    for (int length = 1; length <= 3; ++length) {
      for (int i = 0; i < length; ++i) {
        ASSERT_NEAR(tell(spike * kSpeed), kSpeed, 1.0) << spike << " " << i;
        ASSERT_EQ(bench_.monitor.verdict(Role::kPrimarySpeed), ReadingVerdict::kValid);
      }
      ASSERT_NEAR(tell(kSpeed), kSpeed, 1.0);
      EXPECT_TRUE(bench_.faults.has(Fault::kInputRange)) << spike;
      run_steady(20);
    }
  }
}

// Of the spike itself, though it is not taken; and since when the role is what it is.
TEST_F(Spikes, TheStatusSaysWhatWasExpected) {
  const auto status = [&] { return bench_.monitor.status(Role::kPrimarySpeed); };
  EXPECT_EQ(status().verdict, ReadingVerdict::kMissing);
  tell(kSpeed);
  const std::int64_t begin_ns = t_.ns();
  EXPECT_EQ(status().value, kSpeed);
  EXPECT_TRUE(std::isnan(status().test_ratio));
  run_steady(100);
  EXPECT_EQ(status().verdict, ReadingVerdict::kValid);
  EXPECT_EQ(status().since_ns, begin_ns);
  EXPECT_LT(status().test_ratio, 1.0);
  // Uniform over 1, rounded to 0.25; a line through five values lies off by as much again.
  EXPECT_NEAR(std::sqrt(status().variance), std::sqrt(2.1 / 12.0), 0.15);
  tell(1.5 * kSpeed);
  EXPECT_EQ(status().value, 1.5 * kSpeed);
  EXPECT_NEAR(status().expected, kSpeed, 2.0);
  EXPECT_GT(status().test_ratio, 100.0);
  t_ += kSecond;
  bench_.monitor.update(t_, bench_.faults);
  EXPECT_EQ(status().verdict, ReadingVerdict::kStale);
  EXPECT_EQ(status().since_ns, t_.ns());
  t_ += kSecond;
  bench_.monitor.update(t_, bench_.faults);
  EXPECT_EQ(status().since_ns, (t_ - kSecond).ns());
}

TEST_F(Spikes, WhatStaysIsFollowed) {
  run_steady(100);
  const double now = 1.05 * kSpeed;
  for (int i = 0; i < 3; ++i) EXPECT_NEAR(tell(now), kSpeed, 1.0) << i;
  EXPECT_EQ(tell(now), now);
  EXPECT_FALSE(bench_.faults.has(Fault::kInputRange));
  for (int i = 0; i < 20; ++i) EXPECT_EQ(tell(now), now) << i;
}

// From steady to 500 rad/s^2, the belt gone: no value of it is missed.
TEST_F(Spikes, ARunAwayIsNone) {
  run_steady(100);
  for (int i = 1; i <= 50; ++i) {
    const double gained = 0.5 * 500.0 * 60.0 / 6.283 * 1e-4 * i * i;
    const double value = std::round(4.0 * (kSpeed + gained + noise())) / 4.0;
    EXPECT_EQ(tell(value), value) << i;
  }
}

TEST_F(Spikes, NoneAreSeenBeforeTheNoiseIsKnown) {
  run_steady(20);
  EXPECT_EQ(tell(1.5 * kSpeed), 1.5 * kSpeed);
}

// Slow signals are not kept waiting: of one every 50 ms a single value is left out.
TEST(InputMonitor, SlowSpikesAreShort) {
  Bench bench(
      one_signal(Role::kSecondaryPressure, signal_def(16, can::ValueType::kUnsigned), 8, 50.0));
  MonoTime t{kSecond};
  const auto tell = [&](std::uint64_t raw) {
    t += 50 * kMillisecond;
    bench.monitor.on_frame(at(t, raw_frame(raw)), bench.faults);
    return bench.monitor.history(Role::kSecondaryPressure).newest_value();
  };
  for (std::uint64_t i = 0; i < 60; ++i) tell(1000 + i % 2);
  EXPECT_LT(tell(2000), 1002.0);
  EXPECT_EQ(tell(2000), 2000.0);
}

}  // namespace
}  // namespace beltgrip::daemon
