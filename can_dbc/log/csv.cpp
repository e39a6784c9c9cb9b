// Frames as a table (.csv): a first line that names the columns, in any order, separated by comma,
// semicolon or tab. Known names are in one table below; what a plain number means (hexadecimal or
// not, seconds or smaller) is told from the names and the first lines.
#include <algorithm>
#include <array>
#include <string>

#include "can_dbc/log/format.h"
#include "can_dbc/log/frame_bits.h"
#include "can_dbc/log/text.h"
#include "can_dbc/text/table_row.h"

namespace beltgrip::can {

namespace {

using log_text::clock_ns;
using log_text::date_ns;
using log_text::decimal;
using log_text::hex_value;
using log_text::hexadecimal;
using log_text::is_blank;
using log_text::is_digit;
using log_text::kFdLengths;
using log_text::time_ns;
using log_text::trim_end;

constexpr std::size_t kColumnsMax = 96;

enum class Column : std::uint8_t {
  kOther,
  kTime,
  kTime_ms,
  kTime_us,
  kTime_ns,
  kId,
  kExtended,
  kLength,
  kData,      // all bytes
  kDataByte,  // one byte: the first such column is byte 0
  kBus,
  kRemote,
  kError,
  kFd,
  kBitRateSwitch,
  kErrorState
};

struct ColumnName {
  std::string_view name;  // letters and digits only, lower case
  Column column;
};
constexpr std::array<ColumnName, 69> kColumnNames{{{"time", Column::kTime},
                                                   {"timestamp", Column::kTime},
                                                   {"t", Column::kTime},
                                                   {"ts", Column::kTime},
                                                   {"times", Column::kTime},
                                                   {"timesec", Column::kTime},
                                                   {"timeseconds", Column::kTime},
                                                   {"seconds", Column::kTime},
                                                   {"timestamps", Column::kTime},
                                                   {"timestampepoch", Column::kTime},
                                                   {"abstime", Column::kTime},
                                                   {"abstimesec", Column::kTime},
                                                   {"datetime", Column::kTime},
                                                   {"timems", Column::kTime_ms},
                                                   {"timestampms", Column::kTime_ms},
                                                   {"timeoffsetms", Column::kTime_ms},
                                                   {"timeus", Column::kTime_us},
                                                   {"timestampus", Column::kTime_us},
                                                   {"timens", Column::kTime_ns},
                                                   {"timestampns", Column::kTime_ns},
                                                   {"tns", Column::kTime_ns},
                                                   {"id", Column::kId},
                                                   {"canid", Column::kId},
                                                   {"idhex", Column::kId},
                                                   {"canidhex", Column::kId},
                                                   {"iddec", Column::kId},
                                                   {"identifier", Column::kId},
                                                   {"arbitrationid", Column::kId},
                                                   {"arbid", Column::kId},
                                                   {"messageid", Column::kId},
                                                   {"msgid", Column::kId},
                                                   {"frameid", Column::kId},
                                                   {"address", Column::kId},
                                                   {"addr", Column::kId},
                                                   {"extended", Column::kExtended},
                                                   {"isextended", Column::kExtended},
                                                   {"isextendedid", Column::kExtended},
                                                   {"ext", Column::kExtended},
                                                   {"ide", Column::kExtended},
                                                   {"eff", Column::kExtended},
                                                   {"xtd", Column::kExtended},
                                                   {"dlc", Column::kOther},
                                                   {"len", Column::kLength},
                                                   {"length", Column::kLength},
                                                   {"datalength", Column::kLength},
                                                   {"databytescount", Column::kLength},
                                                   {"data", Column::kData},
                                                   {"datahex", Column::kData},
                                                   {"payload", Column::kData},
                                                   {"databytes", Column::kData},
                                                   {"bus", Column::kBus},
                                                   {"channel", Column::kBus},
                                                   {"buschannel", Column::kBus},
                                                   {"interface", Column::kBus},
                                                   {"network", Column::kBus},
                                                   {"iface", Column::kBus},
                                                   {"remote", Column::kRemote},
                                                   {"isremote", Column::kRemote},
                                                   {"isremoteframe", Column::kRemote},
                                                   {"rtr", Column::kRemote},
                                                   {"error", Column::kError},
                                                   {"iserror", Column::kError},
                                                   {"iserrorframe", Column::kError},
                                                   {"fd", Column::kFd},
                                                   {"isfd", Column::kFd},
                                                   {"edl", Column::kFd},
                                                   {"fdf", Column::kFd},
                                                   {"brs", Column::kBitRateSwitch},
                                                   {"esi", Column::kErrorState}}};

std::string plain_name(std::string_view text) {
  std::string plain;
  for (const char c : text) {
    if (c >= 'A' && c <= 'Z') plain += static_cast<char>(c - 'A' + 'a');
    if ((c >= 'a' && c <= 'z') || is_digit(c)) plain += c;
  }
  return plain;
}

Column column_of(std::string_view name) {
  const std::string plain = plain_name(name);
  for (const ColumnName& row : kColumnNames) {
    if (row.name == plain) return row.column;
  }
  // d1, data0, byte7, b3.
  std::string_view rest = plain;
  static constexpr std::array<std::string_view, 5> kPrefixes{"databyte", "data", "byte", "d", "b"};
  for (const std::string_view prefix : kPrefixes) {
    if (!rest.starts_with(prefix)) continue;
    const auto number = decimal(rest.substr(prefix.size()));
    if (number && *number <= kMaxPayload) return Column::kDataByte;
  }
  return Column::kOther;
}

bool is_true(std::string_view field) {
  if (field.size() == 1) {
    const char c = field[0];
    return c == '1' || c == 't' || c == 'T' || c == 'x' || c == 'X';
  }
  const std::string plain = plain_name(field);
  return plain == "1" || plain == "true" || plain == "yes" || plain == "t" || plain == "x";
}

// Of an identifier: extended or not; nothing: a word of another column.
std::optional<bool> is_extended(std::string_view field) {
  static constexpr std::array<std::string_view, 11> kExtended{
      "true", "1", "t", "x", "yes", "y", "ext", "extended", "xtd", "eff", "ide"};
  static constexpr std::array<std::string_view, 9> kStandard{"false", "0",   "f",        "",   "no",
                                                             "n",     "std", "standard", "sff"};
  if (field == "0" || field == "false") return false;  // as most are
  const std::string plain = plain_name(field);
  const auto is_in = [&plain](const auto& words) {
    return std::find(words.begin(), words.end(), plain) != words.end();
  };
  if (is_in(kExtended)) return true;
  return is_in(kStandard) ? std::optional(false) : std::nullopt;
}

std::optional<std::uint32_t> with_prefix_or(std::string_view field, int base) {
  constexpr std::size_t kTwoDigits = 2;
  if (base == 16 && field.size() == kTwoDigits &&
      (hex_value(field[0]) | hex_value(field[1])) >= 0) {
    return hexadecimal(field);
  }
  if (field.starts_with("0x") || field.starts_with("0X")) return hexadecimal(field.substr(2));
  if (field.ends_with('h') || field.ends_with('H')) {
    return hexadecimal(field.substr(0, field.size() - 1));
  }
  return log_text::in_base(field, base);
}

constexpr std::array<std::int8_t, 256> base64_values() {
  std::array<std::int8_t, 256> table{};
  for (auto& value : table) value = -1;
  for (std::size_t i = 0; i < 26; ++i) {
    table['A' + i] = static_cast<std::int8_t>(i);
    table['a' + i] = static_cast<std::int8_t>(26 + i);
  }
  for (std::size_t i = 0; i < 10; ++i) table['0' + i] = static_cast<std::int8_t>(52 + i);
  table['+'] = table['-'] = 62;
  table['/'] = table['_'] = 63;
  return table;
}
constexpr std::array<std::int8_t, 256> kBase64Values = base64_values();

int base64_value(char c) { return kBase64Values[static_cast<unsigned char>(c)]; }

// Bytes written so far, or nothing if the text is of another kind or has too many.
std::optional<std::size_t> read_base64(std::string_view text, CanFrame& frame) {
  while (text.ends_with('=')) text.remove_suffix(1);
  std::uint32_t bits = 0;
  int have = 0;
  std::size_t length = 0;
  for (const char c : text) {
    const int value = base64_value(c);
    if (value < 0) return std::nullopt;
    bits = (bits << 6) | static_cast<std::uint32_t>(value);
    have += 6;
    if (have < 8) continue;
    have -= 8;
    if (length == kMaxPayload) return std::nullopt;
    frame.data[length++] = static_cast<std::uint8_t>(bits >> have);
  }
  return length;
}

// "112233" and nothing else. What it has written where it is something else, the others write
// again.
std::optional<std::size_t> read_hex_run(std::string_view text, CanFrame& frame) {
  if (text.size() % 2 != 0 || text.size() > 2 * kMaxPayload) return std::nullopt;
  int wrong = 0;  // negative with the first that is no digit
  for (std::size_t i = 0; i < text.size(); i += 2) {
    const int high = hex_value(text[i]);
    const int low = hex_value(text[i + 1]);
    wrong |= high | low;
    if (wrong < 0) return std::nullopt;
    frame.data[i / 2] = static_cast<std::uint8_t>(high << 4 | low);
  }
  return text.size() / 2;
}

// "11 22 33", "112233", "0x112233", "11-22-33", "0x11 0x22", "1 2 3".
std::optional<std::size_t> read_hex(std::string_view text, CanFrame& frame) {
  const auto separates = [](char c) {
    return is_blank(c) || c == '-' || c == ':' || c == '.' || c == '_' || c == ',' || c == ';';
  };
  if (const auto quick = read_hex_run(text, frame)) return quick;
  std::size_t length = 0;
  while (!text.empty()) {
    if (separates(text[0])) {
      text.remove_prefix(1);
      continue;
    }
    std::size_t end = 0;
    while (end < text.size() && !separates(text[end])) ++end;
    std::string_view run = text.substr(0, end);
    text.remove_prefix(end);
    if (run.starts_with("0x") || run.starts_with("0X")) run.remove_prefix(2);
    if (run.size() != 1 && run.size() % 2 != 0) return std::nullopt;
    while (!run.empty()) {
      const std::size_t digits = std::min<std::size_t>(run.size(), 2);
      const auto byte = hexadecimal(run.substr(0, digits));
      if (!byte || length == kMaxPayload) return std::nullopt;
      frame.data[length++] = static_cast<std::uint8_t>(*byte);
      run.remove_prefix(digits);
    }
  }
  return length;
}

class CsvParser : public LineParser {
 public:
  explicit CsvParser(const Sample& sample) { look_ahead(sample); }

