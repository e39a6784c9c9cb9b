#include "can_dbc/log/socketcan_packet.h"

#include <algorithm>
#include <cstring>

#include "can_dbc/log/binary.h"
#include "can_dbc/log/frame_bits.h"

namespace beltgrip::can {

namespace {

// Link types as the register of capture formats numbers them.
constexpr std::uint32_t kLinuxCooked = 113;
constexpr std::uint32_t kSocketCan = 227;
constexpr std::uint32_t kLinuxCooked2 = 276;
constexpr std::size_t kCookedHeader = 16;
constexpr std::size_t kCooked2Header = 20;
// Protocols of cooked packets.
constexpr std::uint16_t kCan = 0x000C;
constexpr std::uint16_t kCanFd = 0x000D;
constexpr std::uint16_t kCanXl = 0x000E;
constexpr std::uint16_t kSentByUs = 4;

// Flags as in linux/can.h.
constexpr std::uint32_t kRemoteFlag = 0x4000'0000;
constexpr std::uint8_t kXlFlag = 0x80;  // where classic and FD have their length
constexpr std::uint8_t kFdBitRateSwitch = 0x01;
constexpr std::uint8_t kFdErrorState = 0x02;
constexpr std::uint8_t kFdFormat = 0x04;
constexpr std::size_t kFrameHeader = 8;
constexpr std::size_t kClassicMost = 8;
constexpr std::uint64_t kFdSize = kFrameHeader + kMaxPayload;

Packet bad(const char* reason) { return {PacketKind::kBad, reason, 0}; }

// The mark of CAN FD is younger than the format: before, the size of the packet told.
bool is_fd(const Fields& fields, std::uint64_t whole_size, bool told_fd) {
  return told_fd || (fields.u8(5) & kFdFormat) != 0 || whole_size == kFdSize ||
         fields.u8(4) > kClassicMost;
}

Packet read_frame(std::string_view bytes, std::uint64_t whole_size, bool big_endian, bool told_fd,
                  LogRecord& record) {
  if (bytes.size() < kFrameHeader) return bad("CAN packet of less than its 8 bytes of header");
  const Fields fields(bytes, big_endian);
  const std::uint32_t id = fields.u32(0);
  std::uint8_t length = fields.u8(4);
  if ((length & kXlFlag) != 0) return bad("CAN XL frame, expected classic CAN or CAN FD");
  record.frame = CanFrame{};
  CanFrame& frame = record.frame;
  frame.error = (id & kErrorFlag) != 0;
  frame.remote = (id & kRemoteFlag) != 0;
  frame.fd = !frame.error && !frame.remote && is_fd(fields, whole_size, told_fd);
  frame.id.extended = !frame.error && (id & kExtendedFlag) != 0;
  frame.id.value = id & kExtendedIdMax;
  if (!frame.id.extended && !frame.error && frame.id.value > kStandardIdMax) {
    return bad("identifier above 0x7FF without the mark of an extended one");
  }
  if (length > (frame.fd ? kMaxPayload : kClassicMost)) {
    return bad("data length above 64, or above 8 without CAN FD");
  }
  frame.length = length;
  if (frame.fd) {
    frame.bit_rate_switch = (fields.u8(5) & kFdBitRateSwitch) != 0;
    frame.error_state_indicator = (fields.u8(5) & kFdErrorState) != 0;
  }
  if (frame.remote) return {PacketKind::kFrame, "", 0};
  if (bytes.size() - kFrameHeader < length) {
    return bad("the capture holds fewer data bytes than the frame's length says");
  }
  std::memcpy(frame.data.data(), bytes.data() + kFrameHeader, length);
  return {PacketKind::kFrame, "", 0};
}

}  // namespace

bool may_carry_can(std::uint32_t link_type) {
  return link_type == kSocketCan || link_type == kLinuxCooked || link_type == kLinuxCooked2;
}

Packet read_packet(std::uint32_t link_type, std::string_view bytes, std::uint64_t whole_size,
                   bool big_endian, LogRecord& record) {
  record.sent = false;
  if (link_type == kSocketCan) return read_frame(bytes, whole_size, true, false, record);
  const bool second = link_type == kLinuxCooked2;
  if (link_type != kLinuxCooked && !second) return {};
  const std::size_t header = second ? kCooked2Header : kCookedHeader;
  if (bytes.size() < header) return bad("packet shorter than the header of its link type");
  const Fields cooked(bytes, true);
  const std::uint16_t protocol = cooked.u16(second ? 0 : 14);
  if (protocol == kCanXl) return bad("CAN XL frame, expected classic CAN or CAN FD");
  if (protocol != kCan && protocol != kCanFd) return {};
  bytes.remove_prefix(header);
  whole_size -= std::min<std::uint64_t>(whole_size, header);
  Packet packet = read_frame(bytes, whole_size, big_endian, protocol == kCanFd, record);
  record.sent = (second ? cooked.u8(10) : cooked.u16(0)) == kSentByUs;
  if (second) packet.interface_index = cooked.u32(4);
  return packet;
}

}  // namespace beltgrip::can
