// The older capture format (.pcap): one header, one link type, then a record a packet, times in
// micro- or nanoseconds. The byte order is that of the machine that recorded.
#include <algorithm>

#include "can_dbc/log/binary.h"
#include "can_dbc/log/socketcan_packet.h"

namespace beltgrip::can {

namespace {

constexpr std::size_t kFileHeader = 24;
constexpr std::size_t kRecordHeader = 16;
constexpr std::uint32_t kMicroseconds = 0xA1B2'C3D4;
constexpr std::uint32_t kLinkTypeBits = 0xFFFF;  // above them: length of a check sum
constexpr std::uint32_t kPacketMost = 262'144;   // what capture programs hold of a packet at most
constexpr std::uint32_t kPacketKept = 128;       // more than any CAN packet

class PcapParser : public BinaryParser {
 public:
  explicit PcapParser(std::unique_ptr<ByteSource> source) : input_(std::move(source)) {}

 private:
  RecordKind step(LogRecord& record) override {
    if (!has_header_) return read_header();
    if (input_.at_end()) {
      return input_.fault().empty() ? end() : cut(input_.position(), input_, "");
    }
    const std::uint64_t at = input_.position();
    const auto head = input_.take(kRecordHeader);
    if (!head) return cut(at, input_, "a packet's header");
    const Fields fields(*head, big_);
    const std::uint32_t second = fields.u32(0);
    const std::uint32_t part = fields.u32(4);
    const std::uint32_t held = fields.u32(8);
    const std::uint32_t whole = fields.u32(12);
    if (held > kPacketMost) {
      return broken(at, "a packet of " + std::to_string(held) +
                            " bytes, expected at most 262144: damaged from here on");
    }
    const auto packet_bytes = input_.take(std::min(held, kPacketKept));
    if (!packet_bytes) return cut(at, input_, "a packet of " + std::to_string(held) + " bytes");
    const Packet packet = read_packet(link_type_, *packet_bytes, whole, big_, record);
    interface_ = std::to_string(packet.interface_index);
    if (!input_.skip(held - std::min(held, kPacketKept))) return cut(at, input_, "a packet");
    record.interface = interface_;
    record.t_ns = second * kSecond_ns + std::int64_t{part} * part_ns_;
    if (packet.kind == PacketKind::kBad) return bad(at, packet.reason);
    return packet.kind == PacketKind::kFrame ? RecordKind::kFrame : RecordKind::kNothing;
  }

  RecordKind read_header() {
    const auto header = input_.take(kFileHeader);
    if (!header) return cut(0, input_, "the file's header");
    big_ = (*header)[0] == '\xA1';
    const Fields fields(*header, big_);
    if (fields.u32(0) == kMicroseconds) part_ns_ = 1000;
    link_type_ = fields.u32(20) & kLinkTypeBits;
    has_header_ = true;
    if (!may_carry_can(link_type_)) {
      return broken(0, "a capture of link type " + std::to_string(link_type_) +
                           ", expected one of a CAN interface (227, or cooked 113 and 276)");
    }
    return RecordKind::kNothing;
  }

  BinaryInput input_;
  bool has_header_ = false;
  bool big_ = false;
  std::int64_t part_ns_ = 1;
  std::uint32_t link_type_ = 0;
  std::string interface_;
};

}  // namespace

std::unique_ptr<BinaryParser> make_pcap_parser(std::unique_ptr<ByteSource> source) {
  return std::make_unique<PcapParser>(std::move(source));
}

}  // namespace beltgrip::can
