#include "can_dbc/dbc/scanner.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <cstring>
#include <limits>

#include "can_dbc/dbc/short_decimal.h"
#include "can_dbc/text/encoding.h"

namespace beltgrip::can::dbc {

namespace {

constexpr bool is_blank(char c) { return static_cast<unsigned char>(c) <= ' '; }
constexpr bool is_line_break(char c) { return c == '\n' || c == '\r'; }
constexpr bool is_word_char(char c) {
  return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || is_digit(c) || c == '_';
}

constexpr std::array<bool, 256> name_characters() {
  std::array<bool, 256> table{};
  for (std::size_t c = '!'; c < 256; ++c) table[c] = true;
  for (const char c : {':', ';', ',', '"', '(', ')', '[', ']', '|', '@'}) {
    table[static_cast<unsigned char>(c)] = false;
  }
  return table;
}
constexpr std::array<bool, 256> kNameCharacters = name_characters();

constexpr std::array<std::string_view, 35> kKeywords{"BA_",
                                                     "BA_DEF_",
                                                     "BA_DEF_DEF_",
                                                     "BA_DEF_DEF_REL_",
                                                     "BA_DEF_REL_",
                                                     "BA_DEF_SGTYPE_",
                                                     "BA_REL_",
                                                     "BA_SGTYPE_",
                                                     "BO_",
                                                     "BO_TX_BU_",
                                                     "BS_",
                                                     "BU_",
                                                     "BU_BO_REL_",
                                                     "BU_EV_REL_",
                                                     "BU_SG_REL_",
                                                     "CAT_",
                                                     "CAT_DEF_",
                                                     "CM_",
                                                     "ENVVAR_DATA_",
                                                     "EV_",
                                                     "EV_DATA_",
                                                     "FILTER",
                                                     "NS_",
                                                     "NS_DESC_",
                                                     "SGTYPE_",
                                                     "SGTYPE_VAL_",
                                                     "SG_",
                                                     "SG_MUL_VAL_",
                                                     "SIGTYPE_VALTYPE_",
                                                     "SIG_GROUP_",
                                                     "SIG_TYPE_REF_",
                                                     "SIG_VALTYPE_",
                                                     "VAL_",
                                                     "VAL_TABLE_",
                                                     "VERSION"};

}  // namespace

bool is_statement_keyword(std::string_view word) noexcept {
  if (word.size() < 3 || word.size() > 16) return false;
  if (word.back() != '_' && word != "FILTER" && word != "VERSION") return false;
  return std::find(kKeywords.begin(), kKeywords.end(), word) != kKeywords.end();
}

std::string clip(std::string_view text) {
  constexpr std::size_t kLongest = 60;
  std::string out;
  for (const char c : text.substr(0, kLongest)) out += is_blank(c) ? ' ' : c;
  if (text.size() > kLongest) {
    // Not in the middle of a character.
    while (!out.empty() && (static_cast<unsigned char>(out.back()) & 0xC0U) == 0x80U)
      out.pop_back();
    if (!out.empty() && static_cast<unsigned char>(out.back()) >= 0xC0U) out.pop_back();
    out += "...";
  }
  return is_utf8(out) ? out : utf8_from_windows_1252(out);
}

LineCounter::Position LineCounter::at(std::size_t offset) {
  offset = std::min(offset, text_.size());
  for (; scanned_ < offset; ++scanned_) {
    const char c = text_[scanned_];
    const bool lone_cr = c == '\r' && (scanned_ + 1 >= text_.size() || text_[scanned_ + 1] != '\n');
    if (c == '\n' || lone_cr) {
      ++line_;
      line_start_ = scanned_ + 1;
    }
  }
  return {line_, static_cast<std::uint32_t>(offset - line_start_ + 1)};
}

std::vector<Problem> ProblemList::finish(std::string_view text) {
  std::stable_sort(items_.begin(), items_.end(),
                   [](const Item& a, const Item& b) { return a.offset < b.offset; });
  std::vector<Problem> problems;
  problems.reserve(items_.size());
  LineCounter lines(text);
  for (std::size_t i = 0; i < items_.size(); ++i) {
    Item& item = items_[i];
    // Messages of one identifier share what refers to it; the problem is one.
    const bool again = i > 0 && item.offset == items_[i - 1].offset &&
                       std::strcmp(item.code, items_[i - 1].code) == 0;
    if (again) continue;
    const LineCounter::Position position = lines.at(item.offset);
    problems.push_back(
        {item.severity, position.line, position.column, item.code, std::move(item.text)});
  }
  items_.clear();
  return problems;
}

void Scanner::skip_spaces() {
  while (at_ < text_.size() && is_blank(text_[at_]) && !is_line_break(text_[at_])) ++at_;
}

void Scanner::skip_blank() {
  for (;;) {
    while (at_ < text_.size() && is_blank(text_[at_])) ++at_;
    if (!at_comment()) return;
    SourceComment comment;
    comment.offset = at_;
    if (text_[at_ + 1] == '/') {
      at_ = line_end_from(at_);
    } else {
      const std::size_t end = block_end_from(at_ + 2);
      comment.closed = end != std::string_view::npos;
      // One that nothing ends must not swallow the file: it ends with its line.
      at_ = comment.closed ? end + 2 : line_end_from(at_);
    }
    comment.text = slice(comment.offset, at_);
    if (comment.offset >= comments_end_) {
      comments_.push_back(comment);
      comments_end_ = at_;
    }
  }
}

std::string_view Scanner::peek_word() const noexcept {
  std::size_t end = at_;
  while (end < text_.size() && is_word_char(text_[end])) ++end;
  return slice(at_, end);
}

std::string_view Scanner::word() noexcept {
  const std::string_view result = peek_word();
  at_ += result.size();
  return result;
}

std::string_view Scanner::name() noexcept {
  const std::size_t begin = at_;
  while (at_ < text_.size() && kNameCharacters[static_cast<unsigned char>(text_[at_])] &&
         !at_comment()) {
    ++at_;
  }
  return slice(begin, at_);
}

std::optional<NumberToken> Scanner::number() {
  NumberToken token;
  token.offset = at_;
  const char* const end = text_.data() + text_.size();
  const char* at = text_.data() + at_;
  if (at != end && (*at == '+' || *at == '-')) token.negative = *at++ == '-';
  if (at == end || !(is_digit(*at) || *at == '.')) return std::nullopt;

  constexpr double kExactWhole = 9007199254740992.0;  // 2^53
  if (const ShortDecimal read = read_short_decimal(at, end); read.end != nullptr) {
    token.value = read.value;
    if (read.whole || read.value == std::floor(read.value)) {
      token.magnitude = static_cast<std::uint64_t>(read.value);
    }
    at = read.end;
  } else if (end - at > 2 && at[0] == '0' && (at[1] == 'x' || at[1] == 'X')) {
    std::uint64_t bits = 0;
    const auto [rest, status] = std::from_chars(at + 2, end, bits, 16);
    if (status != std::errc{}) return std::nullopt;
    token.hexadecimal = true;
    token.magnitude = bits;
    token.value = static_cast<double>(bits);
    at = rest;
  } else {
    std::uint64_t whole = 0;
    const auto [rest, status] = std::from_chars(at, end, whole);
    const bool more = rest != end && (*rest == '.' || *rest == 'e' || *rest == 'E');
    if (status == std::errc{} && !more) {
      token.magnitude = whole;
      token.value = static_cast<double>(whole);
      at = rest;
    } else {
      const auto result = std::from_chars(at, end, token.value);
      if (result.ec == std::errc::invalid_argument) return std::nullopt;
      if (result.ec == std::errc::result_out_of_range) {
        // Too large or too small for a double: the exponent's sign says which.
        const std::string_view digits(at, static_cast<std::size_t>(result.ptr - at));
        const bool small = digits.find("e-") != std::string_view::npos ||
                           digits.find("E-") != std::string_view::npos || digits.starts_with("0.");
        token.value = small ? 0.0 : std::numeric_limits<double>::infinity();
      }
      at = result.ptr;
      if (token.value <= kExactWhole && token.value == std::floor(token.value)) {
        token.magnitude = static_cast<std::uint64_t>(token.value);
      }
    }
  }
  if (token.negative) {
    token.value = -token.value;
    if (token.magnitude && *token.magnitude > (std::uint64_t{1} << 63)) token.magnitude.reset();
  }
  at_ = static_cast<std::size_t>(at - text_.data());
  return token;
}

bool Scanner::keyword_at(std::size_t position) const noexcept {
  std::size_t end = position;
  constexpr std::size_t kLongestKeyword = 17;
  while (end < text_.size() && end - position < kLongestKeyword && is_word_char(text_[end])) ++end;
  const std::string_view word = slice(position, end);
  if (!is_statement_keyword(word)) return false;
  if (word.back() == '_') return true;
  // FILTER and VERSION may as well be names; they start a statement at the start of a line.
  while (position > 0 && is_blank(text_[position - 1])) {
    if (is_line_break(text_[--position])) return true;
  }
  return position == 0;
}

// The last answer is kept: a statement that is given up is read again from its start, and many of
// them may stand on one long line.
std::size_t Scanner::line_end_from(std::size_t position) const noexcept {
  if (position < line_.begin || position > line_.end) {
    const std::size_t end = text_.find_first_of("\r\n", position);
    line_ = {position, end == std::string_view::npos ? text_.size() : end};
  }
  return line_.end;
}

std::size_t Scanner::block_end_from(std::size_t position) noexcept {
  if (position < block_.begin || position > block_.end) {
    block_ = {position, text_.find("*/", position)};
  }
  return block_.end;
}

// A ";" after which the line ends, a comment begins or the next statement stands; or after which
// the line holds no further quote, so that it cannot be inside quoted text.
bool Scanner::ends_statement(std::size_t semicolon) const noexcept {
  std::size_t at = semicolon + 1;
  while (at < text_.size() && is_blank(text_[at]) && !is_line_break(text_[at])) ++at;
  if (at >= text_.size() || is_line_break(text_[at]) || text_[at] == '/' || text_[at] == ';' ||
      keyword_at(at)) {
    return true;
  }
  for (; at < text_.size() && !is_line_break(text_[at]); ++at) {
    if (text_[at] == '"') return false;
  }
  return true;
}

// `"" XX";`: behind the unit a receiver with a quote too many. After a quote inside a unit, as in
// `"12" pipe" X`, receivers follow the last one.
bool Scanner::stray_quote(std::size_t after, std::size_t next_quote) const noexcept {
  std::size_t at = after;
  while (at < next_quote && is_blank(text_[at])) ++at;
  if (at == after || at == next_quote || !is_word_char(text_[at])) return false;
  at = next_quote + 1;
  while (at < text_.size() && (text_[at] == ' ' || text_[at] == '\t' || text_[at] == ';')) ++at;
  return at >= text_.size() || is_line_break(text_[at]);
}

bool Scanner::closes(std::size_t after, StringContext context, bool escaped) const noexcept {
  if (context == StringContext::kName) return !escaped;
  if (context == StringContext::kUnit) {
    if (escaped) return false;
    for (std::size_t at = after; at < text_.size() && !is_line_break(text_[at]); ++at) {
      if (text_[at] == '"') return stray_quote(after, at);
      if (text_[at] == '/' && at + 1 < text_.size() && text_[at + 1] == '/') return true;
      const bool starts_word = is_word_char(text_[at]) && is_blank(text_[at - 1]);
      if (starts_word && keyword_at(at)) return true;
    }
    return true;
  }

  std::size_t at = after;
  bool new_line = false;
  while (at < text_.size() && is_blank(text_[at])) new_line |= is_line_break(text_[at++]);
  if (at == text_.size()) return true;
  const char c = text_[at];
  if (c == ';') {
    if (!escaped) return ends_statement(at);
    // C:\": the backslash is text only where the statement is certainly over.
    std::size_t next = at + 1;
    bool next_new_line = false;
    while (next < text_.size() && is_blank(text_[next])) {
      next_new_line |= is_line_break(text_[next++]);
    }
    return next == text_.size() || (next_new_line && keyword_at(next));
  }
  if (new_line && keyword_at(at)) return true;
  if (escaped) return false;
  if (context == StringContext::kAttribute) return c == ',' || (c == '"' && at > after);
  if (context == StringContext::kValues) {
    if (!is_digit(c) && c != '-' && c != '+') return false;
    while (at < text_.size() &&
           (is_word_char(text_[at]) || text_[at] == '.' || text_[at] == '-' || text_[at] == '+')) {
      ++at;
    }
    while (at < text_.size() && is_blank(text_[at])) ++at;
    return at < text_.size() && text_[at] == '"';
  }
  return false;
}

std::optional<StringToken> Scanner::string(StringContext context) {
  if (peek() != '"') return std::nullopt;
  StringToken token;
  token.offset = at_;
  const std::size_t begin = at_ + 1;
  constexpr std::size_t kNone = std::string_view::npos;
  std::size_t scan = begin;
  std::size_t statement = kNone;  // first line inside that starts like a statement
  for (;;) {
    const std::size_t quote = text_.find('"', scan);
    const std::size_t until = quote == kNone ? text_.size() : quote;
    const std::string_view piece = text_.substr(scan, until - scan);
    const bool one_line_only = piece.find('\n') == kNone && piece.find('\r') == kNone;
    for (std::size_t at = one_line_only ? until : scan; statement == kNone && at < until;) {
      while (at < until && !is_line_break(text_[at])) ++at;
      while (at < until && is_blank(text_[at])) ++at;
      if (at < until && keyword_at(at)) statement = at;
    }
    const bool one_line = context == StringContext::kName || context == StringContext::kUnit;
    const bool over = quote == kNone || (one_line && statement != kNone);
    if (!over) {
      const bool escaped = quote > begin && text_[quote - 1] == '\\';
      if (closes(quote + 1, context, escaped)) {
        token.raw = slice(begin, quote);
        at_ = quote + 1;
        return token;
      }
      if (escaped || statement == kNone) {
        (escaped ? token.escapes : token.inner_quotes) = true;
        scan = quote + 1;
        continue;
      }
    }
    // Nothing ends it before the next statement starts: it ends there, or with its line.
    token.closed = false;
    std::size_t end = statement;
    if (statement == kNone) end = one_line ? line_end_from(begin) : text_.size();
    at_ = one_line ? line_end_from(begin) : end;
    end = at_;
    while (end > begin && is_blank(text_[end - 1])) --end;
    if (end > begin && text_[end - 1] == ';') --end;
    token.raw = slice(begin, end);
    return token;
  }
}

std::size_t Scanner::statement_end_from(std::size_t position) const noexcept {
  bool quoted = false;
  for (std::size_t at = position; at < text_.size(); ++at) {
    const char c = text_[at];
    if (c == '"') quoted = !quoted;
    if (c == ';' && !quoted) return at + 1;
    if (is_line_break(c)) {
      std::size_t next = at;
      while (next < text_.size() && is_blank(text_[next])) ++next;
      if (next == text_.size() || keyword_at(next)) return at;
      at = next - 1;
    }
  }
  return text_.size();
}

}  // namespace beltgrip::can::dbc
