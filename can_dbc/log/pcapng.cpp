// The newer capture format (.pcapng): blocks, each with its length in front and behind. A section
// has a byte order and a list of interfaces, each with a link type and a unit of time. Packets are
// taken from the blocks that hold one; all other kinds are passed.
#include <algorithm>
#include <array>
#include <limits>
#include <vector>

#include "can_dbc/log/binary.h"
#include "can_dbc/log/socketcan_packet.h"

namespace beltgrip::can {

namespace {

enum BlockType : std::uint32_t {
  kSection = 0x0A0D'0D0A,
  kInterface = 1,
  kOldPacket = 2,
  kSimplePacket = 3,
  kEnhancedPacket = 6
};
enum OptionCode : std::uint16_t {
  kOptionsEnd = 0,
  kName = 2,
  kTimeResolution = 9,
  kTimeOffset = 14
};

constexpr std::size_t kBlockHeader = 8;
constexpr std::size_t kBlockFrame = 12;  // with the length behind
constexpr std::uint32_t kByteOrder = 0x1A2B'3C4D;
constexpr std::size_t kPacketFields = 20;
constexpr std::size_t kInterfaceFields = 8;
constexpr std::size_t kSectionFields = 16;
constexpr std::size_t kBlockKept =
    4096;  // of a block: holds any CAN packet, and an interface's options
constexpr std::size_t kInterfacesMost = 1024;  // more are in no capture: bounds the memory
constexpr std::size_t kNameMost = 64;
constexpr std::uint8_t kPowerOfTwo = 0x80;

struct Interface {
  std::uint32_t link_type = 0;
  std::string name;
  bool binary_time = false;
  unsigned exponent = 6;  // unit of time: 10 (or 2) to the power of minus this, seconds
  std::int64_t offset_s = 0;
};

// As one word: logs and options name an interface by one.
std::string word(std::string_view name) {
  std::string word(name.substr(0, kNameMost));
  for (char& c : word) {
    const bool plain = (c >= '0' && c <= '9') || (c >= 'A' && c <= 'Z') || (c >= 'a' && c <= 'z') ||
                       c == '.' || c == '-' || c == ':';
    if (!plain) c = '_';
  }
  return word;
}

// Exact, cut to the nanosecond.
std::optional<std::int64_t> nanoseconds(std::uint64_t ticks, const Interface& interface) {
  __extension__ using Wide = unsigned __int128;
  constexpr unsigned kNanoExponent = 9;
  Wide time_ns = ticks;
  if (interface.binary_time) {
    time_ns = (time_ns * static_cast<Wide>(kSecond_ns)) >> interface.exponent;
  } else {
    for (unsigned i = interface.exponent; i < kNanoExponent; ++i) time_ns *= 10;
    for (unsigned i = kNanoExponent; i < interface.exponent; ++i) time_ns /= 10;
  }
  if (time_ns > static_cast<Wide>(std::numeric_limits<std::int64_t>::max())) return std::nullopt;
  std::int64_t offset_ns = 0;
  std::int64_t sum_ns = 0;
  if (__builtin_mul_overflow(interface.offset_s, kSecond_ns, &offset_ns) ||
      __builtin_add_overflow(static_cast<std::int64_t>(time_ns), offset_ns, &sum_ns)) {
    return std::nullopt;
  }
  return sum_ns;
}

class PcapngParser : public BinaryParser {
 public:
  explicit PcapngParser(std::unique_ptr<ByteSource> source) : input_(std::move(source)) {}

 private:
  RecordKind step(LogRecord& record) override {
    if (input_.at_end()) {
      return input_.fault().empty() ? end() : cut(input_.position(), input_, "");
    }
    at_ = input_.position();
    auto head = input_.peek(kBlockFrame);
    if (!head) return cut(at_, input_, "a block's header");
    std::uint32_t type = Fields(*head, big_).u32(0);
    if (type == kSection) {  // the same in both orders
      big_ = Fields(*head, true).u32(kBlockHeader) == kByteOrder;
      if (Fields(*head, big_).u32(kBlockHeader) != kByteOrder) {
        return broken(at_, "a section without its mark of byte order, expected 1A2B3C4D");
      }
    }
    const std::uint32_t size = Fields(*head, big_).u32(4);
    if (size < kBlockFrame || size % 4 != 0) {
      return broken(at_, "a block of " + std::to_string(size) +
                             " bytes, expected a multiple of 4 from 12 on");
    }
    const std::size_t body = size - kBlockFrame;
    input_.take(kBlockHeader);
    const std::size_t kept = std::min(body, kBlockKept);
    const auto bytes = input_.take(kept);
    if (!bytes) return cut(at_, input_, "a block of " + std::to_string(size) + " bytes");
    const RecordKind kind = read_block(type, Fields(*bytes, big_), record);
    if (kind == RecordKind::kEnd) return broken(at_, reason_);
    if (!input_.skip(body - kept)) {
      return cut(at_, input_, "a block of " + std::to_string(size) + " bytes");
    }
    const auto behind = input_.take(4);
    if (!behind) return cut(at_, input_, "a block of " + std::to_string(size) + " bytes");
    if (const std::uint32_t again = Fields(*behind, big_).u32(0); again != size) {
      return broken(at_, "a block of " + std::to_string(size) +
                             " bytes that ends with the length " + std::to_string(again) +
                             ": damaged from here on");
    }
    return kind == RecordKind::kBad ? bad(at_, reason_) : kind;
  }

