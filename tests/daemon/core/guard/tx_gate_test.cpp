// The transmit gate over every identifier, length and kind, and over what the bytes may say.
#include "daemon/core/guard/tx_gate.h"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

namespace beltgrip::daemon {
namespace {

// CRC-8, polynomial 0x1D, bit by bit: the test's own.
std::uint8_t reference_crc(std::uint16_t data_id, const can::CanFrame& frame) {
  std::vector<std::uint8_t> bytes{static_cast<std::uint8_t>(data_id & 0xFF),
                                  static_cast<std::uint8_t>(data_id >> 8)};
  bytes.insert(bytes.end(), frame.data.begin() + 1, frame.data.begin() + 8);
  unsigned crc = 0;
  for (const std::uint8_t byte : bytes) {
    for (int bit = 7; bit >= 0; --bit) {
      const unsigned out = (crc >> 7 ^ byte >> bit) & 1U;
      crc = (crc << 1 & 0xFFU) ^ (out != 0 ? 0x1DU : 0U);
    }
  }
  return static_cast<std::uint8_t>(crc);
}

can::CanFrame frame_of(std::uint32_t id, std::uint16_t data_id, std::uint8_t counter,
                       std::vector<std::uint8_t> rest = {}) {
  can::CanFrame frame;
  frame.id = {id, false};
  frame.length = 8;
  for (std::size_t i = 0; i < rest.size(); ++i) frame.data[i + 1] = rest[i];
  frame.data[1] = static_cast<std::uint8_t>((frame.data[1] & 0xF0U) | counter);
  frame.data[0] = reference_crc(data_id, frame);
  return frame;
}

// A request of any force may stand at once.
constexpr ClampLimits kAnyRequest{0.0, 65535.0, 1U << 30, 0, 0.0};

bool permits(const can::CanFrame& frame, Control control = Control::kObserve) {
  TxGate gate(FrameIdentifiers{}, control, kAnyRequest);
  const bool permitted = gate.permits(frame);
  EXPECT_EQ(gate.refused(), permitted ? 0U : 1U);
  return permitted;
}

TEST(TxGate, EveryIdentifierLengthAndKind) {
  enum Kind { kData, kRemote, kError, kFd, kExtended };
  for (const Control control : {Control::kObserve, Control::kCommand}) {
    std::uint64_t passed = 0;
    for (std::uint32_t id = 0; id <= can::kStandardIdMax; ++id) {
      for (std::uint8_t length = 0; length <= 8; ++length) {
        for (const Kind kind : {kData, kRemote, kError, kFd, kExtended}) {
          can::CanFrame frame = frame_of(id, static_cast<std::uint16_t>(id), 0);
          frame.length = length;
          for (std::size_t i = length; i < 8; ++i) frame.data[i] = 0;
          frame.remote = kind == kRemote;
          frame.error = kind == kError;
          frame.fd = kind == kFd;
          frame.id.extended = kind == kExtended;
          const bool listed = id == 0x6A0 || id == 0x6A1 || id == 0x6A3 ||
                              (id == 0x6A2 && control == Control::kCommand);
          const bool expected = listed && length == 8 && kind == kData;
          ASSERT_EQ(permits(frame, control), expected)
              << "id " << id << " length " << int{length} << " kind " << kind;
          passed += expected ? 1 : 0;
        }
      }
    }
    EXPECT_EQ(passed, control == Control::kCommand ? 4U : 3U);
  }
}

TEST(TxGate, ExamplesOfTheInterface) {
  can::CanFrame estimate = frame_of(0x6A0, 0x6A0, 3);
  ASSERT_EQ(estimate.data[0], 0xF4);
  EXPECT_TRUE(permits(estimate));
  can::CanFrame clamp = frame_of(0x6A2, 0x6A2, 5, {0x05, 0x01, 0xA6, 0x0B});
  ASSERT_EQ(clamp.data[0], 0x0E);
  EXPECT_TRUE(permits(clamp, Control::kCommand));
  EXPECT_FALSE(permits(clamp, Control::kObserve));
}

TEST(TxGate, EveryBitFlipIsRefused) {
  const can::CanFrame good = frame_of(0x6A1, 0x6A1, 7, {0x37, 1, 2, 3, 4, 5, 6});
  ASSERT_TRUE(permits(good));
  for (std::size_t bit = 0; bit < 64; ++bit) {
    can::CanFrame bad = good;
    bad.data[bit / 8] = static_cast<std::uint8_t>(bad.data[bit / 8] ^ (1U << bit % 8));
    EXPECT_FALSE(permits(bad)) << bit;
  }
}

TEST(TxGate, CounterMustFollow) {
  for (std::uint8_t last = 0; last <= 14; ++last) {
    for (std::uint8_t now = 0; now <= 15; ++now) {
      TxGate gate(FrameIdentifiers{}, Control::kObserve);
      ASSERT_TRUE(gate.permits(frame_of(0x6A3, 0x6A3, last)));
      const bool expected = now == (last + 1) % 15;
      EXPECT_EQ(gate.permits(frame_of(0x6A3, 0x6A3, now)), expected) << int{last} << int{now};
    }
  }
}

TEST(TxGate, NoCounterIsFifteen) {
  TxGate gate(FrameIdentifiers{}, Control::kObserve);
  EXPECT_FALSE(gate.permits(frame_of(0x6A3, 0x6A3, 15)));
}

TEST(TxGate, RefusalDoesNotSilenceForEver) {
  TxGate gate(FrameIdentifiers{}, Control::kObserve);
  ASSERT_TRUE(gate.permits(frame_of(0x6A3, 0x6A3, 0)));
  can::CanFrame bad = frame_of(0x6A3, 0x6A3, 1);
  bad.data[7] = 1;
  EXPECT_FALSE(gate.permits(bad));
  EXPECT_TRUE(gate.permits(frame_of(0x6A3, 0x6A3, 2)));
  EXPECT_FALSE(gate.permits(frame_of(0x6A3, 0x6A3, 2)));
  EXPECT_EQ(gate.refused(), 2U);
}

TEST(TxGate, EveryKindAndValidityOfTheEstimate) {
  for (unsigned bits = 0; bits < 16; ++bits) {
    const unsigned kind = bits & 3U;
    const bool valid = (bits & 4U) != 0;
    const bool reserved = (bits & 8U) != 0;
    const bool expected = kind <= 2 && (!valid || kind == 1) && !reserved;
    EXPECT_EQ(permits(frame_of(0x6A0, 0x6A0, 0, {static_cast<std::uint8_t>(bits << 4)})), expected)
        << bits;
  }
}

TEST(TxGate, EveryCodeOfTheStatus) {
  for (unsigned state = 0; state < 16; ++state) {
    for (unsigned byte = 0; byte < 256; ++byte) {
      const bool expected = state <= 7 && (byte >> 2 & 31U) <= 20 && byte < 128;
      EXPECT_EQ(permits(frame_of(
                    0x6A3, 0x6A3, 0,
                    {static_cast<std::uint8_t>(state << 4), static_cast<std::uint8_t>(byte)})),
                expected)
          << state << " " << byte;
    }
  }
}

TEST(TxGate, ClampIsActiveWithAForceOrNeither) {
  const auto clamp = [](std::uint8_t active, std::uint8_t low, std::uint8_t high,
                        std::uint8_t beyond) {
    return permits(frame_of(0x6A2, 0x6A2, 0, {0, active, low, high, beyond}), Control::kCommand);
  };
  EXPECT_TRUE(clamp(0, 0, 0, 0));
  EXPECT_TRUE(clamp(1, 1, 0, 0));
  EXPECT_TRUE(clamp(1, 0, 1, 0));
  EXPECT_FALSE(clamp(1, 0, 0, 0));
  EXPECT_FALSE(clamp(0, 1, 0, 0));
  EXPECT_FALSE(clamp(2, 1, 0, 0));
  EXPECT_FALSE(clamp(1, 1, 0, 1));
}

// A bit that the interface keeps free, with a right CRC: no program that knows it writes it.
TEST(TxGate, EveryReservedBitAlone) {
  struct Case {
    std::uint16_t id;
    std::vector<std::uint8_t> sound;     // bytes 1 to 7
    std::vector<std::uint8_t> reserved;  // bits of them
  };
  for (const Case& c :
       {Case{0x6A0, {0x50, 1, 2, 3, 4, 5, 6}, {0x80, 0, 0, 0, 0, 0, 0}},
        Case{0x6A1, {0x70, 1, 2, 3, 4, 5, 6}, {0x80, 0, 0, 0, 0, 0, 0}},
        Case{0x6A2, {0, 1, 0x10, 0x27, 0, 0, 0}, {0xF0, 0xFE, 0, 0, 0xFF, 0xFF, 0xFF}},
        Case{0x6A3, {0x20, 0x04, 1, 2, 0x0F, 0, 0}, {0, 0x80, 0, 0, 0xF0, 0xFF, 0xFF}}}) {
    EXPECT_TRUE(permits(frame_of(c.id, c.id, 0, c.sound), Control::kCommand)) << c.id;
    for (std::size_t bit = 0; bit < 56; ++bit) {
      if ((c.reserved[bit / 8] >> bit % 8 & 1U) == 0) continue;
      std::vector<std::uint8_t> bytes = c.sound;
      bytes[bit / 8] = static_cast<std::uint8_t>(bytes[bit / 8] | 1U << bit % 8);
      EXPECT_FALSE(permits(frame_of(c.id, c.id, 0, bytes), Control::kCommand))
          << c.id << " " << bit;
    }
  }
}

// Clamp frames in a row with the right counter.
class Requests {
 public:
  explicit Requests(const ClampLimits& limits)
      : gate_(FrameIdentifiers{}, Control::kCommand, limits) {}
  bool ask(unsigned force_N) {
    const can::CanFrame frame = frame_of(
        0x6A2, 0x6A2, counter_,
        {0, static_cast<std::uint8_t>(force_N > 0), static_cast<std::uint8_t>(force_N & 255U),
         static_cast<std::uint8_t>(force_N >> 8)});
    counter_ = static_cast<std::uint8_t>((counter_ + 1) % 15);
    return gate_.permits(frame);
  }
  void prepare(double acting_N = 3000.0) {
    gate_.see_acting_force(acting_N);
    for (int i = 0; i < 5; ++i) EXPECT_TRUE(ask(0));
  }

