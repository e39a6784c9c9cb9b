// The embedded bus in virtual and in real time.
#include "daemon/io/inproc_bus.h"

#include <gtest/gtest.h>

#include <array>
#include <thread>
#include <vector>

namespace beltgrip::daemon {
namespace {

can::CanFrame numbered(std::uint32_t number) {
  can::CanFrame frame;
  frame.id = {number & can::kStandardIdMax, false};
  frame.length = 4;
  for (std::size_t i = 0; i < 4; ++i) frame.data[i] = static_cast<std::uint8_t>(number >> 8 * i);
  return frame;
}

TEST(InprocBus, VirtualTimePassesOnlyWhileAllWait) {
  const auto bus = InprocBus::create(InprocBus::Clock::kVirtual);
  const auto port = bus->connect();
  EXPECT_EQ(port->now(), MonoTime{});
  EXPECT_EQ(port->wait_until(MonoTime{3 * kSecond}), Wake::kDeadline);
  EXPECT_EQ(port->now(), MonoTime{3 * kSecond});
  EXPECT_EQ(port->wait_until(MonoTime{kSecond}), Wake::kDeadline);  // has been
  EXPECT_EQ(port->now(), MonoTime{3 * kSecond});
  EXPECT_EQ(port->wait_until(InprocBus::kNever), Wake::kClosed);  // nobody is left to send
}

TEST(InprocBus, FramesReachAllWithTheirInstantAndTheirSenderAsEcho) {
  const auto bus = InprocBus::create(InprocBus::Clock::kVirtual);
  auto sender = bus->connect();
  std::array<std::vector<MonoTime>, 2> seen;
  std::array<std::unique_ptr<Port>, 2> ports{bus->connect(), bus->connect()};
  std::array<std::thread, 2> threads;
  for (std::size_t i = 0; i < 2; ++i) {
    threads[i] = std::thread([&, i] {
      std::array<RxFrame, 3> batch;
      while (ports[i]->wait_until(InprocBus::kNever) == Wake::kFrames) {
        const std::size_t count = ports[i]->receive(batch);
        for (std::size_t k = 0; k < count; ++k) {
          EXPECT_EQ(batch[k].frame, numbered(static_cast<std::uint32_t>(seen[i].size())));
          EXPECT_FALSE(batch[k].own_echo);
          seen[i].push_back(batch[k].t);
        }
      }
      ports[i].reset();
    });
  }
  std::uint32_t echoes = 0;
  const auto take_echoes = [&] {
    std::array<RxFrame, 1> own;
    while (sender->receive(own) == 1) {
      EXPECT_TRUE(own[0].own_echo);
      EXPECT_EQ(own[0].frame, numbered(echoes++));
    }
  };
  for (std::uint32_t i = 0; i < 100; ++i) {
    take_echoes();
    sender->wait_until(MonoTime{i / 5 * kMillisecond});  // five at an instant
    EXPECT_EQ(sender->send(numbered(i)), SendResult::kSent);
  }
  take_echoes();
  EXPECT_EQ(echoes, 100U);
  sender.reset();
  for (auto& thread : threads) thread.join();
  for (const auto& times : seen) {
    ASSERT_EQ(times.size(), 100U);
    for (std::size_t i = 0; i < times.size(); ++i) {
      EXPECT_EQ(times[i], MonoTime{i / 5 * kMillisecond});
    }
  }
}

// A sender connected later has sent before a receiver that is due at the same instant looks.
TEST(InprocBus, AtTheSameInstantTheLaterConnectedRunsFirst) {
  const auto bus = InprocBus::create(InprocBus::Clock::kVirtual);
  const auto first = bus->connect();
  auto second = bus->connect();
  std::thread sender([&] {
    for (std::uint32_t i = 1; i <= 50; ++i) {
      std::array<RxFrame, 4> echoes;
      second->receive(echoes);
      second->wait_until(MonoTime{i * 5 * kMillisecond});
      second->send(numbered(i));
    }
    second.reset();
  });
  std::array<RxFrame, 4> batch;
  for (std::uint32_t i = 1; i <= 50; ++i) {
    const MonoTime deadline{i * 5 * kMillisecond};
    EXPECT_EQ(first->wait_until(deadline), Wake::kFrames);
    EXPECT_EQ(first->receive(batch), 1U);
    EXPECT_EQ(batch[0].t, deadline);
    EXPECT_EQ(first->wait_until(deadline), Wake::kDeadline);
  }
  sender.join();
}

TEST(InprocBus, AFullRingDropsAndCounts) {
  const auto bus = InprocBus::create(InprocBus::Clock::kVirtual);
  const auto sender = bus->connect();
  const auto receiver = bus->connect();
  for (std::uint32_t i = 0; i < 5000; ++i) sender->send(numbered(i));
  std::vector<RxFrame> all(6000);
  EXPECT_EQ(receiver->receive(all), 4096U);
  EXPECT_EQ(all[4095].frame, numbered(4095));
  sender->send(numbered(1));
  EXPECT_EQ(receiver->receive(all), 1U);
  EXPECT_EQ(all[0].dropped_before, 904U);
}

TEST(InprocBus, RealTime) {
  const auto bus = InprocBus::named("test");
  EXPECT_EQ(bus, InprocBus::named("test"));
  EXPECT_NE(bus, InprocBus::named("other"));
  const auto receiver = bus->connect();
  const MonoTime start = receiver->now();
  EXPECT_EQ(receiver->wait_until(start + 2 * kMillisecond), Wake::kDeadline);
  EXPECT_GE(receiver->now(), start + 2 * kMillisecond);
  std::thread sender([&] {
    const auto port = InprocBus::named("test")->connect();
    port->send(numbered(7));
    bus->close();
    EXPECT_EQ(port->send(numbered(8)), SendResult::kDown);
    EXPECT_EQ(port->bus_state(), BusState::kDown);
  });
  EXPECT_EQ(receiver->wait_until(InprocBus::kNever), Wake::kFrames);
  std::array<RxFrame, 4> batch;
  EXPECT_EQ(receiver->receive(batch), 1U);
  EXPECT_GE(batch[0].t, start);
  EXPECT_LE(batch[0].t, receiver->now());
  EXPECT_EQ(receiver->wait_until(InprocBus::kNever), Wake::kClosed);
  sender.join();
}

}  // namespace
}  // namespace beltgrip::daemon