  LineKind parse(std::string_view line, LogRecord& record) override {
    trim_end(line);
    if (line.starts_with("\xEF\xBB\xBF")) line.remove_prefix(3);
    if (line.empty() || line[0] == '#') return LineKind::kNothing;
    if (!has_header_) {
      read_header(line);
      return has_header_ ? LineKind::kNothing : bad("not a header with time, identifier and data");
    }
    split(line);
    const char* const wrong =
        wrong_width({fields_.data(), field_count_}, columns_needed_, column_count_);
    return wrong != nullptr ? bad(wrong) : read_row(record);
  }

 private:
  void split(std::string_view line) {
    field_count_ = 0;
    for (;;) {
      skip_blanks_but_separator(line);
      std::string_view field;
      if (line.starts_with('"')) {
        const std::size_t end = std::min(line.find('"', 1), line.size());
        field = line.substr(1, end - 1);
        line.remove_prefix(std::min(end + 1, line.size()));
        const std::size_t next = std::min(line.find(separator_), line.size());
        line.remove_prefix(next);
      } else {
        // Most fields are short: a look at each character is sooner done than a call.
        std::size_t end = 0;
        while (end < line.size() && line[end] != separator_) ++end;
        field = line.substr(0, end);
        line.remove_prefix(end);
      }
      trim_end(field);
      if (field_count_ < kColumnsMax) fields_[field_count_++] = field;
      if (line.empty()) return;
      line.remove_prefix(1);
    }
  }

