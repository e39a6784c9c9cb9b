#include "tests/system/vcan/vcan_fixture.h"

#include <fcntl.h>
#include <linux/can/error.h>
#include <linux/can/raw.h>
#include <net/if.h>
#include <poll.h>
#include <sched.h>
#include <sys/ioctl.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <ctime>
#include <filesystem>
#include <system_error>

namespace beltgrip::test {
namespace {

[[noreturn]] void fail(const std::string& what) {
  throw std::system_error(errno, std::generic_category(), what);
}

template <typename T>
void set_option(int fd, int level, int name, const T& value) {
  if (setsockopt(fd, level, name, &value, sizeof value) != 0) fail("setsockopt");
}

template <typename Frame>
void send_frame(int fd, canid_t id, const std::vector<std::uint8_t>& data) {
  Frame frame{};
  if (data.size() > sizeof frame.data) throw std::length_error("payload");
  frame.can_id = id;
  frame.len = static_cast<std::uint8_t>(data.size());
  std::copy(data.begin(), data.end(), frame.data);
  if (write(fd, &frame, sizeof frame) != sizeof frame) fail("write");
}

}  // namespace

BusSocket::BusSocket(const std::string& interface, bool error_frames)
    : fd_(socket(PF_CAN, SOCK_RAW | SOCK_CLOEXEC, CAN_RAW)) {
  if (fd_ < 0) fail("socket(PF_CAN)");
  set_option(fd_, SOL_CAN_RAW, CAN_RAW_FD_FRAMES, 1);
  set_option(fd_, SOL_SOCKET, SO_TIMESTAMPNS, 1);
  set_option(fd_, SOL_SOCKET, SO_RCVBUF, 4 << 20);
  if (error_frames) set_option(fd_, SOL_CAN_RAW, CAN_RAW_ERR_FILTER, can_err_mask_t{CAN_ERR_MASK});
  sockaddr_can address{};
  address.can_family = AF_CAN;
  address.can_ifindex = static_cast<int>(if_nametoindex(interface.c_str()));
  if (address.can_ifindex == 0) fail(interface);
  if (bind(fd_, reinterpret_cast<sockaddr*>(&address), sizeof address) != 0) fail("bind");
}

BusSocket::~BusSocket() { close(fd_); }

void BusSocket::send(canid_t id, const std::vector<std::uint8_t>& data) const {
  send_frame<can_frame>(fd_, id, data);
}

void BusSocket::send_fd(canid_t id, const std::vector<std::uint8_t>& data) const {
  send_frame<canfd_frame>(fd_, id, data);
}

std::optional<ReceivedFrame> BusSocket::receive(Milliseconds limit) const {
  pollfd waiting{fd_, POLLIN, 0};
  if (poll(&waiting, 1, static_cast<int>(limit.count())) <= 0) return std::nullopt;
  ReceivedFrame seen;
  iovec part{&seen.frame, sizeof seen.frame};
  alignas(cmsghdr) std::array<char, 256> control{};
  msghdr message{};
  message.msg_iov = &part;
  message.msg_iovlen = 1;
  message.msg_control = control.data();
  message.msg_controllen = control.size();
  const ssize_t size = recvmsg(fd_, &message, 0);
  if (size < 0 && (errno == ENETDOWN || errno == ENODEV)) return std::nullopt;
  if (size < 0) fail("recvmsg");
  seen.fd = size == CANFD_MTU;
  for (cmsghdr* each = CMSG_FIRSTHDR(&message); each; each = CMSG_NXTHDR(&message, each)) {
    if (each->cmsg_level != SOL_SOCKET || each->cmsg_type != SCM_TIMESTAMPNS) continue;
    timespec stamp{};
    std::memcpy(&stamp, CMSG_DATA(each), sizeof stamp);
    seen.t_ns = stamp.tv_sec * 1'000'000'000 + stamp.tv_nsec;
  }
  return seen;
}

std::optional<ReceivedFrame> BusSocket::receive_until(
    const std::function<bool(const ReceivedFrame&)>& wanted, Milliseconds limit) const {
  const auto deadline = std::chrono::steady_clock::now() + limit;
  for (;;) {
    const auto left = std::chrono::ceil<Milliseconds>(deadline - std::chrono::steady_clock::now());
    if (left.count() <= 0) return std::nullopt;
    const std::optional<ReceivedFrame> seen = receive(left);
    if (!seen || wanted(*seen)) return seen;
  }
}

void ip(const std::vector<std::string>& arguments) {
  std::vector<std::string> argv{"ip"};
  argv.insert(argv.end(), arguments.begin(), arguments.end());
  const RunResult result = run(argv, kLimit);
  ASSERT_EQ(result.status, 0) << result.err;
}

void Vcan::add_interface(const std::string& name) {
  ASSERT_NO_FATAL_FAILURE(ip({"link", "add", name, "type", "vcan"}));
  ASSERT_NO_FATAL_FAILURE(ip({"link", "set", name, "up"}));
}

void Vcan::SetUp() {
  ASSERT_EQ(unshare(CLONE_NEWNET), 0)
      << "run this through tests/system/vcan/run: " << strerror(errno);
  ASSERT_NO_FATAL_FAILURE(add_interface("vcan0"));
  std::string name = std::filesystem::temp_directory_path() / "beltgrip_vcan.XXXXXX";
  ASSERT_NE(mkdtemp(name.data()), nullptr) << strerror(errno);
  folder_ = name;
}

void Vcan::TearDown() {
  if (!folder_.empty()) std::filesystem::remove_all(folder_);
}

}  // namespace beltgrip::test
