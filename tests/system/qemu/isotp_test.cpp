// The daemon's ISO-TP against the kernel's: an ECU, and another tester, that leave the protocol to
// Linux (can-isotp): single frames, first frame with flow control and consecutive frames, padding
// judged strictly. In the emulated machine, whose kernel has that module:
// tests/system/qemu/run build/tests/isotp_test
#include <linux/can/isotp.h>
#include <net/if.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <array>
#include <atomic>
#include <cerrno>
#include <cmath>
#include <csignal>
#include <numbers>
#include <system_error>
#include <thread>

#include "tests/support/assertions.h"
#include "tests/system/vcan/uds_rig.h"

namespace beltgrip::test {
namespace {

// One end of a connection on vcan1; the kernel does the rest.
class IsoTpSocket {
 public:
  IsoTpSocket(canid_t sends, canid_t receives, const can_isotp_options& options,
              const can_isotp_fc_options& flow)
      : fd_(socket(PF_CAN, SOCK_DGRAM | SOCK_CLOEXEC, CAN_ISOTP)) {
    if (fd_ < 0) fail("socket(CAN_ISOTP)");
    if (setsockopt(fd_, SOL_CAN_ISOTP, CAN_ISOTP_OPTS, &options, sizeof options) != 0 ||
        setsockopt(fd_, SOL_CAN_ISOTP, CAN_ISOTP_RECV_FC, &flow, sizeof flow) != 0) {
      fail("setsockopt");
    }
    sockaddr_can address{};
    address.can_family = AF_CAN;
    address.can_ifindex = static_cast<int>(if_nametoindex("vcan1"));
    address.can_addr.tp.tx_id = sends;
    address.can_addr.tp.rx_id = receives;
    if (bind(fd_, reinterpret_cast<sockaddr*>(&address), sizeof address) != 0) fail("bind");
  }
  ~IsoTpSocket() { close(fd_); }
  IsoTpSocket(const IsoTpSocket&) = delete;
  IsoTpSocket& operator=(const IsoTpSocket&) = delete;

  // A whole message; false when the kernel has found something wrong with what went before.
  bool send(const std::vector<std::uint8_t>& message) const {
    return write(fd_, message.data(), message.size()) == static_cast<ssize_t>(message.size());
  }
  // The next message; empty at the limit. Throws what the kernel found wrong.
  std::vector<std::uint8_t> receive(Milliseconds limit) const {
    pollfd waiting{fd_, POLLIN, 0};
    if (poll(&waiting, 1, static_cast<int>(limit.count())) <= 0) return {};
    std::vector<std::uint8_t> message(4095);
    const ssize_t size = read(fd_, message.data(), message.size());
    if (size < 0) fail("read");
    message.resize(static_cast<std::size_t>(size));
    return message;
  }

 private:
  [[noreturn]] static void fail(const char* what) {
    throw std::system_error(errno, std::generic_category(), what);
  }
  int fd_;
};

const std::vector<std::uint8_t> kAsk{0x22, 0x11, 0x01};
constexpr can_isotp_options kLenient{};

// Every frame of the other side full and filled up as the standard has it, else it is an error.
can_isotp_options strict() {
  can_isotp_options options{};
  options.flags =
      CAN_ISOTP_TX_PADDING | CAN_ISOTP_RX_PADDING | CAN_ISOTP_CHK_PAD_LEN | CAN_ISOTP_CHK_PAD_DATA;
  options.txpad_content = options.rxpad_content = 0xCC;
  return options;
}

// Answers every request in a message of `length` bytes, the pressure in front.
class KernelEcu {
 public:
  KernelEcu(std::size_t length, const can_isotp_options& options)
      : length_(length),
        socket_(kUdsAnswer, kUdsRequest, options, {}),
        thread_([this] { run(); }) {}
  ~KernelEcu() {
    stop_ = true;
    thread_.join();
  }
  void set_pressure(int mbar) { pressure_mbar_ = mbar; }
  int answers() const { return answers_; }
  int errors() const { return errors_; }  // and messages that ask for something else

 private:
  void run() try {
    while (!stop_) {
      const std::vector<std::uint8_t> request = socket_.receive(Milliseconds{5});
      if (request.empty()) continue;
      const int mbar = pressure_mbar_;
      std::vector<std::uint8_t> answer{0x62, 0x11, 0x01, static_cast<std::uint8_t>(mbar & 0xFF),
                                       static_cast<std::uint8_t>(mbar >> 8)};
      answer.resize(length_, 0x5A);
      ++(request == kAsk && socket_.send(answer) ? answers_ : errors_);
    }
  } catch (const std::system_error&) {
    ++errors_;
  }

