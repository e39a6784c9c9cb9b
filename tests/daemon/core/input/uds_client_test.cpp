// Polling and listening for diagnostics: an ECU of the test's own few lines, time in steps of 5 ms,
// and every frame that leaves passes the transmit gate.
#include "daemon/core/input/uds_client.h"

#include <gtest/gtest.h>

#include <array>
#include <functional>
#include <vector>

#include "daemon/core/guard/tx_gate.h"
#include "daemon/core/loop/pipeline.h"

namespace beltgrip::daemon {

using estimator::ReadingVerdict;
namespace {

using Bytes = std::vector<std::uint8_t>;

constexpr can::CanId kRequest{0x7E1, false}, kResponse{0x7E9, false};
constexpr Duration kStep = 5 * kMillisecond;

RoleBinding role_of(Role role, std::uint16_t identifier, double period_ms) {
  RoleBinding binding;
  binding.role = role;
  binding.uds = UdsSource{.request = kRequest, .response = kResponse, .identifier = identifier};
  binding.id = kResponse;
  can::SignalDef signal;
  signal.start_bit = 7;
  signal.length = 16;
  signal.byte_order = can::ByteOrder::kBig;
  binding.codec = can::SignalCodec(signal);
  binding.factor = 1000.0;  // kPa
  binding.period_ms = period_ms;
  return binding;
}

Config config_of(Diagnostics diagnostics, std::vector<RoleBinding> roles) {
  Config config;
  config.diagnostics = diagnostics;
  config.roles = std::move(roles);
  return config;
}

can::CanFrame frame_of(can::CanId id, const Bytes& bytes) {
  can::CanFrame frame;
  frame.id = id;
  frame.length = static_cast<std::uint8_t>(bytes.size());
  std::copy(bytes.begin(), bytes.end(), frame.data.begin());
  return frame;
}

struct Sent {
  MonoTime t{};
  Bytes bytes;
};

// A client whose frames go to a function that may answer.
class Bench {
 public:
  using Ecu = std::function<void(const Sent&)>;
  explicit Bench(const Config& config) : client(config) {
    PollLimits limits;
    for (const RoleBinding& role : config.roles) {
      limits.requests[limits.size++] = {role.bus, role.uds->request, role.uds->identifier,
                                        Duration::of_ms(*role.period_ms), role.uds->service};
    }
    if (config.diagnostics == Diagnostics::kPoll) gate = TxGate({}, Control::kObserve, {}, limits);
  }

  void run(
      Duration duration, const Ecu& ecu = [](const Sent&) {}) {
    for (const MonoTime end = t + duration; t < end; t += kStep) {
      Outbox outbox;
      client.step(t, up, outbox);
      for (std::size_t i = 0; i < outbox.size; ++i) {
        EXPECT_TRUE(gate.permits(outbox.frames[i], outbox.bus[i], t)) << "at " << t;
        EXPECT_EQ(outbox.frames[i].id, kRequest);
        const auto payload = outbox.frames[i].payload();
        sent.push_back({t, {payload.begin(), payload.end()}});
        arrive(outbox.frames[i], true);
        ecu(sent.back());
      }
    }
  }
  // A frame that comes a millisecond after the step that is due.
  void arrive(const can::CanFrame& frame, bool echo = false) {
    UdsReading reading;
    client.on_frame({.t = t + kMillisecond, .frame = frame, .own_echo = echo}, reading);
    for (bool more = !reading.roles.empty(); more; more = client.next(reading)) {
      readings.push_back(reading);
      data.emplace_back(reading.data.begin(), reading.data.end());
    }
  }
  void answer(const Bytes& bytes) { arrive(frame_of(kResponse, bytes)); }
  void answer_all(const Sent& request) {
    answer({0x05, 0x62, request.bytes[2], request.bytes[3], 0x09, 0xC4, 0xCC, 0xCC});
  }
  std::vector<double> times_ms() const {
    std::vector<double> all;
    for (const Sent& each : sent) all.push_back(static_cast<double>(each.t.ns()) / 1e6);
    return all;
  }

