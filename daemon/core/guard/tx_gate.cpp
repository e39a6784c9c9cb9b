#include "daemon/core/guard/tx_gate.h"

#include <algorithm>
#include <utility>

#include "can_dbc/frame/e2e.h"

namespace beltgrip::daemon {

namespace {

constexpr std::uint8_t kLength = 8;
constexpr double kActingShare = 0.05;  // of the newest; chosen: 100 ms at 200 samples a second
constexpr std::array<std::uint16_t, 4> kDataIds{0x6A0, 0x6A1, 0x6A2, 0x6A3};
enum : std::size_t { kEstimate, kSlip, kClamp, kStatus };

// Codes as laid out in beltgrip.dbc; a test compares. Written out here so that the gate reads the
// bytes on its own.
bool content_allowed(std::size_t message, const can::CanFrame& frame) noexcept {
  const auto& bytes = frame.data;
  switch (message) {
    case kEstimate: {
      const unsigned kind = (bytes[1] >> 4) & 0x3U;
      const bool valid = (bytes[1] & 0x40U) != 0;
      return kind <= 2 && (!valid || kind == 1) && (bytes[1] & 0x80U) == 0;
    }
    case kSlip:
      return (bytes[1] & 0x80U) == 0;
    case kClamp: {
      const bool active = (bytes[2] & 0x01U) != 0;
      const bool force = bytes[3] != 0 || bytes[4] != 0;
      return (bytes[1] & 0xF0U) == 0 && (bytes[2] & 0xFEU) == 0 && active == force &&
             bytes[5] == 0 && bytes[6] == 0 && bytes[7] == 0;
    }
    default: {
      const unsigned state = bytes[1] >> 4;
      const unsigned reason = bytes[2] >> 2 & 0x1FU;
      return state <= 7 && reason <= 20 && (bytes[2] & 0x80U) == 0 && (bytes[5] & 0xF0U) == 0 &&
             bytes[6] == 0 && bytes[7] == 0;
    }
  }
}

}  // namespace

TxGate::TxGate(const FrameIdentifiers& identifiers, Control control, const ClampLimits& clamp,
               const PollLimits& poll) noexcept
    : identifiers_{identifiers.estimate, identifiers.slip, identifiers.clamp, identifiers.status},
      control_(control),
      clamp_(clamp),
      poll_(poll) {
  expected_counter_.fill(kAnyCounter);
}

std::size_t TxGate::message_of(const can::CanFrame& frame) const noexcept {
  if (frame.id.extended || frame.remote || frame.error || frame.fd || frame.length != kLength) {
    return kMessages;
  }
  for (std::size_t i = 0; i < kMessages; ++i) {
    if (frame.id.value == identifiers_[i]) return i;
  }
  return kMessages;
}

bool TxGate::begins_at_acting(double force_N) const noexcept {
  return clamp_.start_share == 0.0 ||
         (acting_N_ > 0.0 && force_N >= clamp_.start_share * acting_N_);
}

void TxGate::see_acting_force(double force_N) noexcept {
  if (!(force_N > 0.0)) {  // or not a number
    acting_N_ = 0.0;
  } else {
    acting_N_ += (acting_N_ > 0.0 ? kActingShare : 1.0) * (force_N - acting_N_);
  }
}

// A request that breaks a limit is over: it takes inactive frames before another may begin.
bool TxGate::request_allowed(const can::CanFrame& frame) noexcept {
  const double force_N = frame.data[3] + 256.0 * frame.data[4];
  if ((frame.data[2] & 0x01U) == 0) {
    if (inactive_frames_ < clamp_.inactive_before) ++inactive_frames_;
    active_frames_ = 0;
    return true;
  }
  const bool first = active_frames_ == 0;
  const bool allowed =
      force_N >= clamp_.floor_N && active_frames_ < clamp_.frames_max &&
      (first ? inactive_frames_ >= clamp_.inactive_before && begins_at_acting(force_N)
             : force_N <= last_force_N_ && force_N >= last_force_N_ - clamp_.fall_max_N);
  inactive_frames_ = 0;
  if (!allowed) {
    active_frames_ = 0;
    return false;
  }
  last_force_N_ = force_N;
  ++active_frames_;
  return true;
}

bool TxGate::own_allowed(std::size_t message, const can::CanFrame& frame) noexcept {
  const auto counter = static_cast<std::uint8_t>(frame.data[1] & 0x0FU);
  std::uint8_t& expected = expected_counter_[message];
  const bool allowed =
      (message != kClamp || control_ == Control::kCommand) && counter <= can::e2e::kCounterMax &&
      (expected == kAnyCounter || counter == expected) &&
      can::e2e::crc_profile1(kDataIds[message], frame.payload().subspan(1)) == frame.data[0] &&
      content_allowed(message, frame) && (message != kClamp || request_allowed(frame));
  expected = allowed ? can::e2e::next_counter(counter) : kAnyCounter;
  return allowed;
}

// One of a request's identifiers; `seen` has a bit for each that the request has named.
bool TxGate::poll_one_allowed(const can::CanFrame& frame, std::uint8_t bus, MonoTime t,
                              std::uint32_t identifier, std::uint32_t& seen) noexcept {
  for (std::size_t i = 0; i < poll_.size; ++i) {
    const PollLimits::Request& request = poll_.requests[i];
    if (request.bus != bus || request.id != frame.id || request.service != frame.data[1]) continue;
    if (request.identifier != identifier) continue;
    const std::uint32_t bit = std::uint32_t{1} << i;
    if ((seen & bit) != 0 || polled_[i].due > t + request.period / 2) return false;
    seen |= bit;
    return true;
  }
  return false;
}

// One for the last request to this ECU.
bool TxGate::flow_allowed(const can::CanFrame& frame, std::uint8_t bus) noexcept {
  for (std::size_t i = 0; i < poll_.size; ++i) {
    const PollLimits::Request& request = poll_.requests[i];
    if (request.bus != bus || request.id != frame.id || !polled_[i].flow_left) continue;
    polled_[i].flow_left = false;
    return true;
  }
  return false;
}

// Layout of ISO 15765-2, ISO 14229-1 and ISO 14230-3, read here on its own.
bool TxGate::poll_allowed(const can::CanFrame& frame, std::uint8_t bus, MonoTime t) noexcept {
  static_assert(PollLimits::kMost <= 32, "a bit each");
  if (frame.remote || frame.error || frame.fd || frame.length != kLength) return false;
  const auto& bytes = frame.data;
  if ((bytes[0] == 0x30 || bytes[0] == 0x32) && bytes[1] == 0 && bytes[2] == 0) {
    return flow_allowed(frame, bus);
  }
  const std::size_t width = bytes[1] == 0x22 ? 2 : bytes[1] == 0x21 ? 1 : 0;
  const std::size_t size = bytes[0];  // of a single frame: the service and the identifiers
  if (width == 0 || size < 1 + width || size > 7 || (size - 1) % width != 0) return false;
  std::uint32_t seen = 0;
  for (std::size_t at = 2; at <= size; at += width) {
    const std::uint32_t identifier =
        width == 2 ? static_cast<std::uint32_t>(bytes[at] << 8 | bytes[at + 1]) : bytes[at];
    if (!poll_one_allowed(frame, bus, t, identifier, seen)) return false;
  }
  bool flow = true;
  for (std::size_t i = 0; i < poll_.size; ++i) {
    if ((seen >> i & 1) == 0) continue;
    polled_[i].due = std::max(polled_[i].due, t) + poll_.requests[i].period;
    polled_[i].flow_left = std::exchange(flow, false);
  }
  return true;
}

bool TxGate::permits(const can::CanFrame& frame, std::uint8_t bus, MonoTime t) noexcept {
  const std::size_t message = bus == 0 ? message_of(frame) : kMessages;
  const bool allowed =
      message != kMessages ? own_allowed(message, frame) : poll_allowed(frame, bus, t);
  if (!allowed) ++refused_;
  return allowed;
}

}  // namespace beltgrip::daemon
