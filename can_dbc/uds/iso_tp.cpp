#include "can_dbc/uds/iso_tp.h"

#include <algorithm>
#include <cassert>

namespace beltgrip::can {

namespace {

// High nibble of the first byte.
enum : unsigned { kSingle = 0, kFirst = 1, kConsecutive = 2, kFlowControl = 3 };

constexpr std::size_t kFrameBytes = 8;
constexpr std::size_t kSingleMost = 7;
constexpr std::size_t kFirstHeader = 2;

CanFrame padded(CanId id) noexcept {
  CanFrame frame;
  frame.id = id;
  frame.length = kFrameBytes;
  std::fill_n(frame.data.begin(), kFrameBytes, kIsoTpPadding);
  return frame;
}

}  // namespace

IsoTpReceiver::Event IsoTpReceiver::on_frame(std::int64_t t_ns, const CanFrame& frame) noexcept {
  const auto payload = frame.payload();
  if (frame.error || payload.empty()) return Event::kIgnored;
  switch (payload[0] >> 4U) {
    case kSingle:
      return on_single(t_ns, payload);
    case kFirst:
      return on_first(t_ns, payload);
    case kConsecutive:
      return on_consecutive(t_ns, payload);
    default:
      return Event::kIgnored;
  }
}

IsoTpReceiver::Event IsoTpReceiver::on_single(std::int64_t t_ns,
                                              std::span<const std::uint8_t> payload) noexcept {
  // Of more than 8 bytes: the length stands in the next byte.
  const bool escaped = payload.size() > kFrameBytes;
  const std::size_t length = escaped ? payload[1] : payload[0] & 0x0FU;
  const std::size_t header = escaped ? 2 : 1;
  if (escaped && ((payload[0] & 0x0FU) != 0 || length <= kSingleMost)) return Event::kIgnored;
  if (length == 0 || length > payload.size() - header) return Event::kIgnored;
  receiving_ = false;
  size_ = 0;
  length_ = length;
  first_ns_ = t_ns;
  take(payload.subspan(header));
  return Event::kMessage;
}

IsoTpReceiver::Event IsoTpReceiver::on_first(std::int64_t t_ns,
                                             std::span<const std::uint8_t> payload) noexcept {
  if (payload.size() < kFrameBytes) return Event::kIgnored;
  const std::size_t length = (payload[0] & 0x0FU) * std::size_t{256} + payload[1];
  if (length == 0) {
    // The length stands in the next four bytes: more than 4095, or an error of the sender.
    const bool long_one = payload[2] != 0 || payload[3] != 0 || payload[4] >= 0x10;
    if (!long_one) return Event::kIgnored;
    receiving_ = false;
    return Event::kTooLong;
  }
  const std::size_t single_most =
      payload.size() > kFrameBytes ? payload.size() - kFirstHeader : kSingleMost;
  if (length <= single_most) return Event::kIgnored;
  receiving_ = true;
  frame_bytes_ = payload.size();
  size_ = 0;
  length_ = length;
  sequence_ = 1;
  first_ns_ = last_ns_ = t_ns;
  take(payload.subspan(kFirstHeader));
  return Event::kFirst;
}

IsoTpReceiver::Event IsoTpReceiver::on_consecutive(std::int64_t t_ns,
                                                   std::span<const std::uint8_t> payload) noexcept {
  if (!receiving_) return Event::kIgnored;
  if (expire(t_ns)) return Event::kBroken;
  // Shorter than the others may only be the last one, which holds at least what is left.
  const std::size_t left = length_ - size_;
  if (payload.size() != frame_bytes_ && payload.size() - 1 < left) return Event::kIgnored;
  if ((payload[0] & 0x0FU) != sequence_) {
    receiving_ = false;
    return Event::kBroken;
  }
  sequence_ = (sequence_ + 1U) & 0x0FU;
  last_ns_ = t_ns;
  take(payload.subspan(1));
  receiving_ = size_ < length_;
  return receiving_ ? Event::kContinued : Event::kMessage;
}

void IsoTpReceiver::take(std::span<const std::uint8_t> bytes) noexcept {
  const std::size_t count = std::min(bytes.size(), length_ - size_);
  assert(size_ + count <= bytes_.size());
  std::copy_n(bytes.begin(), count, bytes_.begin() + static_cast<std::ptrdiff_t>(size_));
  size_ += count;
}

bool IsoTpReceiver::expire(std::int64_t t_ns) noexcept {
  if (!receiving_ || t_ns <= last_ns_ || t_ns - last_ns_ <= kIsoTpFrameTimeout_ns) return false;
  receiving_ = false;
  return true;
}

CanFrame iso_tp_single(CanId id, std::span<const std::uint8_t> payload) noexcept {
  assert(payload.size() <= kSingleMost);
  CanFrame frame = padded(id);
  frame.data[0] = static_cast<std::uint8_t>(payload.size());
  std::copy(payload.begin(), payload.end(), frame.data.begin() + 1);
  return frame;
}

CanFrame iso_tp_flow_control(CanId id, FlowStatus status) noexcept {
  CanFrame frame = padded(id);
  frame.data[0] = static_cast<std::uint8_t>(kFlowControl << 4U | static_cast<unsigned>(status));
  frame.data[1] = 0;  // block size: no further flow control
  frame.data[2] = 0;  // separation time
  return frame;
}

}  // namespace beltgrip::can
