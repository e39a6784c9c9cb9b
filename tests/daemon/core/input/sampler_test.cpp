// Alignment in time: channels of different rates, phases and jitter, sampled on one grid, against
// the functions they were taken from.
#include "daemon/core/input/sampler.h"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <random>

#include "tests/daemon/test_vehicle.h"

namespace beltgrip::daemon {
namespace {

using Function = std::function<double(double)>;

struct Channel {
  Role role;
  std::uint32_t id;
  double period_ms;
  double phase_ms;
  Function truth;
  double late_ms = 0.0;   // so long after the instant it tells of a frame is sent
  double delay_ms = 0.0;  // as configured
};

// Signals as doubles, one message each.
Config config_of(const std::vector<Channel>& channels, bool periods_known) {
  Config config;
  config.trigger = Trigger::kAlways;
  can::SignalDef signal;
  signal.length = 64;
  signal.type = can::ValueType::kFloat64;
  for (const Channel& channel : channels) {
    RoleBinding binding;
    binding.role = channel.role;
    binding.id = {channel.id, false};
    binding.message_length = 8;
    binding.codec = can::SignalCodec(signal);
    if (periods_known) binding.period_ms = channel.period_ms;
    binding.delay_ms = channel.delay_ms;
    config.roles.push_back(binding);
  }
  return config;
}

struct Errors {  // largest, over all samples
  double omega_p = 0.0, omega_s = 0.0, pressure = 0.0, torque = 0.0;
  double slip_percent = 0.0;
  double pressure_mean = 0.0;
  double pressure_ahead_s = 0.0;
  std::size_t samples = 0, usable = 0;
  Duration delay{};
};

Errors sample_all(const std::vector<Channel>& channels, bool periods_known = true,
                  double jitter_ms = 0.0, double duration_s = 3.0,
                  const std::function<bool(std::uint32_t, int)>& lost = {}) {
  const Config config = config_of(channels, periods_known);
  InputMonitor inputs(config);
  Sampler sampler(inputs, true);
  FaultSet faults;
  std::mt19937_64 random(3);
  std::uniform_real_distribution<double> uniform;
  struct Arrival {
    MonoTime t;
    std::uint32_t id;
    double value;
  };
  std::vector<Arrival> arrivals;
  for (const Channel& channel : channels) {
    for (int i = 0;; ++i) {
      const double measured_s = (channel.phase_ms + i * channel.period_ms) * 1e-3;
      if (measured_s > duration_s) break;
      if (lost && lost(channel.id, i)) continue;
      const double t_ms = measured_s * 1e3 + jitter_ms * uniform(random);
      const double told_s = measured_s - 1e-3 * channel.late_ms;
      arrivals.push_back(
          {MonoTime::of_ns(std::llround(t_ms * 1e6)), channel.id, channel.truth(told_s)});
    }
  }
  std::stable_sort(arrivals.begin(), arrivals.end(),
                   [](const Arrival& a, const Arrival& b) { return a.t < b.t; });
  const auto truth = [&](Role role, double t) {
    return std::find_if(channels.begin(), channels.end(),
                        [&](const Channel& each) { return each.role == role; })
        ->truth(t);
  };
  Errors errors;
  std::size_t next = 0;
  MonoTime last = MonoTime::min();
  for (MonoTime t{}; t < MonoTime::of_ns(std::llround(duration_s * 1e9)); t += 5 * kMillisecond) {
    for (; next < arrivals.size() && arrivals[next].t <= t; ++next) {
      RxFrame frame{.t = arrivals[next].t, .frame = {}};
      frame.frame.id = {arrivals[next].id, false};
      frame.frame.length = 8;
      const auto bits = std::bit_cast<std::uint64_t>(arrivals[next].value);
      for (std::size_t i = 0; i < 8; ++i) {
        frame.frame.data[i] = static_cast<std::uint8_t>(bits >> 8 * i);
      }
      inputs.on_frame(frame, faults);
    }
    inputs.update(t, faults);
    const estimator::VariatorSample& sample = sampler.sample(t, errors.usable == 0);
    ++errors.samples;
    if (!sample.usable) continue;
    EXPECT_GT(MonoTime::of_ns(sample.t_ns), last);
    if (errors.usable != 0 && !lost) {
      EXPECT_EQ(MonoTime::of_ns(sample.t_ns) - last, 5 * kMillisecond);
    }
    last = MonoTime::of_ns(sample.t_ns);
    ++errors.usable;
    const double s = static_cast<double>(sample.t_ns) * 1e-9;
    const auto keep = [](double& worst, double error) { worst = std::max(worst, std::abs(error)); };
    const double omega_p = truth(Role::kPrimarySpeed, s), omega_s = truth(Role::kSecondarySpeed, s);
    keep(errors.omega_p, sample.omega_p_rad_s - omega_p);
    keep(errors.omega_s, sample.omega_s_rad_s - omega_s);
    keep(errors.slip_percent,
         100.0 * (sample.omega_s_rad_s / sample.omega_p_rad_s - omega_s / omega_p) / 2.25);
    keep(errors.pressure, sample.secondary_pressure_Pa - truth(Role::kSecondaryPressure, s));
    errors.pressure_mean += sample.secondary_pressure_Pa - truth(Role::kSecondaryPressure, s);
    keep(errors.pressure_ahead_s, static_cast<double>(sample.pressure_ahead_ns) * 1e-9);
    keep(errors.torque, sample.torque_Nm - truth(Role::kEngineTorque, s));
  }
  errors.pressure_mean /= static_cast<double>(std::max<std::size_t>(errors.usable, 1));
  errors.delay = sampler.delay().value_or(Duration{});
  return errors;
}

// A coast-down: speeds fall by 20 % in 3 s, the clamp by 300 N/s on 0.0113 m2.
const Function kPrimary = [](double t) { return 150.0 - 10.0 * t; };
const Function kSecondary = [](double t) { return 2.25 * (150.0 - 10.0 * t); };
const Function kPressure = [](double t) { return 4e5 - 300.0 / 0.0113 * t; };
const Function kTorque = [](double t) { return -30.0 + 5.0 * std::sin(6.0 * t); };

std::vector<Channel> channels(double speed_ms, double pressure_ms, double torque_ms,
                              double second_phase_ms = 3.7) {
  return {{Role::kPrimarySpeed, 0x10, speed_ms, 0.4, kPrimary},
          {Role::kSecondarySpeed, 0x11, speed_ms, second_phase_ms, kSecondary},
          {Role::kSecondaryPressure, 0x12, pressure_ms, 1.9, kPressure},
          {Role::kEngineTorque, 0x13, torque_ms, 2.2, kTorque}};
}

TEST(Sampler, StraightLinesAreExactWhateverTheRates) {
  for (const double speed : {1.0, 5.0, 10.0, 20.0, 40.0, 50.0}) {
    for (const double pressure : {1.0, 10.0, 20.0, 50.0, 100.0}) {
      const Errors errors = sample_all(channels(speed, pressure, 10.0));
      EXPECT_GT(errors.usable, 500U) << speed << " " << pressure;
      EXPECT_LT(errors.omega_p, 1e-6) << speed << " " << pressure;
      EXPECT_LT(errors.omega_s, 1e-6) << speed << " " << pressure;
      EXPECT_LT(errors.slip_percent, 1e-6) << speed << " " << pressure;
      EXPECT_LT(errors.pressure, 1e-3) << speed << " " << pressure;
      EXPECT_LT(errors.torque, 0.02) << speed << " " << pressure;
    }
  }
}

TEST(Sampler, TheDelayIsThatOfTheSlowerSpeedAndASlowPressureAddsNone) {
  EXPECT_EQ(sample_all(channels(10, 10, 10)).delay, 10 * kMillisecond);
  EXPECT_EQ(sample_all(channels(10, 20, 10)).delay, 20 * kMillisecond);
  EXPECT_EQ(sample_all(channels(10, 50, 10)).delay, 10 * kMillisecond);
  EXPECT_EQ(sample_all(channels(10, 100, 100)).delay, 10 * kMillisecond);
  EXPECT_EQ(sample_all(channels(40, 100, 100)).delay, 40 * kMillisecond);
  EXPECT_EQ(sample_all(channels(100, 100, 100)).delay, 50 * kMillisecond);
  // The slowest pressure that is waited for, and the first that is not.
  EXPECT_EQ(sample_all(channels(10, 25, 10)).delay, 25 * kMillisecond);
  EXPECT_EQ(sample_all(channels(10, 26, 10)).delay, 10 * kMillisecond);
}

// Frames come at 1.9 ms and every 100 ms after, samples every 5 ms of instants 10 ms ago: the last
// before a frame lies 88.1 ms beyond the one before.
TEST(Sampler, ASampleTellsHowFarItsPressureIsForetold) {
  EXPECT_EQ(sample_all(channels(10, 10, 10)).pressure_ahead_s, 0.0);
  EXPECT_NEAR(sample_all(channels(10, 100, 10)).pressure_ahead_s, 0.0881, 1e-6);
  // What a frame tells late was read so much earlier.
  std::vector<Channel> late = channels(10, 100, 10);
  late[2].late_ms = late[2].delay_ms = 30.0;
  EXPECT_NEAR(sample_all(late).pressure_ahead_s, 0.1181, 1e-6);
}

TEST(Sampler, LearnedPeriodsGiveTheSame) {
  const Errors errors = sample_all(channels(10, 20, 10), false);
  EXPECT_EQ(errors.delay, 20 * kMillisecond);
  EXPECT_LT(errors.slip_percent, 1e-6);
  EXPECT_GT(errors.usable, 500U);
}

// Two speeds that come 5 ms after each other, used as they come, would differ by 0.03 % of slip in
// this coast-down; interpolated they do not, and jitter of a millisecond costs its share only.
TEST(Sampler, SkewBetweenTheSpeedsIsTakenOut) {
  for (const double phase : {0.4, 2.9, 5.4, 8.9}) {
    EXPECT_LT(sample_all(channels(10, 10, 10, phase)).slip_percent, 1e-6) << phase;
    EXPECT_LT(sample_all(channels(10, 10, 10, phase), true, 1.0).slip_percent, 0.011) << phase;
  }
}

TEST(Sampler, AConfiguredDelayIsTakenOut) {
  for (const double late_ms : {-4.0, 3.0, 25.0}) {
    auto late = channels(10, 10, 10);
    late[1].late_ms = late_ms;
    EXPECT_GT(sample_all(late).slip_percent, 0.02) << late_ms;
    late[1].delay_ms = late_ms;
    const Errors errors = sample_all(late);
    EXPECT_LT(errors.slip_percent, 1e-6) << late_ms;
    EXPECT_EQ(errors.delay, (late_ms > 0.0 ? 10 + std::llround(late_ms) : 10) * kMillisecond);
  }
  // Beyond 50 ms in all the slope is followed.
  auto late = channels(10, 10, 10);
  late[2].late_ms = late[2].delay_ms = 70.0;
  const Errors errors = sample_all(late);
  EXPECT_EQ(errors.delay, 50 * kMillisecond);
  EXPECT_LT(errors.pressure, 1.0);
}

TEST(Sampler, AFollowedSlopeDoesNotLag) {
  for (const double period : {50.0, 100.0}) {
    const Errors errors = sample_all(channels(10, period, 10), true, 1.0);
    // Holding the last value would lag by half a period of ramp: 664 and 1327 Pa.
    EXPECT_LT(std::abs(errors.pressure_mean), 30.0) << period;
  }
}

TEST(Sampler, ALostFrameIsBridged) {
  const Errors errors =
      sample_all(channels(10, 20, 10), true, 0.0, 3.0,
                 [](std::uint32_t id, int i) { return (i + static_cast<int>(id)) % 10 == 0; });
  EXPECT_LT(errors.omega_p, 1e-6);
  EXPECT_LT(errors.slip_percent, 1e-6);
  EXPECT_LT(errors.pressure, 1e-3);
  EXPECT_GT(errors.usable, 550U);
}

// Two frames of a slow pressure are lost. Its slope is followed for two periods, then it stays
// level; half a period later the input is stale. A sample tells of the instant 10 ms before.
TEST(Sampler, ASlopeIsFollowedForTwoPeriods) {
  const auto lost = [](std::uint32_t id, int i) { return id == 0x12 && (i == 30 || i == 31); };
  const Errors errors = sample_all(channels(10, 50, 10), true, 0.0, 3.0, lost);
  constexpr double kSlope = 300.0 / 0.0113;  // Pa/s
  EXPECT_NEAR(errors.pressure, kSlope * 0.015, kSlope * 0.005);
}

// The inputs of one car at rest with itself, all told every 10 ms until they end.
struct Steady {
  explicit Steady(bool periods_known) : config(config_of(channels(10, 10, 10), periods_known)) {}
  void run_to(MonoTime end) {
    for (; t <= end; t += 10 * kMillisecond) {
      for (const RoleBinding& each : config.roles) {
        RxFrame frame{.t = t, .frame = {}};
        frame.frame.id = each.id;
        frame.frame.length = 8;
        each.codec.insert({frame.frame.data.data(), 8},
                          std::bit_cast<std::uint64_t>(value(each.role)));
        inputs.on_frame(frame, faults);
      }
      inputs.update(t, faults);
    }
  }
  double value(Role role) const {
    const double small =
        1e-3 * std::sin(static_cast<double>(t.ns()));  // nothing real is quite still
    switch (role) {
      case Role::kPrimarySpeed:
        return 100.0 + small;
      case Role::kSecondarySpeed:
        return 225.0 + small;
      case Role::kSecondaryPressure:
        return 4e5 + small;
      default:
        return -30.0 + small;
    }
  }

