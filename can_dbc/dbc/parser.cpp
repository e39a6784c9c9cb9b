#include "can_dbc/dbc/parser.h"

#include <algorithm>
#include <array>
#include <bit>
#include <charconv>
#include <cmath>
#include <limits>
#include <set>

#include "can_dbc/dbc/draft.h"
#include "can_dbc/dbc/usual_signal.h"
#include "can_dbc/text/encoding.h"

namespace beltgrip::can {

namespace dbc {

namespace {

constexpr std::string_view kByteOrderMark = "\xEF\xBB\xBF";
constexpr std::uint32_t kExtendedFlag = 0x8000'0000U;
constexpr std::size_t kExcerptLength = 24;  // of the text that a message quotes

// Reads the statements of a DBC text into a draft. Each handler starts behind its keyword; false:
// it has said what is wrong, and the statement is kept as text.
class StatementReader {
 public:
  explicit StatementReader(Draft& draft) : draft_(draft), scan_(draft.text) {}
  void run();

 private:
  using Handler = bool (StatementReader::*)();
  struct Row {
    std::string_view keyword;
    Handler handler;
  };
  static const std::array<Row, 32> kRows;

  bool version();
  bool new_symbols();
  bool bit_timing();
  bool nodes();
  bool value_table();
  bool message();
  bool message_name(std::string_view& name, std::size_t name_offset);
  void message_tail(MessageDef& message);
  void set_id(std::uint32_t raw_id, std::string_view name, std::size_t id_offset,
              MessageDef& message);
  bool signal();
  bool multiplexing(std::string_view indicator, std::size_t indicator_offset, SignalDef& signal,
                    std::optional<std::uint64_t>& selector);
  bool signal_name(std::string_view& name, std::size_t name_offset, SignalDef& signal,
                   std::optional<std::uint64_t>& selector);
  bool signal_layout(SignalDef& signal);
  bool usual_signal();
  bool environment_variable();
  bool environment_data();
  bool comment();
  bool attribute_definition();
  bool attribute_default();
  bool attribute();
  bool relation();
  bool values();
  bool signal_group();
  bool value_type();
  bool multiplex_values();
  bool senders();
  bool verbatim();

  void check_order(std::string_view word);
  void unknown_statement();
  void signal_tail(SignalDef& signal, SignalUsage& usage);
  ShortText unit_of(Text unit);
  const SignalUsage* usage_of(const SignalUsage& usage);
  List<Text> receiver_list();
  void end_message();
  void add_signal(const SignalDef& signal, std::size_t name_offset,
                  std::optional<std::uint64_t> selector_value);
  template <typename T>
  void make_room(std::vector<T>& messages) const;
  bool value_list(ValueTable& table);
  bool read_labels();
  ValueTable table_of_labels();
  bool attribute_value(Text& value);
  bool object_of(Reference& reference);

  // Tokens that must be here; each says what it found and expected instead.
  bool expect(char c, const char* what);
  bool expect_number(NumberToken& token, const char* what);
  bool expect_unsigned(std::uint64_t& value, std::uint64_t highest, const char* what);
  bool expect_id(std::uint32_t& raw_id);
  bool expect_name(std::string_view& name, const char* what);
  bool expect_string(Text& text, StringContext context, const char* what);
  void expect_semicolon();
  bool fail(const char* expected);
  bool fail_at(std::size_t offset, const char* expected);
  void names_until_semicolon(std::vector<Text>& names);
  Text take_text(const StringToken& token);
  void check_name(std::string_view name, std::size_t offset);

