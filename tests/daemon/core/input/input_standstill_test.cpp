// Inputs that stand still while others move: what a request, the other shaft and the engine say of
// a signal, since when, and for how long it counts as frozen.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <random>
#include <vector>

#include "daemon/core/input/input_monitor.h"

namespace beltgrip::daemon {

using estimator::ReadingVerdict;
namespace {

constexpr Duration kPeriod = 10 * kMillisecond;
constexpr Duration kSilence = 50 * kMillisecond;  // then a signal of 10 ms is stale

enum Signal : std::size_t { kPrimary, kSecondary, kEngine, kPressure, kSignals };
constexpr std::array kRoles{Role::kPrimarySpeed, Role::kSecondarySpeed, Role::kEngineSpeed,
                            Role::kSecondaryPressure};
constexpr std::array kSteps{0.1, 0.25, 0.1, 500.0};  // rad/s, Pa

Config config() {
  Config config;
  config.trigger = Trigger::kAlways;
  for (std::size_t i = 0; i < kSignals; ++i) {
    can::SignalDef signal;
    signal.length = 16;
    signal.type = can::ValueType::kSigned;
    signal.scale = kSteps[i];
    RoleBinding binding;
    binding.role = kRoles[i];
    binding.id = {static_cast<std::uint32_t>(0x100 + i), false};
    binding.message_length = 2;
    binding.codec = can::SignalCodec(signal);
    binding.period_ms = 10.0;
    config.roles.push_back(binding);
  }
  return config;
}

// A bus with the four signals, and beside it what each has told: the account's own knowledge.
class Bus {
 public:
  struct Sent {
    MonoTime t{};
    double value = 0.0;
  };
  void tick() { t_ += kPeriod; }
  void send(std::size_t signal, double value) {
    const auto raw = static_cast<std::int16_t>(std::lround(value / kSteps[signal]));
    can::CanFrame frame;
    frame.id = {static_cast<std::uint32_t>(0x100 + signal), false};
    frame.length = 2;
    frame.data[0] = static_cast<std::uint8_t>(raw & 0xFF);
    frame.data[1] = static_cast<std::uint8_t>(raw >> 8 & 0xFF);
    EXPECT_EQ(monitor.on_frame({.t = t_, .frame = frame}, faults), FrameUse::kTaken);
    sent[signal].push_back({t_, raw * kSteps[signal]});
    course[signal].add(t_, sent[signal].back().value);
  }
  void update() {
    faults = {};
    monitor.update(t_, faults);
  }
  MonoTime t() const { return t_; }
  ReadingVerdict verdict(std::size_t signal) const { return monitor.verdict(kRoles[signal]); }
  bool heard(std::size_t signal) const {
    return !sent[signal].empty() && t_ - sent[signal].back().t <= kSilence;
  }

  InputMonitor monitor{config()};
  FaultSet faults;
  std::array<std::vector<Sent>, kSignals> sent;
  std::array<ValueCourse, kSignals> course{ValueCourse(0.1, true), ValueCourse(0.25, true),
                                           ValueCourse(0.1, true), ValueCourse(500.0, false)};

