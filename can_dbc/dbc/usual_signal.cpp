#include "can_dbc/dbc/usual_signal.h"

#include <array>
#include <cstring>

#include "can_dbc/dbc/draft.h"
#include "can_dbc/dbc/short_decimal.h"

namespace beltgrip::can::dbc {

namespace {

constexpr bool is_space(char c) { return c == ' ' || c == '\t'; }
constexpr bool is_digit(char c) { return c >= '0' && c <= '9'; }

constexpr std::array<bool, 256> word_characters() {
  std::array<bool, 256> table{};
  for (std::size_t c = 0; c < 26; ++c) table['a' + c] = table['A' + c] = true;
  for (std::size_t c = 0; c < 10; ++c) table['0' + c] = true;
  table['_'] = true;
  return table;
}
constexpr std::array<bool, 256> kWordCharacters = word_characters();
bool is_word_char(char c) { return kWordCharacters[static_cast<unsigned char>(c)]; }

// From the front of one line. Behind it stands a line break, which belongs to no token.
class Line {
 public:
  Line(const char* begin, const char* end) : at_(begin), end_(end) {}

  const char* at() const { return at_; }
  bool over() const { return at_ == end_; }
  void skip_spaces() {
    while (is_space(*at_)) ++at_;
  }
  bool take(char c) {
    if (*at_ != c) return false;
    ++at_;
    return true;
  }
  bool take_behind_spaces(char c) {
    skip_spaces();
    return take(c);
  }
  // A name that nothing is to be said of; else empty.
  std::string_view name() {
    const char* const begin = at_;
    while (is_word_char(*at_)) ++at_;
    const std::string_view name(begin, static_cast<std::size_t>(at_ - begin));
    const bool plain = !name.empty() && !is_digit(name[0]) && name.size() <= kNameLengthMax;
    return plain && !is_statement_keyword(name) ? name : std::string_view();
  }
  bool take_whole(std::uint32_t& value) {
    const ShortDecimal read = read_short_decimal(at_, end_);
    constexpr std::uint64_t kMost = 0x7FFF'FFFF;
    if (read.end == nullptr || !read.whole || read.digits > kMost) return false;
    value = static_cast<std::uint32_t>(read.digits);
    at_ = read.end;
    return true;
  }
  bool take_number(double& value) {
    const bool negative = *at_ == '-';
    if (negative || *at_ == '+') ++at_;
    const ShortDecimal read = read_short_decimal(at_, end_);
    if (read.end == nullptr) return false;
    value = negative ? -read.value : read.value;
    at_ = read.end;
    return true;
  }
  bool take_unit(std::string_view& unit) {
    if (!take('"')) return false;
    const auto left = static_cast<std::size_t>(end_ - at_);
    const auto* const quote = static_cast<const char*>(std::memchr(at_, '"', left));
    if (quote == nullptr || quote[-1] == '\\') return false;
    unit = {at_, static_cast<std::size_t>(quote - at_)};
    if (std::memchr(at_, '\r', unit.size()) != nullptr) return false;
    at_ = quote + 1;
    return true;
  }
  // What is left of the line is names, the last thing none but a name.
  bool take_receivers(std::string_view& receivers) {
    skip_spaces();
    const char* const begin = at_;
    bool comma = true;
    while (!over()) {
      if (name().empty()) return false;
      comma = false;
      for (; is_space(*at_) || *at_ == ','; ++at_) comma |= *at_ == ',';
    }
    receivers = {begin, static_cast<std::size_t>(at_ - begin)};
    return !comma;
  }

 private:
  const char* at_;
  const char* end_;
};

// "M", "m3", "m3M", or nothing.
bool take_indicator(Line& line, UsualSignal& signal) {
  if (line.take('m')) {
    std::uint32_t value = 0;
    if (!line.take_whole(value)) return false;
    signal.selector_value = value;
  }
  signal.is_multiplexer = line.take('M');
  return true;
}

}  // namespace

const char* read_usual_signal(std::string_view text, UsualSignal& signal) noexcept {
  const auto* const line_break =
      static_cast<const char*>(std::memchr(text.data(), '\n', text.size()));
  if (line_break == nullptr) return nullptr;
  const char* const end =
      line_break != text.data() && line_break[-1] == '\r' ? line_break - 1 : line_break;
  Line line(&text.front(), end);
  line.skip_spaces();
  signal.name = line.name();
  if (signal.name.empty()) return nullptr;
  line.skip_spaces();
  if (!take_indicator(line, signal) || !line.take_behind_spaces(':')) return nullptr;
  line.skip_spaces();
  if (!line.take_whole(signal.start_bit) || !line.take('|') || !line.take_whole(signal.length) ||
      !line.take('@')) {
    return nullptr;
  }
  signal.is_big_endian = line.take('0');
  if (!signal.is_big_endian && !line.take('1')) return nullptr;
  signal.is_signed = line.take('-');
  if (!signal.is_signed && !line.take('+')) return nullptr;
  if (!line.take_behind_spaces('(') || !line.take_number(signal.scale) || !line.take(',') ||
      !line.take_number(signal.offset) || !line.take(')') || !line.take_behind_spaces('[') ||
      !line.take_number(signal.minimum) || !line.take('|') || !line.take_number(signal.maximum) ||
      !line.take(']')) {
    return nullptr;
  }
  line.skip_spaces();
  if (!line.take_unit(signal.unit) || !line.take_receivers(signal.receivers)) return nullptr;
  return line.at();
}

std::string_view take_receiver(std::string_view& receivers) noexcept {
  std::size_t begin = 0;
  while (begin < receivers.size() && !is_word_char(receivers[begin])) ++begin;
  std::size_t end = begin;
  while (end < receivers.size() && is_word_char(receivers[end])) ++end;
  const std::string_view name = receivers.substr(begin, end - begin);
  receivers.remove_prefix(end);
  return name;
}

}  // namespace beltgrip::can::dbc
