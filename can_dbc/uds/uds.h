// UDS ReadDataByIdentifier (ISO 14229-1, service 0x22): the request for one identifier, and what a
// reply says. Pure, any thread.
#pragma once

#include <array>
#include <cstdint>
#include <span>

namespace beltgrip::can {

struct UdsReply {
  enum class Kind : std::uint8_t {
    kOther,     // of another service, or too short
    kData,      // identifier and data
    kNegative,  // refused: code
    kPending    // refused with 0x78: the answer takes longer
  };
  Kind kind = Kind::kOther;
  std::uint16_t identifier = 0;        // kData
  std::uint8_t code = 0;               // kNegative, kPending
  std::span<const std::uint8_t> data;  // kData: what follows the first identifier
};

UdsReply parse_uds_reply(std::span<const std::uint8_t> message) noexcept;
std::array<std::uint8_t, 3> uds_read_request(std::uint16_t identifier) noexcept;

// Negative response codes by what a client does about them.
enum class UdsRefusal : std::uint8_t {
  kNow,  // busy, conditions not met: worth asking again soon
  kEver  // service, identifier, session or rights: the same answer is to be expected for long
};
UdsRefusal uds_refusal(std::uint8_t code) noexcept;

}  // namespace beltgrip::can
