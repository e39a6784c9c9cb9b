// The one exit: reads the bytes about to leave and lets pass only what is allowed. Default deny.
// Knows nothing of the publisher, the experiment or the estimator: it judges the frame, and beside
// it knows the force that acts.
// Real-time thread.
//
// Passes on bus 0: one of the four identifiers, standard, data, classic, 8 bytes, right CRC for its
// data id, a legal counter that follows the one before (any after a refusal), codes inside their
// tables, MuMaxValid only with a value; a clamp frame only with control "command", and a request
// only inside ClampLimits: after enough inactive frames, from the force that acts, never below the
// floor, never rising, never falling by more than a step from frame to frame, no longer than a
// number of frames.
//
// Passes on any bus, where polling is allowed: ReadDataByIdentifier, or ReadDataByLocalIdentifier,
// of listed identifiers, each once, to their ECU, as one single frame of 8 bytes, none more often
// than its period (early by half of one at the most); and one flow control, "continue" or
// "overflow", for each such request.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>

#include "can_dbc/frame/can_frame.h"
#include "daemon/core/base/limits.h"
#include "daemon/core/base/mono_time.h"
#include "daemon/core/base/own_identifiers.h"

namespace beltgrip::daemon {

// Of a request, as its frames show it. By default none is allowed.
struct ClampLimits {
  double floor_N = 1e9;
  double fall_max_N = 0.0;  // from one frame to the next
  std::uint32_t frames_max = 0;
  std::uint32_t inactive_before =
      limits::kInactiveFrames;  // frames between two requests, and before the first
  double start_share = limits::kGateStartShare;  // of the force that acts, smoothed over 20 samples
};

// Of the requests for diagnostics. By default none is allowed.
struct PollLimits {
  static constexpr std::size_t kMost = 32;
  struct Request {
    std::uint8_t bus = 0;
    can::CanId id;
    std::uint16_t identifier = 0;  // of the data
    Duration period = Duration::zero();
    std::uint8_t service = 0x22;
  };
  std::array<Request, kMost> requests{};
  std::size_t size = 0;
};

class TxGate {
 public:
  TxGate(const FrameIdentifiers& identifiers, Control control, const ClampLimits& clamp = {},
         const PollLimits& poll = {}) noexcept;
  // Once a sample, before its frames; 0: not known, and no request may begin.
  void see_acting_force(double force_N) noexcept;
  // Counts what it refuses.
  bool permits(const can::CanFrame& frame, std::uint8_t bus = 0, MonoTime t = {}) noexcept;
  std::uint64_t refused() const noexcept { return refused_; }

 private:
  static constexpr std::size_t kMessages = 4;
  static constexpr std::uint8_t kAnyCounter = 0xFF;

  std::size_t message_of(const can::CanFrame& frame) const noexcept;  // kMessages: none
  bool begins_at_acting(double force_N) const noexcept;
  bool request_allowed(const can::CanFrame& frame) noexcept;
  bool own_allowed(std::size_t message, const can::CanFrame& frame) noexcept;
  bool poll_one_allowed(const can::CanFrame& frame, std::uint8_t bus, MonoTime t,
                        std::uint32_t identifier, std::uint32_t& seen) noexcept;
  bool flow_allowed(const can::CanFrame& frame, std::uint8_t bus) noexcept;
  bool poll_allowed(const can::CanFrame& frame, std::uint8_t bus, MonoTime t) noexcept;

  std::array<std::uint32_t, kMessages> identifiers_;
  std::array<std::uint8_t, kMessages> expected_counter_;
  Control control_;
  ClampLimits clamp_;
  PollLimits poll_;
  struct Polled {
    MonoTime due = MonoTime::min();  // of the next request, at the full rate
    bool flow_left = false;          // a flow control for the last request
  };
  std::array<Polled, PollLimits::kMost> polled_{};
  std::uint32_t active_frames_ = 0;    // of the request that stands
  std::uint32_t inactive_frames_ = 0;  // in a row, since the last request
  double last_force_N_ = 0.0;
  double acting_N_ = 0.0;  // smoothed; 0: not known
  std::uint64_t refused_ = 0;
};

}  // namespace beltgrip::daemon
