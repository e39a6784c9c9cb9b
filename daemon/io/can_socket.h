// One SocketCAN raw socket: kernel filters let only the wanted identifiers through; stamps are the
// kernel's, brought to the monotonic clock. After open() nothing is allocated. The real-time
// thread's.
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
#include <limits>
#include <span>
#include <string>

#include "daemon/core/base/port.h"
#include "daemon/io/stamp.h"

namespace beltgrip::daemon {

class CanSocket {
 public:
  static constexpr std::size_t kBatch = 64;
  static constexpr MonoTime kNever = MonoTime::max();

  // Of `wanted` it takes those of `bus`, which is what its frames are marked with.
  CanSocket(const std::string& interface, std::span<const WantedFrames> wanted, std::uint8_t bus);
  ~CanSocket() { close_socket(); }
  CanSocket(const CanSocket&) = delete;
  CanSocket& operator=(const CanSocket&) = delete;

  // 0, or the errno of the call that failed; where says which.
  int open(const char*& where) noexcept;
  // A socket that is gone is opened again once its pause is over.
  void try_reopen(MonoTime t) noexcept;
  MonoTime reopen_at() const noexcept { return socket_ < 0 ? reopen_at_ : kNever; }
  int descriptor() const noexcept { return socket_; }  // -1 while it is gone

  // Takes at most out.size() and kBatch frames.
  std::size_t receive(std::span<RxFrame> out) noexcept;
  SendResult send(const can::CanFrame& frame) noexcept;
  BusState state() const noexcept { return state_; }
  void select(std::span<const WantedFrames> wanted) noexcept;

 private:
  static constexpr std::size_t kControlSize = 128;

  bool set_filters() noexcept;
  void close_socket() noexcept;
  void lost(int error) noexcept;
  // False for what is no whole frame.
  bool convert(const mmsghdr& message, const canfd_frame& raw, RxFrame& out) noexcept;

  std::array<char, 16> interface_{};
  static constexpr std::size_t kFilters = 64;  // more than roles, requests and own frames
  std::array<can_filter, kFilters> filters_{};
  std::size_t filter_count_ = 0;
  std::uint8_t bus_;
  int socket_ = -1;
  BusState state_ = BusState::kActive;
  MonoTime reopen_at_;
  Duration reopen_pause_;

  // One batch.
  std::array<mmsghdr, kBatch> headers_{};
  std::array<iovec, kBatch> vectors_{};
  std::array<canfd_frame, kBatch> raw_{};
  alignas(cmsghdr) std::array<std::array<char, kControlSize>, kBatch> control_{};

  StampConverter stamps_;
  std::uint32_t kernel_drops_ = 0;
  std::uint32_t drops_reported_ = 0;
};

MonoTime monotonic_now() noexcept;

}  // namespace beltgrip::daemon
