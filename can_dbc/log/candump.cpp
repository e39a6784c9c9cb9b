// candump's two formats: the compact one of -l and -L, "(1.000000) vcan0 123#0011", and that of the
// console, " (1.000000)  vcan0  123   [2]  00 11", with any of its kinds of time stamp.
#include <algorithm>
#include <cstring>
#include <string>

#include "can_dbc/log/format.h"
#include "can_dbc/log/frame_bits.h"
#include "can_dbc/log/text.h"
#include "can_dbc/log/usual_line.h"

namespace beltgrip::can {

namespace {

using log_text::date_ns;
using log_text::decimal;
using log_text::hex_value;
using log_text::skip_blanks;
using log_text::take_word;
using log_text::time_ns;
using log_text::trim_end;

constexpr std::size_t kClassicPayload = 8;

constexpr std::size_t kStandardIdDigits = 3;
constexpr std::size_t kExtendedIdDigits = 8;

// Identifier digits: three for a standard one, eight for an extended one or an error frame. On the
// console older candumps pad with blanks, so that there may be fewer.
bool read_id(std::string_view digits, CanFrame& frame) {
  if (digits.empty() || digits.size() > kExtendedIdDigits) return false;
  std::uint32_t id = 0;
  for (const char c : digits) {
    const int value = hex_value(c);
    if (value < 0) return false;
    id = (id << 4) | static_cast<std::uint32_t>(value);
  }
  if (digits.size() == kExtendedIdDigits) {
    frame.error = (id & kErrorFlag) != 0;
    frame.id = {id & kExtendedIdMax, !frame.error};
    return true;
  }
  frame.id = {id, digits.size() > kStandardIdDigits};
  return frame.id.value <= (frame.id.extended ? kExtendedIdMax : kStandardIdMax);
}

// "_9" to "_F" behind eight bytes is the raw length code of a classic frame.
bool is_length_code(std::string_view text, std::size_t length) {
  return length == kClassicPayload && text.size() == 2 && text[0] == '_' &&
         hex_value(text[1]) > static_cast<int>(kClassicPayload);
}

class CandumpParser : public LineParser {
 public:
  explicit CandumpParser(bool delta) : delta_(delta) {}

  LineKind parse(std::string_view line, LogRecord& record) override {
    if (line.find('\x1B') != std::string_view::npos) line = without_colours(line);
    const bool words_of_error =
        after_error_ && (line.starts_with('\t') || line.starts_with("  \t"));
    skip_blanks(line);
    trim_end(line);
    if (line.empty() || words_of_error) return LineKind::kNothing;
    after_error_ = false;
    if (line[0] != '(') return without_time_stamp(line);

    const std::size_t close = line.find(')');
    if (close == std::string_view::npos) return bad("time stamp without \")\"");
    std::string_view stamp = line.substr(1, close - 1);
    line.remove_prefix(close + 1);
    skip_blanks(stamp);
    auto t_ns = time_ns(stamp);
    if (!t_ns) t_ns = date_ns(stamp);
    if (!t_ns) return bad("unreadable time stamp");

    const std::string_view interface = take_word(line);
    std::string_view word = take_word(line);
    if (word.empty()) return bad("ends before the frame");
    record.frame = CanFrame{};
    const std::size_t hash = word.find('#');
    const LineKind kind = hash != std::string_view::npos ? compact_frame(word, hash, record.frame)
                                                         : console_frame(word, line, record.frame);
    if (kind != LineKind::kFrame) return kind;
    const std::string_view direction = hash != std::string_view::npos ? take_word(line) : "";
    if (!direction.empty() && (!is_direction(direction) || !take_word(line).empty())) {
      return bad("more behind the frame than R or T");
    }
    after_error_ = record.frame.error;
    record.t_ns = *t_ns;
    if (delta_ && hash == std::string_view::npos) {
      if (__builtin_add_overflow(sum_ns_, *t_ns, &sum_ns_)) {
        return bad("time stamp beyond the range");
      }
      record.t_ns = sum_ns_;
    }
    record.interface = interface;
    record.sent = direction == "T";
    return LineKind::kFrame;
  }

  const char* quick_frame(std::string_view text, LogRecord& record) override {
    if (text.size() < kUsualLineMost) return nullptr;
    const char* const end = read_usual_line(text, record);
    if (end != nullptr) after_error_ = false;
    return end;
  }

 private:
  static bool is_direction(std::string_view word) { return word == "R" || word == "T"; }