  UdsClient client;
  TxGate gate{{}, Control::kObserve};
  std::array<bool, kBusMax> up{true, true};
  MonoTime t{};
  std::vector<Sent> sent;
  std::vector<UdsReading> readings;
  std::vector<Bytes> data;
};

const Config kOnePressure =
    config_of(Diagnostics::kPoll, {role_of(Role::kSecondaryPressure, 0x1101, 50.0)});

TEST(UdsClient, ListeningSendsNothingAndTakesEveryonesAnswers) {
  Config config = kOnePressure;
  config.diagnostics = Diagnostics::kListen;
  Bench bench(config);
  bench.run(kSecond);
  bench.answer({0x05, 0x62, 0x11, 0x01, 0x09, 0xC4, 0xCC, 0xCC});
  bench.answer({0x05, 0x62, 0x11, 0x02, 0xFF, 0xFF, 0xCC, 0xCC});  // another identifier
  bench.answer({0x03, 0x7F, 0x22, 0x31, 0xCC, 0xCC, 0xCC, 0xCC});
  bench.arrive(frame_of({0x7EA, false}, {0x05, 0x62, 0x11, 0x01, 0, 0, 0, 0}));  // another ECU
  bench.arrive(frame_of({0x7E9, true}, {0x05, 0x62, 0x11, 0x01, 0, 0, 0, 0}));
  bench.run(kSecond);
  EXPECT_TRUE(bench.sent.empty());
  ASSERT_EQ(bench.readings.size(), 1U);
  EXPECT_EQ(bench.data[0], (Bytes{0x09, 0xC4}));
  EXPECT_EQ(bench.readings[0].roles[0], Role::kSecondaryPressure);
  EXPECT_EQ(bench.readings[0].t, MonoTime{kSecond + kMillisecond});
}

// Four values of an ECU, two bytes each, in two requests: three identifiers fit in a frame.
Config four_values(std::uint8_t service, std::uint16_t bytes) {
  constexpr std::array kRoles{Role::kPrimarySpeed, Role::kSecondarySpeed, Role::kSecondaryPressure,
                              Role::kEngineTorque};
  std::vector<RoleBinding> roles;
  for (std::size_t i = 0; i < kRoles.size(); ++i) {
    roles.push_back(role_of(kRoles[i], static_cast<std::uint16_t>(0x10 + i), 50.0));
    roles.back().uds->service = service;
    roles.back().uds->bytes = bytes;
  }
  return config_of(Diagnostics::kPoll, std::move(roles));
}

// Answers with its own name as the data of each identifier, on CAN FD where it must.
void answer_several(Bench& bench, const Sent& request) {
  const std::size_t width = request.bytes[1] == 0x22 ? 2 : 1;
  Bytes answer{static_cast<std::uint8_t>(request.bytes[1] + 0x40)};
  for (std::size_t at = 2; at <= request.bytes[0]; at += width) {
    for (std::size_t i = 0; i < width; ++i) answer.push_back(request.bytes[at + i]);
    answer.push_back(request.bytes[at + width - 1]);
    answer.push_back(0x77);
  }
  Bytes single{static_cast<std::uint8_t>(answer.size())};
  if (answer.size() > 7) single.insert(single.begin(), 0x00);
  single.insert(single.end(), answer.begin(), answer.end());
  can::CanFrame frame = frame_of(kResponse, single);
  frame.fd = single.size() > 8;
  bench.arrive(frame);
}

TEST(UdsClient, AsksForSeveralIdentifiersAtOnce) {
  Bench bench(four_values(0x22, 2));
  bench.run(kSecond, [&](const Sent& request) { answer_several(bench, request); });
  ASSERT_EQ(bench.sent.size(), 40U);
  EXPECT_EQ(bench.sent[0].bytes, (Bytes{0x07, 0x22, 0x00, 0x10, 0x00, 0x11, 0x00, 0x12}));
  EXPECT_EQ(bench.sent[1].bytes, (Bytes{0x03, 0x22, 0x00, 0x13, 0xCC, 0xCC, 0xCC, 0xCC}));
  ASSERT_EQ(bench.readings.size(), 80U);
  for (std::size_t i = 0; i < 4; ++i) {
    EXPECT_EQ(bench.readings[i].roles[0], bench.readings[i + 4].roles[0]);
    EXPECT_EQ(bench.data[i], (Bytes{static_cast<std::uint8_t>(0x10 + i), 0x77}));
  }
}

TEST(UdsClient, AsksForLocalIdentifiers) {
  Bench bench(four_values(0x21, 2));
  bench.run(kSecond, [&](const Sent& request) { answer_several(bench, request); });
  ASSERT_EQ(bench.sent.size(), 20U);  // six would fit
  EXPECT_EQ(bench.sent[0].bytes, (Bytes{0x05, 0x21, 0x10, 0x11, 0x12, 0x13, 0xCC, 0xCC}));
  EXPECT_EQ(bench.readings.size(), 80U);
  // The same number by the other service is another identifier.
  bench.answer({0x05, 0x62, 0x00, 0x10, 1, 2, 0xCC, 0xCC});
  EXPECT_EQ(bench.readings.size(), 80U);
}

TEST(UdsClient, AnEcuThatRefusesSeveralIsAskedForOneAtATime) {
  Bench bench(four_values(0x22, 2));
  bench.run(kSecond, [&](const Sent& request) {
    if (request.bytes[0] > 3) {
      bench.answer({0x03, 0x7F, 0x22, 0x13, 0xCC, 0xCC, 0xCC, 0xCC});
    } else {
      answer_several(bench, request);
    }
  });
  ASSERT_GT(bench.sent.size(), 70U);
  for (std::size_t i = 1; i < bench.sent.size(); ++i) EXPECT_EQ(bench.sent[i].bytes[0], 3);
  EXPECT_GT(bench.readings.size(), 70U);
  EXPECT_EQ(bench.client.counters().refusals, 1U);
}

// Foreign data of unknown length end what can be told apart.
TEST(UdsClient, AnAnswerIsTakenAsFarAsItsLengthsAreKnown) {
  Config config = four_values(0x22, 2);
  config.diagnostics = Diagnostics::kListen;
  Bench bench(config);
  bench.answer({0x07, 0x62, 0x00, 0x10, 1, 2, 0x00, 0x11});
  ASSERT_EQ(bench.readings.size(), 2U);  // its data are cut: the monitor refuses them
  EXPECT_EQ(bench.data[0], (Bytes{1, 2}));
  EXPECT_TRUE(bench.data[1].empty());
  bench.answer({0x06, 0x62, 0x77, 0x77, 1, 0x00, 0x10, 0xCC});
  EXPECT_EQ(bench.readings.size(), 2U);
}

TEST(UdsClient, PollsAtItsPeriod) {
  Bench bench(kOnePressure);
  bench.run(kSecond, [&](const Sent& request) { bench.answer_all(request); });
  ASSERT_EQ(bench.sent.size(), 20U);
  EXPECT_EQ(bench.readings.size(), 20U);
  for (std::size_t i = 0; i < 20; ++i) {
    EXPECT_EQ(bench.sent[i].bytes, (Bytes{0x03, 0x22, 0x11, 0x01, 0xCC, 0xCC, 0xCC, 0xCC}));
    EXPECT_EQ(bench.sent[i].t, MonoTime{i * 50 * kMillisecond});
  }
  EXPECT_EQ(bench.client.counters().answers, 20U);
  EXPECT_EQ(bench.gate.refused(), 0U);
}

// Two identifiers of one ECU: the second waits for the answer to the first.
TEST(UdsClient, OneRequestAtATimeToAnEcu) {
  Bench bench(config_of(Diagnostics::kPoll, {role_of(Role::kPrimaryPressure, 0x1100, 20.0),
                                             role_of(Role::kSecondaryPressure, 0x1101, 50.0)}));
  std::size_t open = 0;
  std::vector<std::size_t> count(2);
  for (int step = 0; step < 200; ++step) {
    const std::size_t before = bench.sent.size();
    bench.run(kStep);
    const std::size_t fresh = bench.sent.size() - before;
    open += fresh;
    EXPECT_LE(open, 1U) << step;
    // Answered every third step.
    if (open == 1 && step % 3 == 0) {
      ++count[bench.sent.back().bytes[3]];
      bench.answer_all(bench.sent.back());
      open = 0;
    }
  }
  EXPECT_GT(count[0], 30U);
  EXPECT_NEAR(static_cast<double>(count[1]), 20.0, 2.0);
  EXPECT_EQ(bench.gate.refused(), 0U);
}

TEST(UdsClient, ASilentEcuIsAskedLessAndLess) {
  Bench bench(kOnePressure);
  bench.run(60 * kSecond);
  EXPECT_TRUE(bench.readings.empty());
  const auto times = bench.times_ms();
  // 150 ms for the answer and the pause: 50, 100, 200 ... 3200, then 5000.
  ASSERT_GE(times.size(), 9U);
  double expected = 0.0, pause = 50.0;
  for (const double at : times) {
    EXPECT_NEAR(at, expected, 1e-6);
    expected += 150.0 + pause;
    pause = std::min(2.0 * pause, 5000.0);
  }
  EXPECT_EQ(bench.client.counters().timeouts, bench.sent.size());
  // It answers again, and is asked at its period from then on.
  bench.sent.clear();
  bench.run(11 * kSecond, [&](const Sent& request) { bench.answer_all(request); });
  EXPECT_GT(bench.sent.size(), 100U);
  EXPECT_EQ(bench.gate.refused(), 0U);
}

TEST(UdsClient, ABusyEcuIsAskedAgainSoonAndOneThatRefusesNot) {
  for (const bool ever : {false, true}) {
    Bench bench(kOnePressure);
    const std::uint8_t code = ever ? 0x31 : 0x21;
    bench.run(59 * kSecond, [&](const Sent&) { bench.answer({0x03, 0x7F, 0x22, code}); });
    EXPECT_TRUE(bench.readings.empty());
    EXPECT_EQ(bench.client.counters().refusals, bench.sent.size());
    EXPECT_EQ(bench.client.counters().last_code, code);
    if (ever) {
      EXPECT_EQ(bench.sent.size(), 1U);
      bench.run(2 * kSecond);
      EXPECT_EQ(bench.sent.size(), 2U);
    } else {
      EXPECT_GT(bench.sent.size(), 10U);
      EXPECT_LT(bench.sent.size(), 25U);
      EXPECT_NEAR(bench.times_ms()[1], 55.0, 5.0);
    }
    EXPECT_EQ(bench.gate.refused(), 0U);
  }
}

TEST(UdsClient, PendingGivesTime) {
  Bench bench(kOnePressure);
  bench.run(kStep);
  ASSERT_EQ(bench.sent.size(), 1U);
  for (int i = 0; i < 3; ++i) {
    bench.answer({0x03, 0x7F, 0x22, 0x78});
    bench.run(4 * kSecond);
  }
  EXPECT_EQ(bench.sent.size(), 1U);  // still the first
  bench.answer({0x05, 0x62, 0x11, 0x01, 0x00, 0x07});
  ASSERT_EQ(bench.readings.size(), 1U);
  bench.run(kStep);
  EXPECT_EQ(bench.sent.size(), 2U);  // long due
  // Then silence: 5 s after the last word.
  bench.answer({0x03, 0x7F, 0x22, 0x78});
  bench.run(4990 * kMillisecond);
  EXPECT_EQ(bench.sent.size(), 2U);
  bench.run(70 * kMillisecond);
  EXPECT_EQ(bench.sent.size(), 3U);
  EXPECT_EQ(bench.client.counters().timeouts, 1U);
}

TEST(UdsClient, AnEcuThatIsPendingForEverIsGivenUp) {
  Bench bench(kOnePressure);
  bench.run(29 * kSecond, [&](const Sent&) { bench.answer({0x03, 0x7F, 0x22, 0x78}); });
  for (int i = 0; i < 40; ++i) {
    bench.answer({0x03, 0x7F, 0x22, 0x78});
    bench.run(kSecond);
  }
  EXPECT_GE(bench.client.counters().timeouts, 2U);
  EXPECT_EQ(bench.gate.refused(), 0U);
}

TEST(UdsClient, ALongAnswerGetsOneFlowControlAndTheStampOfItsFirstFrame) {
  Bench bench(kOnePressure);
  bench.run(kStep);
  bench.answer({0x10, 0x0A, 0x62, 0x11, 0x01, 1, 2, 3});
  bench.run(kStep);
  ASSERT_EQ(bench.sent.size(), 2U);
  EXPECT_EQ(bench.sent[1].bytes, (Bytes{0x30, 0x00, 0x00, 0xCC, 0xCC, 0xCC, 0xCC, 0xCC}));
  bench.answer({0x10, 0x0A, 0x62, 0x11, 0x01, 4, 5, 6});  // begins again
  const MonoTime first = bench.t + kMillisecond;
  bench.run(20 * kMillisecond);
  EXPECT_EQ(bench.sent.size(), 2U);
  bench.answer({0x21, 7, 8, 9, 10});
  ASSERT_EQ(bench.readings.size(), 1U);
  EXPECT_EQ(bench.data[0], (Bytes{4, 5, 6, 7, 8, 9, 10}));
  EXPECT_EQ(bench.readings[0].t, first);
  EXPECT_EQ(bench.gate.refused(), 0U);
}

TEST(UdsClient, AnAnswerThatIsTooLongIsRefused) {
  Bench bench(kOnePressure);
  bench.run(kStep);
  bench.answer({0x10, 0x00, 0x00, 0x01, 0x00, 0x00, 1, 2});
  bench.run(kStep);
  ASSERT_EQ(bench.sent.size(), 2U);
  EXPECT_EQ(bench.sent[1].bytes[0], 0x32);
  EXPECT_EQ(bench.gate.refused(), 0U);
}

TEST(UdsClient, AnAnswerThatNeverEndsIsGivenUp) {
  Bench bench(kOnePressure);
  bench.run(kStep);
  bench.answer({0x1F, 0xFF, 0x62, 0x11, 0x01, 1, 2, 3});
  for (unsigned i = 1; i <= 12; ++i) {
    bench.run(kSecond / 2);
    bench.answer({static_cast<std::uint8_t>(0x20 + i), 0, 0, 0, 0, 0, 0, 0});
  }
  EXPECT_GE(bench.client.counters().timeouts, 1U);
  EXPECT_GE(bench.sent.size(), 3U);  // request, flow control, and a new request
  EXPECT_TRUE(bench.readings.empty());
}

TEST(UdsClient, AnotherTesterHasTheRightOfWay) {
  Bench bench(kOnePressure);
  bench.run(kSecond, [&](const Sent& request) { bench.answer_all(request); });
  bench.sent.clear();
  bench.readings.clear();
  for (int i = 0; i < 10; ++i) {
    bench.arrive(frame_of(kRequest, {0x03, 0x22, 0x11, 0x01}));
    bench.answer({0x10, 0x0A, 0x62, 0x11, 0x01, 1, 2, 3});
    bench.arrive(frame_of(kRequest, {0x30, 0x00, 0x00}));
    bench.answer({0x21, 7, 8, 9, 10});
    bench.run(kSecond);
  }
  EXPECT_TRUE(bench.sent.empty());
  EXPECT_EQ(bench.readings.size(), 10U);  // its answers are values all the same
  bench.run(3990 * kMillisecond);
  EXPECT_TRUE(bench.sent.empty());
  bench.run(20 * kMillisecond);
  EXPECT_EQ(bench.sent.size(), 1U);
  EXPECT_EQ(bench.client.counters().foreign, 20U);
}

TEST(UdsClient, ABusThatDoesNotSendIsTriedFiveTimesASecond) {
  Bench bench(kOnePressure);
  bench.up = {false, true};
  bench.run(2 * kSecond);
  EXPECT_NEAR(static_cast<double>(bench.sent.size()), 10.0, 1.0);
  bench.up = {true, true};
  bench.sent.clear();
  bench.run(kSecond, [&](const Sent& request) { bench.answer_all(request); });
  EXPECT_GE(bench.sent.size(), 16U);
  // And a full queue.
  Bench full(kOnePressure);
  full.run(2 * kSecond, [&](const Sent& request) {
    full.client.on_send_failed(frame_of(kRequest, request.bytes), 0, full.t);
  });
  EXPECT_NEAR(static_cast<double>(full.sent.size()), 10.0, 1.0);
}

// The pipeline's view: a value with its age, and no value when the ECU refuses.
TEST(UdsClient, TheSignalIsValidOnlyWhileAnswersCome) {
  Pipeline pipeline(kOnePressure);
  const Role role = Role::kSecondaryPressure;
  std::uint64_t requests = 0;
  for (MonoTime t{}; t < MonoTime{10 * kSecond}; t += kStep) {
    Outbox outbox;
    pipeline.on_sample(t, outbox);
    for (std::size_t i = 0; i < outbox.size; ++i) {
      if (outbox.frames[i].id != kRequest) continue;
      ++requests;
      const Bytes answer = t < MonoTime{5 * kSecond} ? Bytes{0x05, 0x62, 0x11, 0x01, 0x01, 0xF4}
                                                     : Bytes{0x03, 0x7F, 0x22, 0x22};
      pipeline.on_frame({.t = t + kMillisecond, .frame = frame_of(kResponse, answer)});
    }
    const SignalObservation seen = pipeline.signal(role);
    if (t >= MonoTime{kStep} && t < MonoTime{5 * kSecond}) {
      ASSERT_EQ(seen.status.verdict, ReadingVerdict::kValid) << t;
      ASSERT_EQ(seen.value, 500e3);
    }
    if (t > MonoTime{5 * kSecond + 130 * kMillisecond}) {
      ASSERT_EQ(seen.status.verdict, ReadingVerdict::kStale) << t;
    }
  }
  EXPECT_GT(requests, 100U);
  EXPECT_EQ(pipeline.counters().frames_refused, 0U);
  EXPECT_EQ(pipeline.counters().diagnostics.answers, 100U);
}

TEST(UdsClient, AnAnswerThatIsTooShortIsABadFrameAndNoValue) {
  Config config = kOnePressure;
  config.diagnostics = Diagnostics::kListen;
  Pipeline pipeline(config);
  Outbox outbox;
  pipeline.on_sample(MonoTime{}, outbox);
  pipeline.on_frame(
      {.t = MonoTime::of_ns(1), .frame = frame_of(kResponse, {0x04, 0x62, 0x11, 0x01, 0x01})});
  EXPECT_EQ(pipeline.counters().frames_bad, 1U);
  EXPECT_FALSE(pipeline.signal(Role::kSecondaryPressure).seen);
  // All ones: not available.
  pipeline.on_frame({.t = MonoTime::of_ns(2),
                     .frame = frame_of(kResponse, {0x05, 0x62, 0x11, 0x01, 0xFF, 0xFF})});
  EXPECT_FALSE(pipeline.signal(Role::kSecondaryPressure).seen);
  pipeline.on_frame({.t = MonoTime::of_ns(3),
                     .frame = frame_of(kResponse, {0x05, 0x62, 0x11, 0x01, 0x00, 0x01})});
  EXPECT_EQ(pipeline.signal(Role::kSecondaryPressure).value, 1000.0);
}

// A further bus that is off or down is a fault, whatever is on it.
TEST(FurtherBus, ItsTroubleIsAFault) {
  for (const Role role : {Role::kSecondaryPressure, Role::kOilTemperature}) {
    Config config = config_of(Diagnostics::kListen, {role_of(role, 0x1101, 50.0)});
    config.roles[0].bus = 1;
    config.further_bus = FurtherBus{"diag", "can1", {}};
    config.trigger = Trigger::kAlways;
    Pipeline pipeline(config);
    EXPECT_EQ(pipeline.bus_count(), 2U);
    Outbox outbox;
    pipeline.on_frame(
        {.t = MonoTime{}, .frame = frame_of(kResponse, {0x05, 0x62, 0x11, 0x01, 0, 1})});
    EXPECT_FALSE(pipeline.signal(role).seen);  // that was bus 0
    pipeline.on_frame(
        {.t = MonoTime{}, .frame = frame_of(kResponse, {0x05, 0x62, 0x11, 0x01, 0, 1}), .bus = 1});
    EXPECT_TRUE(pipeline.signal(role).seen);
    EXPECT_EQ(pipeline.on_sample(MonoTime{}, outbox).faults & fault_bit(Fault::kBusDown), 0U);
    pipeline.on_bus_state(BusState::kDown, MonoTime{kStep}, 1);
    EXPECT_NE(pipeline.on_sample(MonoTime{kStep}, outbox).faults & fault_bit(Fault::kBusDown), 0U);
    can::CanFrame off;
    off.error = true;
    off.id = {0x40, false};
    off.length = 8;
    pipeline.on_frame({.t = MonoTime{kStep}, .frame = off, .bus = 1});
    EXPECT_NE(pipeline.on_sample(MonoTime{2 * kStep}, outbox).faults & fault_bit(Fault::kBusOff),
              0U);
    // Our own identifier on the further bus is not ours.
    pipeline.on_frame(
        {.t = MonoTime{kStep}, .frame = frame_of({0x6A1, false}, Bytes(8)), .bus = 1});
    EXPECT_EQ(
        pipeline.on_sample(MonoTime{3 * kStep}, outbox).faults & fault_bit(Fault::kForeignSender),
        0U);
  }
}

}  // namespace
}  // namespace beltgrip::daemon
