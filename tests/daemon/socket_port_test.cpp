// SocketPort on a real SocketCAN: what comes through, with which stamps and marks, and what the
// port does when the interface goes down, away, full or silent.
#include "daemon/io/socket_port.h"

#include <gtest/gtest.h>
#include <linux/can/error.h>
#include <sys/eventfd.h>
#include <unistd.h>

#include <array>

#include "tests/vcan/vcan_fixture.h"

namespace beltgrip::daemon {
namespace {

using test::BusSocket;
using test::ip;

constexpr Duration kLimit = 20 * kSecond;

class SocketPortTest : public test::Vcan {
 protected:
  std::unique_ptr<SocketPort> open(const std::vector<can::CanId>& identifiers, int stop_fd = -1) {
    auto opened = SocketPort::open("vcan0", identifiers, stop_fd);
    if (const auto* error = std::get_if<BusError>(&opened)) {
      ADD_FAILURE() << error->text;
      return nullptr;
    }
    return std::move(std::get<std::unique_ptr<SocketPort>>(opened));
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
    const auto* error = std::get_if<BusError>(&opened);
    ASSERT_NE(error, nullptr);
    EXPECT_TRUE(error->text.starts_with("bus.interface: found no CAN interface \"" + name + "\""))
        << error->text;
    EXPECT_NE(error->text.find(", expected "), std::string::npos);
    EXPECT_EQ(error->text.find('\n'), std::string::npos);
  }
}

TEST_F(SocketPortTest, DroppedFramesAreCounted) {
  const auto port = open({{0x123, false}});
  ASSERT_NE(port, nullptr);
  const BusSocket bus("vcan0");
  constexpr std::size_t kSent = 5000;
  for (std::size_t i = 0; i < kSent; ++i) bus.send(0x123, {1});
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

}  // namespace
}  // namespace beltgrip::daemon
