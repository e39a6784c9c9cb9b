// How the records of a channel group of an MDF 4 file hold CAN frames: which bits are what. Tools
// only.
#pragma once

#include <optional>
#include <string_view>

#include "can_dbc/frame/can_frame.h"
#include "can_dbc/log/mdf/file.h"

namespace beltgrip::can::mdf {

// A number in a record, or the same one for all of them.
struct Number {
  enum class Kind { kNone, kConstant, kUnsigned, kReal };
  Kind kind = Kind::kNone;
  std::size_t byte = 0;
  unsigned bit = 0;
  unsigned bits = 0;
  bool big_endian = false;
  double offset = 0.0, factor = 1.0;             // as the file says
  std::vector<std::pair<double, double>> table;  // raw to value, instead of the two
  std::optional<std::size_t> invalid_bit;        // behind the record: set where it is none

  bool there() const { return kind != Kind::kNone; }
  // Precondition: the record is as long as the group says.
  double raw(std::string_view record) const;
  double value(std::string_view record) const;
  std::uint64_t integer(std::string_view record) const;
  bool valid(std::string_view record, std::size_t data_bytes) const;
};

enum class EventKind { kData, kRemote, kError };

struct FrameLayout {
  EventKind kind = EventKind::kData;
  std::size_t data_bytes = 0;  // of the record, without validity
  Number time, id, extended, code, length, channel, sent, fd, bit_rate_switch, error_state;
  std::size_t payload_at = 0;
  std::size_t payload_size = 0;    // that the record has room for
  Number payload_offset;           // the payload stands elsewhere, from this byte on
  std::uint64_t payload_link = 0;  // in a group of that block, or in data behind it
};

// Nothing: the group holds no CAN frames. Throws MdfError where it should, but cannot be read.
std::optional<FrameLayout> read_layout(File& file, const Block& group, std::size_t data_bytes,
                                       std::size_t validity_bytes);

// Nanoseconds, exact where the file counts in a decimal unit.
std::optional<std::int64_t> time_ns(const Number& time, std::string_view record,
                                    std::int64_t start_ns);

// The frame but for its data; what is wrong with it, or nullptr. `length`: of the data.
const char* read_frame(const FrameLayout& layout, std::string_view record, CanFrame& frame,
                       std::size_t& length);

}  // namespace beltgrip::can::mdf
