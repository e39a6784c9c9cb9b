#include "can_dbc/log/usual_columns.h"

#include <cassert>
#include <cstdint>
#include <cstring>

#include "can_dbc/log/eight_chars.h"
#include "can_dbc/log/text.h"

namespace beltgrip::can {

namespace {

using namespace eight_chars;
using log_text::hex_value;
using log_text::is_digit;
using log_text::kPowersOfTen;

constexpr int kBlanksMost = 2 * kChars - 1;  // before a column
constexpr int kWordMost = kChars;
constexpr int kDataMost = 3 * 8;
// Blanks, the widest column, and a word that is read from its end on.
constexpr int kColumnMost = kBlanksMost + kDataMost + kChars;

// From the front of a line. Each step takes what it names; false: it is not there, and the line is
// another one.
class Columns {
 public:
  explicit Columns(std::string_view text) : at_(text.data()), end_(at_ + kUsualColumnsMost) {}

  char next() const noexcept { return *at_; }
  bool has_room() const noexcept { return end_ - at_ >= kColumnMost; }
  bool take(char c) noexcept {
    if (*at_ != c) return false;
    ++at_;
    return true;
  }
  bool blank_behind() noexcept { return take(' '); }
  bool blanks() noexcept {  // or none
    if (*at_ != ' ') return true;
    for (int words = 0; words < 2; ++words) {
      const std::uint64_t others = load(at_) ^ each(' ');
      if (others != 0) {
        at_ += before(others);
        return true;
      }
      at_ += kChars;
    }
    return false;
  }
  bool word(std::string_view& word) noexcept {
    const char* const begin = at_;
    while (at_ - begin<kWordMost&& * at_> ' ') ++at_;
    word = {begin, static_cast<std::size_t>(at_ - begin)};
    return at_ != begin && blank_behind();
  }
  bool two(const char* letters) noexcept {
    if (std::memcmp(at_, letters, 2) != 0) return false;
    at_ += 2;
    return blank_behind();
  }
  bool direction() noexcept { return two("Rx") || two("Tx"); }
  // "12.345", of a unit that has so many decimal places down to the nanosecond.
  bool time(int places, std::int64_t& t_ns) noexcept {
    std::uint64_t value = 0;
    if (digits(value) == 0) return false;
    t_ns = static_cast<std::int64_t>(value) * kPowersOfTen[static_cast<std::size_t>(places)];
    if (take('.')) {
      const int count = digits(value);
      if (count == 0 || count > places) return false;
      t_ns +=
          static_cast<std::int64_t>(value) * kPowersOfTen[static_cast<std::size_t>(places - count)];
    }
    return blank_behind();
  }
  // How many digits it has: 0 to 8.
  int hexadecimal(std::uint32_t& value) noexcept {
    int count = 0;
    for (; count < kChars; ++count, ++at_) {
      const int digit = hex_value(*at_);
      if (digit < 0) break;
      value = value << 4 | static_cast<std::uint32_t>(digit);
    }
    return count;
  }
  bool length(std::uint8_t& bytes) noexcept {  // "8"
    bytes = static_cast<std::uint8_t>(*at_ - '0');
    ++at_;
    return bytes <= kClassicPayload && is_line_blank();
  }
  // "01 02 03": so many, the first lowest.
  bool data(int count, std::uint64_t& bytes) noexcept {
    const bool all =
        count == kClassicPayload ? take_data(kClassicPayload, bytes) : take_data(count, bytes);
    return all && is_line_blank();
  }
  // What is left of the line, without a character that steers: behind its end.
  const char* line_end() noexcept {
    for (; at_ + kChars <= end_; at_ += kChars) {
      const std::uint64_t found = controls(load(at_));
      if (found == 0) continue;
      at_ += before(found);
      if (*at_ == '\r') ++at_;
      return at_ != end_ && *at_ == '\n' ? at_ + 1 : nullptr;
    }
    return nullptr;
  }
  bool is_over() const noexcept { return *at_ == '\n' || *at_ == '\r'; }

 private:
  static constexpr int kClassicPayload = 8;

