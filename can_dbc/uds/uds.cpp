#include "can_dbc/uds/uds.h"

namespace beltgrip::can {

namespace {

constexpr std::uint8_t kRead = 0x22;
constexpr std::uint8_t kReadAnswer = 0x62;
constexpr std::uint8_t kRefused = 0x7F;
constexpr std::uint8_t kResponsePending = 0x78;

}  // namespace

UdsReply parse_uds_reply(std::span<const std::uint8_t> message) noexcept {
  UdsReply reply;
  constexpr std::size_t kHeader = 3;
  if (message.size() < kHeader) return reply;
  if (message[0] == kReadAnswer) {
    reply.kind = UdsReply::Kind::kData;
    reply.identifier = static_cast<std::uint16_t>(message[1] << 8U | message[2]);
    reply.data = message.subspan(kHeader);
  } else if (message[0] == kRefused && message[1] == kRead) {
    reply.code = message[2];
    reply.kind =
        reply.code == kResponsePending ? UdsReply::Kind::kPending : UdsReply::Kind::kNegative;
  }
  return reply;
}

std::array<std::uint8_t, 3> uds_read_request(std::uint16_t identifier) noexcept {
  return {kRead, static_cast<std::uint8_t>(identifier >> 8U),
          static_cast<std::uint8_t>(identifier & 0xFFU)};
}

UdsRefusal uds_refusal(std::uint8_t code) noexcept {
  switch (code) {
    case 0x11:  // serviceNotSupported
    case 0x12:  // subFunctionNotSupported
    case 0x13:  // incorrectMessageLengthOrInvalidFormat
    case 0x14:  // responseTooLong
    case 0x31:  // requestOutOfRange
    case 0x33:  // securityAccessDenied
    case 0x34:  // authenticationRequired
    case 0x7E:  // subFunctionNotSupportedInActiveSession
    case 0x7F:  // serviceNotSupportedInActiveSession
      return UdsRefusal::kEver;
    default:
      return UdsRefusal::kNow;
  }
}

}  // namespace beltgrip::can