  Config config;
  InputMonitor inputs{config};
  Sampler sampler{inputs, true};
  FaultSet faults;
  MonoTime t{kMillisecond};
};

TEST(Sampler, TheDelayStaysWhileItMayNotChange) {
  Steady car(true);
  car.run_to(MonoTime{kSecond});
  ASSERT_TRUE(car.inputs.all_valid());
  EXPECT_FALSE(car.sampler.sample(MonoTime{kSecond}, false).usable);
  EXPECT_FALSE(car.sampler.delay());
  EXPECT_TRUE(car.sampler.sample(MonoTime{kSecond}, true).usable);
  EXPECT_EQ(car.sampler.delay(), 10 * kMillisecond);
}

TEST(Sampler, OneInstantIsOneSampleAndWhatIsUnusableChangesNoValue) {
  Steady car(true);
  car.run_to(MonoTime{kSecond});
  ASSERT_TRUE(car.sampler.sample(MonoTime{kSecond}, true).usable);
  const double omega_p_rad_s = car.sampler.newest().omega_p_rad_s;
  EXPECT_FALSE(car.sampler.sample(MonoTime{kSecond}, true).usable);
  EXPECT_FALSE(car.sampler.sample(MonoTime{kSecond - 50 * kMillisecond}, true).usable);
  EXPECT_EQ(car.sampler.newest().omega_p_rad_s, omega_p_rad_s);
  EXPECT_EQ(car.sampler.newest().t_ns, (kSecond - 10 * kMillisecond).ns());
  EXPECT_TRUE(car.sampler.sample(MonoTime{kSecond + 5 * kMillisecond}, true).usable);
}

TEST(Sampler, NoSampleOfInputsThatEnded) {
  Steady car(true);
  car.run_to(MonoTime{kSecond});
  ASSERT_TRUE(car.sampler.sample(MonoTime{kSecond}, true).usable);
  const MonoTime later{2 * kSecond};
  car.inputs.update(later, car.faults);
  ASSERT_FALSE(car.inputs.all_valid());
  EXPECT_FALSE(car.sampler.sample(later, true).usable);
  EXPECT_FALSE(car.sampler.newest().usable);
}

TEST(Sampler, WithoutAPrimarySpeedThereIsNoSample) {
  auto standing = channels(10, 10, 10);
  standing[0].truth = [](double) { return 0.0; };
  EXPECT_EQ(sample_all(standing).usable, 0U);
  standing[0].truth = [](double) { return -1.0; };
  EXPECT_EQ(sample_all(standing).usable, 0U);
}

TEST(SignalHistory, ABurstAfterAPauseIsNoSlope) {
  SignalHistory history;
  MonoTime t{};
  for (int i = 0; i < 20; ++i) history.add(t += 5 * kMillisecond, 100.0);
  t += 40 * kMillisecond;
  for (const double value : {100.5, 99.5, 99.5, 100.5, 101.0}) {
    history.add(t += kMillisecond / 20, value);
    double ahead = 0.0;
    ASSERT_TRUE(history.value_at(t + 5 * kMillisecond, 10 * kMillisecond, ahead));
    EXPECT_NEAR(ahead, 100.0, 5.0);
  }
}

TEST(SignalHistory, KeepsItsOrder) {
  SignalHistory history;
  double value = 0.0;
  EXPECT_FALSE(history.value_at(MonoTime{}, kSecond, value));
  history.add(MonoTime::of_ns(100), 1.0);
  EXPECT_TRUE(history.value_at(MonoTime::of_ns(100), kSecond, value));
  EXPECT_EQ(value, 1.0);
  EXPECT_FALSE(history.value_at(MonoTime::of_ns(500), kSecond, value));  // one value has no slope
  EXPECT_FALSE(history.value_at(MonoTime::of_ns(99), kSecond, value));
  history.add(MonoTime::of_ns(100), 2.0);  // the same stamp again: the newer value counts
  EXPECT_EQ(history.newest_value(), 2.0);
  history.add(MonoTime::of_ns(50), 3.0);  // and so for one from the past
  EXPECT_EQ(history.newest(), MonoTime::of_ns(100));
  EXPECT_EQ(history.newest_value(), 3.0);
  history.add(MonoTime::of_ns(200), 5.0);
  EXPECT_TRUE(history.value_at(MonoTime::of_ns(150), kSecond, value));
  EXPECT_EQ(value, 4.0);
  EXPECT_TRUE(history.value_at(MonoTime::of_ns(250), kSecond, value));
  EXPECT_EQ(value, 6.0);
  EXPECT_TRUE(history.value_at(MonoTime::of_ns(5000), Duration::of_ns(100), value));
  EXPECT_EQ(value, 7.0);  // no further than it may reach
  for (int i = 0; i < 1000; ++i) history.add(MonoTime::of_ns(300 + i), i);
  // 128 values are kept: the oldest, and what lies before it.
  EXPECT_TRUE(history.value_at(MonoTime::of_ns(1299 - 127), kSecond, value));
  EXPECT_EQ(value, 872.0);
  EXPECT_FALSE(history.value_at(MonoTime::of_ns(1299 - 128), kSecond, value));
}

// By hand: the line through the last four of five values has the slope 1.4 a unit of time, and is
// followed for twice the time they span.
TEST(SignalHistory, FollowsTheLineOfTheLastFourForTwiceTheirSpan) {
  SignalHistory history;
  for (const auto& [t, value] : {std::pair{0, 50.0}, {1, 0.0}, {2, 2.0}, {3, 1.0}, {4, 5.0}}) {
    history.add(MonoTime::of_ns(t), value);
  }
  constexpr double kSlope = (-1.5 * 0.0 - 0.5 * 2.0 + 0.5 * 1.0 + 1.5 * 5.0) / 5.0;
  double value = 0.0;
  EXPECT_TRUE(history.value_at(MonoTime::of_ns(6), Duration::of_ns(1000), value));
  EXPECT_NEAR(value, 5.0 + 2 * kSlope, 1e-12);
  EXPECT_TRUE(history.value_at(MonoTime::of_ns(10), Duration::of_ns(1000), value));
  EXPECT_NEAR(value, 5.0 + 6 * kSlope, 1e-12);
  EXPECT_TRUE(history.value_at(MonoTime::of_ns(11), Duration::of_ns(1000), value));
  EXPECT_NEAR(value, 5.0 + 6 * kSlope, 1e-12);
}

}  // namespace
}  // namespace beltgrip::daemon
