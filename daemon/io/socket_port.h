// SocketCAN as a Port: one interface, or two that are waited for together. Frames of both come in
// the order of their stamps. The real-time thread's.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "daemon/core/base/port.h"
#include "daemon/core/base/result.h"
#include "daemon/io/can_socket.h"

namespace beltgrip::daemon {

// An interface to open, and the key that names it in the configuration.
struct BusToOpen {
  std::string interface;
  std::string key;
};

class SocketPort final : public Port {
 public:
  // Receives `wanted` and the controller's error frames of one bus, or of up to kBusMax.
  // wait_until returns kClosed once stop_fd is readable (a signalfd or eventfd; -1: never).
  static Result<std::unique_ptr<SocketPort>> open(const std::string& interface,
                                                  const std::vector<WantedFrames>& wanted,
                                                  int stop_fd);
  static Result<std::unique_ptr<SocketPort>> open(const std::vector<BusToOpen>& buses,
                                                  const std::vector<WantedFrames>& wanted,
                                                  int stop_fd);

  MonoTime now() noexcept override;
  Wake wait_until(MonoTime deadline) noexcept override;
  std::size_t receive(std::span<RxFrame> out) noexcept override;
  SendResult send(const can::CanFrame& frame) noexcept override { return send_on(0, frame); }
  BusState bus_state() noexcept override { return bus_state_of(0); }
  SendResult send_on(std::uint8_t bus, const can::CanFrame& frame) noexcept override;
  BusState bus_state_of(std::uint8_t bus) noexcept override;
  void select(std::span<const WantedFrames> wanted) noexcept override;

 private:
  // Frames of one bus that have been read and not yet been taken.
  struct Waiting {
    std::array<RxFrame, CanSocket::kBatch> frames;
    std::size_t next = 0, end = 0;
    bool full = false;  // there may be more to read
    bool empty() const noexcept { return next == end; }
  };

  explicit SocketPort(int stop_fd) : stop_fd_(stop_fd) {}
  std::size_t receive_merged(std::span<RxFrame> out) noexcept;

  int stop_fd_;
  std::array<std::unique_ptr<CanSocket>, kBusMax> sockets_;
  std::size_t count_ = 0;
  std::array<Waiting, kBusMax> waiting_{};
};

}  // namespace beltgrip::daemon