  void skip_blanks_but_separator(std::string_view& line) const {
    while (!line.empty() && is_blank(line[0]) && line[0] != separator_) line.remove_prefix(1);
  }

  void read_header(std::string_view line) {
    for (const char separator : {',', ';', '\t'}) {
      separator_ = separator;
      split(line);
      bool time = false;
      bool id = false;
      bool data = false;
      bool length = false;
      column_count_ = field_count_;
      columns_needed_ = 0;
      for (std::size_t i = 0; i < field_count_; ++i) {
        columns_[i] = column_of(fields_[i]);
        const Column column = columns_[i];
        const bool is_time = column >= Column::kTime && column <= Column::kTime_ns;
        if (is_time && time) columns_[i] = Column::kOther;
        if (column == Column::kId && id) columns_[i] = Column::kOther;
        time |= is_time;
        id |= column == Column::kId;
        data |= column == Column::kData || column == Column::kDataByte;
        length |= column == Column::kLength;
        // A frame may leave out the bytes that it has not.
        if (column != Column::kDataByte && !fields_[i].empty()) columns_needed_ = i + 1;
      }
      has_header_ = time && id && data;
      if (!has_header_) continue;
      // Without a column of the length itself the length code stands for it.
      for (std::size_t i = 0; i < field_count_; ++i) {
        if (!length && plain_name(fields_[i]) == "dlc") columns_[i] = Column::kLength;
        if (plain_name(fields_[i]) == "idhex" || plain_name(fields_[i]) == "canidhex")
          id_base_ = 16;
        if (plain_name(fields_[i]) == "iddec") id_base_ = 10;
      }
      const std::string first = plain_name(fields_[0]);
      savvycan_ = first == "timestamp" && field_count_ > 6 && plain_name(fields_[3]) == "dir";
      return;
    }
  }

