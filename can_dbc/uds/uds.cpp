#include "can_dbc/uds/uds.h"

namespace beltgrip::can {

namespace {

constexpr std::uint8_t kAnswered = 0x40;  // added to the service
constexpr std::uint8_t kRefused = 0x7F;
constexpr std::uint8_t kResponsePending = 0x78;

bool is_read(std::uint8_t service) {
  return service == kReadByIdentifier || service == kReadByLocalIdentifier;
}

}  // namespace

UdsReply parse_uds_reply(std::span<const std::uint8_t> message) noexcept {
  UdsReply reply;
  if (message.size() < 2) return reply;
  const auto service = static_cast<std::uint8_t>(message[0] - kAnswered);
  if (is_read(service)) {
    reply.service = service;
    reply.data = message.subspan(1);
    const auto identifier = uds_take_identifier(service, reply.data);
    if (!identifier) return {};
    reply.kind = UdsReply::Kind::kData;
    reply.identifier = *identifier;
  } else if (message.size() > 2 && message[0] == kRefused && is_read(message[1])) {
    reply.service = message[1];
    reply.code = message[2];
    reply.kind =
        reply.code == kResponsePending ? UdsReply::Kind::kPending : UdsReply::Kind::kNegative;
  }
  return reply;
}

UdsRequest uds_read_request(std::uint8_t service,
                            std::span<const std::uint16_t> identifiers) noexcept {
  UdsRequest request;
  request.bytes[request.size++] = service;
  for (const std::uint16_t each : identifiers) {
    if (identifier_bytes(service) == 2) {
      request.bytes[request.size++] = static_cast<std::uint8_t>(each >> 8U);
    }
    request.bytes[request.size++] = static_cast<std::uint8_t>(each & 0xFFU);
  }
  return request;
}

std::optional<std::uint16_t> uds_take_identifier(std::uint8_t service,
                                                 std::span<const std::uint8_t>& rest) noexcept {
  const std::size_t size = identifier_bytes(service);
  if (rest.size() < size) return {};
  const auto identifier = static_cast<std::uint16_t>(size == 2 ? rest[0] << 8U | rest[1] : rest[0]);
  rest = rest.subspan(size);
  return identifier;
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
