// SocketPort on a real SocketCAN: what comes through, with which stamps and marks, and what the
// port does when the interface goes down, away, full or silent.
#include "daemon/io/socket_port.h"

#include <gtest/gtest.h>
#include <linux/can/error.h>
#include <sys/eventfd.h>
#include <unistd.h>

#include <array>

#include "tests/system/vcan/vcan_fixture.h"

namespace beltgrip::daemon {
namespace {

using test::BusSocket;
using test::ip;

constexpr Duration kLimit = 20 * kSecond;

class SocketPortTest : public test::Vcan {
 protected:
  std::unique_ptr<SocketPort> open(const std::vector<can::CanId>& identifiers, int stop_fd = -1) {
    std::vector<WantedFrames> wanted;
    for (const can::CanId id : identifiers) wanted.push_back({id, false});
    return open_wanted(wanted, stop_fd);
  }
  std::unique_ptr<SocketPort> open_wanted(const std::vector<WantedFrames>& wanted,
                                          int stop_fd = -1) {
    auto opened = SocketPort::open("vcan0", wanted, stop_fd);
    if (opened) return *std::move(opened);
    ADD_FAILURE() << opened.error();
    return nullptr;
  }
  // Frames until `count` have come or the limit is over.
  static std::vector<RxFrame> take(SocketPort& port, std::size_t count) {
    std::vector<RxFrame> all;
    const MonoTime limit = port.now() + kLimit;
    std::array<RxFrame, 16> batch;
    while (all.size() < count && port.wait_until(limit) == Wake::kFrames) {
      const std::size_t got = port.receive(batch);
      all.insert(all.end(), batch.begin(), batch.begin() + static_cast<std::ptrdiff_t>(got));
    }
    return all;
  }
  // Waits, taking frames, until the port says this of its link.
  static bool wait_for_state(SocketPort& port, BusState state) {
    const MonoTime limit = port.now() + kLimit;
    std::array<RxFrame, 16> batch;
    while (port.bus_state() != state && port.now() < limit) {
      if (port.wait_until(port.now() + 5 * kMillisecond) == Wake::kFrames) port.receive(batch);
    }
    return port.bus_state() == state;
  }
};

can::CanFrame frame_of(std::uint32_t id, std::initializer_list<std::uint8_t> data) {
  can::CanFrame frame;
  frame.id = {id, false};
  frame.length = static_cast<std::uint8_t>(data.size());
  std::copy(data.begin(), data.end(), frame.data.begin());
  return frame;
}

TEST_F(SocketPortTest, OnlyTheWantedIdentifiersComeThrough) {
  const auto port = open({{0x123, false}, {0x456, true}});
  ASSERT_NE(port, nullptr);
  const BusSocket bus("vcan0");
  bus.send(0x124, {9});
  bus.send(0x123 | CAN_EFF_FLAG, {9});
  bus.send(0x456, {9});
  bus.send(0x123 | CAN_RTR_FLAG, {});
  bus.send(0x123, {1, 2, 3});
  bus.send(0x456 | CAN_EFF_FLAG, {4, 5});
  std::vector<std::uint8_t> long_data(64);
  for (std::size_t i = 0; i < 64; ++i) long_data[i] = static_cast<std::uint8_t>(i);
  bus.send_fd(0x123, long_data);
  const auto frames = take(*port, 3);
  ASSERT_EQ(frames.size(), 3U);
  EXPECT_EQ(frames[0].frame, frame_of(0x123, {1, 2, 3}));
  EXPECT_EQ(frames[1].frame.id, (can::CanId{0x456, true}));
  EXPECT_EQ(frames[1].frame.length, 2);
  EXPECT_TRUE(frames[2].frame.fd);
  EXPECT_EQ(frames[2].frame.length, 64);
  EXPECT_TRUE(std::equal(long_data.begin(), long_data.end(), frames[2].frame.data.begin()));
  for (const RxFrame& each : frames) {
    EXPECT_FALSE(each.own_echo);
    EXPECT_EQ(each.dropped_before, 0U);
  }
}

TEST_F(SocketPortTest, StampsAreMonotonicAndOfTheArrival) {
  const auto port = open({{0x123, false}});
  ASSERT_NE(port, nullptr);
  const BusSocket bus("vcan0");
  const MonoTime before = port->now();
  for (std::uint8_t i = 0; i < 100; ++i) bus.send(0x123, {i});
  const MonoTime after = port->now();
  const auto frames = take(*port, 100);
  ASSERT_EQ(frames.size(), 100U);
  MonoTime last = before;
  for (const RxFrame& each : frames) {
    EXPECT_GE(each.t, last);
    EXPECT_LE(each.t, port->now());
    last = each.t;
  }
  // Stamped when they came, not when they were read.
  EXPECT_LE(frames[0].t, after + kMillisecond);
}

TEST_F(SocketPortTest, EchoesAreMarkedAndForeignFramesAreNot) {
  const auto port = open({{0x6A1, false}});
  ASSERT_NE(port, nullptr);
  const BusSocket bus("vcan0");
  EXPECT_EQ(port->send(frame_of(0x6A1, {1})), SendResult::kSent);
  auto frames = take(*port, 1);
  ASSERT_EQ(frames.size(), 1U);
  EXPECT_TRUE(frames[0].own_echo);
  bus.send(0x6A1, {2});
  frames = take(*port, 1);
  ASSERT_EQ(frames.size(), 1U);
  EXPECT_FALSE(frames[0].own_echo);
  EXPECT_EQ(frames[0].frame, frame_of(0x6A1, {2}));
  const auto seen = bus.receive(test::kLimit);
  ASSERT_TRUE(seen.has_value());
  EXPECT_EQ(seen->frame.can_id, 0x6A1U);
}

TEST_F(SocketPortTest, ErrorFramesComeAsSuch) {
  const auto port = open({{0x123, false}});
  ASSERT_NE(port, nullptr);
  const BusSocket bus("vcan0");
  bus.send(CAN_ERR_FLAG | CAN_ERR_ACK, {0, 0, 0, 0, 0, 0, 0, 0});  // not asked for
  bus.send(CAN_ERR_FLAG | CAN_ERR_BUSOFF, {0, 0, 0, 0, 0, 0, 0, 0});
  bus.send(CAN_ERR_FLAG | CAN_ERR_CRTL, {0, CAN_ERR_CRTL_TX_PASSIVE, 0, 0, 0, 0, 0, 0});
  const auto frames = take(*port, 2);
  ASSERT_EQ(frames.size(), 2U);
  EXPECT_TRUE(frames[0].frame.error);
  EXPECT_EQ(frames[0].frame.id.value, static_cast<std::uint32_t>(CAN_ERR_BUSOFF));
  EXPECT_EQ(frames[1].frame.data[1], CAN_ERR_CRTL_TX_PASSIVE);
}

TEST_F(SocketPortTest, AStopRequestClosesThePort) {
  const int stop = eventfd(0, EFD_CLOEXEC);
  const auto port = open({{0x123, false}}, stop);
  ASSERT_NE(port, nullptr);
  EXPECT_EQ(port->wait_until(port->now() + kMillisecond), Wake::kDeadline);
  eventfd_write(stop, 1);
  EXPECT_EQ(port->wait_until(port->now() + kLimit), Wake::kClosed);
  close(stop);
}

TEST_F(SocketPortTest, ALinkThatGoesDownAndUpIsTheSameSocket) {
  const auto port = open({{0x123, false}});
  ASSERT_NE(port, nullptr);
  ip({"link", "set", "vcan0", "down"});
  EXPECT_TRUE(wait_for_state(*port, BusState::kDown));
  EXPECT_EQ(port->send(frame_of(0x123, {1})), SendResult::kDown);
  // Said once: then there is nothing to read, and no busy loop.
  std::array<RxFrame, 4> batch;
  EXPECT_EQ(port->receive(batch), 0U);
  EXPECT_EQ(port->wait_until(port->now() + 20 * kMillisecond), Wake::kDeadline);
  ip({"link", "set", "vcan0", "up"});
  EXPECT_EQ(port->send(frame_of(0x123, {1})), SendResult::kSent);
  EXPECT_EQ(port->bus_state(), BusState::kActive);
  EXPECT_EQ(take(*port, 1).size(), 1U);
}

TEST_F(SocketPortTest, ReceivingAfterDownAndUpIsEnough) {
  const auto port = open({{0x123, false}});
  ASSERT_NE(port, nullptr);
  ip({"link", "set", "vcan0", "down"});
  EXPECT_TRUE(wait_for_state(*port, BusState::kDown));
  ip({"link", "set", "vcan0", "up"});
  const BusSocket bus("vcan0");
  bus.send(0x123, {1});
  EXPECT_EQ(take(*port, 1).size(), 1U);
  EXPECT_EQ(port->bus_state(), BusState::kActive);
}

TEST_F(SocketPortTest, ALinkThatIsDownAtTheStart) {
  ip({"link", "set", "vcan0", "down"});
  const auto port = open({{0x123, false}});
  ASSERT_NE(port, nullptr);
  EXPECT_TRUE(wait_for_state(*port, BusState::kDown));
  ip({"link", "set", "vcan0", "up"});
  EXPECT_EQ(port->send(frame_of(0x123, {1})), SendResult::kSent);
  EXPECT_EQ(port->bus_state(), BusState::kActive);
}

TEST_F(SocketPortTest, ADeletedLinkIsOpenedAgainWhenItIsBack) {
  const auto port = open({{0x123, false}});
  ASSERT_NE(port, nullptr);
  ip({"link", "del", "vcan0"});
  EXPECT_TRUE(wait_for_state(*port, BusState::kAbsent));
  EXPECT_EQ(port->send(frame_of(0x123, {1})), SendResult::kDown);
  std::array<RxFrame, 4> batch;
  EXPECT_EQ(port->receive(batch), 0U);
  // While it is away the port sleeps until its deadline, whatever it tries meanwhile.
  const MonoTime deadline = port->now() + 300 * kMillisecond;
  EXPECT_EQ(port->wait_until(deadline), Wake::kDeadline);
  EXPECT_GE(port->now(), deadline);
  EXPECT_EQ(port->bus_state(), BusState::kAbsent);
  add_interface("vcan0");
  EXPECT_TRUE(wait_for_state(*port, BusState::kActive));
  const BusSocket bus("vcan0");
  bus.send(0x123, {7});
  const auto frames = take(*port, 1);
  ASSERT_EQ(frames.size(), 1U);
  EXPECT_EQ(frames[0].frame, frame_of(0x123, {7}));
}

TEST_F(SocketPortTest, AMissingInterfaceIsOneLine) {
  for (const std::string name : {"can9", "lo"}) {
    auto opened = SocketPort::open(name, {}, -1);
    ASSERT_FALSE(opened);
    const std::string& error = opened.error();
    EXPECT_TRUE(error.starts_with("bus.interface: found no CAN interface \"" + name + "\""))
        << error;
    EXPECT_NE(error.find(", expected "), std::string::npos);
    EXPECT_EQ(error.find('\n'), std::string::npos);
  }
}

TEST_F(SocketPortTest, DroppedFramesAreCounted) {
  const auto port = open({{0x123, false}});
  ASSERT_NE(port, nullptr);
  const BusSocket bus("vcan0"), witness("vcan0");
  constexpr std::size_t kSent = 5000;
  // One at a time: a burst can overflow the kernel's input queue too (softnet_stat), where frames
  // are lost before any socket and no socket counts them.
  for (std::size_t i = 0; i < kSent; ++i) {
    bus.send(0x123, {1});
    ASSERT_TRUE(witness.receive(test::kLimit).has_value()) << i;
  }
  // The counter comes with the next frame that is received after the loss.
  std::size_t received = 0, dropped = 0;
  std::array<RxFrame, 64> batch;
  const MonoTime limit = port->now() + kLimit;
  while (received + dropped < kSent + 1 && port->now() < limit) {
    if (port->wait_until(port->now() + 50 * kMillisecond) == Wake::kDeadline) {
      bus.send(0x123, {2});
      continue;
    }
    const std::size_t count = port->receive(batch);
    for (std::size_t i = 0; i < count; ++i) dropped += batch[i].dropped_before;
    received += count;
  }
  EXPECT_GE(received + dropped, kSent + 1);
  EXPECT_GT(dropped, 1000U);
}

TEST_F(SocketPortTest, AFullQueueIsSaidAtOnce) {
  const auto port = open({{0x123, false}});
  ASSERT_NE(port, nullptr);
  const test::RunResult tc = test::run({"tc", "qdisc", "add", "dev", "vcan0", "root", "tbf", "rate",
                                        "8kbit", "burst", "100", "limit", "160"},
                                       test::kLimit);
  ASSERT_EQ(tc.status, 0) << tc.err;
  std::size_t sent = 0, full = 0;
  for (int i = 0; i < 100; ++i) {
    const SendResult result = port->send(frame_of(0x123, {1, 2, 3, 4, 5, 6, 7, 8}));
    sent += result == SendResult::kSent ? 1 : 0;
    full += result == SendResult::kFull ? 1 : 0;
  }
  EXPECT_EQ(sent + full, 100U);
  EXPECT_GT(full, 50U);
  EXPECT_EQ(port->bus_state(), BusState::kActive);
}

TEST_F(SocketPortTest, AParameterGroupComesFromEverySourceWithEveryPriority) {
  // EEC1 (0xF004, to all) and TSC1 (0x0000, to a destination).
  const auto port = open_wanted({{{0x0CF004FE, true}, true}, {{0x0C0000FE, true}, true}});
  ASSERT_NE(port, nullptr);
  const BusSocket bus("vcan0");
  bus.send(0x0CF00300 | CAN_EFF_FLAG, {9});  // another group
  bus.send(0x0DF00400 | CAN_EFF_FLAG, {9});  // another data page
  bus.send(0x0C010003 | CAN_EFF_FLAG, {9});
  bus.send(0x0CF00400 | CAN_EFF_FLAG | CAN_RTR_FLAG, {});
  bus.send(0x0CF00400 | CAN_EFF_FLAG, {1});
  bus.send(0x18F00431 | CAN_EFF_FLAG, {2});
  bus.send(0x0C00FF03 | CAN_EFF_FLAG, {3});
  const auto frames = take(*port, 3);
  ASSERT_EQ(frames.size(), 3U);
  for (std::size_t i = 0; i < 3; ++i) EXPECT_EQ(frames[i].frame.data[0], i + 1);
}

TEST_F(SocketPortTest, EveryKindIsSentButErrorFramesAndWhatIsTooLong) {
  const auto port = open({});
  ASSERT_NE(port, nullptr);
  const BusSocket bus("vcan0");
  can::CanFrame frame = frame_of(0x123, {1});
  frame.id = {0x12345678, true};
  frame.fd = true;
  frame.bit_rate_switch = true;
  frame.length = 12;
  EXPECT_EQ(port->send(frame), SendResult::kSent);
  auto seen = bus.receive(test::kLimit);
  ASSERT_TRUE(seen.has_value());
  EXPECT_TRUE(seen->fd);
  EXPECT_EQ(seen->frame.can_id, 0x12345678U | CAN_EFF_FLAG);
  EXPECT_EQ(seen->frame.len, 12);
  EXPECT_NE(seen->frame.flags & CANFD_BRS, 0);
  frame = frame_of(0x123, {});
  frame.remote = true;
  frame.length = 4;
  EXPECT_EQ(port->send(frame), SendResult::kSent);
  seen = bus.receive(test::kLimit);
  ASSERT_TRUE(seen.has_value());
  EXPECT_FALSE(seen->fd);
  EXPECT_EQ(seen->frame.can_id, 0x123U | CAN_RTR_FLAG);
  EXPECT_EQ(seen->frame.len, 4);

  frame = frame_of(0x40, {1});
  frame.error = true;
  EXPECT_EQ(port->send(frame), SendResult::kFailed);
  frame = frame_of(0x123, {1});
  frame.length = 9;
  EXPECT_EQ(port->send(frame), SendResult::kFailed);
}

class TwoBuses : public SocketPortTest {
 protected:
  void SetUp() override {
    SocketPortTest::SetUp();
    add_interface("vcan1");
    auto opened = SocketPort::open(
        {{"vcan0", "bus.interface"}, {"vcan1", "bus.diag.interface"}},
        {{{0x123, false}, false, 0}, {{0x123, false}, false, 1}, {{0x124, false}, false, 1}}, -1);
    ASSERT_TRUE(opened) << opened.error();
    port_ = *std::move(opened);
  }
  std::unique_ptr<SocketPort> port_;
};

TEST_F(TwoBuses, FramesComeInTheOrderOfTheirStampsEachWithItsBus) {
  const BusSocket first("vcan0"), second("vcan1");
  // The kernel begins to stamp on arrival a little after the first socket wants it; till then a
  // frame has the time at which it was read.
  for (const MonoTime limit = port_->now() + kLimit; port_->now() < limit;) {
    first.send(0x123, {0});
    const MonoTime sent = port_->now();
    const auto probe = take(*port_, 1);
    ASSERT_EQ(probe.size(), 1U);
    if (probe[0].t <= sent) break;
  }
  first.send(0x124, {99});  // wanted on the other only
  for (std::uint8_t i = 0; i < 200; ++i) {
    (i % 3 == 0 ? second : first).send(0x123, {i});
  }
  second.send(0x124, {200});
  const auto frames = take(*port_, 201);
  ASSERT_EQ(frames.size(), 201U);
  MonoTime last = frames[0].t;
  for (std::size_t i = 0; i < frames.size(); ++i) {
    EXPECT_EQ(frames[i].frame.data[0], i);
    EXPECT_EQ(frames[i].bus, i % 3 == 0 || i == 200 ? 1 : 0) << i;
    EXPECT_GE(frames[i].t, last);
    last = frames[i].t;
  }
}

TEST_F(TwoBuses, AFrameLeavesOnItsBus) {
  const BusSocket first("vcan0"), second("vcan1");
  EXPECT_EQ(port_->send_on(1, frame_of(0x124, {1})), SendResult::kSent);
  EXPECT_EQ(port_->send_on(0, frame_of(0x123, {2})), SendResult::kSent);
  EXPECT_EQ(port_->send_on(2, frame_of(0x123, {3})), SendResult::kDown);
  auto seen = second.receive(test::kLimit);
  ASSERT_TRUE(seen.has_value());
  EXPECT_EQ(seen->frame.can_id, 0x124U);
  seen = first.receive(test::kLimit);
  ASSERT_TRUE(seen.has_value());
  EXPECT_EQ(seen->frame.can_id, 0x123U);
  const auto echoes = take(*port_, 2);
  ASSERT_EQ(echoes.size(), 2U);
  EXPECT_TRUE(echoes[0].own_echo && echoes[1].own_echo);
}

TEST_F(TwoBuses, OneGoesDownAndTheOtherGoesOn) {
  ASSERT_NO_FATAL_FAILURE(ip({"link", "set", "vcan1", "down"}));
  const MonoTime limit = port_->now() + kLimit;
  std::array<RxFrame, 16> batch;
  while (port_->bus_state_of(1) != BusState::kDown && port_->now() < limit) {
    if (port_->wait_until(port_->now() + 5 * kMillisecond) == Wake::kFrames) port_->receive(batch);
  }
  EXPECT_EQ(port_->bus_state_of(1), BusState::kDown);
  EXPECT_EQ(port_->bus_state_of(0), BusState::kActive);
  const BusSocket first("vcan0");
  first.send(0x123, {7});
  EXPECT_EQ(take(*port_, 1).size(), 1U);
  EXPECT_EQ(port_->send_on(1, frame_of(0x124, {1})), SendResult::kDown);
  ASSERT_NO_FATAL_FAILURE(ip({"link", "set", "vcan1", "up"}));
  EXPECT_EQ(port_->send_on(1, frame_of(0x124, {1})), SendResult::kSent);
  EXPECT_EQ(port_->bus_state_of(1), BusState::kActive);
}

}  // namespace
}  // namespace beltgrip::daemon
