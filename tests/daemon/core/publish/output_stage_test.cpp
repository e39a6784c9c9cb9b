// What the last stage lets out, with the limits that it reads from the configuration; confirmation,
// foreign senders, and a stage that goes on for another.
#include "daemon/core/publish/output_stage.h"

#include <gtest/gtest.h>

#include <cmath>

namespace beltgrip::daemon {
namespace {

constexpr Duration kTen = 10 * kMillisecond;
constexpr MonoTime kStart{7 * kSecond};
constexpr double kActing_N = 3300.0;

// Floor 1000.2 + 0.01 * 2e5 = 3000.2 N; 600 N/s.
Config config_of(double spring_N = 1000.2, double rate_N_per_s = 600.0) {
  Config config;
  config.control = Control::kCommand;
  config.variator.secondary_spring_force_N = spring_N;
  config.variator.secondary_piston_area_m2 = 0.01;
  config.experiment.secondary_pressure_floor_Pa = 2e5;
  config.estimator.ramp_rate_max_N_per_s = rate_N_per_s;
  return config;
}

struct Bench {
  explicit Bench(const Config& config = config_of()) : stage(config, kTen) {}
  // One sample every 10 ms; its clamp frames that left.
  int sample(double acting_N = kActing_N) {
    stage.collect(t, now);
    return pass(acting_N);
  }
  int pass(double acting_N = kActing_N) {
    out.size = 0;
    stage.pass(t, acting_N, out, faults);
    int clamps = 0;
    for (std::size_t i = 0; i < out.size; ++i) clamps += out.frames[i].id.value == 0x6A2 ? 1 : 0;
    t += kTen;
    return clamps;
  }
  void quiet(int samples = 20) {
    now.clamp = {};
    for (int i = 0; i < samples; ++i) sample();
  }
  bool asks(double force_N) {
    now.clamp = {true, force_N};
    return sample() == 1;
  }
  void hear(std::uint32_t id, bool echo, bool extended = false, std::uint8_t bus = 0) {
    RxFrame frame;
    frame.t = t;
    frame.frame.id = {id, extended};
    frame.own_echo = echo;
    frame.bus = bus;
    stage.on_frame(frame, faults);
  }
  OutputStage stage;
  Publication now = [] {
    Publication first;
    first.command = true;
    return first;
  }();
  Outbox out{};
  FaultSet faults;
  MonoTime t = kStart;
};

// The least whole force that leaves, coming down by a newton a frame.
int least_N(double spring_N) {
  Bench bench(config_of(spring_N));
  bench.quiet();
  for (int force_N = 3010; force_N > 2900; --force_N) {
    if (!bench.asks(force_N)) return force_N + 1;
  }
  return 0;
}

TEST(OutputStage, NoForceBelowTheStaticFloorLeaves) {
  EXPECT_EQ(least_N(1000.2), 3000);  // 1 N for the rounding of the frame
  EXPECT_EQ(least_N(999.8), 2999);
}

// The largest whole step down that leaves.
int most_N(double rate_N_per_s) {
  for (int step_N = 1; step_N < 100; ++step_N) {
    Bench bench(config_of(1000.2, rate_N_per_s));
    bench.quiet();
    EXPECT_TRUE(bench.asks(3300.0));
    if (!bench.asks(3300.0 - step_N)) return step_N - 1;
  }
  return 100;
}

TEST(OutputStage, NoForceFallsFasterThanTheConfigurationLets) {
  // 16 ms of it, and 1 N for rounding: 10.6, 10.2 and 9.8 N.
  EXPECT_EQ(most_N(600.0), 10);
  EXPECT_EQ(most_N(575.0), 10);
  EXPECT_EQ(most_N(550.0), 9);
}

TEST(OutputStage, NoRequestStandsForLongerThanTheGateLets) {
  Bench bench;
  bench.quiet();
  int frames = 0;
  while (frames < 5000 && bench.asks(3200.0)) ++frames;
  EXPECT_EQ(frames, 1510);  // 15 s, and ten frames of a loop that is late
}

TEST(OutputStage, NoRequestBeginsWhereTheActingForceIsNotKnown) {
  Bench bench;
  for (int i = 0; i < 20; ++i) bench.sample(0.0);
  bench.now.clamp = {true, 3200.0};
  EXPECT_EQ(bench.sample(0.0), 0);
}

TEST(OutputStage, WhatIsRefusedIsAFaultAndCounted) {
  Bench bench;
  bench.quiet();
  EXPECT_EQ(bench.stage.refused(), 0U);
  EXPECT_FALSE(bench.faults.has(Fault::kFrameRefused));
  EXPECT_FALSE(bench.asks(2000.0));
  EXPECT_EQ(bench.stage.refused(), 1U);
  EXPECT_TRUE(bench.faults.has(Fault::kFrameRefused));
}

RoleBinding polled(std::uint16_t identifier, double period_ms) {
  RoleBinding role;
  role.uds =
      UdsSource{.request = {0x7E0, false}, .response = {0x7E8, false}, .identifier = identifier};
  role.period_ms = period_ms;
  return role;
}

struct Poll : Bench {
  explicit Poll(const Config& config) : Bench(config) {}
  // Does a request for this identifier leave now?
  bool asks_for(std::uint16_t identifier, std::uint32_t id = 0x7E0) {
    can::CanFrame frame;
    frame.id = {id, false};
    frame.length = 8;
    frame.data = {0x03, 0x22, static_cast<std::uint8_t>(identifier >> 8U),
                  static_cast<std::uint8_t>(identifier)};
    Publication nothing = now;
    nothing.command = false;
    stage.collect(t, nothing).push(frame);
    pass();
    for (std::size_t i = 0; i < out.size; ++i) {
      if (out.frames[i].id.value == id) return true;
    }
    return false;
  }
};

Config polling() {
  Config config = config_of();
  config.diagnostics = Diagnostics::kPoll;
  // Twice the same identifier: the shorter period counts, whichever comes first.
  for (const auto& [identifier, period_ms] :
       {std::pair{0x1001, 200.0}, std::pair{0x1001, 100.0}, std::pair{0x1002, 100.0},
        std::pair{0x1002, 200.0}, std::pair{0x1003, 300.0}}) {
    config.roles.push_back(polled(static_cast<std::uint16_t>(identifier), period_ms));
  }
  RoleBinding broadcast;
  broadcast.period_ms = 10.0;
  config.roles.push_back(broadcast);
  RoleBinding without_period = polled(0x1004, 100.0);
  without_period.period_ms.reset();
  config.roles.push_back(without_period);
  return config;
}

TEST(OutputStage, OnlyWhatIsConfiguredIsAskedForAndNoMoreOften) {
  for (const auto& [identifier, period] : {std::pair{std::uint16_t{0x1001}, 100 * kMillisecond},
                                           std::pair{std::uint16_t{0x1002}, 100 * kMillisecond},
                                           std::pair{std::uint16_t{0x1003}, 300 * kMillisecond}}) {
    Poll bench(polling());
    EXPECT_TRUE(bench.asks_for(identifier)) << identifier;
    // Early by half a period at the most.
    const MonoTime first = bench.t - kTen;
    while (bench.t < first + period / 2) {
      EXPECT_FALSE(bench.asks_for(identifier)) << identifier << ' ' << bench.t;
    }
    EXPECT_TRUE(bench.asks_for(identifier)) << identifier;
  }
  Poll bench(polling());
  EXPECT_FALSE(bench.asks_for(0x1004));
  EXPECT_FALSE(bench.asks_for(0x1001, 0x7E1));
}

// The same number on another bus, of another ECU or of another service is another identifier, with
// a period of its own.
TEST(OutputStage, AnIdentifierIsOneOfItsBusEcuAndService) {
  RoleBinding bus = polled(0x0001, 100.0), ecu = bus, service = bus;
  bus.bus = 1;
  ecu.uds->request = {0x7E1, false};
  service.uds->service = 0x21;
  Config config = config_of();
  config.diagnostics = Diagnostics::kPoll;
  config.roles = {bus, ecu, service, polled(0x0001, 200.0), bus, ecu, service};
  Poll bench(config);
  EXPECT_TRUE(bench.asks_for(0x0001));
  const MonoTime first = bench.t - kTen;
  while (bench.t < first + 100 * kMillisecond) EXPECT_FALSE(bench.asks_for(0x0001)) << bench.t;
  EXPECT_TRUE(bench.asks_for(0x0001));
}

TEST(OutputStage, NothingIsAskedForWithoutAllowance) {
  Config config = polling();
  config.diagnostics = Diagnostics::kListen;
  Poll bench(config);
  EXPECT_FALSE(bench.asks_for(0x1001));
}

TEST(OutputStage, EveryOwnIdentifierOfAnotherSenderIsAFault) {
  for (std::uint32_t id = 0x69E; id < 0x6A8; ++id) {
    Bench bench;
    bench.hear(id, false);
    const bool own = id >= 0x6A0 && id <= 0x6A3;
    EXPECT_EQ(bench.faults.has(Fault::kForeignSender), own) << id;
    EXPECT_EQ(bench.stage.foreign_identifier(), own ? id : 0U);
  }
  Bench bench;
  bench.hear(0, false);
  bench.hear(0x6A2, true);         // our own
  bench.hear(0x6A2, false, true);  // other identifiers, other buses
  bench.hear(0x6A2, false, false, 1);
  EXPECT_FALSE(bench.faults.has(Fault::kForeignSender));
}

TEST(OutputStage, AClampFrameWaitsForItsOwnEcho) {
  Bench bench;
  EXPECT_FALSE(bench.stage.unconfirmed(kStart + kSecond));  // nothing sent
  bench.now.command = false;
  EXPECT_EQ(bench.sample(), 0);
  EXPECT_FALSE(bench.stage.unconfirmed(kStart + kSecond));  // no clamp frame
  bench.now.command = true;
  const MonoTime sent = bench.t;
  EXPECT_EQ(bench.sample(), 1);
  EXPECT_EQ(bench.sample(), 1);  // the first that waits counts
  EXPECT_FALSE(bench.stage.unconfirmed(sent + 2 * kTen - kNanosecond));
  EXPECT_TRUE(bench.stage.unconfirmed(sent + 2 * kTen));
  bench.hear(0x6A1, true);
  EXPECT_TRUE(bench.stage.unconfirmed(sent + 2 * kTen));
  bench.hear(0x6A2, true);
  EXPECT_FALSE(bench.stage.unconfirmed(sent + 2 * kTen));
  const MonoTime again = bench.t;
  EXPECT_EQ(bench.sample(), 1);
  EXPECT_FALSE(bench.stage.unconfirmed(again + 2 * kTen - kNanosecond));
  EXPECT_TRUE(bench.stage.unconfirmed(again + 2 * kTen));
}

// Clamp frames that leave in a second after ask_again.
int told_again(Bench& bench, MonoTime t) {
  bench.stage.ask_again(t, bench.faults);
  int frames = 0;
  for (int i = 0; i < 100; ++i) frames += bench.sample();
  return frames;
}

TEST(OutputStage, AFrameThatIsNeverConfirmedIsLostAfterASecond) {
  {
    Bench bench;
    bench.quiet();
    EXPECT_EQ(told_again(bench, kStart + kSecond - kNanosecond), 0);
  }
  {
    Bench bench;
    bench.quiet();
    EXPECT_EQ(told_again(bench, kStart + kSecond), 5);
  }
  {  // nothing waits
    Bench bench;
    bench.quiet();
    bench.hear(0x6A2, true);
    EXPECT_EQ(told_again(bench, kStart + 10 * kSecond), 0);
  }
  {  // not into a foreign sender's requests; but what was lost is lost
    Bench bench;
    bench.quiet();
    bench.hear(0x6A0, false);
    bench.stage.ask_again(kStart + kSecond, bench.faults);
    EXPECT_FALSE(bench.stage.unconfirmed(kStart + 2 * kSecond));
    EXPECT_EQ(told_again(bench, kStart + 2 * kSecond), 0);
  }
}

TEST(OutputStage, AnotherGoesOnWhereOneEnded) {
  Bench before;
  before.quiet();
  EXPECT_FALSE(before.asks(2000.0));
  Bench after;
  after.stage.go_on_from(before.stage);
  EXPECT_EQ(after.stage.refused(), 1U);
  // The first clamp frame waits on; counters go on.
  EXPECT_FALSE(after.stage.unconfirmed(kStart + 2 * kTen - kNanosecond));
  EXPECT_TRUE(after.stage.unconfirmed(kStart + 2 * kTen));
  after.t = before.t;
  after.now.status.outcome = Outcome::kAborted;  // leaves at once, with the next counter
  after.sample();
  bool seen = false;
  for (std::size_t i = 0; i < after.out.size; ++i) {
    if (after.out.frames[i].id.value != 0x6A3) continue;
    seen = true;
    EXPECT_EQ(after.out.frames[i].data[1] & 15, 1);
  }
  EXPECT_TRUE(seen);
}

}  // namespace
}  // namespace beltgrip::daemon
