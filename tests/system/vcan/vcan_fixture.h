// A network namespace with vcan interfaces for each test, and a raw socket that looks at the bus
// without any code of BeltGrip. Needs a kernel with SocketCAN: run through tests/system/vcan/run.
#pragma once

#include <gtest/gtest.h>
#include <linux/can.h>

#include <chrono>
#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "tests/support/process.h"

namespace beltgrip::test {

// Generous: it only ends a test that has already failed. The clock of an emulated machine runs on
// while it waits for a file of its host (to start `tc`: 0.3 s, 10 and more than 30 s where the host
// is busy).
inline constexpr Milliseconds kLimit{300'000};

struct ReceivedFrame {
  std::int64_t t_ns = 0;  // receive stamp of the kernel, wall clock
  canfd_frame frame{};    // can_id with its flag bits
  bool fd = false;
};

class BusSocket {
 public:
  // Takes all frames; with error_frames those too. Never sees what it sent itself.
  explicit BusSocket(const std::string& interface, bool error_frames = false);
  ~BusSocket();
  BusSocket(const BusSocket&) = delete;
  BusSocket& operator=(const BusSocket&) = delete;

  void send(canid_t id, const std::vector<std::uint8_t>& data) const;
  void send_fd(canid_t id, const std::vector<std::uint8_t>& data) const;
  // The next frame, or nothing within the limit or once the interface has gone down.
  std::optional<ReceivedFrame> receive(Milliseconds limit) const;
  // The first frame for which `wanted` holds; the frames before it are dropped.
  std::optional<ReceivedFrame> receive_until(
      const std::function<bool(const ReceivedFrame&)>& wanted, Milliseconds limit) const;

 private:
  int fd_ = -1;
};

// Runs `ip ARGUMENTS...`; a failure fails the test.
void ip(const std::vector<std::string>& arguments);

class Vcan : public testing::Test {
 protected:
  void SetUp() override;  // a new namespace with vcan0 up
  void TearDown() override;

  static void add_interface(const std::string& name);
  // A fresh folder of this test; gone afterwards.
  const std::string& folder() const { return folder_; }

 private:
  std::string folder_;
};

}  // namespace beltgrip::test
