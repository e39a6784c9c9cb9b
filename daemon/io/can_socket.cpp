#include "daemon/io/can_socket.h"

#include <linux/can/error.h>
#include <linux/can/raw.h>
#include <linux/net_tstamp.h>
#include <net/if.h>
#include <sys/ioctl.h>
#include <time.h>
#include <unistd.h>

#include <algorithm>
#include <cassert>
#include <cerrno>
#include <cstring>

#include "can_dbc/dbc/message_index.h"

namespace beltgrip::daemon {

namespace {

constexpr Duration kReopenFirst = 100 * kMillisecond;
constexpr Duration kReopenMaximum = 5 * kSecond;

std::int64_t nanoseconds(const timespec& time) noexcept {
  return (std::int64_t{time.tv_sec} * kSecond).ns() + time.tv_nsec;
}

std::int64_t clock_ns(clockid_t clock) noexcept {
  timespec time{};
  clock_gettime(clock, &time);
  return nanoseconds(time);
}

template <typename T>
bool set_option(int fd, int level, int name, const T& value) noexcept {
  return setsockopt(fd, level, name, &value, sizeof value) == 0;
}

can_filter filter_of(const WantedFrames& wanted) noexcept {
  if (wanted.every) return {0, 0};
  // Exactly this identifier of this kind, or any of its parameter group, and no remote frames.
  return {wanted.id.value | (wanted.id.extended ? CAN_EFF_FLAG : 0),
          can::identifier_mask(wanted.id, wanted.by_group) | CAN_EFF_FLAG | CAN_RTR_FLAG};
}

}  // namespace

MonoTime monotonic_now() noexcept { return MonoTime::of_ns(clock_ns(CLOCK_MONOTONIC)); }

CanSocket::CanSocket(const std::string& interface, std::span<const WantedFrames> wanted,
                     std::uint8_t bus)
    : bus_(bus) {
  interface.copy(interface_.data(), interface_.size() - 1);
  select(wanted);
  for (std::size_t i = 0; i < kBatch; ++i) {
    vectors_[i] = {&raw_[i], sizeof raw_[i]};
    headers_[i].msg_hdr.msg_iov = &vectors_[i];
    headers_[i].msg_hdr.msg_iovlen = 1;
  }
}

int CanSocket::open(const char*& where) noexcept {
  where = "socket";
  socket_ = socket(PF_CAN, SOCK_RAW | SOCK_CLOEXEC | SOCK_NONBLOCK, CAN_RAW);
  if (socket_ < 0) return errno;
  const auto failed = [&](const char* call) {
    const int error = errno;
    where = call;
    close_socket();
    return error;
  };
  ifreq request{};
  std::copy(interface_.begin(), interface_.end(), request.ifr_name);
  if (ioctl(socket_, SIOCGIFINDEX, &request) != 0) return failed("look-up");
  if (!set_filters()) return failed("filters");
  const can_err_mask_t errors = CAN_ERR_CRTL | CAN_ERR_BUSOFF | CAN_ERR_RESTARTED;
  if (!set_option(socket_, SOL_CAN_RAW, CAN_RAW_ERR_FILTER, errors)) return failed("error filter");
  const int on = 1;
  // Our own frames come back once they have been sent: an echo is no foreign sender.
  if (!set_option(socket_, SOL_CAN_RAW, CAN_RAW_RECV_OWN_MSGS, on)) return failed("own frames");
  if (!set_option(socket_, SOL_SOCKET, SO_TIMESTAMPNS, on)) return failed("time stamps");
  if (!set_option(socket_, SOL_SOCKET, SO_RXQ_OVFL, on)) return failed("drop counter");
  // Without these the port still does its work: classic frames only, a longer queue.
  set_option(socket_, SOL_CAN_RAW, CAN_RAW_FD_FRAMES, on);
  const int smallest = 0;  // the kernel's minimum: a full queue is said at once, nothing grows old
  set_option(socket_, SOL_SOCKET, SO_SNDBUF, smallest);
  sockaddr_can address{};
  address.can_family = AF_CAN;
  address.can_ifindex = request.ifr_ifindex;
  if (bind(socket_, reinterpret_cast<const sockaddr*>(&address), sizeof address) != 0) {
    return failed("bind");
  }
  kernel_drops_ = 0;
  drops_reported_ = 0;
  state_ = BusState::kActive;
  return 0;
}

bool CanSocket::set_filters() noexcept {
  return setsockopt(socket_, SOL_CAN_RAW, CAN_RAW_FILTER, filters_.data(),
                    static_cast<socklen_t>(filter_count_ * sizeof(can_filter))) == 0;
}

void CanSocket::select(std::span<const WantedFrames> wanted) noexcept {
  filter_count_ = 0;
  for (const WantedFrames& each : wanted) {
    if (each.bus != bus_) continue;
    assert(filter_count_ < kFilters);
    filters_[filter_count_++] = filter_of(each);
  }
  // Where the kernel has no memory for them now, the socket is opened anew with them.
  if (socket_ >= 0 && !set_filters()) lost(EBADF);
}

void CanSocket::close_socket() noexcept {
  if (socket_ >= 0) close(socket_);
  socket_ = -1;
}

void CanSocket::try_reopen(MonoTime t) noexcept {
  if (socket_ >= 0 || t < reopen_at_) return;
  const char* where = "";
  if (open(where) == 0) return;
  state_ = BusState::kAbsent;
  reopen_pause_ = std::clamp(2 * reopen_pause_, kReopenFirst, kReopenMaximum);
  reopen_at_ = t + reopen_pause_;
}

void CanSocket::lost(int error) noexcept {
  if (error == ENETDOWN) {
    state_ = BusState::kDown;
  } else if (error == ENODEV || error == ENXIO || error == EBADF) {
    close_socket();
    state_ = BusState::kAbsent;
    reopen_pause_ = {};
    reopen_at_ = monotonic_now() + kReopenFirst;
  }
}

std::size_t CanSocket::receive(std::span<RxFrame> out) noexcept {
  if (socket_ < 0) return 0;
  const std::size_t wanted = std::min(out.size(), kBatch);
  for (std::size_t i = 0; i < wanted; ++i) {
    headers_[i].msg_hdr.msg_control = control_[i].data();
    headers_[i].msg_hdr.msg_controllen = kControlSize;
    headers_[i].msg_hdr.msg_flags = 0;
  }
  const int received =
      recvmmsg(socket_, headers_.data(), static_cast<unsigned>(wanted), MSG_DONTWAIT, nullptr);
  if (received < 0) {
    if (errno != EAGAIN && errno != EINTR) lost(errno);
    return 0;
  }
  if (state_ == BusState::kDown && received > 0) state_ = BusState::kActive;
  stamps_.read(monotonic_now(), clock_ns(CLOCK_REALTIME));
  std::size_t count = 0;
  for (std::size_t i = 0; i < static_cast<std::size_t>(received); ++i) {
    if (convert(headers_[i], raw_[i], out[count])) ++count;
  }
  return count;
}

bool CanSocket::convert(const mmsghdr& message, const canfd_frame& raw, RxFrame& out) noexcept {
  bool has_stamp = false;
  std::int64_t stamp = 0;
  msghdr header = message.msg_hdr;
  for (const cmsghdr* each = CMSG_FIRSTHDR(&header); each != nullptr;
       each = CMSG_NXTHDR(&header, const_cast<cmsghdr*>(each))) {
    if (each->cmsg_level != SOL_SOCKET) continue;
    if (each->cmsg_type == SO_TIMESTAMPNS) {
      timespec time;
      std::memcpy(&time, CMSG_DATA(each), sizeof time);
      stamp = nanoseconds(time);
      has_stamp = true;
    } else if (each->cmsg_type == SO_RXQ_OVFL) {
      std::memcpy(&kernel_drops_, CMSG_DATA(each), sizeof kernel_drops_);
    }
  }
  out = {};
  out.bus = bus_;
  out.t = stamps_.convert(has_stamp, stamp);
  const bool fd = message.msg_len == CANFD_MTU;
  if ((!fd && message.msg_len != CAN_MTU) || (header.msg_flags & MSG_TRUNC) != 0 ||
      raw.len > (fd ? CANFD_MAX_DLEN : CAN_MAX_DLEN)) {
    return false;
  }
  out.dropped_before = kernel_drops_ - drops_reported_;
  drops_reported_ = kernel_drops_;
  out.own_echo = (header.msg_flags & MSG_CONFIRM) != 0;
  can::CanFrame& frame = out.frame;
  frame.error = (raw.can_id & CAN_ERR_FLAG) != 0;
  frame.id.extended = !frame.error && (raw.can_id & CAN_EFF_FLAG) != 0;
  frame.id.value = raw.can_id & (frame.error         ? CAN_ERR_MASK
                                 : frame.id.extended ? CAN_EFF_MASK
                                                     : CAN_SFF_MASK);
  frame.remote = !frame.error && (raw.can_id & CAN_RTR_FLAG) != 0;
  frame.fd = fd;
  frame.bit_rate_switch = fd && (raw.flags & CANFD_BRS) != 0;
  frame.error_state_indicator = fd && (raw.flags & CANFD_ESI) != 0;
  frame.length = raw.len;
  if (!frame.remote) std::copy_n(raw.data, raw.len, frame.data.begin());
  return true;
}

SendResult CanSocket::send(const can::CanFrame& frame) noexcept {
  if (socket_ < 0) return SendResult::kDown;
  // One layout holds both formats; the size that is written says which it is.
  canfd_frame raw{};
  raw.can_id =
      frame.id.value | (frame.id.extended ? CAN_EFF_FLAG : 0) | (frame.remote ? CAN_RTR_FLAG : 0);
  raw.len = frame.length;
  raw.flags = static_cast<std::uint8_t>((frame.bit_rate_switch ? CANFD_BRS : 0) |
                                        (frame.error_state_indicator ? CANFD_ESI : 0));
  if (frame.error || frame.length > (frame.fd ? CANFD_MAX_DLEN : CAN_MAX_DLEN)) {
    return SendResult::kFailed;
  }
  std::copy_n(frame.data.begin(), frame.length, raw.data);
  const std::size_t size = frame.fd ? CANFD_MTU : CAN_MTU;
  if (::write(socket_, &raw, size) == static_cast<ssize_t>(size)) {
    if (state_ == BusState::kDown) state_ = BusState::kActive;
    return SendResult::kSent;
  }
  const int error = errno;
  if (error == EAGAIN || error == ENOBUFS || error == EINTR) return SendResult::kFull;
  lost(error);
  return state_ == BusState::kActive ? SendResult::kFailed : SendResult::kDown;
}

}  // namespace beltgrip::daemon