  // Identifiers without 0x are hexadecimal if one in the first lines can be nothing else: letters,
  // or zeros in front. Whole time stamps are seconds unless their size says otherwise.
  void look_ahead(const Sample& sample) {
    for (const std::string_view raw : sample) {
      std::string_view line = raw;
      trim_end(line);
      if (line.starts_with("\xEF\xBB\xBF")) line.remove_prefix(3);
      if (line.empty() || line[0] == '#') continue;
      if (!has_header_) {
        read_header(line);
        continue;  // the header may stand behind a preamble
      }
      split(line);
      for (std::size_t i = 0; i < std::min(field_count_, column_count_); ++i) {
        const std::string_view field = fields_[i];
        if (columns_[i] == Column::kId && !field.empty() && hexadecimal(field)) {
          const bool letters = !decimal(field);
          const bool padded = field.size() > 1 && field[0] == '0';
          hex_ids_ |= letters || padded;
        }
        // Three digits are no hexadecimal byte.
        constexpr std::size_t kHexDigitsMax = 2;
        if (columns_[i] == Column::kDataByte && field.size() > kHexDigitsMax && decimal(field)) {
          byte_base_ = 10;
        }
        if (columns_[i] == Column::kTime && plain_unit_ns_ == 0) {
          plain_unit_ns_ = unit_of(field);
        }
      }
    }
    if (savvycan_) {
      hex_ids_ = true;
      plain_unit_ns_ = 1'000;
    }
    if (id_base_ == 0) id_base_ = hex_ids_ ? 16 : 10;
    has_header_ = false;  // the header is read again as the first line
  }

  // Of a time since 1970, by its size; seconds otherwise.
  static std::int64_t unit_of(std::string_view field) {
    if (field.find_first_not_of("0123456789") != std::string_view::npos) return 1'000'000'000;
    if (field.size() >= 18) return 1;
    if (field.size() >= 15) return 1'000;
    if (field.size() >= 12) return 1'000'000;
    return 1'000'000'000;
  }

  // Of a row, beside what its record takes at once.
  struct Payload {
    std::optional<std::size_t> wanted_length;
    std::size_t length = 0;
    std::string_view data;
    bool bytes_read = true;
  };