  bool is_line_blank() const noexcept { return *at_ == ' ' || is_over(); }
  // How many there are: 0 to 8.
  int digits(std::uint64_t& value) noexcept {
    const std::uint64_t word = load(at_);
    const std::uint64_t ends = no_digits(word);
    const int count = ends == 0 ? kChars : before(ends);
    if (count == 0) return 0;
    value = decimal_of(word, count);
    at_ += count;
    return count;
  }
  // Quicker where the compiler knows how many.
  [[gnu::always_inline]] bool take_data(int count, std::uint64_t& bytes) noexcept {
    constexpr std::ptrdiff_t kByteChars = 3;
    int wrong = 0;    // negative with the first that is no digit
    int between = 0;  // not 0 with the first that is no blank
    for (int i = 0; i < count; ++i) {
      const char* const byte = at_ + kByteChars * i;
      const int high = hex_value(byte[0]);
      const int low = hex_value(byte[1]);
      wrong |= high | low;
      if (i > 0) between |= byte[-1] ^ ' ';
      bytes |= static_cast<std::uint64_t>(static_cast<std::uint8_t>(high << 4 | low))
               << (kChars * i);
    }
    at_ += kByteChars * count - 1;
    return wrong >= 0 && between == 0;
  }

  const char* at_;
  const char* end_;
};

struct Frame {
  std::int64_t t_ns = 0;
  std::string_view interface;
  CanId id{};
  std::uint8_t length = 0;
  std::uint64_t bytes = 0;

  // Behind so many refusals the compiler takes it for rare and fills the frame byte by byte, unless
  // it stands alone.
  [[gnu::noinline]] void give(LogRecord& record) const noexcept {
    record.t_ns = t_ns;
    record.interface = interface;
    record.frame = CanFrame{};
    record.frame.id = id;
    record.frame.length = length;
    std::memcpy(record.frame.data.data(), &bytes, sizeof bytes);
  }
};

bool is_in_range(CanId id) noexcept {
  return id.value <= (id.extended ? kExtendedIdMax : kStandardIdMax);
}

bool is_channel(std::string_view word) noexcept {
  static_assert(kWordMost <= 9, "below 32 bits, whatever the digits");
  for (const char c : word) {
    if (!is_digit(c)) return false;
  }
  return true;
}

}  // namespace

const char* read_usual_asc(std::string_view text, LogRecord& record) noexcept {
  assert(text.size() >= kUsualColumnsMost);
  constexpr int kPlaces = 9;  // of a second
  // Time, channel, identifier, direction, kind, length, data.
  static_assert(std::size_t{7} * kColumnMost <= kUsualColumnsMost);
  Columns line(text);
  Frame frame;
  if (!line.blanks() || !line.time(kPlaces, frame.t_ns) || !line.blanks() ||
      !line.word(frame.interface) || !is_channel(frame.interface) || !line.blanks()) {
    return nullptr;
  }
  if (line.hexadecimal(frame.id.value) == 0) return nullptr;
  frame.id.extended = line.take('x');
  if (!line.blank_behind() || !is_in_range(frame.id) || !line.blanks() || !line.direction() ||
      !line.blanks() || !line.take('d') || !line.blank_behind() || !line.blanks() ||
      !line.length(frame.length)) {
    return nullptr;
  }
  if (frame.length > 0 && !(line.blanks() && line.data(frame.length, frame.bytes))) return nullptr;
  const char* const end = line.line_end();
  if (end != nullptr) frame.give(record);
  return end;
}

const char* read_usual_trc(std::string_view text, std::string_view columns,
                           LogRecord& record) noexcept {
  assert(text.size() >= kUsualColumnsMost);
  constexpr int kPlaces = 6;  // of a millisecond
  Columns line(text);
  Frame frame{record.t_ns, record.interface};
  std::string_view unused;
  if (!line.blanks() || !is_digit(line.next())) return nullptr;
  for (const char column : columns) {
    if (column == 'D') break;
    if (!line.has_room() || !line.blanks()) return nullptr;
    bool taken = false;
    switch (column) {
      case 'O':
        taken = line.time(kPlaces, frame.t_ns);
        break;
      case 'T':
        taken = line.two("DT");
        break;
      case 'B':
        taken = line.word(frame.interface);
        break;
      case 'I': {
        constexpr int kStandardDigits = 4;
        frame.id.extended = line.hexadecimal(frame.id.value) > kStandardDigits;
        taken = line.blank_behind() && is_in_range(frame.id);
        break;
      }
      case 'd':
        taken = line.direction();
        break;
      case 'L':
      case 'l':
        taken = line.length(frame.length);
        break;
      default:
        taken = line.word(unused);
        break;
    }
    if (!taken) return nullptr;
  }
  if (!line.has_room() || !line.blanks()) return nullptr;
  // Without data a word may follow that says why.
  if (frame.length > 0 ? !line.data(frame.length, frame.bytes) : !line.is_over()) return nullptr;
  const char* const end = line.line_end();
  if (end != nullptr) frame.give(record);
  return end;
}

}  // namespace beltgrip::can