  Draft& draft_;
  Scanner scan_;
  std::size_t start_ = 0;  // of the statement
  enum class Within : std::uint8_t { kNothing, kMessage, kRefusedMessage };
  Within within_ = Within::kNothing;  // what SG_ lines belong to
  std::vector<std::uint32_t> names_;  // of the message that is read; see MessageSource
  std::vector<SelectorValue> selector_values_;
  std::vector<SignalDef> signals_;
  std::array<ShortText, 64> units_;  // chosen: lately used ones, each where its characters say
  std::array<const SignalUsage*, 64> usages_{};  // in the same way
  std::vector<Text> receivers_;                  // of the signal that is read
  List<Text> last_receivers_;
  List<Text> usual_receivers_;  // of the last usual signal, and as it has them
  std::string_view last_receivers_text_;
  struct LabelRead {
    std::int64_t key = 0;
    std::size_t offset = 0;
    Text text;
  };
  std::vector<LabelRead> labels_;  // of the value list that is read
  std::vector<std::pair<std::int64_t, Text>> entries_;
  bool closed_ = true;  // the last quoted text had an end
  bool seen_bit_timing_ = false;
  bool seen_nodes_ = false;
  std::size_t last_rank_ = 0;  // see check_order
  std::string_view last_section_;
  std::array<bool, 7> late_reported_{};
  std::set<std::pair<Text, Text>> defined_;  // attributes: name, object
};

const std::array<StatementReader::Row, 32> StatementReader::kRows{{
    {"SG_", &StatementReader::signal},
    {"BO_", &StatementReader::message},
    {"VAL_", &StatementReader::values},
    {"CM_", &StatementReader::comment},
    {"BA_", &StatementReader::attribute},
    {"SG_MUL_VAL_", &StatementReader::multiplex_values},
    {"VAL_TABLE_", &StatementReader::value_table},
    {"BA_DEF_", &StatementReader::attribute_definition},
    {"BA_DEF_DEF_", &StatementReader::attribute_default},
    {"SIG_VALTYPE_", &StatementReader::value_type},
    {"BO_TX_BU_", &StatementReader::senders},
    {"SIG_GROUP_", &StatementReader::signal_group},
    {"BA_DEF_REL_", &StatementReader::attribute_definition},
    {"BA_DEF_DEF_REL_", &StatementReader::attribute_default},
    {"BA_REL_", &StatementReader::relation},
    {"VERSION", &StatementReader::version},
    {"NS_", &StatementReader::new_symbols},
    {"BS_", &StatementReader::bit_timing},
    {"BU_", &StatementReader::nodes},
    {"EV_", &StatementReader::environment_variable},
    {"ENVVAR_DATA_", &StatementReader::environment_data},
    {"BA_DEF_SGTYPE_", &StatementReader::verbatim},
    {"BA_SGTYPE_", &StatementReader::verbatim},
    {"CAT_", &StatementReader::verbatim},
    {"CAT_DEF_", &StatementReader::verbatim},
    {"EV_DATA_", &StatementReader::environment_data},
    {"FILTER", &StatementReader::verbatim},
    {"NS_DESC_", &StatementReader::verbatim},
    {"SGTYPE_", &StatementReader::verbatim},
    {"SGTYPE_VAL_", &StatementReader::verbatim},
    {"SIGTYPE_VALTYPE_", &StatementReader::verbatim},
    {"SIG_TYPE_REF_", &StatementReader::verbatim},
}};

bool StatementReader::fail_at(std::size_t offset, const char* expected) {
  const std::string_view rest = scan_.line_rest(offset, kExcerptLength);
  const std::string found = offset >= draft_.text.size() ? "the end of the file"
                            : rest.empty()               ? "the end of the line"
                                                         : "\"" + clip(rest) + "\"";
  draft_.problems.error(offset, "syntax", "found " + found + ", expected " + expected);
  return false;
}

// What is missing is missing at the end of its line, not at the start of the next.
bool StatementReader::fail(const char* expected) {
  const std::size_t offset = scan_.position();
  std::size_t end = offset;
  while (end > start_ && static_cast<unsigned char>(draft_.text[end - 1]) <= ' ') --end;
  const bool next_line = scan_.line_rest(end, offset - end).size() < offset - end;
  return fail_at(next_line ? end : offset, expected);
}

bool StatementReader::expect(char c, const char* what) { return scan_.accept(c) || fail(what); }

bool StatementReader::expect_number(NumberToken& token, const char* what) {
  scan_.skip_blank();
  const auto number = scan_.number();
  if (!number) return fail(what);
  token = *number;
  return true;
}

bool StatementReader::expect_unsigned(std::uint64_t& value, std::uint64_t highest,
                                      const char* what) {
  NumberToken token;
  if (!expect_number(token, what)) return false;
  if (!token.magnitude || *token.magnitude > highest || (token.negative && *token.magnitude != 0)) {
    return fail_at(token.offset, what);
  }
  value = *token.magnitude;
  return true;
}

// Identifiers: decimal; also 0x..., bare hexadecimal digits, and the negative number that a 32-bit
// signed print makes of bit 31.
bool StatementReader::expect_id(std::uint32_t& raw_id) {
  constexpr const char* kExpected = "an identifier of at most 32 bits";
  scan_.skip_blank();
  const std::size_t offset = scan_.position();
  const auto number = scan_.number();
  const std::string_view rest = scan_.peek_word();
  if (number && rest.empty() && number->magnitude && *number->magnitude <= 0xFFFF'FFFFU) {
    if (number->hexadecimal) {
      draft_.problems.warn(offset, "hex-id", "hexadecimal identifier, expected a decimal one");
    }
    raw_id = static_cast<std::uint32_t>(*number->magnitude);
    if (number->negative) {
      draft_.problems.warn(offset, "negative-id",
                           "negative identifier, read as the 32-bit number with its sign bit set");
      raw_id = ~raw_id + 1;
    }
    return true;
  }
  scan_.seek(offset);
  const std::string_view digits = scan_.peek_word();
  const auto [end, status] =
      std::from_chars(digits.data(), digits.data() + digits.size(), raw_id, 16);
  if (status != std::errc{} || end != digits.data() + digits.size() ||
      is_statement_keyword(digits)) {
    return fail(kExpected);
  }
  const bool decimal = std::all_of(digits.begin(), digits.end(), is_digit);
  if (decimal) return fail(kExpected);  // more than 32 bits
  scan_.seek(offset + digits.size());
  draft_.problems.warn(offset, "hex-id",
                       "hexadecimal identifier \"" + clip(digits) + "\", expected a decimal one");
  return true;
}

bool StatementReader::expect_name(std::string_view& name, const char* what) {
  scan_.skip_blank();
  const std::size_t offset = scan_.position();
  // A keyword on a new line starts a statement; on the same line it is a name.
  std::size_t before = offset;
  while (before > start_ && static_cast<unsigned char>(draft_.text[before - 1]) <= ' ') --before;
  const bool new_line = scan_.line_rest(before, offset - before).size() < offset - before;
  if (new_line && scan_.keyword_at(offset)) return fail(what);
  name = scan_.name();
  if (name.empty()) return fail(what);
  if (name.size() > kNameLengthMax) return fail_at(offset, "a name of at most 1024 characters");
  return true;
}

Text StatementReader::take_text(const StringToken& token) {
  closed_ = token.closed;
  if (!token.closed) {
    draft_.problems.error(token.offset, "unclosed-string",
                          "quoted text without an end; read up to the next statement");
  }
  if (token.inner_quotes) {
    draft_.problems.warn(token.offset, "quote-in-text",
                         "quotes inside quoted text, expected \\\" there; kept as text");
  }
  if (!token.escapes) return draft_.utf8(token.raw);
  std::string text;
  for (std::size_t i = 0; i < token.raw.size(); ++i) {
    const bool escape = token.raw[i] == '\\' && i + 1 < token.raw.size() && token.raw[i + 1] == '"';
    if (!escape) text += token.raw[i];
  }
  return draft_.utf8(draft_.arena().keep(text));
}

bool StatementReader::expect_string(Text& text, StringContext context, const char* what) {
  scan_.skip_blank();
  const auto token = scan_.string(context);
  if (!token) return fail(what);
  text = take_text(*token);
  return true;
}

void StatementReader::expect_semicolon() {
  if (!closed_ || scan_.accept(';')) return;
  const std::size_t offset = scan_.position();
  if (scan_.at_end() || scan_.keyword_at(offset)) {
    draft_.problems.warn(offset, "semicolon", "expected \";\" at the end of the statement");
    return;
  }
  draft_.problems.warn(offset, "trailing-text",
                       "text \"" + clip(scan_.line_rest(offset, kExcerptLength)) +
                           "\" before the end of the statement; kept as text");
  scan_.seek(scan_.statement_end_from(offset));
  draft_.keep(start_, scan_.position());
}

void StatementReader::check_name(std::string_view name, std::size_t offset) {
  const bool plain = std::all_of(name.begin(), name.end(), [](char c) {
    return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || is_digit(c) || c == '_';
  });
  if (!plain) {
    draft_.problems.warn(offset, "name-characters",
                         "name \"" + clip(name) + "\", expected letters, digits and underscores");
  } else if (is_digit(name.front())) {
    draft_.problems.warn(offset, "name-digit", "name \"" + clip(name) + "\" starts with a digit");
  } else if (is_statement_keyword(name)) {
    draft_.problems.warn(offset, "name-keyword", "name \"" + clip(name) + "\" is a keyword");
  }
}

void StatementReader::run() {
  if (draft_.text.starts_with(kByteOrderMark)) {
    scan_.seek(kByteOrderMark.size());
    draft_.problems.warn(0, "byte-order-mark", "the file starts with a byte order mark");
  }
  for (;;) {
    scan_.skip_blank();
    if (scan_.at_end()) break;
    start_ = scan_.position();
    closed_ = true;
    if (scan_.accept(';')) {
      draft_.problems.warn(start_, "stray-semicolon", "\";\" without a statement");
      while (scan_.accept(';')) {
      }
      continue;
    }
    const std::string_view word = scan_.peek_word();
    const auto row = std::find_if(kRows.begin(), kRows.end(),
                                  [&](const Row& candidate) { return candidate.keyword == word; });
    if (row == kRows.end()) {
      unknown_statement();
      continue;
    }
    check_order(word);
    scan_.seek(start_ + word.size());
    if (!(this->*row->handler)()) {
      const bool one_line = word == "SG_" || word == "BO_" || word == "BU_";
      scan_.seek(one_line ? scan_.line_end_from(start_) : scan_.statement_end_from(start_));
      draft_.keep(start_, scan_.position());
    }
  }
  end_message();
  if (!seen_bit_timing_ || !seen_nodes_) {
    draft_.problems.warn(0, "header-missing",
                         std::string("no ") + (seen_bit_timing_ ? "" : "BS_:") +
                             (seen_bit_timing_ || seen_nodes_ ? "" : " and no ") +
                             (seen_nodes_ ? "" : "BU_:") + " in the file");
  }
  LineCounter lines(draft_.text);
  for (const SourceComment& source : scan_.comments()) {
    draft_.database.source_comments.push_back(
        {lines.at(source.offset).line, draft_.utf8(source.text)});
    draft_.problems.warn(source.offset, source.closed ? "source-comment" : "unclosed-comment",
                         source.closed
                             ? "comment in the source, which the format does not have; kept"
                             : "\"/*\" without \"*/\"; its line is taken as the comment");
  }
}

// The format's order, as far as it says what comes before what refers to it: header, messages, all
// the rest. A kind of section that comes late is said once.
void StatementReader::check_order(std::string_view word) {
  seen_bit_timing_ |= word == "BS_";
  seen_nodes_ |= word == "BU_";
  static constexpr std::array<std::string_view, 6> kOrder{"VERSION", "NS_",        "BS_",
                                                          "BU_",     "VAL_TABLE_", "BO_"};
  if (word == "SG_") return;
  const auto place = std::find(kOrder.begin(), kOrder.end(), word);
  const auto rank = static_cast<std::size_t>(place - kOrder.begin());
  if (rank < last_rank_ && !late_reported_[rank]) {
    late_reported_[rank] = true;
    draft_.problems.warn(
        start_, "section-order",
        std::string(word) + " behind " + std::string(last_section_) + ", expected before it");
  }
  last_rank_ = rank;
  last_section_ = word;
}

void StatementReader::unknown_statement() {
  const std::size_t end = std::max(scan_.statement_end_from(start_), start_ + 1);
  draft_.problems.warn(
      start_, "unknown-statement",
      "unknown statement \"" + clip(scan_.slice(start_, end)) + "\"; kept as text");
  draft_.keep(start_, end);
  scan_.seek(end);
}

bool StatementReader::verbatim() {
  scan_.seek(scan_.statement_end_from(start_));
  draft_.keep(start_, scan_.position());
  return true;
}

bool StatementReader::version() {
  scan_.accept(':');
  Text text;
  if (!expect_string(text, StringContext::kName, "the version in quotes")) return false;
  draft_.database.version = text;
  scan_.skip_spaces();
  if (scan_.peek() == ';') scan_.seek(scan_.position() + 1);
  return true;
}

// A list of keywords, each as a rule on a line of its own. It ends where a keyword is used: with
// anything but a further keyword of this list behind it on its line.
bool StatementReader::new_symbols() {
  scan_.accept(':');
  for (;;) {
    scan_.skip_blank();
    const std::size_t begin = scan_.position();
    const std::string_view symbol = scan_.word();
    if (symbol.empty()) break;
    scan_.skip_spaces();
    const bool alone = scan_.at_line_end() || scan_.at_comment();
    static constexpr std::array<std::string_view, 6> kNeverListed{"BO_", "SG_", "BU_",
                                                                  "EV_", "BS_", "VERSION"};
    const std::string_view next = scan_.peek_word();
    const bool list_goes_on =
        is_statement_keyword(next) &&
        std::find(kNeverListed.begin(), kNeverListed.end(), next) == kNeverListed.end();
    if (!alone && !list_goes_on) {
      scan_.seek(begin);
      break;
    }
    draft_.database.new_symbols.push_back(draft_.utf8(symbol));
  }
  return true;
}

bool StatementReader::bit_timing() {
  scan_.accept(':');
  scan_.skip_spaces();
  const std::size_t begin = scan_.position();
  while (!scan_.at_line_end() && !scan_.at_comment() && scan_.peek() != ';' &&
         !scan_.keyword_at(scan_.position())) {
    scan_.seek(scan_.position() + 1);
  }
  std::string_view timing = scan_.slice(begin, scan_.position());
  while (!timing.empty() && timing.back() == ' ') timing.remove_suffix(1);
  draft_.database.bit_timing = draft_.utf8(timing);
  if (scan_.peek() == ';') scan_.seek(scan_.position() + 1);
  return true;
}

// Names on the line, and on further lines that hold nothing but names.
bool StatementReader::nodes() {
  if (!expect(':', "\":\"")) return false;
  std::vector<std::pair<std::string_view, std::size_t>> line;
  for (;;) {
    scan_.skip_spaces();
    const std::size_t at = scan_.position();
    if (scan_.at_line_end() || scan_.at_comment() || scan_.peek() == ';') {
      for (const auto& [name, offset] : line) {
        check_name(name, offset);
        draft_.database.nodes.push_back(draft_.utf8(name));
        draft_.node_offsets.push_back(offset);
      }
      line.clear();
      if (scan_.peek() == ';') {
        scan_.seek(at + 1);
        return true;
      }
      scan_.skip_blank();
      if (scan_.at_end() || scan_.keyword_at(scan_.position())) return true;
      start_ = scan_.position();  // if this line is no list of names, it starts a statement
      continue;
    }
    if (scan_.peek() == ',') {
      scan_.seek(at + 1);
      continue;
    }
    const bool keyword = scan_.keyword_at(at);
    const std::string_view name = scan_.name();
    if (name.empty() || name.size() > kNameLengthMax || keyword) {
      // Not a line of names.
      const bool first_line = scan_.slice(start_, start_ + 3) == "BU_";
      if (first_line && name.empty()) {
        // A stray quote or bracket costs no node.
        const std::size_t behind = draft_.text.find_first_not_of("\"()[]|@:", at);
        const std::size_t end = std::min(behind, draft_.text.size());
        draft_.problems.warn(at, "node-list",
                             "found \"" + clip(scan_.slice(at, end)) +
                                 "\" among the nodes, expected names; kept as text");
        draft_.keep(at, end);
        scan_.seek(end);
        continue;
      }
      if (first_line) return fail_at(at, "node names");
      scan_.seek(start_);
      return true;
    }
    line.emplace_back(name, at);
  }
}

// The name of a message up to its colon; names with blanks in them are joined as they are.
bool StatementReader::message_name(std::string_view& name, std::size_t name_offset) {
  if (!expect_name(name, "a message name")) return false;
  scan_.skip_blank();
  if (scan_.peek() == ':') return true;
  const std::string_view line = scan_.line_rest(name_offset, kNameLengthMax);
  const std::size_t colon = line.find(':');
  const bool on_line = colon != std::string_view::npos;
  if (!on_line && !is_digit(scan_.peek())) return fail("\":\" after the message name");
  if (on_line) {
    name = line.substr(0, colon);
    while (static_cast<unsigned char>(name.back()) <= ' ') name.remove_suffix(1);
    scan_.seek(name_offset + colon);
  } else {
    draft_.problems.warn(scan_.position(), "colon", "expected \":\" after the message name");
  }
  return true;
}

// What follows the length: the transmitter, and text that has no business there.
void StatementReader::message_tail(MessageDef& message) {
  scan_.skip_spaces();
  const std::string_view transmitter = scan_.name();
  if (transmitter.empty()) {
    draft_.problems.warn(scan_.position(), "transmitter",
                         "expected a transmitter after the length");
  } else if (transmitter.size() <= kNameLengthMax) {
    message.transmitter = draft_.utf8(transmitter);
  }
  scan_.skip_spaces();
  if (scan_.peek() == ';') {
    scan_.seek(scan_.position() + 1);
    scan_.skip_spaces();
  }
  if (!scan_.at_line_end() && !scan_.at_comment() && !scan_.keyword_at(scan_.position())) {
    const std::size_t end = scan_.line_end_from(scan_.position());
    draft_.problems.warn(scan_.position(), "trailing-text",
                         "text \"" + clip(scan_.slice(scan_.position(), end)) +
                             "\" after the transmitter; kept as text");
    draft_.keep(start_, end);
    scan_.seek(end);
  }
}

void StatementReader::set_id(std::uint32_t raw_id, std::string_view name, std::size_t id_offset,
                             MessageDef& message) {
  const bool independent = name == kIndependentMessage || raw_id == kIndependentId;
  const std::uint32_t without_flag = raw_id & ~kExtendedFlag;
  message.id.extended = without_flag != raw_id;
  message.id.value = without_flag & kExtendedIdMax;
  if (!independent) {
    const bool flag_missing = !message.id.extended && without_flag > kStandardIdMax;
    const bool too_large = without_flag > kExtendedIdMax;
    message.id.extended |= flag_missing;
    if (flag_missing || too_large) {
      draft_.problems.warn(
          id_offset, flag_missing ? "id-extended" : "id-range",
          "identifier " + std::to_string(raw_id) +
              (flag_missing ? " is above 0x7FF without bit 31" : "") +
              (flag_missing && too_large ? " and" : "") +
              (too_large ? " has more than 29 bits; the lower 29 are used" : "; read as 29 bits"));
    }
  }
}

bool StatementReader::message() {
  within_ = Within::kRefusedMessage;
  MessageSource source;
  source.offset = start_;
  MessageDef message;
  scan_.skip_blank();
  const std::size_t id_offset = scan_.position();
  if (!expect_id(source.raw_id)) return false;

  scan_.skip_blank();
  const std::size_t name_offset = scan_.position();
  std::string_view name;
  if (!message_name(name, name_offset)) return false;
  scan_.accept(':');
  check_name(name, name_offset);
  message.name = draft_.utf8(name);
  std::uint64_t length = 0;
  if (!expect_unsigned(length, 0x7FFF'FFFF, "the message length in bytes")) return false;
  message.length = static_cast<std::uint32_t>(length);

  message_tail(message);
  set_id(source.raw_id, name, id_offset, message);
  within_ = Within::kMessage;
  end_message();
  make_room(draft_.messages);
  make_room(draft_.database.messages);
  draft_.messages.push_back(source);
  draft_.database.messages.push_back(std::move(message));
  return true;
}

// "M", "m3", "m3M"; whatever else stands there belongs to the name: false.
bool StatementReader::multiplexing(std::string_view indicator, std::size_t indicator_offset,
                                   SignalDef& signal, std::optional<std::uint64_t>& selector) {
  if (indicator == "M") {
    signal.is_multiplexer = true;
    return true;
  }
  std::string_view digits = indicator;
  if (digits[0] != 'm') return false;
  digits.remove_prefix(1);
  const bool both = !digits.empty() && digits.back() == 'M';
  if (both) digits.remove_suffix(1);
  std::uint64_t value = 0;
  const auto [end, status] = std::from_chars(digits.data(), digits.data() + digits.size(), value);
  if (digits.empty()) {
    draft_.problems.warn(indicator_offset, "mux-number",
                         "multiplexer indicator \"" + clip(indicator) +
                             "\" without a number; the signal is read in every frame");
  } else if (end == digits.data() + digits.size() && status == std::errc{}) {
    selector = value;
  } else {
    return false;
  }
  signal.is_multiplexer = both;
  return true;
}

// The name of a signal up to its colon, and what says how it is multiplexed.
bool StatementReader::signal_name(std::string_view& name, std::size_t name_offset,
                                  SignalDef& signal, std::optional<std::uint64_t>& selector) {
  if (!expect_name(name, "a signal name")) return false;
  scan_.skip_blank();
  if (scan_.peek() == ':') return true;
  // "name m3 :"; whatever else stands there belongs to the name.
  std::size_t name_end = name_offset + name.size();
  std::string_view indicator;
  std::size_t indicator_offset = 0;
  while (scan_.peek() != ':') {
    if (!indicator.empty()) name_end = indicator_offset + indicator.size();
    indicator_offset = scan_.position();
    if (scan_.keyword_at(indicator_offset)) return fail("\":\" after the signal name");
    indicator = scan_.name();
    if (indicator.empty() || name_end - name_offset > kNameLengthMax) {
      return fail("\":\" after the signal name");
    }
    scan_.skip_blank();
  }
  if (!multiplexing(indicator, indicator_offset, signal, selector)) {
    name_end = indicator_offset + indicator.size();
  }
  name = scan_.slice(name_offset, name_end);
  return true;
}

// "0|8@1+ (1,0)"
bool StatementReader::signal_layout(SignalDef& signal) {
  std::uint64_t start = 0;
  std::uint64_t length = 0;
  NumberToken scale;
  NumberToken offset;
  constexpr std::uint64_t kBitsMax = 0x7FFF'FFFF;
  if (!expect_unsigned(start, kBitsMax, "the start bit") || !expect('|', "\"|\"") ||
      !expect_unsigned(length, kBitsMax, "the length in bits") || !expect('@', "\"@\"")) {
    return false;
  }
  scan_.skip_blank();
  const char order_digit = scan_.peek();
  if (order_digit != '0' && order_digit != '1') return fail("the byte order, 0 or 1");
  scan_.seek(scan_.position() + 1);
  signal.start_bit = static_cast<std::uint32_t>(start);
  signal.length = static_cast<std::uint32_t>(length);
  signal.byte_order = order_digit == '0' ? ByteOrder::kBig : ByteOrder::kLittle;
  if (scan_.accept('-')) {
    signal.type = ValueType::kSigned;
  } else if (!scan_.accept('+')) {
    draft_.problems.warn(scan_.position(), "sign",
                         "expected \"+\" or \"-\" after the byte order; read as unsigned");
  }
  if (!expect('(', "\"(\" before the factor") || !expect_number(scale, "the factor") ||
      !expect(',', "\",\" between factor and offset") || !expect_number(offset, "the offset") ||
      !expect(')', "\")\" after the offset")) {
    return false;
  }
  signal.scale = scale.value;
  signal.offset = offset.value;
  return true;
}

bool StatementReader::signal() {
  if (within_ == Within::kNothing) {
    draft_.problems.error(start_, "signal-without-message", "SG_ without a BO_ before it");
    return false;
  }
  if (within_ == Within::kRefusedMessage) return false;
  if (usual_signal()) return true;

  SignalDef signal;
  scan_.skip_blank();
  const std::size_t name_offset = scan_.position();
  std::optional<std::uint64_t> selector;
  std::string_view name;
  if (!signal_name(name, name_offset, signal, selector)) return false;
  scan_.accept(':');
  check_name(name, name_offset);
  signal.name = draft_.utf8(name);

  if (!signal_layout(signal)) return false;
  receivers_.clear();
  SignalUsage usage;
  signal_tail(signal, usage);
  usage.receivers = receiver_list();
  signal.usage = usage_of(usage);
  add_signal(signal, name_offset, selector);
  return true;
}

// A file has few of them, many times.
ShortText StatementReader::unit_of(Text unit) {
  if (unit.empty()) return {};
  const auto character = [](char c) {
    return static_cast<std::size_t>(static_cast<unsigned char>(c));
  };
  const std::size_t sum = unit.size() + 3 * character(unit.front()) + 5 * character(unit.back());
  ShortText& known = units_[sum % units_.size()];
  if (!(known == unit)) known = draft_.arena().shorten(unit);
  return known;
}

const SignalUsage* StatementReader::usage_of(const SignalUsage& usage) {
  const auto bits = [](double value) { return std::bit_cast<std::uint64_t>(value); };
  constexpr std::uint64_t kSpread = 0x9E37'79B9'7F4A'7C15U;  // 2^64 by the golden ratio
  const std::uint64_t mixed = (bits(usage.minimum) * 3 + bits(usage.maximum)) * kSpread;
  const SignalUsage*& known = usages_[mixed >> 58U];
  const bool is_known = known != nullptr && bits(known->minimum) == bits(usage.minimum) &&
                        bits(known->maximum) == bits(usage.maximum) &&
                        known->receivers == usage.receivers;
  if (!is_known) known = draft_.arena().one(usage);
  return known;
}

// Signals that follow each other have the same receivers, most of them.
List<Text> StatementReader::receiver_list() {
  if (!(last_receivers_ == receivers_)) last_receivers_ = draft_.arena().list(receivers_);
  return last_receivers_;
}

// The signals of the last message are complete: they get just the room that they need.
void StatementReader::end_message() {
  if (signals_.empty()) return;
  draft_.messages.back().names = draft_.sources.list(names_);
  draft_.messages.back().selector_values = draft_.sources.list(selector_values_);
  draft_.database.messages.back().signals.assign(signals_.begin(), signals_.end());
  names_.clear();
  selector_values_.clear();
  signals_.clear();
}

// For as many as there will be if the rest of the file is like what has been read: a vector that
// grows by doubling is there one and a half times while it does. Four times as many at most, since
// a file may be of another opinion at its beginning.
template <typename T>
void StatementReader::make_room(std::vector<T>& messages) const {
  constexpr std::size_t kFirst = 16;
  constexpr std::size_t kMostTimes = 4;
  const std::size_t count = messages.size();
  if (count < messages.capacity()) return;
  const double read = static_cast<double>(start_) / static_cast<double>(draft_.text.size());
  const double expected = static_cast<double>(count) / std::max(read, 1.0 / kMostTimes);
  messages.reserve(std::max(static_cast<std::size_t>(expected), count + count / 8) + kFirst);
}

void StatementReader::add_signal(const SignalDef& signal, std::size_t name_offset,
                                 std::optional<std::uint64_t> selector_value) {
  const std::size_t behind = name_offset - draft_.messages.back().offset;
  if (selector_value) {
    selector_values_.push_back({static_cast<std::uint32_t>(signals_.size()), *selector_value});
  }
  names_.push_back(static_cast<std::uint32_t>(std::min<std::size_t>(behind, UINT32_MAX)));
  signals_.push_back(signal);
}

bool StatementReader::usual_signal() {
  UsualSignal usual;
  const char* const end = read_usual_signal(scan_.rest(), usual);
  if (end == nullptr) return false;
  SignalDef signal;
  signal.name = Text(usual.name);
  signal.start_bit = usual.start_bit;
  signal.length = usual.length;
  signal.byte_order = usual.is_big_endian ? ByteOrder::kBig : ByteOrder::kLittle;
  signal.type = usual.is_signed ? ValueType::kSigned : ValueType::kUnsigned;
  signal.is_multiplexer = usual.is_multiplexer;
  signal.scale = usual.scale;
  signal.offset = usual.offset;
  signal.unit = unit_of(draft_.utf8(usual.unit));
  if (last_receivers_text_.empty() || usual.receivers != last_receivers_text_) {
    receivers_.clear();
    last_receivers_text_ = usual.receivers;
    std::string_view left = usual.receivers;
    for (Text name(take_receiver(left)); !name.empty(); name = Text(take_receiver(left))) {
      receivers_.push_back(name);
    }
    usual_receivers_ = receiver_list();
  }
  signal.usage = usage_of({usual.minimum, usual.maximum, usual_receivers_});
  add_signal(signal, static_cast<std::size_t>(usual.name.data() - draft_.text.data()),
             usual.selector_value);
  scan_.seek(static_cast<std::size_t>(end - draft_.text.data()));
  return true;
}

// Range, unit, receivers: the values can be read without them, so what is missing is a warning.
void StatementReader::signal_tail(SignalDef& signal, SignalUsage& usage) {
  const auto incomplete = [&](const char* what) {
    draft_.problems.warn(
        scan_.position(), "signal-incomplete",
        std::string("expected ") + what + "; the rest of the line is kept as text");
    const std::size_t end = scan_.line_end_from(scan_.position());
    if (end > scan_.position()) draft_.keep(start_, end);
    scan_.seek(end);
  };
  scan_.skip_spaces();
  if (scan_.peek() != '[') return incomplete("the range [minimum|maximum]");
  scan_.accept('[');
  scan_.skip_spaces();
  const auto minimum = scan_.number();
  if (!minimum) return incomplete("the minimum");
  if (!scan_.accept('|')) return incomplete("\"|\" between minimum and maximum");
  scan_.skip_spaces();
  const auto maximum = scan_.number();
  if (!maximum) return incomplete("the maximum");
  if (!scan_.accept(']')) return incomplete("\"]\" after the maximum");
  usage.minimum = minimum->value;
  usage.maximum = maximum->value;

  const std::size_t behind_range = scan_.position();
  scan_.skip_blank();
  if (scan_.peek() != '"') scan_.seek(behind_range);
  const auto unit = scan_.string(StringContext::kUnit);
  if (!unit) return incomplete("the unit in quotes");
  signal.unit = unit_of(take_text(*unit));
  if (!unit->closed) return;

  bool comma = false;
  for (;;) {
    scan_.skip_spaces();
    if (comma && scan_.at_line_end()) {
      // A list that goes on behind its comma on the next line.
      scan_.skip_blank();
      if (scan_.keyword_at(scan_.position())) break;
    }
    if (scan_.at_line_end() || scan_.at_comment() || scan_.keyword_at(scan_.position())) break;
    const std::size_t at = scan_.position();
    comma = scan_.peek() == ',';
    if (scan_.peek() == ';') {
      draft_.problems.warn(at, "stray-semicolon", "\";\" behind a signal");
    }
    if (comma || scan_.peek() == ';') {
      scan_.seek(at + 1);
      continue;
    }
    const std::string_view receiver = scan_.name();
    if (receiver.empty() || receiver.size() > kNameLengthMax) return incomplete("receivers");
    receivers_.push_back(draft_.utf8(receiver));
  }
  if (receivers_.empty()) {
    draft_.problems.warn(scan_.position(), "receiver", "expected a receiver after the unit");
  }
}

bool StatementReader::environment_variable() {
  EnvironmentVariable variable;
  std::string_view name;
  std::string_view access;
  NumberToken minimum;
  NumberToken maximum;
  NumberToken initial;
  constexpr std::uint64_t kAny = ~std::uint64_t{0};
  if (!expect_name(name, "the variable's name") || !expect(':', "\":\"") ||
      !expect_unsigned(variable.type, kAny, "the variable's type") || !expect('[', "\"[\"") ||
      !expect_number(minimum, "the minimum") || !expect('|', "\"|\"") ||
      !expect_number(maximum, "the maximum") || !expect(']', "\"]\"") ||
      !expect_string(variable.unit, StringContext::kName, "the unit in quotes") ||
      !expect_number(initial, "the initial value") ||
      !expect_unsigned(variable.id, kAny, "the variable's number") ||
      !expect_name(access, "the access type")) {
    return false;
  }
  variable.name = draft_.utf8(name);
  variable.minimum = minimum.value;
  variable.maximum = maximum.value;
  variable.initial_value = initial.value;
  variable.access_type = draft_.utf8(access);
  names_until_semicolon(variable.access_nodes);
  expect_semicolon();
  draft_.database.environment_variables.push_back(std::move(variable));
  return true;
}

bool StatementReader::environment_data() {
  DataBytesRef data;
  if (!expect_name(data.name, "the variable's name") || !expect(':', "\":\"") ||
      !expect_unsigned(data.bytes, ~std::uint64_t{0}, "the size in bytes")) {
    return false;
  }
  expect_semicolon();
  data.offset = start_;
  data.end = scan_.position();
  draft_.data_bytes.push_back(data);
  return true;
}

// "BU_ node", "BO_ id", "SG_ id name", "EV_ name" or nothing.
bool StatementReader::object_of(Reference& reference) {
  scan_.skip_blank();
  const std::string_view word = scan_.peek_word();
  if (word != "BU_" && word != "BO_" && word != "SG_" && word != "EV_") return true;
  scan_.word();
  reference.object = word == "BU_"   ? Object::kNode
                     : word == "BO_" ? Object::kMessage
                     : word == "SG_" ? Object::kSignal
                                     : Object::kVariable;
  if ((word == "BO_" || word == "SG_") && !expect_id(reference.raw_id)) return false;
  if (word == "BO_") return true;
  scan_.skip_blank();
  const std::size_t offset = scan_.position();
  reference.name = scan_.name();
  if (reference.name.empty()) {
    draft_.problems.warn(offset, "object-name",
                         "expected a name after \"" + std::string(word) + "\"; kept as text");
  }
  return true;
}

bool StatementReader::comment() {
  CommentRef comment;
  if (!object_of(comment) ||
      !expect_string(comment.text, StringContext::kComment, "the comment in quotes")) {
    return false;
  }
  expect_semicolon();
  comment.offset = start_;
  comment.end = scan_.position();
  draft_.comments.push_back(comment);
  return true;
}

bool StatementReader::attribute_definition() {
  AttributeDef definition;
  scan_.skip_blank();
  const std::string_view object = scan_.peek_word();
  if (!object.empty()) {
    scan_.word();
    definition.object = Text(object);
  }
  if (!expect_string(definition.name, StringContext::kName, "the attribute's name in quotes")) {
    return false;
  }
  if (definition.name.size() > kNameLengthMax) return fail("a name of at most 1024 characters");
  scan_.skip_blank();
  definition.type = Text(scan_.word());
  static constexpr std::array<std::string_view, 5> kTypes{"INT", "HEX", "FLOAT", "STRING", "ENUM"};
  if (std::find(kTypes.begin(), kTypes.end(), definition.type) == kTypes.end()) {
    draft_.problems.warn(scan_.position(), "attribute-type",
                         "expected INT, HEX, FLOAT, STRING or ENUM; read as STRING");
    definition.type = "STRING";
  }
  if (definition.type == "ENUM") {
    for (;;) {
      scan_.skip_blank();
      if (scan_.accept(',')) continue;
      const auto token = scan_.string(StringContext::kAttribute);
      if (!token) break;
      definition.choices.push_back(take_text(*token));
      if (!closed_) break;
    }
  } else if (definition.type != "STRING") {
    scan_.skip_blank();
    if (const auto minimum = scan_.number()) definition.minimum = minimum->value;
    scan_.accept(',');
    scan_.skip_blank();
    if (const auto maximum = scan_.number()) definition.maximum = maximum->value;
  }
  expect_semicolon();
  if (!defined_.emplace(definition.name, definition.object).second) {
    draft_.problems.warn(
        start_, "duplicate-definition",
        "attribute \"" + clip(definition.name) + "\" is defined again; this definition is used");
  }
  draft_.database.attribute_definitions.push_back(std::move(definition));
  return true;
}

// A number as written, or quoted text.
bool StatementReader::attribute_value(Text& value) {
  scan_.skip_blank();
  const std::size_t begin = scan_.position();
  if (const auto token = scan_.string(StringContext::kAttribute)) {
    value = take_text(*token);
    return true;
  }
  if (!scan_.number() || !scan_.peek_word().empty()) {
    scan_.seek(begin);
    if (scan_.name().empty()) return fail("the attribute's value");
    draft_.problems.warn(begin, "unquoted-value", "attribute value without quotes");
  }
  value = draft_.utf8(scan_.slice(begin, scan_.position()));
  return true;
}

bool StatementReader::attribute_default() {
  AttributeRef reference;
  reference.object = Object::kDefault;
  if (!expect_string(reference.attribute, StringContext::kName, "the attribute's name in quotes")) {
    return false;
  }
  if (!attribute_value(reference.value)) return false;
  expect_semicolon();
  reference.offset = start_;
  reference.end = scan_.position();
  draft_.attributes.push_back(reference);
  return true;
}

bool StatementReader::attribute() {
  AttributeRef reference;
  if (!expect_string(reference.attribute, StringContext::kName, "the attribute's name in quotes") ||
      !object_of(reference)) {
    return false;
  }
  if (!attribute_value(reference.value)) return false;
  expect_semicolon();
  reference.offset = start_;
  reference.end = scan_.position();
  draft_.attributes.push_back(reference);
  return true;
}

bool StatementReader::relation() {
  RelationRef reference;
  if (!expect_string(reference.attribute, StringContext::kName, "the attribute's name in quotes")) {
    return false;
  }
  scan_.skip_blank();
  reference.kind = scan_.word();
  if (reference.kind != "BU_SG_REL_" && reference.kind != "BU_BO_REL_" &&
      reference.kind != "BU_EV_REL_") {
    return fail("BU_SG_REL_, BU_BO_REL_ or BU_EV_REL_");
  }
  if (!expect_name(reference.node, "the node's name")) return false;
  scan_.skip_blank();
  if (reference.kind == "BU_EV_REL_") {
    if (!expect_name(reference.name, "the variable's name")) return false;
  } else {
    const std::string_view object = scan_.peek_word();
    if (object == "SG_" || object == "BO_") scan_.word();
    if (!expect_id(reference.raw_id)) return false;
    if (reference.kind == "BU_SG_REL_" && !expect_name(reference.name, "the signal's name")) {
      return false;
    }
  }
  if (!attribute_value(reference.value)) return false;
  expect_semicolon();
  reference.offset = start_;
  reference.end = scan_.position();
  draft_.relations.push_back(reference);
  return true;
}

// Pairs of a number and a text, up to the semicolon.
bool StatementReader::value_list(ValueTable& table) {
  labels_.clear();
  const bool read = read_labels();
  table = table_of_labels();
  return read;
}

bool StatementReader::read_labels() {
  for (;;) {
    scan_.skip_blank();
    if (scan_.peek() == ';' || scan_.at_end() || scan_.keyword_at(scan_.position())) return true;
    const auto number = scan_.number();
    if (!number) return fail("a number or \";\"");
    Text text;
    if (!expect_string(text, StringContext::kValues, "the value's text in quotes")) return false;
    if (!number->magnitude) {
      draft_.problems.warn(number->offset, "value-number",
                           "expected a whole number of at most 64 bits; kept as text");
      draft_.keep(number->offset, scan_.position());
      if (!closed_) return true;
      continue;
    }
    const std::uint64_t bits = number->negative ? ~*number->magnitude + 1 : *number->magnitude;
    labels_.push_back({static_cast<std::int64_t>(bits), number->offset, text});
    if (!closed_) return true;
  }
}

// By their numbers. Of several texts for one the last stands.
ValueTable StatementReader::table_of_labels() {
  const auto before = [](const LabelRead& a, const LabelRead& b) { return a.key < b.key; };
  if (!std::is_sorted(labels_.begin(), labels_.end(), before)) {
    std::stable_sort(labels_.begin(), labels_.end(), before);
  }
  entries_.clear();
  for (const LabelRead& label : labels_) {
    if (entries_.empty() || entries_.back().first != label.key) {
      entries_.emplace_back(label.key, label.text);
      continue;
    }
    entries_.back().second = label.text;
    draft_.problems.warn(label.offset, "duplicate-value",
                         "value " + std::to_string(label.key) + " again; this text, \"" +
                             clip(label.text) + "\", is used");
  }
  return draft_.arena().table(entries_);
}

bool StatementReader::value_table() {
  std::string_view name;
  if (!expect_name(name, "the table's name")) return false;
  ValueTable table;
  if (!value_list(table)) return false;
  expect_semicolon();
  const auto [place, is_new] =
      draft_.database.value_tables.insert_or_assign(draft_.utf8(name), table);
  if (!is_new) {
    draft_.problems.warn(start_, "duplicate-table",
                         "value table \"" + clip(place->first) + "\" again; this one is used");
  }
  return true;
}

bool StatementReader::values() {
  ValuesRef reference;
  scan_.skip_blank();
  // "id signal", or the name of an environment variable.
  const bool signal = is_digit(scan_.peek()) || scan_.peek() == '-';
  reference.object = signal ? Object::kSignal : Object::kVariable;
  if (signal && !expect_id(reference.raw_id)) return false;
  if (!expect_name(reference.name, "a name")) return false;
  scan_.skip_blank();
  const char c = scan_.peek();
  const bool list = is_digit(c) || c == '-' || c == '+' || c == ';';
  if (!list && !scan_.at_end() && !scan_.keyword_at(scan_.position())) {
    if (!expect_name(reference.table, "values, or the name of a table")) return false;
  } else if (!value_list(reference.values)) {
    return false;
  }
  expect_semicolon();
  reference.offset = start_;
  reference.end = scan_.position();
  draft_.values.push_back(reference);
  return true;
}

void StatementReader::names_until_semicolon(std::vector<Text>& names) {
  for (;;) {
    scan_.skip_blank();
    if (scan_.accept(',')) continue;
    const std::size_t at = scan_.position();
    if (scan_.keyword_at(at)) return;
    const std::string_view name = scan_.name();
    if (name.empty() || name.size() > kNameLengthMax) {
      scan_.seek(at);
      return;
    }
    names.push_back(draft_.utf8(name));
  }
}

bool StatementReader::signal_group() {
  GroupRef reference;
  reference.object = Object::kMessage;
  std::string_view name;
  if (!expect_id(reference.raw_id) || !expect_name(name, "the group's name")) return false;
  scan_.skip_blank();
  if (scan_.peek() != ':' && !expect_unsigned(reference.group.repetitions, ~std::uint64_t{0},
                                              "the number of repetitions")) {
    return false;
  }
  if (!expect(':', "\":\"")) return false;
  reference.group.name = draft_.utf8(name);
  std::vector<Text> signals;
  names_until_semicolon(signals);
  reference.group.signals = draft_.arena().list(signals);
  expect_semicolon();
  reference.offset = start_;
  reference.end = scan_.position();
  draft_.groups.push_back(reference);
  return true;
}

bool StatementReader::value_type() {
  ValueTypeRef reference;
  reference.object = Object::kSignal;
  if (!expect_id(reference.raw_id) || !expect_name(reference.name, "the signal's name")) {
    return false;
  }
  scan_.accept(':');
  if (!expect_unsigned(reference.type, ~std::uint64_t{0}, "the value type, 0 to 2")) return false;
  expect_semicolon();
  reference.offset = start_;
  reference.end = scan_.position();
  draft_.value_types.push_back(reference);
  return true;
}

bool StatementReader::multiplex_values() {
  MultiplexRef reference;
  std::vector<ValueRange> ranges;
  reference.object = Object::kSignal;
  if (!expect_id(reference.raw_id) || !expect_name(reference.name, "the signal's name") ||
      !expect_name(reference.selector, "the multiplexer's name")) {
    return false;
  }
  for (;;) {
    scan_.skip_blank();
    if (scan_.accept(',')) continue;
    if (!is_digit(scan_.peek())) break;
    const std::size_t at = scan_.position();
    std::uint64_t low = 0;
    constexpr std::uint64_t kAny = ~std::uint64_t{0};
    if (!expect_unsigned(low, kAny, "a range like 3-5")) return false;
    std::uint64_t high = low;
    if (scan_.accept('-') && !expect_unsigned(high, kAny, "the end of the range")) return false;
    if (high < low) {
      draft_.problems.warn(at, "mux-range",
                           "range " + std::to_string(low) + "-" + std::to_string(high) +
                               " ends before it starts; read the other way round");
      std::swap(low, high);
    }
    ranges.emplace_back(low, high);
  }
  if (ranges.empty()) return fail("a range like 3-5");
  reference.ranges = draft_.arena().list(ranges);
  expect_semicolon();
  reference.offset = start_;
  reference.end = scan_.position();
  draft_.multiplexes.push_back(reference);
  return true;
}

bool StatementReader::senders() {
  SendersRef reference;
  reference.object = Object::kMessage;
  if (!expect_id(reference.raw_id)) return false;
  scan_.accept(':');
  names_until_semicolon(reference.senders);
  expect_semicolon();
  reference.offset = start_;
  reference.end = scan_.position();
  draft_.senders.push_back(std::move(reference));
  return true;
}

}  // namespace

// In a file that is not UTF-8 as a whole, a piece that is, with more than ASCII in it, was hardly
// meant as Windows-1252.
Text Draft::utf8(std::string_view piece) {
  if (text_is_utf8 || is_utf8(piece)) return Text(piece);
  return arena().keep(utf8_from_windows_1252(piece));
}

}  // namespace dbc

DbcParseResult parse_dbc(std::string text) {
  std::optional<std::string> from_utf16 = utf8_from_utf16(text);
  const bool is_utf16 = from_utf16.has_value();
  dbc::Draft draft(is_utf16 ? std::move(*from_utf16) : std::move(text));
  if (is_utf16) {
    draft.problems.warn(0, "utf-16", "the file is UTF-16, expected UTF-8 or Windows-1252");
  }
  draft.text_is_utf8 = is_ascii(draft.text) || is_utf8(draft.text);
  if (!draft.text_is_utf8) {
    const auto first = std::find_if(draft.text.begin(), draft.text.end(),
                                    [](char c) { return static_cast<unsigned char>(c) >= 0x80; });
    draft.problems.warn(static_cast<std::size_t>(first - draft.text.begin()), "encoding",
                        "text that is not UTF-8; read as Windows-1252");
  }
  if (const std::size_t nul = draft.text.find('\0'); nul != std::string_view::npos) {
    draft.problems.warn(nul, "nul-byte", "a byte of value 0 in the text; read as a blank");
  }
  dbc::StatementReader(draft).run();
  dbc::resolve(draft);
  dbc::lint(draft);
  DbcParseResult result;
  result.database = std::move(draft.database);
  result.problems = draft.problems.finish(draft.text);
  return result;
}

}  // namespace beltgrip::can