  std::size_t length_;
  IsoTpSocket socket_;
  std::atomic<int> pressure_mbar_{4000}, answers_{0}, errors_{0};
  std::atomic<bool> stop_{false};
  std::thread thread_;
};

// T cos(theta) / (2 R F) of the rig's 50 Nm at this pressure, for the default variator; its radius
// at this ratio is 1 % less than at the end stop.
bool shows_traction_at(const PublishedFrames& published, double bar) {
  const double force_N = 0.0113 * bar * 1e5 + 500.0;
  const double mu = 50.0 * std::cos(11.0 * std::numbers::pi / 180.0) / (2.0 * 0.0784 * force_N);
  return pressure_valid(published) &&
         std::abs(published.last("BeltGripSlip").signals.at("MuStar") - mu) < 0.03 * mu;
}
auto traction_at(double bar) {
  return [bar](const PublishedFrames& published) { return shows_traction_at(published, bar); };
}

class KernelIsoTp : public Vcan {
 protected:
  void SetUp() override {
    ASSERT_NO_FATAL_FAILURE(Vcan::SetUp());
    add_interface("vcan1");
    player_.emplace(canplayer(write_steady_log(folder()), "vcan0", true));
  }
  std::vector<std::string> daemon(bool polls) const {
    return {program("beltgripd"), "--config",
            take_pressure_from_uds(write_rig_config(folder(), "vcan0"), polls)};
  }

 private:
  std::optional<Process> player_;
};

struct Answer {
  const char* name;
  std::size_t length;
  bool strict;
};

class Polled : public KernelIsoTp, public testing::WithParamInterface<Answer> {};

TEST_P(Polled, TheKernelUnderstandsTheDaemonAndTheDaemonTheKernel) {
  const BusSocket bus("vcan0");
  KernelEcu ecu(GetParam().length, GetParam().strict ? strict() : kLenient);
  Process beltgripd(daemon(true));
  PublishedFrames published;
  ASSERT_TRUE(listen(bus, published, traction_at(4.0))) << beltgripd.err();
  ecu.set_pressure(6000);
  EXPECT_TRUE(listen(bus, published, traction_at(6.0))) << beltgripd.err();
  const int before = ecu.answers();
  EXPECT_TRUE(listen(bus, published, [&](const PublishedFrames&) {
    return ecu.answers() >= before + 20;
  })) << beltgripd.err();
  EXPECT_EQ(ecu.errors(), 0);
  EXPECT_FALSE(is_set(published, "FaultFrameRefused"));
  EXPECT_EQ(published.problems(), std::vector<std::string>{});
  beltgripd.signal(SIGTERM);
  EXPECT_EQ(beltgripd.wait(kLimit), 0);
}

INSTANTIATE_TEST_SUITE_P(, Polled,
                         testing::Values(Answer{"Single", 5, false}, Answer{"FullSingle", 7, true},
                                         Answer{"FirstAndOne", 8, true},
                                         Answer{"FirstAndMany", 300, false},
                                         Answer{"FirstAndManyFilledUp", 300, true}),
                         [](const auto& test) { return test.param.name; });

// The flow control is the other tester's: blocks of four frames, 2 ms apart.
TEST_F(KernelIsoTp, TheDaemonListensToTwoKernels) {
  const BusSocket bus("vcan0");
  KernelEcu ecu(62, kLenient);
  can_isotp_fc_options in_blocks{};
  in_blocks.bs = 4;
  in_blocks.stmin = 2;
  const IsoTpSocket tester(kUdsRequest, kUdsAnswer, kLenient, in_blocks);
  Process beltgripd(daemon(false));
  PublishedFrames published;
  const auto ask_until = [&](const std::function<bool(const PublishedFrames&)>& done) {
    return listen(bus, published, [&](const PublishedFrames& seen) {
      EXPECT_TRUE(tester.send(kAsk));
      EXPECT_EQ(tester.receive(kLimit).size(), 62U);
      return done(seen);
    });
  };
  ASSERT_TRUE(ask_until(traction_at(4.0))) << beltgripd.err();
  ecu.set_pressure(6000);
  EXPECT_TRUE(ask_until(traction_at(6.0))) << beltgripd.err();
  EXPECT_EQ(ecu.errors(), 0);
  EXPECT_EQ(published.problems(), std::vector<std::string>{});
}

}  // namespace
}  // namespace beltgrip::test