 private:
  MonoTime t_{kSecond};
};

// How far a signal has moved since then, less three deviations of its noise and one step; nothing
// where it is silent or not known so far back, 128 values. Between two values it lies on a line.
double moved(const Bus& bus, std::size_t signal, MonoTime since) {
  const std::vector<Bus::Sent>& sent = bus.sent[signal];
  if (!bus.heard(signal)) return 0.0;
  std::size_t after = sent.size() > 128 ? sent.size() - 128 : 0;
  if (sent[after].t > since) return 0.0;
  while (after + 1 < sent.size() && sent[after].t < since) ++after;
  double then = sent[after].value;
  if (sent[after].t > since) {
    const Bus::Sent &from = sent[after - 1], &to = sent[after];
    then = std::lerp(from.value, to.value, fraction(since - from.t, to.t - from.t));
  }
  const double by = sent.back().value - then;
  const double sure =
      std::abs(by) - 3.0 * bus.course[signal].noise() - bus.course[signal].resolution();
  if (sure <= 0.0) return 0.0;
  return by < 0.0 ? -sure : sure;
}

// How far it should have moved itself, by the rest.
double expected_motion(const Bus& bus, std::size_t signal, const InputMonitor::Watch& watch) {
  const MonoTime since = bus.course[signal].since();
  if (signal == kPressure) {
    const MonoTime from = since > watch.request_begun ? since : watch.request_begun;
    const double falling_s = 1e-9 * static_cast<double>((bus.t() - from - watch.answer).ns());
    return falling_s > 0.0 ? falling_s * watch.fall_Pa_per_s : 0.0;
  }
  if (signal == kEngine) return std::abs(moved(bus, kPrimary, since));
  const double omega_p = bus.course[kPrimary].value(), omega_s = bus.course[kSecondary].value();
  if (omega_p == 0.0 || omega_s / omega_p <= 0.0) return 0.0;  // no ratio to speak of
  const double ratio = omega_s / omega_p;
  if (signal == kSecondary) {
    // What the torque does not explain: slip in overrun slows the primary, in drive it speeds it.
    const double against = -watch.torque_sign * moved(bus, kPrimary, since) * ratio;
    return against > 0.0 ? against : 0.0;
  }
  const double against = watch.torque_sign * moved(bus, kSecondary, since) / ratio;
  const double engine = std::abs(moved(bus, kEngine, since));
  return against > engine ? against : engine;
}

struct Counts {
  int frozen = 0, thawed = 0, live = 0;
};

// One drive: all live for 1.5 s, then one stands still for 0.9 s while the others go where they go,
// then it moves again, from there: a jump would be taken for a spike.
void drive(std::mt19937_64& random, Counts& counts) {
  const auto draw = [&](double from, double to) {
    return std::uniform_real_distribution<double>(from, to)(random);
  };
  std::normal_distribution<double> normal;
  Bus bus;
  const bool crawls = draw(0.0, 1.0) < 0.25;
  std::array<double, kSignals> value{draw(90.0, 180.0), draw(200.0, 400.0), draw(90.0, 180.0),
                                     draw(4e5, 9e5)};
  if (crawls) value = {draw(-0.4, 0.8), draw(-0.5, 1.0), draw(0.0, 1.0), value[kPressure]};
  std::array<double, kSignals> noise{}, slope{};
  for (std::size_t i = 0; i < kSignals; ++i) {
    noise[i] = kSteps[i] * draw(0.0, crawls ? 0.5 : 1.5);
    slope[i] = (crawls ? 0.06 : 1.0) * kSteps[i] * draw(-0.6, 0.6);
  }
  const auto still = static_cast<std::size_t>(random() % kSignals);
  const auto silent = static_cast<std::size_t>(random() % (3 * kSignals));  // mostly none
  InputMonitor::Watch watch;
  watch.on = draw(0.0, 1.0) > 0.1;
  watch.slopes = draw(0.0, 1.0) > 0.5;
  watch.torque_sign = draw(0.0, 1.0) > 0.5 ? 1.0 : -1.0;
  watch.request_begun =
      MonoTime{kSecond + 1500 * kMillisecond} + Duration::of_ns(std::llround(draw(-3e8, 3e8)));
  watch.fall_Pa_per_s = draw(0.0, 1e5);
  watch.answer = Duration::of_ns(std::llround(draw(0.0, 3e8)));
  bus.monitor.watch(watch);

  std::array<std::optional<MonoTime>, kSignals> stands;
  for (int i = 0; i < 270; ++i) {
    bus.tick();
    const bool event = i >= 150 && i < 240;
    if (i == 240) value[still] = bus.sent[still].back().value;
    for (std::size_t each = 0; each < kSignals; ++each) {
      if (event) value[each] += slope[each];
      if (event && each == silent) continue;
      const bool same = event && each == still;
      bus.send(each,
               same ? bus.sent[each].back().value : value[each] + noise[each] * normal(random));
    }
    bus.update();
    std::array<bool, kSignals> found{};
    for (std::size_t each = 0; each < kSignals; ++each) {
      if (!bus.heard(each)) {
        stands[each].reset();
        bus.course[each].reset();
        continue;
      }
      if (stands[each] != bus.course[each].since()) {
        counts.thawed += stands[each] ? 1 : 0;
        stands[each].reset();
      }
      found[each] = watch.on &&
                    bus.course[each].stands_still(expected_motion(bus, each, watch), watch.slopes);
    }
    std::optional<Role> first;
    for (std::size_t each = 0; each < kSignals; ++each) {
      if (found[each]) stands[each] = bus.course[each].since();
      const ReadingVerdict expected = !bus.heard(each) ? ReadingVerdict::kStale
                                      : stands[each]   ? ReadingVerdict::kFrozen
                                                       : ReadingVerdict::kValid;
      ASSERT_EQ(bus.verdict(each), expected) << "signal " << each << ", sample " << i;
      if (stands[each] && !first) first = kRoles[each];
      (stands[each] ? counts.frozen : counts.live) += 1;
    }
    EXPECT_EQ(bus.monitor.frozen(), first);
    EXPECT_EQ(bus.faults.has(Fault::kInputFrozen), first.has_value());
    EXPECT_EQ(bus.monitor.any_lost(),
              first || !bus.heard(kPrimary) || !bus.heard(kSecondary) || !bus.heard(kPressure));
  }
}

TEST(Standstill, IsSeenWhenAnotherAccountSeesIt) {
  std::mt19937_64 random(5);
  Counts counts;
  for (int i = 0; i < 800 && !::testing::Test::HasFatalFailure(); ++i) {
    SCOPED_TRACE(i);
    drive(random, counts);
  }
  EXPECT_GT(counts.frozen, 5000);
  EXPECT_GT(counts.thawed, 100);
  EXPECT_GT(counts.live, 100000);
}

// --- one speed stands, the other has moved by more than slip can explain -------------------------

class Speeds : public testing::Test {
 protected:
  // The primary at 105 rad/s, the secondary at this speed.
  ReadingVerdict tell(double secondary_rad_s, bool secondary_comes = true) {
    bus_.tick();
    bus_.send(kPrimary, primary_rad_s_);
    if (secondary_comes) bus_.send(kSecondary, secondary_rad_s);
    bus_.update();
    return bus_.verdict(kPrimary);
  }
  Bus bus_;
  double primary_rad_s_ = 105.0;
};

// 15 % of the other's speed, or of 10 rad/s; after 0.2 s.
TEST_F(Speeds, FifteenPercentAndAFifthOfASecond) {
  struct Case {
    double from_rad_s, to_rad_s;
    bool frozen;
  };
  for (const Case& c :
       {Case{200.0, 170.25, false}, Case{200.0, 169.75, true}, Case{200.0, 229.75, false},
        Case{200.0, 230.25, true}, Case{5.0, 3.5, false}, Case{5.0, 3.25, true},
        Case{-5.0, -3.25, true}, Case{20.0, 17.0, false}, Case{20.0, 16.75, true}}) {
    bus_ = Bus();
    primary_rad_s_ = 104.0;
    tell(c.from_rad_s);
    primary_rad_s_ = 105.0;
    tell(c.from_rad_s);
    for (int ms = 10; ms < 200; ms += 10) {
      ASSERT_EQ(tell(c.to_rad_s), ReadingVerdict::kValid) << ms;
    }
    EXPECT_EQ(tell(c.to_rad_s), c.frozen ? ReadingVerdict::kFrozen : ReadingVerdict::kValid)
        << c.from_rad_s << " " << c.to_rad_s;
    EXPECT_EQ(bus_.verdict(kSecondary), ReadingVerdict::kValid);
    if (!c.frozen) continue;
    tell(c.to_rad_s);
    tell(c.to_rad_s);
    EXPECT_NEAR(bus_.monitor.lost(bus_.t()).cause.figure, 0.22, 1e-12);
  }
}

// The other way round.
TEST_F(Speeds, TheSecondaryAsWell) {
  for (int i = 0; i < 21; ++i) {
    EXPECT_EQ(bus_.verdict(kSecondary), i < 2 ? bus_.verdict(kSecondary) : ReadingVerdict::kValid);
    primary_rad_s_ = i < 1 ? 105.0 : 125.0;
    tell(236.25);
  }
  EXPECT_EQ(bus_.verdict(kSecondary), ReadingVerdict::kFrozen);
  EXPECT_EQ(bus_.verdict(kPrimary), ReadingVerdict::kValid);
}

// What the other was before it fell silent says nothing of what it is now.
TEST_F(Speeds, ASilenceOfTheOtherBeginsAnew) {
  tell(200.0);
  for (int i = 0; i < 30; ++i) EXPECT_EQ(tell(200.0, false), ReadingVerdict::kValid);
  ASSERT_EQ(bus_.verdict(kSecondary), ReadingVerdict::kStale);
  for (int i = 0; i < 50; ++i) EXPECT_EQ(tell(100.0), ReadingVerdict::kValid) << i;
}

// --- what else has shown it, and what is then said ----------------------------------------------

TEST(Lost, WhatStandsStillIsNamedUntilItMoves) {
  Bus bus;
  const auto tell = [&](double pressure_Pa) {
    bus.tick();
    bus.send(kPressure, pressure_Pa);
    bus.update();
  };
  for (int i = 0; i < 10; ++i) tell(5e5);
  EXPECT_EQ(bus.monitor.lost(bus.t()).reason, estimator::StopReason::kNone);
  bus.monitor.stands_still(Role::kSecondaryPressure);
  EXPECT_EQ(bus.monitor.frozen(), Role::kSecondaryPressure);  // at once
  for (int i = 0; i < 3; ++i) tell(5e5);
  EXPECT_EQ(bus.verdict(kPressure), ReadingVerdict::kFrozen);
  const Stop stop = bus.monitor.lost(bus.t());
  EXPECT_EQ(stop.reason, estimator::StopReason::kInputFrozen);
  EXPECT_STREQ(stop.cause.what, "stands still for");
  EXPECT_NEAR(stop.cause.figure, 0.12, 1e-12);
  EXPECT_STREQ(stop.cause.unit, "s");
  EXPECT_EQ(stop.cause.role, Role::kSecondaryPressure);
  tell(5.005e5);
  EXPECT_EQ(bus.verdict(kPressure), ReadingVerdict::kValid);
  EXPECT_EQ(bus.monitor.frozen(), std::nullopt);
}

TEST(Lost, WhatIsSilentIsNamedWithItsLimit) {
  Bus bus;
  for (int i = 0; i < 3; ++i) {
    bus.tick();
    bus.send(kPrimary, 100.0 + i);
    if (i == 0) bus.send(kSecondary, 200.0);
    bus.update();
  }
  EXPECT_EQ(bus.monitor.lost(bus.t()).reason, estimator::StopReason::kNone);
  for (int i = 0; i < 4; ++i) {
    bus.tick();
    bus.send(kPrimary, 110.0 + i);
    bus.update();
  }
  const Stop stop = bus.monitor.lost(bus.t());
  EXPECT_EQ(stop.reason, estimator::StopReason::kInputs);
  EXPECT_STREQ(stop.cause.what, "silent for");
  EXPECT_NEAR(stop.cause.figure, 0.06, 1e-12);
  EXPECT_NEAR(stop.cause.limit, 0.05, 1e-12);
  EXPECT_STREQ(stop.cause.unit, "s");
  EXPECT_EQ(stop.cause.role, Role::kSecondarySpeed);
}

// --- would it show? ------------------------------------------------------------------------------

// The primary's speed or the engine's, as the course of its values has it, within 0.6 s.
TEST(Standstill, ShowsWhereOneOfTheTwoWouldShowIt) {
  std::mt19937_64 random(3);
  std::normal_distribution<double> normal;
  int shows = 0, hides = 0;
  for (int i = 0; i < 200; ++i) {
    Bus bus;
    const double primary_noise = i % 3 == 0 ? 0.0 : 0.02 * static_cast<double>(random() % 12);
    const double engine_noise = i % 3 == 1 ? 0.0 : 0.02 * static_cast<double>(random() % 12);
    const int engine_ends = i % 4 == 0 ? 80 : 200;
    for (int k = 0; k < 100; ++k) {
      bus.tick();
      bus.send(kPrimary, 120.0 + primary_noise * normal(random));
      if (k < engine_ends) bus.send(kEngine, 121.0 + engine_noise * normal(random));
      bus.update();
    }
    const auto within = [&](std::size_t signal) {
      const std::optional<Duration> after = bus.course[signal].shown_after(kPeriod);
      return bus.heard(signal) && after && *after <= 600 * kMillisecond;
    };
    const bool expected = within(kPrimary) || within(kEngine);
    EXPECT_EQ(bus.monitor.standstill_shows(), expected) << i;
    ++(expected ? shows : hides);
  }
  EXPECT_GT(shows, 30);
  EXPECT_GT(hides, 30);
}

}  // namespace
}  // namespace beltgrip::daemon