  RecordKind reject(std::string reason) {
    reason_ = std::move(reason);
    return RecordKind::kBad;
  }

  // kEnd: nothing behind can be read either.
  RecordKind read_block(std::uint32_t type, const Fields& fields, LogRecord& record) {
    switch (type) {
      case kSection:
        return read_section(fields);
      case kInterface:
        return read_interface(fields);
      case kEnhancedPacket:
        if (fields.size() < kPacketFields) return reject("a packet block without its 20 bytes");
        return read(fields, fields.u32(0), record);
      case kOldPacket:
        if (fields.size() < kPacketFields) return reject("a packet block without its 20 bytes");
        return read(fields, fields.u16(0), record);
      case kSimplePacket:
        return reject("a packet without a time stamp (simple packet block)");
      default:
        return RecordKind::kNothing;
    }
  }

  RecordKind read_section(const Fields& fields) {
    interfaces_.clear();
    if (fields.size() >= kSectionFields && fields.u16(4) == 1) return RecordKind::kNothing;
    reason_ = "a section of another version, expected 1.0";
    return RecordKind::kEnd;
  }

  RecordKind read_interface(const Fields& fields) {
    if (fields.size() < kInterfaceFields) return reject("an interface block without its 8 bytes");
    if (interfaces_.size() == kInterfacesMost) {
      reason_ = "more than 1024 interfaces in a section";
      return RecordKind::kEnd;
    }
    Interface interface;
    interface.link_type = fields.u16(0);
    interface.name = std::to_string(interfaces_.size());
    read_options(fields, interface);
    interfaces_.push_back(std::move(interface));
    return RecordKind::kNothing;
  }

  static void read_options(const Fields& fields, Interface& interface) {
    constexpr std::size_t kHead = 4;
    for (std::size_t at = kInterfaceFields; at + kHead <= fields.size();) {
      const std::uint16_t code = fields.u16(at);
      const std::size_t size = fields.u16(at + 2);
      at += kHead;
      if (code == kOptionsEnd || size > fields.size() - at) return;
      if (code == kName && size > 0) interface.name = word(fields.text(at, size));
      if (code == kTimeResolution && size == 1) {
        interface.binary_time = (fields.u8(at) & kPowerOfTwo) != 0;
        interface.exponent = fields.u8(at) & ~kPowerOfTwo & 0xFFU;
      }
      if (code == kTimeOffset && size == 8) {
        interface.offset_s = static_cast<std::int64_t>(fields.u64(at));
      }
      at += (size + 3) & ~std::size_t{3};
    }
  }

  RecordKind read(const Fields& fields, std::uint32_t number, LogRecord& record) {
    if (number >= interfaces_.size()) {
      return reject("a packet of interface " + std::to_string(number) + ", of " +
                    std::to_string(interfaces_.size()) + " that the section names");
    }
    const Interface& interface = interfaces_[number];
    const std::uint32_t held = fields.u32(12);
    const std::size_t there = fields.size() - kPacketFields;
    if (held > there && there < kBlockKept - kPacketFields) {
      return reject("a packet of " + std::to_string(held) + " bytes in a block that has " +
                    std::to_string(there));
    }
    const Packet packet = read_packet(
        interface.link_type, fields.text(kPacketFields, std::min<std::size_t>(held, there)),
        fields.u32(16), big_, record);
    if (packet.kind == PacketKind::kOther) return RecordKind::kNothing;
    if (packet.kind == PacketKind::kBad) return reject(packet.reason);
    const auto t_ns = nanoseconds((std::uint64_t{fields.u32(4)} << 32U) | fields.u32(8), interface);
    if (!t_ns) return reject("time stamp beyond the range");
    record.t_ns = *t_ns;
    index_ = packet.interface_index > 0 ? std::to_string(packet.interface_index) : "";
    record.interface = index_.empty() ? std::string_view(interface.name) : index_;
    return RecordKind::kFrame;
  }

  BinaryInput input_;
  bool big_ = false;
  std::uint64_t at_ = 0;
  std::vector<Interface> interfaces_;
  std::string index_;
  std::string reason_;
};

}  // namespace

std::unique_ptr<BinaryParser> make_pcapng_parser(std::unique_ptr<ByteSource> source) {
  return std::make_unique<PcapngParser>(std::move(source));
}

}  // namespace beltgrip::can
