// Vector's text log (.asc): a header with number base and kind of time stamp, then one event a
// line. Frames and error frames are taken; all other events (statistics, status, transport
// protocols, triggers) are none.
#include <algorithm>
#include <array>

#include "can_dbc/log/format.h"
#include "can_dbc/log/frame_bits.h"
#include "can_dbc/log/text.h"
#include "can_dbc/log/usual_columns.h"

namespace beltgrip::can {

namespace {

using log_text::decimal;
using log_text::hexadecimal;
using log_text::in_base;
using log_text::is_digit;
using log_text::kFdLengths;
using log_text::skip_blanks;
using log_text::take_hex_bytes;
using log_text::take_word;
using log_text::time_ns;
using log_text::trim_end;

bool starts_with_word(std::string_view text, std::string_view lower_case_word) {
  if (text.size() < lower_case_word.size()) return false;
  return std::equal(lower_case_word.begin(), lower_case_word.end(), text.begin(),
                    [](char a, char b) { return a == (b >= 'A' && b <= 'Z' ? b + 32 : b); });
}

class AscParser : public LineParser {
 public:
  LineKind parse(std::string_view line, LogRecord& record) override {
    skip_blanks(line);
    trim_end(line);
    if (line.empty() || line.starts_with("//") || line.starts_with(';')) return LineKind::kNothing;
    if (!is_digit(line[0]) && line[0] != '-') return header(line);

    const auto stamp_ns = time_ns(take_word(line));
    if (!stamp_ns) return bad("unreadable time stamp");
    if (!take_stamp(*stamp_ns, record)) return bad("time stamp beyond the range");
    record.frame = CanFrame{};
    const std::string_view first = take_word(line);
    if (first == "CANFD") {
      record.interface = take_word(line);
      return fd_event(line, record.frame);
    }
    if (decimal(first)) {
      record.interface = first;
      return classic_event(line, record.frame);
    }
    return LineKind::kNothing;
  }

  const char* quick_frame(std::string_view text, LogRecord& record) override {
    if (base_ != 16 || text.size() < kUsualColumnsMost) return nullptr;
    const char* const end = read_usual_asc(text, record);
    return end != nullptr && take_stamp(record.t_ns, record) ? end : nullptr;
  }

 private:
  // Relative stamps count from the event before, whatever it was. False: beyond the range.
  bool take_stamp(std::int64_t stamp_ns, LogRecord& record) {
    std::int64_t sum_ns = 0;
    if (__builtin_add_overflow(relative_ ? last_ns_ : 0, stamp_ns, &sum_ns)) return false;
    last_ns_ = sum_ns;
    record.t_ns = sum_ns;
    return true;
  }

  LineKind header(std::string_view line) {
    if (starts_with_word(line, "base")) {
      std::string_view rest = line;
      take_word(rest);
      base_ = starts_with_word(take_word(rest), "dec") ? 10 : 16;
      take_word(rest);  // "timestamps"
      skip_blanks(rest);
      relative_ = starts_with_word(rest, "relative");
      return LineKind::kNothing;
    }
    static constexpr std::array<std::string_view, 9> kHeaders{"date",
                                                              "internal events",
                                                              "no internal events",
                                                              "begin triggerblock",
                                                              "end trigger",
                                                              "begin trigger",
                                                              "previous log file",
                                                              "split",
                                                              "start of measurement"};
    for (const std::string_view known : kHeaders) {
      if (starts_with_word(line, known)) return LineKind::kNothing;
    }
    return bad("not an event");
  }

  static LineKind error_frame(CanFrame& frame) {
    frame.error = true;
    frame.id.value = kBusError;
    frame.length = kErrorLength;
    return LineKind::kFrame;
  }

  // "18EBFF00x": extended. False if it is no number.
  bool read_id(std::string_view word, CanFrame& frame) const {
    frame.id.extended = word.ends_with('x') || word.ends_with('X');
    if (frame.id.extended) word.remove_suffix(1);
    const auto id = in_base(word, base_);
    if (!id) return false;
    frame.id.value = *id;
    return true;
  }

  // A name instead of the number: the number stands at the end, "ID = 418119424x", always decimal.
  static bool id_from_end(std::string_view line, CanFrame& frame) {
    const std::size_t at = line.rfind("ID =");
    if (at == std::string_view::npos) return false;
    line.remove_prefix(at + 4);
    std::string_view word = take_word(line);
    frame.id.extended = word.ends_with('x');
    if (frame.id.extended) word.remove_suffix(1);
    const auto id = decimal(word);
    frame.id.value = id.value_or(0);
    return id.has_value();
  }