  std::optional<std::int64_t> time_of(Column column, std::string_view field) {
    static constexpr std::array<std::int64_t, 4> kUnits_ns{0, 1'000'000, 1'000, 1};
    std::int64_t unit_ns =
        kUnits_ns[static_cast<std::size_t>(column) - static_cast<std::size_t>(Column::kTime)];
    if (unit_ns == 0) unit_ns = plain_unit_ns_ == 0 ? 1'000'000'000 : plain_unit_ns_;
    auto t_ns = time_ns(field, unit_ns);
    if (!t_ns) t_ns = date_ns(field);
    if (!t_ns) t_ns = clock_ns(field);
    return t_ns;
  }

  bool read_id(std::string_view digits, CanFrame& frame) const {
    const bool marked = digits.size() > 1 && (digits.back() == 'x' || digits.back() == 'X');
    if (marked) digits.remove_suffix(1);
    const auto id = with_prefix_or(digits, id_base_);
    if (!id || *id > kExtendedIdMax) return false;
    frame.id.value = *id;
    frame.id.extended |= marked || *id > kStandardIdMax;
    return true;
  }

  void read_byte(std::string_view field, CanFrame& frame, Payload& payload) const {
    if (field.empty()) return;
    const auto byte = with_prefix_or(field, byte_base_);
    if (!byte || *byte > 0xFF || payload.length == kMaxPayload) {
      payload.bytes_read = false;
      return;
    }
    frame.data[payload.length++] = static_cast<std::uint8_t>(*byte);
  }

  // nullptr, or what is wrong.
  const char* read_field(Column column, std::string_view field, LogRecord& record,
                         Payload& payload) {
    CanFrame& frame = record.frame;
    switch (column) {
      case Column::kTime:
      case Column::kTime_ms:
      case Column::kTime_us:
      case Column::kTime_ns: {
        const auto t_ns = time_of(column, field);
        if (!t_ns) return "unreadable time";
        record.t_ns = *t_ns;
        break;
      }
      case Column::kId:
        if (!read_id(field, frame)) return "unreadable identifier";
        break;
      case Column::kExtended: {
        const auto extended = is_extended(field);
        if (!extended) return "unreadable kind of identifier; expected true or false";
        frame.id.extended |= *extended;
        break;
      }
      case Column::kLength:
        if (const auto value = decimal(field)) {
          payload.wanted_length = *value;
        } else if (const auto marked = with_prefix_or(field, 10)) {
          payload.wanted_length = *marked;
        } else if (!field.empty()) {
          return "unreadable length";
        }
        break;
      case Column::kData:
        payload.data = field;
        break;
      case Column::kDataByte:
        read_byte(field, frame, payload);
        break;
      case Column::kBus:
        if (!field.empty()) record.interface = field;
        break;
      case Column::kRemote:
        frame.remote = is_true(field);
        break;
      case Column::kError:
        frame.error = is_true(field);
        break;
      case Column::kFd:
        frame.fd = is_true(field);
        break;
      case Column::kBitRateSwitch:
        frame.bit_rate_switch = is_true(field);
        break;
      case Column::kErrorState:
        frame.error_state_indicator = is_true(field);
        break;
      case Column::kOther:
        break;
    }
    return nullptr;
  }

  // The whole payload in one column wins over columns of single bytes. False: it does not fit the
  // length that the row says.
  static bool read_data(CanFrame& frame, Payload& payload) {
    frame.data.fill(0);
    auto& wanted_length = payload.wanted_length;
    // python-can writes base64, everybody else hexadecimal digits: the length decides.
    auto count = read_hex(payload.data, frame);
    // A length code instead of a length.
    const bool is_code = count && wanted_length && *wanted_length > 8 && *wanted_length < 16 &&
                         kFdLengths[*wanted_length] == *count;
    if (is_code) wanted_length = count;
    if (!count || (wanted_length && *count != *wanted_length)) {
      frame.data.fill(0);
      count = read_base64(payload.data, frame);
      if (!count || !wanted_length || *count != *wanted_length) return false;
    }
    payload.length = *count;
    return true;
  }

  LineKind read_row(LogRecord& record) {
    record.frame = CanFrame{};
    record.interface = "1";
    CanFrame& frame = record.frame;
    Payload payload;
    for (std::size_t i = 0; i < std::min(field_count_, column_count_); ++i) {
      const char* const wrong = read_field(columns_[i], fields_[i], record, payload);
      if (wrong != nullptr) return bad(wrong);
    }
    const auto& wanted_length = payload.wanted_length;
    if (frame.error) {
      frame = CanFrame{.id = {kBusError, false}, .error = true, .length = 8};
      return LineKind::kFrame;
    }
    if (frame.remote) {
      frame.data.fill(0);
      frame.length = static_cast<std::uint8_t>(std::min<std::size_t>(wanted_length.value_or(0), 8));
      frame.fd = frame.bit_rate_switch = frame.error_state_indicator = false;
      return LineKind::kFrame;
    }
    if (!payload.bytes_read) return bad("unreadable data byte");
    if (!payload.data.empty() && !read_data(frame, payload)) {
      return bad("data do not fit the length");
    }
    std::size_t length = payload.length;
    if (wanted_length && length > *wanted_length) {
      std::fill(frame.data.begin() + static_cast<std::ptrdiff_t>(*wanted_length),
                frame.data.begin() + static_cast<std::ptrdiff_t>(length), std::uint8_t{0});
      length = *wanted_length;  // unused byte columns filled with zeros
    }
    if (wanted_length && length < *wanted_length)
      return bad("fewer data bytes than the length says");
    if (length > 8) frame.fd = true;
    if (!frame.fd) frame.bit_rate_switch = frame.error_state_indicator = false;
    frame.length = static_cast<std::uint8_t>(length);
    return LineKind::kFrame;
  }

  char separator_ = ',';
  bool has_header_ = false;
  bool savvycan_ = false;
  bool hex_ids_ = false;
  int id_base_ = 0;
  int byte_base_ = 16;  // of data bytes in columns of their own
  std::int64_t plain_unit_ns_ = 0;
  std::size_t column_count_ = 0;
  std::size_t columns_needed_ = 0;
  std::array<Column, kColumnsMax> columns_{};
  std::size_t field_count_ = 0;
  std::array<std::string_view, kColumnsMax> fields_;
};

}  // namespace

bool is_head_of_frames(std::string_view line) {
  trim_end(line);
  const Sample none;
  CsvParser parser(none);
  LogRecord record;
  return !line.empty() && line[0] != '#' && parser.parse(line, record) == LineKind::kNothing;
}

std::unique_ptr<LineParser> make_csv_parser(const Sample& sample) {
  return std::make_unique<CsvParser>(sample);
}

}  // namespace beltgrip::can
