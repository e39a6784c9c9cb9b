#include "can_dbc/log/mdf/layout.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>

#include "can_dbc/log/binary.h"
#include "can_dbc/log/frame_bits.h"
#include "can_dbc/log/text.h"

namespace beltgrip::can::mdf {

namespace {

constexpr std::size_t kChannelsMost = 65'536;  // of a group; one of frames has a dozen
constexpr int kDepthMost = 4;
constexpr std::size_t kChannelFields = 28;
constexpr std::size_t kConversionFields = 24;
constexpr std::size_t kTableMost = 1024;
constexpr std::size_t kClassicMost = 8;

enum ChannelType : std::uint8_t {
  kFixed = 0,
  kVariable = 1,
  kMaster = 2,
  kMaximum = 5,
  kVirtual = 6
};
enum DataType : std::uint8_t {
  kUnsignedLittle = 0,
  kUnsignedBig = 1,
  kRealLittle = 4,
  kRealBig = 5
};
enum Conversion : std::uint8_t { kSame = 0, kLinear = 1, kValueToValue = 5 };

struct Event {
  std::string_view name;
  EventKind kind;
};
constexpr std::array<Event, 3> kEvents{{{"CAN_DataFrame", EventKind::kData},
                                        {"CAN_RemoteFrame", EventKind::kRemote},
                                        {"CAN_ErrorFrame", EventKind::kError}}};

struct Channel {
  std::string name;  // "CAN_DataFrame.ID"
  std::uint64_t at = 0, conversion = 0, data = 0;
  std::uint8_t type = 0, sync = 0, data_type = 0;
  unsigned bit = 0, bits = 0, byte = 0;
  std::uint32_t flags = 0, invalid_bit = 0;
};

void read_channels(File& file, std::uint64_t link, const std::string& above, int depth,
                   std::vector<Channel>& channels) {
  while (link != 0) {
    if (channels.size() == kChannelsMost || depth > kDepthMost) {
      throw MdfError{link, "more channels in a group than 65536, or nested deeper than 4"};
    }
    const Block block = file.block(link);
    const std::string bytes = file.data(block, kChannelFields);
    if (block.id != "##CN" || block.links.size() < 8 || bytes.size() < kChannelFields) {
      throw MdfError{link, "a block " + block.id + ", expected a channel (CN)"};
    }
    const Fields fields(bytes);
    Channel channel;
    channel.name = file.text(block.links[2]);
    if (!above.empty() && channel.name.find('.') == std::string::npos) {
      channel.name = above + '.' + channel.name;
    }
    channel.at = link;
    channel.conversion = block.links[4];
    channel.data = block.links[5];
    channel.type = fields.u8(0);
    channel.sync = fields.u8(1);
    channel.data_type = fields.u8(2);
    channel.bit = fields.u8(3);
    channel.byte = fields.u32(4);
    channel.bits = fields.u32(8);
    channel.flags = fields.u32(12);
    channel.invalid_bit = fields.u32(16);
    const std::string name = channel.name;
    channels.push_back(std::move(channel));
    // Its parts, where they are channels; not where it is an array.
    if (const std::uint64_t parts = block.links[1]; parts != 0 && file.block(parts).id == "##CN") {
      read_channels(file, parts, name, depth + 1, channels);
    }
    link = block.links[0];
  }
}

void read_conversion(File& file, std::uint64_t link, Number& number) {
  if (link == 0) return;
  const Block block = file.block(link);
  const std::string bytes = file.data(block, kConversionFields + 8 * kTableMost);
  if (block.id != "##CC" || bytes.size() < kConversionFields) {
    throw MdfError{link, "a block " + block.id + ", expected a conversion (CC)"};
  }
  const Fields fields(bytes);
  const std::uint8_t type = fields.u8(0);
  const std::size_t count =
      std::min<std::size_t>(fields.u16(6), (bytes.size() - kConversionFields) / 8);
  const auto value = [&](std::size_t i) {
    return std::bit_cast<double>(fields.u64(kConversionFields + 8 * i));
  };
  if (type == kSame) return;
  if (type == kLinear && count >= 2) {
    number.offset = value(0);
    number.factor = value(1);
  } else if (type == kValueToValue) {
    for (std::size_t i = 0; i + 1 < count; i += 2)
      number.table.emplace_back(value(i), value(i + 1));
  } else {
    throw MdfError{link, "a conversion of type " + std::to_string(type) +
                             " of a part of a CAN frame, expected 0, 1 or 5"};
  }
}

Number number_of(File& file, const Channel& channel, std::size_t data_bytes,
                 std::size_t validity_bytes) {
  constexpr std::uint32_t kMayBeInvalid = 2;
  Number number;
  read_conversion(file, channel.conversion, number);
  if (channel.type == kVirtual) {
    number.kind = Number::Kind::kConstant;
    if (number.factor != 0.0) throw MdfError{channel.at, channel.name + " counts the records"};
    return number;
  }
  const bool real = channel.data_type == kRealLittle || channel.data_type == kRealBig;
  number.kind = real ? Number::Kind::kReal : Number::Kind::kUnsigned;
  number.big_endian = channel.data_type == kUnsignedBig || channel.data_type == kRealBig;
  number.byte = channel.byte;
  number.bit = channel.bit;
  number.bits = channel.bits;
  const std::size_t last = std::size_t{channel.byte} + (channel.bit + channel.bits + 7) / 8;
  const bool size_fits =
      real ? channel.bit == 0 && (channel.bits == 32 || channel.bits == 64)
           : channel.bits > 0 && channel.bit < 8 && channel.bit + channel.bits <= 64;
  if ((!real && channel.data_type > kUnsignedBig) || !size_fits || last > data_bytes) {
    throw MdfError{channel.at, channel.name + " of type " + std::to_string(channel.data_type) +
                                   " with " + std::to_string(channel.bits) + " bits at byte " +
                                   std::to_string(channel.byte) + " of a record of " +
                                   std::to_string(data_bytes) + ": expected a number within it"};
  }
  if ((channel.flags & kMayBeInvalid) != 0 && channel.invalid_bit < 8 * validity_bytes) {
    number.invalid_bit = channel.invalid_bit;
  }
  return number;
}

std::string_view last_word(std::string_view name) {
  return name.substr(name.rfind('.') == std::string_view::npos ? 0 : name.rfind('.') + 1);
}

void read_payload(File& file, const Channel& channel, FrameLayout& layout,
                  std::size_t validity_bytes) {
  if (channel.type == kVariable) {
    Channel offset = channel;
    offset.data_type = kUnsignedLittle;
    layout.payload_offset = number_of(file, offset, layout.data_bytes, validity_bytes);
    layout.payload_link = channel.data;
    return;
  }
  layout.payload_at = channel.byte;
  layout.payload_size = channel.bits / 8;
  const bool fits = channel.bits % 8 == 0 && channel.bit == 0 &&
                    layout.payload_at + layout.payload_size <= layout.data_bytes;
  if (!fits || (channel.type != kFixed && channel.type != kMaximum)) {
    throw MdfError{channel.at, channel.name + " is not a row of bytes within the record"};
  }
}

struct Member {
  std::string_view name;
  Number FrameLayout::*number;
};
constexpr std::array<Member, 9> kMembers{{{"ID", &FrameLayout::id},
                                          {"IDE", &FrameLayout::extended},
                                          {"DLC", &FrameLayout::code},
                                          {"DataLength", &FrameLayout::length},
                                          {"BusChannel", &FrameLayout::channel},
                                          {"Dir", &FrameLayout::sent},
                                          {"EDL", &FrameLayout::fd},
                                          {"BRS", &FrameLayout::bit_rate_switch},
                                          {"ESI", &FrameLayout::error_state}}};

const char* whats_missing(const FrameLayout& layout) {
  if (!layout.time.there()) return "time";
  if (layout.kind == EventKind::kError) return nullptr;
  if (!layout.id.there()) return "ID";
  if (!layout.length.there() && !layout.code.there()) return "DLC or DataLength";
  if (layout.kind == EventKind::kData && layout.payload_size == 0 &&
      !layout.payload_offset.there()) {
    return "DataBytes";
  }
  return nullptr;
}

bool flag(const Number& number, std::string_view record) {
  return number.there() && number.integer(record) != 0;
}

}  // namespace

double Number::raw(std::string_view record) const {
  if (kind == Kind::kConstant || kind == Kind::kNone) return 0.0;
  const std::size_t bytes = (bit + bits + 7) / 8;
  std::uint64_t value = 0;
  for (std::size_t i = 0; i < bytes; ++i) {
    const std::size_t place = big_endian ? i : bytes - 1 - i;
    value = (value << 8U) | static_cast<unsigned char>(record[byte + place]);
  }
  if (kind == Kind::kReal) {
    return bits == 64
               ? std::bit_cast<double>(value)
               : static_cast<double>(std::bit_cast<float>(static_cast<std::uint32_t>(value)));
  }
  value >>= bit;
  if (bits < 64) value &= (std::uint64_t{1} << bits) - 1;
  return static_cast<double>(value);
}

double Number::value(std::string_view record) const {
  const double number = raw(record);
  if (table.empty()) return offset + factor * number;
  const auto row = std::find_if(table.begin(), table.end(),
                                [&](const auto& entry) { return entry.first == number; });
  return row == table.end() ? number : row->second;
}

std::uint64_t Number::integer(std::string_view record) const {
  constexpr double kMost = 1e18;
  const double number = value(record);
  return number >= 0.0 && number < kMost ? static_cast<std::uint64_t>(number) : 0;
}

bool Number::valid(std::string_view record, std::size_t data_bytes) const {
  if (!invalid_bit) return true;
  const auto byte_there = static_cast<unsigned char>(record[data_bytes + *invalid_bit / 8]);
  return ((byte_there >> (*invalid_bit % 8)) & 1U) == 0;
}

std::optional<FrameLayout> read_layout(File& file, const Block& group, std::size_t data_bytes,
                                       std::size_t validity_bytes) {
  if (group.links.size() < 2) return std::nullopt;
  std::vector<Channel> channels;
  read_channels(file, group.links[1], "", 0, channels);
  const Event* event = nullptr;
  for (const Channel& channel : channels) {
    for (const Event& candidate : kEvents) {
      if (channel.name == candidate.name ||
          channel.name.starts_with(std::string(candidate.name) + '.')) {
        event = &candidate;
      }
    }
  }
  if (event == nullptr) return std::nullopt;
  FrameLayout layout;
  layout.kind = event->kind;
  layout.data_bytes = data_bytes;
  for (const Channel& channel : channels) {
    constexpr std::uint8_t kTimeSync = 1;
    if (channel.type == kMaster && channel.sync == kTimeSync) {
      layout.time = number_of(file, channel, data_bytes, validity_bytes);
      continue;
    }
    if (!channel.name.starts_with(std::string(event->name) + '.')) continue;
    const std::string_view word = last_word(channel.name);
    if (word == "DataBytes" && layout.kind == EventKind::kData) {
      read_payload(file, channel, layout, validity_bytes);
    }
    for (const Member& member : kMembers) {
      if (word == member.name) {
        layout.*member.number = number_of(file, channel, data_bytes, validity_bytes);
      }
    }
  }
  if (const char* missing = whats_missing(layout)) {
    throw MdfError{group.at, "a group of " + std::string(event->name) + " without " + missing};
  }
  return layout;
}

std::optional<std::int64_t> time_ns(const Number& time, std::string_view record,
                                    std::int64_t start_ns) {
  constexpr double kRoundOff = 1e-9;  // of a factor such as 1e-6, told in binary
  constexpr double kMost_ns = 9e18;
  const double factor_ns = time.factor * double{kSecond_ns};
  const double nearest = std::round(factor_ns);
  const bool decimal = nearest > 0.0 && std::abs(factor_ns - nearest) < kRoundOff * nearest;
  const double since_ns =
      time.offset * double{kSecond_ns} + time.raw(record) * (decimal ? nearest : factor_ns);
  std::int64_t sum_ns = 0;
  if (!(std::abs(since_ns) < kMost_ns) ||
      __builtin_add_overflow(std::llround(since_ns), start_ns, &sum_ns)) {
    return std::nullopt;
  }
  return sum_ns;
}

const char* read_frame(const FrameLayout& layout, std::string_view record, CanFrame& frame,
                       std::size_t& length) {
  frame = CanFrame{};
  length = 0;
  for (const Number* number : {&layout.time, &layout.id, &layout.length, &layout.code}) {
    if (!number->valid(record, layout.data_bytes)) return "a frame that is marked as not valid";
  }
  if (layout.kind == EventKind::kError) {
    frame.error = true;
    frame.id.value = kBusError;
    frame.length = kErrorLength;
    return nullptr;
  }
  const std::uint64_t id = layout.id.integer(record);
  if (id > (kExtendedFlag | kExtendedIdMax)) return "identifier above 29 bits";
  frame.id.value = static_cast<std::uint32_t>(id) & kExtendedIdMax;
  frame.id.extended =
      flag(layout.extended, record) || (id & kExtendedFlag) != 0 || frame.id.value > kStandardIdMax;
  const std::uint64_t code = layout.code.there() ? layout.code.integer(record) : 0;
  frame.fd = layout.kind == EventKind::kData && flag(layout.fd, record);
  frame.bit_rate_switch = frame.fd && flag(layout.bit_rate_switch, record);
  frame.error_state_indicator = frame.fd && flag(layout.error_state, record);
  if (layout.kind == EventKind::kRemote) {
    frame.remote = true;
    const std::uint64_t asked = layout.code.there() ? code : layout.length.integer(record);
    frame.length = static_cast<std::uint8_t>(std::min<std::uint64_t>(asked, kClassicMost));
    return nullptr;
  }
  if (layout.length.there()) {
    length = static_cast<std::size_t>(layout.length.integer(record));
  } else {
    length = code < log_text::kFdLengths.size() ? log_text::kFdLengths[code] : kMaxPayload + 1;
    if (!frame.fd) length = std::min(length, kClassicMost);
  }
  if (length > (frame.fd ? kMaxPayload : kClassicMost)) {
    return "data length above 64, or above 8 without CAN FD";
  }
  frame.length = static_cast<std::uint8_t>(length);
  return nullptr;
}

}  // namespace beltgrip::can::mdf
