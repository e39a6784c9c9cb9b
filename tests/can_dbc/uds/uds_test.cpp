// Answers of UDS ReadDataByIdentifier, written down by hand from ISO 14229-1.
#include "can_dbc/uds/uds.h"

#include <gtest/gtest.h>

#include <vector>

namespace beltgrip::can {
namespace {

using Bytes = std::vector<std::uint8_t>;
using Kind = UdsReply::Kind;

TEST(Uds, ThePositiveAnswer) {
  const Bytes message{0x62, 0x11, 0x01, 0x09, 0xC4};
  const UdsReply reply = parse_uds_reply(message);
  EXPECT_EQ(reply.kind, Kind::kData);
  EXPECT_EQ(reply.identifier, 0x1101);
  EXPECT_EQ(Bytes(reply.data.begin(), reply.data.end()), (Bytes{0x09, 0xC4}));
  const Bytes empty{0x62, 0xF1, 0x90};
  EXPECT_EQ(parse_uds_reply(empty).identifier, 0xF190);
  EXPECT_TRUE(parse_uds_reply(empty).data.empty());
}

TEST(Uds, RefusalsAndThePendingAnswer) {
  const UdsReply refused = parse_uds_reply(Bytes{0x7F, 0x22, 0x31});
  EXPECT_EQ(refused.kind, Kind::kNegative);
  EXPECT_EQ(refused.code, 0x31);
  EXPECT_EQ(parse_uds_reply(Bytes{0x7F, 0x22, 0x78}).kind, Kind::kPending);
}

TEST(Uds, EverythingElse) {
  for (const Bytes& other :
       {Bytes{}, Bytes{0x62}, Bytes{0x62, 0x11}, Bytes{0x7F, 0x22}, Bytes{0x7F, 0x10, 0x31},
        Bytes{0x7F, 0x19, 0x78}, Bytes{0x50, 0x03, 0x00, 0x32}, Bytes{0x22, 0x11, 0x01},
        Bytes{0x41, 0x0C, 0x1A, 0xF8}}) {
    EXPECT_EQ(parse_uds_reply(other).kind, Kind::kOther);
  }
}

TEST(Uds, TheRequest) {
  const auto request = [](std::uint8_t service, std::vector<std::uint16_t> identifiers) {
    const UdsRequest made = uds_read_request(service, identifiers);
    return std::vector<std::uint8_t>(made.payload().begin(), made.payload().end());
  };
  EXPECT_EQ(request(0x22, {0xF190}), (Bytes{0x22, 0xF1, 0x90}));
  EXPECT_EQ(request(0x22, {0xF190, 0x1101, 0x0002}),
            (Bytes{0x22, 0xF1, 0x90, 0x11, 0x01, 0x00, 0x02}));
  EXPECT_EQ(request(0x21, {0x01, 0xA0}), (Bytes{0x21, 0x01, 0xA0}));
  EXPECT_EQ(identifiers_most(0x22), 3U);
  EXPECT_EQ(identifiers_most(0x21), 6U);
}

TEST(Uds, RefusalsThatWillStand) {
  const Bytes stand{0x11, 0x12, 0x13, 0x14, 0x31, 0x33, 0x34, 0x7E, 0x7F};
  for (unsigned code = 0; code < 256; ++code) {
    const bool ever = std::find(stand.begin(), stand.end(), code) != stand.end();
    EXPECT_EQ(uds_refusal(static_cast<std::uint8_t>(code)) == UdsRefusal::kEver, ever) << code;
  }
}

}  // namespace
}  // namespace beltgrip::can
