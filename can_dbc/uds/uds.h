// Reading data by identifier: UDS (ISO 14229-1, service 0x22) and KWP2000's local identifiers of
// one byte (ISO 14230-3, service 0x21). The request, and what a reply says. Pure, any thread.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>

namespace beltgrip::can {

inline constexpr std::uint8_t kReadByIdentifier = 0x22, kReadByLocalIdentifier = 0x21;
constexpr std::size_t identifier_bytes(std::uint8_t service) {
  return service == kReadByLocalIdentifier ? 1 : 2;
}

struct UdsReply {
  enum class Kind : std::uint8_t {
    kOther,     // of another service, or too short
    kData,      // identifier and data
    kNegative,  // refused: code
    kPending    // refused with 0x78: the answer takes longer
  };
  Kind kind = Kind::kOther;
  std::uint8_t service = 0;            // that was asked for
  std::uint16_t identifier = 0;        // kData
  std::uint8_t code = 0;               // kNegative, kPending
  std::span<const std::uint8_t> data;  // kData: what follows the first identifier
};

// A request in one frame of classic CAN.
struct UdsRequest {
  static constexpr std::size_t kMost = 7;
  std::array<std::uint8_t, kMost> bytes{};
  std::size_t size = 0;
  std::span<const std::uint8_t> payload() const noexcept { return {bytes.data(), size}; }
};
// How many identifiers of this service fit.
constexpr std::size_t identifiers_most(std::uint8_t service) {
  return (UdsRequest::kMost - 1) / identifier_bytes(service);
}

UdsReply parse_uds_reply(std::span<const std::uint8_t> message) noexcept;
// At most identifiers_most().
UdsRequest uds_read_request(std::uint8_t service,
                            std::span<const std::uint16_t> identifiers) noexcept;
// The identifier at the front of bytes that follow the data of another; nothing where they end.
std::optional<std::uint16_t> uds_take_identifier(std::uint8_t service,
                                                 std::span<const std::uint8_t>& rest) noexcept;

// Negative response codes by what a client does about them.
enum class UdsRefusal : std::uint8_t {
  kNow,  // busy, conditions not met: worth asking again soon
  kEver  // service, identifier, session or rights: the same answer is to be expected for long
};
UdsRefusal uds_refusal(std::uint8_t code) noexcept;

}  // namespace beltgrip::can