  bool id_in_range(const CanFrame& frame) const {
    return frame.id.value <= (frame.id.extended ? kExtendedIdMax : kStandardIdMax);
  }

  bool read_data(std::string_view& line, CanFrame& frame) const {
    if (base_ == 16 && take_hex_bytes(line, frame.length, frame.data.data())) return true;
    for (std::size_t i = 0; i < frame.length; ++i) {
      const auto byte = in_base(take_word(line), base_);
      if (!byte || *byte > 0xFF) return false;
      frame.data[i] = static_cast<std::uint8_t>(*byte);
    }
    return true;
  }

  // "64  Rx   d 4 64 00 00 00 ...", "100 Rx r [8] ...", "ErrorFrame ...".
  LineKind classic_event(std::string_view line, CanFrame& frame) {
    const std::string_view id = take_word(line);
    if (starts_with_word(id, "errorframe")) return error_frame(frame);
    const std::string_view direction = take_word(line);
    const bool is_frame = starts_with_word(direction, "rx") || starts_with_word(direction, "tx");
    if (!is_frame) return LineKind::kNothing;  // "Statistic:", "J1939TP", ...
    if (!read_id(id, frame) && !id_from_end(line, frame)) return bad("unreadable identifier");
    if (!id_in_range(frame)) return bad("identifier out of range");
    const std::string_view kind = take_word(line);
    frame.remote = kind == "r" || kind == "R";
    if (!frame.remote && kind != "d" && kind != "D") return bad("neither data nor remote frame");
    const std::string_view length_word = take_word(line);
    const auto length = in_base(length_word, base_);
    if (frame.remote) {
      // Without a length, the next word is that of what follows.
      frame.length = static_cast<std::uint8_t>(std::min(length.value_or(0), 8U));
      return LineKind::kFrame;
    }
    if (!length || *length > 15) return bad("unreadable length");
    frame.length = static_cast<std::uint8_t>(std::min(*length, 8U));
    if (!read_data(line, frame)) return bad("fewer data bytes than the length says");
    return LineKind::kFrame;
  }

  // "Rx 30a [Name] 1 0 8 8 01 02 ... 102203 133 303000 ...": bit rate switch, error state, length
  // code, length, data, duration, bits, flags.
  LineKind fd_event(std::string_view line, CanFrame& frame) {
    std::string_view word = take_word(line);
    if (starts_with_word(word, "errorframe")) return error_frame(frame);
    if (!starts_with_word(word, "rx") && !starts_with_word(word, "tx")) return LineKind::kNothing;
    word = take_word(line);
    if (starts_with_word(word, "errorframe")) return error_frame(frame);
    if (!read_id(word, frame)) return bad("unreadable identifier");
    if (!id_in_range(frame)) return bad("identifier out of range");
    word = take_word(line);
    if (word != "0" && word != "1") word = take_word(line);  // behind the message's name
    const std::string_view error_state = take_word(line);
    const auto code = hexadecimal(take_word(line));
    const auto length = decimal(take_word(line));
    if ((word != "0" && word != "1") || (error_state != "0" && error_state != "1") || !code ||
        *code > 15 || !length || *length > kMaxPayload) {
      return bad("unreadable CAN FD flags or length");
    }
    frame.fd = true;
    frame.bit_rate_switch = word == "1";
    frame.error_state_indicator = error_state == "1";
    frame.length = static_cast<std::uint8_t>(*length);
    if (!read_data(line, frame)) return bad("fewer data bytes than the length says");
    take_word(line);
    take_word(line);
    const auto flags = hexadecimal(take_word(line));
    constexpr std::uint32_t kRemote = 0x10;
    constexpr std::uint32_t kFdFormat = 0x1000;
    if (!flags || *flags == 0) return LineKind::kFrame;  // not told
    frame.remote = (*flags & kRemote) != 0;
    const bool classic = frame.remote || ((*flags & kFdFormat) == 0 && frame.length <= 8);
    if (!classic) return LineKind::kFrame;
    // A classic frame on a CAN FD channel.
    frame.fd = frame.bit_rate_switch = frame.error_state_indicator = false;
    if (frame.remote) {
      frame.length = std::min(kFdLengths[*code], std::uint8_t{8});
      frame.data.fill(0);
    }
    return LineKind::kFrame;
  }

  int base_ = 16;
  bool relative_ = false;
  std::int64_t last_ns_ = 0;
};

}  // namespace

std::unique_ptr<LineParser> make_asc_parser() { return std::make_unique<AscParser>(); }

}  // namespace beltgrip::can