  // "123#0011", "123#R8", "12345678##10011", "123#00.11".
  LineKind compact_frame(std::string_view word, std::size_t hash, CanFrame& frame) {
    if ((hash != kStandardIdDigits && hash != kExtendedIdDigits) ||
        !read_id(word.substr(0, hash), frame)) {
      return bad("unreadable identifier; expected 3 or 8 hexadecimal digits");
    }
    word.remove_prefix(hash + 1);
    if (word.starts_with('#')) {
      constexpr int kBitRateSwitch = 1;
      constexpr int kErrorState = 2;
      word.remove_prefix(1);
      const int flags = word.empty() ? -1 : hex_value(word[0]);
      if (flags < 0 || frame.error) return bad("CAN FD frame without its flags digit");
      frame.fd = true;
      frame.bit_rate_switch = (flags & kBitRateSwitch) != 0;
      frame.error_state_indicator = (flags & kErrorState) != 0;
      word.remove_prefix(1);
    } else if (word.starts_with('R') || word.starts_with('r')) {
      frame.remote = true;
      word.remove_prefix(1);
      if (word.empty()) return LineKind::kFrame;
      const int length = hex_value(word[0]);
      word.remove_prefix(1);
      if (length < 0 || length > 8 ||
          !(word.empty() || is_length_code(word, static_cast<std::size_t>(length)))) {
        return bad("remote frame with an unreadable length");
      }
      frame.length = static_cast<std::uint8_t>(length);
      return LineKind::kFrame;
    }
    const std::size_t longest = frame.fd ? kMaxPayload : kClassicPayload;
    std::size_t length = 0;
    while (word.size() >= 2) {
      const int high = hex_value(word[0]);
      const int low = hex_value(word[1]);
      if (high < 0) {
        if (word[0] != '.') break;
        word.remove_prefix(1);
        continue;
      }
      if (low < 0) return bad("odd number of data digits");
      if (length == longest) return bad("more data bytes than a frame holds");
      frame.data[length++] = static_cast<std::uint8_t>(high << 4 | low);
      word.remove_prefix(2);
    }
    if (word.size() == 1 && hex_value(word[0]) >= 0) return bad("odd number of data digits");
    if (!word.empty() && (frame.fd || !is_length_code(word, length))) {
      return bad("data that are no hexadecimal digits");
    }
    frame.length = static_cast<std::uint8_t>(length);
    return LineKind::kFrame;
  }

  // "123   [2]  00 11", "123   [8]  remote request", "123  [12]  00 ..." (CAN FD: two digits).
  LineKind console_frame(std::string_view word, std::string_view line, CanFrame& frame) {
    const auto direction_or_flag = [](std::string_view w) {
      return w == "RX" || w == "TX" || w == "-" || w == "B" || w == "E";
    };
    for (; direction_or_flag(word); word = take_word(line)) {
      frame.bit_rate_switch |= word == "B";
      frame.error_state_indicator |= word == "E";
    }
    if (!read_id(word, frame)) return bad("unreadable identifier");
    word = take_word(line);
    if (word.size() == 3 && word.front() == '{' && word.back() == '}' && hex_value(word[1]) > 8) {
      word = "[8]";  // -8 shows the raw length code of a classic frame of eight bytes
    }
    if (word.size() < 3 || word.front() != '[' || word.back() != ']') {
      return bad("no length in brackets");
    }
    const std::string_view digits = word.substr(1, word.size() - 2);
    const auto length = decimal(digits);
    frame.fd = digits.size() > 1;
    if (!length || *length > (frame.fd ? kMaxPayload : kClassicPayload)) {
      return bad("unreadable length");
    }
    if (!frame.fd) frame.bit_rate_switch = frame.error_state_indicator = false;
    frame.length = static_cast<std::uint8_t>(*length);
    skip_blanks(line);
    if (line.starts_with("remote request")) {
      frame.remote = true;
      return LineKind::kFrame;
    }
    for (std::size_t i = 0; i < *length; ++i) {
      const std::string_view byte = take_word(line);
      const int high = byte.size() == 2 ? hex_value(byte[0]) : -1;
      const int low = byte.size() == 2 ? hex_value(byte[1]) : -1;
      if (high < 0 || low < 0) return bad("fewer data bytes than the length says");
      frame.data[i] = static_cast<std::uint8_t>(high << 4 | low);
    }
    return LineKind::kFrame;
  }

  LineKind without_time_stamp(std::string_view line) {
    if (line.starts_with('#') || line.starts_with(';') || line.starts_with("//")) {
      return LineKind::kNothing;
    }
    const bool frame =
        line.find('#') != std::string_view::npos ||
        (line.find('[') != std::string_view::npos && line.find(']') != std::string_view::npos);
    return bad(frame ? "no time stamp" : "not a frame");
  }

  std::string_view without_colours(std::string_view line) {
    plain_.clear();
    for (std::size_t i = 0; i < line.size(); ++i) {
      if (line[i] == '\x1B') {
        while (i < line.size() && line[i] != 'm') ++i;
      } else {
        plain_ += line[i];
      }
    }
    return plain_;
  }

  bool delta_;
  bool after_error_ = false;  // the words of an error frame follow on lines of their own
  std::int64_t sum_ns_ = 0;
  std::string plain_;
};

}  // namespace

// Console stamps of -t z and -t d look alike: both start at zero. But those of -t d, differences,
// fall as often as they rise, and do not grow; those of -t z grow to three times the mean from the
// first half to the second, even where frames are out of order.
std::unique_ptr<LineParser> make_candump_parser(const Sample& sample) {
  CandumpParser probe(false);
  LogRecord record;
  std::vector<std::int64_t> stamps_ns;
  for (const std::string_view line : sample) {
    if (line.find('[') == std::string_view::npos) continue;
    if (probe.parse(line, record) != LineKind::kFrame) continue;
    stamps_ns.push_back(record.t_ns);
  }
  if (stamps_ns.empty() || stamps_ns[0] != 0) return std::make_unique<CandumpParser>(false);
  std::size_t falls = 0;
  double first_half = 0.0;
  double second_half = 0.0;
  for (std::size_t i = 0; i < stamps_ns.size(); ++i) {
    if (i > 0 && stamps_ns[i] < stamps_ns[i - 1]) ++falls;
    (i < stamps_ns.size() / 2 ? first_half : second_half) += static_cast<double>(stamps_ns[i]);
  }
  constexpr std::size_t kFallsPerTen = 1;
  constexpr double kGrowth = 2.5;
  const bool delta =
      falls * 10 > stamps_ns.size() * kFallsPerTen && second_half < kGrowth * first_half;
  return std::make_unique<CandumpParser>(delta);
}

}  // namespace beltgrip::can