  TxGate& gate() { return gate_; }

 private:
  TxGate gate_;
  std::uint8_t counter_ = 0;
};

TEST(TxGate, NoRequestWithoutLimits) {
  Requests requests{ClampLimits{}};
  requests.prepare();
  EXPECT_FALSE(requests.ask(3000));
}

TEST(TxGate, EachLimitOfARequestAlone) {
  const ClampLimits limits{1000.0, 4.0, 20, limits::kInactiveFrames, 0.2};
  const auto prepared = [&limits] {
    Requests requests(limits);
    requests.prepare();
    return requests;
  };
  Requests early(limits);
  for (int i = 0; i < 4; ++i) EXPECT_TRUE(early.ask(0));
  EXPECT_FALSE(early.ask(3000));  // five inactive frames first

  Requests falls = prepared();
  EXPECT_TRUE(falls.ask(3000));
  EXPECT_TRUE(falls.ask(3000));
  EXPECT_TRUE(falls.ask(2996));
  EXPECT_FALSE(falls.ask(2991));
  EXPECT_FALSE(falls.ask(2996));  // over: inactive frames before the next
  falls.prepare();
  EXPECT_TRUE(falls.ask(2900));

  Requests rises = prepared();
  EXPECT_TRUE(rises.ask(3000));
  EXPECT_FALSE(rises.ask(3001));

  Requests floor = prepared();
  EXPECT_FALSE(floor.ask(999));
  floor.prepare();
  EXPECT_TRUE(floor.ask(1000));
  EXPECT_FALSE(floor.ask(999));

  Requests lasts = prepared();
  for (int i = 0; i < 20; ++i) EXPECT_TRUE(lasts.ask(3000));
  EXPECT_FALSE(lasts.ask(3000));

  Requests pause = prepared();
  EXPECT_TRUE(pause.ask(3000));
  for (int i = 0; i < 4; ++i) EXPECT_TRUE(pause.ask(0));
  EXPECT_FALSE(pause.ask(3000));
}

// At 80 % of the force that acts, smoothed; and never where that is not known.
TEST(TxGate, ARequestBeginsAtTheForceThatActs) {
  const ClampLimits limits{1000.0, 4.0, 20};
  Requests at(limits);
  at.prepare(3000.0);
  EXPECT_TRUE(at.ask(2400));
  EXPECT_TRUE(at.ask(2396));  // and may fall from there

  Requests below(limits);
  below.prepare(3000.0);
  EXPECT_FALSE(below.ask(2399));

  for (const double unknown : {0.0, -1.0, std::nan("")}) {
    Requests blind(limits);
    blind.prepare(3000.0);
    blind.gate().see_acting_force(unknown);
    EXPECT_FALSE(blind.ask(3000)) << unknown;
  }
  Requests noisy(limits);
  noisy.prepare(3000.0);
  noisy.gate().see_acting_force(6000.0);  // one reading moves it by 150 N
  EXPECT_FALSE(noisy.ask(2519));
  noisy.prepare(0.0);
  noisy.prepare(3000.0);
  noisy.gate().see_acting_force(6000.0);
  EXPECT_TRUE(noisy.ask(2520));
  Requests risen(limits);
  risen.prepare(3000.0);
  for (int i = 0; i < 100; ++i) risen.gate().see_acting_force(6000.0);
  EXPECT_FALSE(risen.ask(4700));
}

TEST(TxGate, ConfiguredIdentifiersKeepTheirDataIds) {
  const FrameIdentifiers identifiers{0x100, 0x101, 0x102, 0x103};
  TxGate gate(identifiers, Control::kObserve);
  EXPECT_TRUE(gate.permits(frame_of(0x100, 0x6A0, 0)));
  EXPECT_FALSE(gate.permits(frame_of(0x101, 0x101, 0)));  // data id is the default identifier
  EXPECT_FALSE(gate.permits(frame_of(0x6A0, 0x6A0, 0)));
  EXPECT_FALSE(gate.permits(frame_of(0x102, 0x6A2, 0)));
}

// --- requests for diagnostics ---------------------------------------------------------------

can::CanFrame request_of(std::uint32_t id, std::vector<std::uint8_t> bytes) {
  can::CanFrame frame;
  frame.id = {id, id > can::kStandardIdMax};
  frame.length = 8;
  frame.data.fill(0);
  std::fill_n(frame.data.begin(), 8, std::uint8_t{0xCC});
  std::copy(bytes.begin(), bytes.end(), frame.data.begin());
  return frame;
}

PollLimits two_identifiers() {
  PollLimits limits;
  limits.requests[0] = {0, {0x7E1, false}, 0x1101, 50 * kMillisecond};
  limits.requests[1] = {1, {0x18DA10F1, true}, 0xF190, 100 * kMillisecond};
  limits.size = 2;
  return limits;
}

TEST(TxGatePoll, OnlyTheListedRequestOnItsBus) {
  const auto permits = [](const can::CanFrame& frame, std::uint8_t bus) {
    TxGate gate({}, Control::kCommand, kAnyRequest, two_identifiers());
    return gate.permits(frame, bus, MonoTime{});
  };
  for (std::uint32_t id = 0; id <= can::kStandardIdMax; ++id) {
    for (const std::uint8_t bus : {std::uint8_t{0}, std::uint8_t{1}}) {
      const bool passed = permits(request_of(id, {0x03, 0x22, 0x11, 0x01}), bus);
      ASSERT_EQ(passed, id == 0x7E1 && bus == 0) << id << " " << int{bus};
    }
  }
  EXPECT_TRUE(permits(request_of(0x18DA10F1, {0x03, 0x22, 0xF1, 0x90}), 1));
  EXPECT_FALSE(permits(request_of(0x18DA10F1, {0x03, 0x22, 0x11, 0x01}), 1));
  EXPECT_FALSE(permits(request_of(0x18DA10F1, {0x03, 0x22, 0xF1, 0x90}), 0));
  // Own frames stay on their bus.
  EXPECT_TRUE(permits(frame_of(0x6A0, 0x6A0, 0), 0));
  EXPECT_FALSE(permits(frame_of(0x6A0, 0x6A0, 0), 1));
}

TEST(TxGatePoll, SeveralListedIdentifiersOfOneService) {
  PollLimits limits;
  limits.requests[0] = {0, {0x7E1, false}, 0x1101, 50 * kMillisecond};
  limits.requests[1] = {0, {0x7E1, false}, 0x1102, 50 * kMillisecond};
  limits.requests[2] = {0, {0x7E1, false}, 0x0003, 50 * kMillisecond, 0x21};
  limits.requests[3] = {0, {0x7E2, false}, 0x1103, 50 * kMillisecond};
  limits.size = 4;
  MonoTime t{};
  TxGate gate({}, Control::kObserve, {}, limits);
  const auto permits = [&](std::initializer_list<std::uint8_t> bytes, Duration later = kSecond) {
    return gate.permits(request_of(0x7E1, bytes), 0, t += later);
  };
  EXPECT_TRUE(permits({0x05, 0x22, 0x11, 0x01, 0x11, 0x02}));
  EXPECT_TRUE(permits({0x30, 0, 0}, Duration{}));
  EXPECT_FALSE(permits({0x30, 0, 0}, Duration{}));  // one for the whole request
  EXPECT_TRUE(permits({0x02, 0x21, 0x03}));
  EXPECT_FALSE(permits({0x05, 0x22, 0x11, 0x01, 0x11, 0x01}));              // twice
  EXPECT_FALSE(permits({0x05, 0x22, 0x11, 0x01, 0x11, 0x03}));              // another ECU's
  EXPECT_FALSE(permits({0x07, 0x22, 0x11, 0x01, 0x11, 0x02, 0x00, 0x03}));  // another service's
  EXPECT_FALSE(permits({0x04, 0x22, 0x11, 0x01, 0x11}));                    // half an identifier
  EXPECT_FALSE(permits({0x08, 0x22, 0x11, 0x01, 0x11, 0x02, 0x11, 0x01}));
  EXPECT_FALSE(permits({0x01, 0x22}));
  EXPECT_FALSE(permits({0x01, 0x21}));
  EXPECT_FALSE(permits({0x02, 0x21, 0x04}));
  // Each keeps its own period.
  EXPECT_TRUE(permits({0x03, 0x22, 0x11, 0x02}));
  EXPECT_FALSE(permits({0x05, 0x22, 0x11, 0x01, 0x11, 0x02}, 10 * kMillisecond));
  EXPECT_TRUE(permits({0x03, 0x22, 0x11, 0x01}, Duration{}));
}

// Every pair of the first two bytes, and every data identifier: no other service passes.
TEST(TxGatePoll, OnlyReadingAndOnlyTheListedIdentifier) {
  TxGate gate({}, Control::kCommand, kAnyRequest, two_identifiers());
  MonoTime t{};
  for (unsigned first = 0; first < 256; ++first) {
    for (unsigned second = 0; second < 256; ++second) {
      const bool listed = first == 0x03 && second == 0x22;
      const auto frame = request_of(
          0x7E1, {static_cast<std::uint8_t>(first), static_cast<std::uint8_t>(second), 0x11, 0x01});
      ASSERT_EQ(gate.permits(frame, 0, t += kSecond), listed) << first << " " << second;
    }
  }
  for (unsigned identifier = 0; identifier <= 0xFFFF; ++identifier) {
    const auto frame = request_of(0x7E1, {0x03, 0x22, static_cast<std::uint8_t>(identifier >> 8),
                                          static_cast<std::uint8_t>(identifier & 0xFF)});
    ASSERT_EQ(gate.permits(frame, 0, t += kSecond), identifier == 0x1101) << identifier;
  }
  can::CanFrame odd = request_of(0x7E1, {0x03, 0x22, 0x11, 0x01});
  for (std::uint8_t length = 0; length < 8; ++length) {
    odd.length = length;
    EXPECT_FALSE(gate.permits(odd, 0, t += kSecond));
  }
  odd.length = 8;
  for (bool can::CanFrame::*kind :
       {&can::CanFrame::remote, &can::CanFrame::error, &can::CanFrame::fd}) {
    odd.*kind = true;
    EXPECT_FALSE(gate.permits(odd, 0, t += kSecond));
    odd.*kind = false;
  }
  EXPECT_TRUE(gate.permits(odd, 0, t += kSecond));
  // What stands behind the end of the list is not listed.
  EXPECT_FALSE(gate.permits(request_of(0, {0x03, 0x22, 0, 0}), 0, t += kSecond));
}

TEST(TxGatePoll, NoneWithoutAllowance) {
  TxGate gate({}, Control::kCommand, kAnyRequest);
  EXPECT_FALSE(gate.permits(request_of(0x7E1, {0x03, 0x22, 0x11, 0x01}), 0, MonoTime{kSecond}));
  EXPECT_FALSE(gate.permits(request_of(0x7E1, {0x30, 0, 0}), 0, MonoTime{kSecond}));
}

TEST(TxGatePoll, NoMoreOftenThanItsPeriod) {
  const can::CanFrame request = request_of(0x7E1, {0x03, 0x22, 0x11, 0x01});
  TxGate gate({}, Control::kObserve, {}, two_identifiers());
  int passed = 0;
  for (MonoTime t{}; t < MonoTime{10 * kSecond}; t += kMillisecond)
    passed += gate.permits(request, 0, t);
  EXPECT_GE(passed, 200);
  EXPECT_LE(passed, 202);
  // Early by half a period, and not a tick more.
  TxGate early({}, Control::kObserve, {}, two_identifiers());
  EXPECT_TRUE(early.permits(request, 0, MonoTime{kSecond}));
  EXPECT_FALSE(early.permits(request, 0, MonoTime{kSecond + 25 * kMillisecond} - kNanosecond));
  EXPECT_TRUE(early.permits(request, 0, MonoTime{kSecond + 25 * kMillisecond}));
  // One that was late lets the next come on the grid, not earlier.
  EXPECT_TRUE(gate.permits(request, 0, MonoTime{20 * kSecond + 20 * kMillisecond}));
  EXPECT_FALSE(gate.permits(request, 0, MonoTime{20 * kSecond + 40 * kMillisecond}));
  EXPECT_TRUE(gate.permits(request, 0, MonoTime{20 * kSecond + 50 * kMillisecond}));
}

TEST(TxGatePoll, OneFlowControlForARequest) {
  TxGate gate({}, Control::kObserve, {}, two_identifiers());
  const can::CanFrame flow = request_of(0x7E1, {0x30, 0, 0});
  EXPECT_FALSE(gate.permits(flow, 0, MonoTime{}));
  EXPECT_TRUE(gate.permits(request_of(0x7E1, {0x03, 0x22, 0x11, 0x01}), 0, MonoTime{}));
  EXPECT_FALSE(gate.permits(request_of(0x7E1, {0x31, 0, 0}), 0, MonoTime::of_ns(1)));  // wait
  EXPECT_FALSE(gate.permits(request_of(0x7E1, {0x30, 1, 0}), 0, MonoTime::of_ns(1)));
  EXPECT_TRUE(gate.permits(flow, 0, MonoTime::of_ns(1)));
  EXPECT_FALSE(gate.permits(flow, 0, MonoTime::of_ns(2)));
  EXPECT_EQ(gate.refused(), 4U);
}

TEST(TxGatePoll, FlowControlGoesWhereTheRequestWent) {
  TxGate gate({}, Control::kObserve, {}, two_identifiers());
  ASSERT_TRUE(gate.permits(request_of(0x7E1, {0x03, 0x22, 0x11, 0x01}), 0, MonoTime{}));
  EXPECT_FALSE(gate.permits(request_of(0x7E1, {0x30, 0, 0}), 1, MonoTime::of_ns(1)));
  EXPECT_FALSE(gate.permits(request_of(0x7E2, {0x30, 0, 0}), 0, MonoTime::of_ns(1)));
  EXPECT_FALSE(gate.permits(request_of(0x18DA10F1, {0x30, 0, 0}), 1, MonoTime::of_ns(1)));
  EXPECT_TRUE(gate.permits(request_of(0x7E1, {0x30, 0, 0}), 0, MonoTime::of_ns(1)));
}

// As many as the list holds, and as many of them as a frame holds.
TEST(TxGatePoll, AFullListAndAFullRequest) {
  PollLimits limits;
  for (std::size_t i = 0; i < PollLimits::kMost; ++i) {
    limits.requests[i] = {
        0, {0x7E1, false}, static_cast<std::uint16_t>(0x1100 + i), 50 * kMillisecond};
  }
  limits.size = PollLimits::kMost;
  TxGate gate({}, Control::kObserve, {}, limits);
  EXPECT_TRUE(
      gate.permits(request_of(0x7E1, {0x07, 0x22, 0x11, 0, 0x11, 1, 0x11, 31}), 0, MonoTime{}));
  EXPECT_FALSE(gate.permits(request_of(0x7E1, {0x03, 0x22, 0x11, 32}), 0, MonoTime{}));
  EXPECT_FALSE(gate.permits(request_of(0x7E2, {0x30, 0, 0}), 0, MonoTime::of_ns(1)));
  EXPECT_TRUE(gate.permits(request_of(0x7E1, {0x30, 0, 0}), 0, MonoTime::of_ns(1)));
}

}  // namespace
}  // namespace beltgrip::daemon
