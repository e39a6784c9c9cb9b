// The frames of one input message: do they come as often as they should, and are their counter and
// CRC right? SI, monotonic time. Real-time thread; fixed memory.
//
// Rate: the last kFrames frames took less than kTooFast or more than kTooSlow of the time that the
// message's period gives them. A pause in which the inputs grow stale starts the count anew: that
// is another fault.
// Protection: a frame is good when its CRC is right and its counter has gone on by 1 to
// kCounterStep. A counter that stands still, one that jumps and a wrong CRC are bad. The message
// is invalid after a jump, and after kBad bad ones of the last 8; valid again with the kGood-th
// good frame in a row. No value is taken from a bad frame, nor from any while the message is
// invalid. The first frame is good when its CRC is.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>

#include "can_dbc/frame/can_frame.h"
#include "daemon/core/base/mono_time.h"
#include "daemon/core/config/options/config.h"

namespace beltgrip::daemon {

class FrameGuard {
 public:
  static constexpr std::size_t kFrames = 16;
  static constexpr double kTooFast = 0.65, kTooSlow = 1.75;
  static constexpr std::uint32_t kCounterStep = 3;
  static constexpr int kBad = 3, kGood = 5;

  FrameGuard() = default;  // lets everything pass
  FrameGuard(std::optional<Duration> period, const MessageProtection* protection) noexcept
      : period_(period), protection_(protection) {}

  // False: nothing may be taken from the frame.
  bool admit(const can::CanFrame& frame) noexcept;
  // Of a frame of right kind and length, whether admitted or not.
  void count(MonoTime t) noexcept;

  bool wrong_rate() const noexcept { return wrong_rate_; }
  bool invalid() const noexcept { return invalid_; }

 private:
  bool is_good(const can::CanFrame& frame) noexcept;

  std::optional<Duration> period_;
  const MessageProtection* protection_ = nullptr;
  std::array<MonoTime, kFrames> stamps_{};
  std::size_t stamped_ = 0;
  bool wrong_rate_ = false;
  std::optional<std::uint32_t> counter_;  // of the last frame with a right CRC
  std::uint8_t bad_ = 0;                  // one bit for each of the last frames
  int good_ = 0;                          // in a row
  bool invalid_ = false;
};

}  // namespace beltgrip::daemon
