// PEAK's text log (.trc), versions 1.0, 1.1, 1.2, 1.3, 2.0 and 2.1. A version is a list of columns;
// version 2 names its own in the header. Times are milliseconds since the start of the trace.
#include <algorithm>
#include <string>

#include "can_dbc/log/format.h"
#include "can_dbc/log/frame_bits.h"
#include "can_dbc/log/text.h"
#include "can_dbc/log/usual_columns.h"

namespace beltgrip::can {

namespace {

using log_text::decimal;
using log_text::hexadecimal;
using log_text::is_digit;
using log_text::kFdLengths;
using log_text::skip_blanks;
using log_text::take_hex_bytes;
using log_text::take_word;
using log_text::time_ns;
using log_text::trim_end;

constexpr std::int64_t kMillisecond_ns = 1'000'000;
constexpr std::string_view kDefaultInterface = "1";

// The columns by the letters of version 2: N number, O time, T type, B bus, I identifier, d
// direction, R reserved, L length code, l length, D data. Version 1 has the type where version 2
// has the direction, and writes "1)" for the number.
struct Version {
  std::string_view text, columns;
};
constexpr std::array<Version, 6> kVersions{{{"1.0", "NOILD"},
                                            {"1.1", "NOdILD"},
                                            {"1.2", "NOBdILD"},
                                            {"1.3", "NOBdIRLD"},
                                            {"2.0", "NOTIdlD"},
                                            {"2.1", "NOTBIdRLD"}}};

class TrcParser : public LineParser {
 public:
  LineKind parse(std::string_view line, LogRecord& record) override {
    skip_blanks(line);
    trim_end(line);
    if (line.empty()) return LineKind::kNothing;
    if (line[0] == ';') {
      header(line);
      return LineKind::kNothing;
    }
    if (!is_digit(line[0])) return bad("not a frame");
    record.frame = CanFrame{};
    record.interface = kDefaultInterface;
    CanFrame& frame = record.frame;
    std::string_view type = "DT";
    std::string_view direction = "Rx";
    std::size_t code = 0;
    bool code_is_length = false;
    for (const char column : columns_) {
      if (column == 'D') break;
      std::string_view word = take_word(line);
      if (word.empty()) return bad("ends before the data");
      switch (column) {
        case 'O': {
          const auto t_ns = time_ns(word, kMillisecond_ns);
          if (!t_ns) return bad("unreadable time");
          record.t_ns = *t_ns;
          break;
        }
        case 'T':
          // What is no frame need not have the columns of one.
          if (word == "ER") return error_frame(frame);
          if (!is_frame_type(word)) return LineKind::kNothing;
          type = word;
          break;
        case 'B':
          record.interface = word;
          break;
        case 'I': {
          const auto id = hexadecimal(word);
          constexpr std::size_t kStandardDigits = 4;
          frame.id.extended = word.size() > kStandardDigits;
          // Version 1 marks what is no frame by an identifier of all ones.
          if (id && *id == 0xFFFF'FFFF) return LineKind::kNothing;
          const std::uint32_t highest = frame.id.extended ? kExtendedIdMax : kStandardIdMax;
          if (!id || *id > highest) return bad("unreadable identifier");
          frame.id.value = *id;
          break;
        }
        case 'd':
          direction = word;
          break;
        case 'L':
        case 'l': {
          const auto value = decimal(word);
          if (!value || *value > kMaxPayload) return bad("unreadable length");
          code = *value;
          code_is_length = column == 'l';
          break;
        }
        default:  // number, reserved
          break;
      }
    }
    if (direction == "Warng") return LineKind::kNothing;
    if (direction == "Error") return error_frame(frame);
    set_kind(type, frame);
    if (frame.fd && !code_is_length) {
      if (code > 15) return bad("unreadable length");
      code = kFdLengths[code];
    }
    if (!frame.fd && code > 8) return bad("more than 8 bytes in a classic frame");
    frame.length = static_cast<std::uint8_t>(code);
    if (!frame.remote && take_hex_bytes(line, code, frame.data.data())) return LineKind::kFrame;
    skip_blanks(line);
    frame.remote |= line.starts_with("RTR");
    for (std::size_t i = 0; i < code && !frame.remote; ++i) {
      const auto byte = hexadecimal(take_word(line));
      if (!byte || *byte > 0xFF) return bad("fewer data bytes than the length says");
      frame.data[i] = static_cast<std::uint8_t>(*byte);
    }
    return LineKind::kFrame;
  }

  const char* quick_frame(std::string_view text, LogRecord& record) override {
    if (text.size() < kUsualColumnsMost) return nullptr;
    record.interface = kDefaultInterface;
    return read_usual_trc(text, columns_, record);
  }

 private:
  static void set_kind(std::string_view type, CanFrame& frame) {
    frame.fd = type == "FD" || type == "FB" || type == "FE" || type == "BI";
    frame.bit_rate_switch = type == "FB" || type == "BI";
    frame.error_state_indicator = type == "FE" || type == "BI";
    frame.remote = type == "RR";
  }

  static bool is_frame_type(std::string_view type) {
    static constexpr std::array<std::string_view, 6> kFrames{"DT", "FD", "FB", "FE", "BI", "RR"};
    return std::find(kFrames.begin(), kFrames.end(), type) != kFrames.end();
  }

  static LineKind error_frame(CanFrame& frame) {
    frame = CanFrame{};
    frame.id = {kBusError, false};
    frame.error = true;
    frame.length = kErrorLength;
    return LineKind::kFrame;
  }

  void header(std::string_view line) {
    constexpr std::string_view kFileVersion = ";$FILEVERSION=";
    constexpr std::string_view kColumns = ";$COLUMNS=";
    if (line.starts_with(kFileVersion)) {
      const std::string_view text = line.substr(kFileVersion.size());
      for (const Version& version : kVersions) {
        if (version.text == text) columns_ = version.columns;
      }
    } else if (line.starts_with(kColumns)) {
      std::string columns;
      for (const char c : line.substr(kColumns.size())) {
        if (c != ',' && c != ' ') columns += c;
      }
      columns_ = columns;
    }
  }

  std::string columns_{kVersions[0].columns};  // version 1.0 does not say which it is
};

}  // namespace

std::unique_ptr<LineParser> make_trc_parser() { return std::make_unique<TrcParser>(); }

}  // namespace beltgrip::can
