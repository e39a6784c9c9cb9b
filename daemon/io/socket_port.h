// A SocketCAN raw socket as a Port. Kernel filters let only the wanted identifiers through; stamps
// are the kernel's, brought to the monotonic clock. After open() nothing is allocated. The
// real-time thread's.
//
// What the interface does (measured on vcan, Linux 6.1) and what happens here:
//   down       one read says ENETDOWN, writes too; the same socket works after up: stay, report
//   kDown
//              until something is received or sent again
//   deleted    reads say ENODEV, writes ENXIO for ever: close, and open again by name with a pause
//              that grows from 0.1 s to 5 s; report kAbsent
//   queue full writes say EAGAIN or ENOBUFS: kFull, the frame is dropped, the next one is newer
#pragma once

#include <linux/can.h>
#include <sys/socket.h>

#include <array>
#include <memory>
#include <string>
#include <variant>
#include <vector>

#include "daemon/core/port.h"
#include "daemon/io/stamp.h"

namespace beltgrip::daemon {

struct BusError {
  std::string text;  // one line
};

class SocketPort final : public Port {
 public:
  // Receives `identifiers` and the controller's error frames. wait_until returns kClosed once
  // stop_fd is readable (a signalfd or eventfd; -1: never).
  static std::variant<std::unique_ptr<SocketPort>, BusError> open(
      const std::string& interface, const std::vector<can::CanId>& identifiers, int stop_fd);
  ~SocketPort() override;
  SocketPort(const SocketPort&) = delete;
  SocketPort& operator=(const SocketPort&) = delete;

  MonoTime now() noexcept override;
  Wake wait_until(MonoTime deadline) noexcept override;
  std::size_t receive(std::span<RxFrame> out) noexcept override;
  SendResult send(const can::CanFrame& frame) noexcept override;
  BusState bus_state() noexcept override { return state_; }

 private:
  static constexpr std::size_t kBatch = 64;
  static constexpr std::size_t kControlSize = 128;

  SocketPort(const std::string& interface, const std::vector<can::CanId>& identifiers, int stop_fd);
  // 0, or the errno of the call that failed; where says which.
  int open_socket(const char*& where) noexcept;
  void close_socket() noexcept;
  void try_reopen(MonoTime t) noexcept;
  void lost(int error) noexcept;
  // False for what is no whole frame.
  bool convert(const mmsghdr& message, const canfd_frame& raw, RxFrame& out) noexcept;

  std::array<char, 16> interface_{};
  std::vector<can_filter> filters_;
  int stop_fd_;
  int socket_ = -1;
  BusState state_ = BusState::kActive;
  MonoTime reopen_at_ = 0;
  Duration reopen_pause_ = 0;

  // One batch.
  std::array<mmsghdr, kBatch> headers_{};
  std::array<iovec, kBatch> vectors_{};
  std::array<canfd_frame, kBatch> raw_{};
  alignas(cmsghdr) std::array<std::array<char, kControlSize>, kBatch> control_{};

  StampConverter stamps_;
  std::uint32_t kernel_drops_ = 0;
  std::uint32_t drops_reported_ = 0;
};

}  // namespace beltgrip::daemon
