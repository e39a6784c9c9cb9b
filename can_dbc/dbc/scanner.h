// The tokens of DBC text: words, numbers, quoted text, blanks and comments, each with its offset.
// Forgiving where real files are (see StringContext), linear in the text whatever it holds.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "can_dbc/dbc/parser.h"

namespace beltgrip::can::dbc {

constexpr bool is_digit(char c) { return c >= '0' && c <= '9'; }

// Problems by offset; sorted and turned into lines and columns at the end.
class ProblemList {
 public:
  // Text that quotes the input passes it through clip() first: a megabyte is no message.
  void add(Severity severity, std::size_t offset, const char* code, std::string text) {
    items_.push_back({severity, offset, code, std::move(text)});
  }
  void warn(std::size_t offset, const char* code, std::string text) {
    add(Severity::kWarning, offset, code, std::move(text));
  }
  void error(std::size_t offset, const char* code, std::string text) {
    add(Severity::kError, offset, code, std::move(text));
  }
  std::vector<Problem> finish(std::string_view text);

 private:
  struct Item {
    Severity severity;
    std::size_t offset;
    const char* code;
    std::string text;
  };
  std::vector<Item> items_;
};

// At most 60 characters of it, on one line, printable.
std::string clip(std::string_view text);

// Number of line breaks (LF, CRLF or a lone CR) before each offset asked for, in one pass.
class LineCounter {
 public:
  explicit LineCounter(std::string_view text) : text_(text) {}
  struct Position {
    std::uint32_t line;    // 1-based
    std::uint32_t column;  // 1-based, bytes
  };
  Position at(std::size_t offset);  // offsets must not fall

 private:
  std::string_view text_;
  std::size_t scanned_ = 0;
  std::size_t line_start_ = 0;
  std::uint32_t line_ = 1;
};

// Where quoted text stands says which quote ends it when it holds quotes that nothing escapes.
enum class StringContext : std::uint8_t {
  kName,       // the first one
  kComment,    // one followed by ";" (or by a new statement)
  kValues,     // one followed by the next number, or ";"
  kAttribute,  // one followed by ";", "," or the next quote
  kUnit        // the last one before the receivers
};

struct StringToken {
  std::string_view raw;       // between the quotes
  std::size_t offset = 0;     // of the opening quote
  bool escapes = false;       // holds \"
  bool inner_quotes = false;  // holds quotes that nothing escapes
  bool closed = true;         // false: no end found; raw is what stands before the next statement
};

struct NumberToken {
  double value = 0.0;
  std::size_t offset = 0;
  // Set when the number is a whole one of at most 64 bits (a negative one: at least -2^63).
  std::optional<std::uint64_t> magnitude;
  bool negative = false;
  bool hexadecimal = false;
};

struct SourceComment {
  std::size_t offset = 0;
  std::string_view text;
  bool closed = true;
};

bool is_statement_keyword(std::string_view word) noexcept;

class Scanner {
 public:
  explicit Scanner(std::string_view text) : text_(text) {}

  std::size_t position() const noexcept { return at_; }
  void seek(std::size_t position) noexcept { at_ = position; }
  bool at_end() const noexcept { return at_ >= text_.size(); }
  char peek() const noexcept { return at_ < text_.size() ? text_[at_] : '\0'; }
  std::string_view rest() const noexcept { return text_.substr(std::min(at_, text_.size())); }
  std::string_view slice(std::size_t begin, std::size_t end) const noexcept {
    return text_.substr(begin, end - begin);
  }

  void skip_blank();   // blanks, line breaks and comments
  void skip_spaces();  // blanks on this line only
  bool at_line_end() const noexcept {
    return at_ >= text_.size() || text_[at_] == '\n' || text_[at_] == '\r';
  }
  bool at_comment() const noexcept {
    return at_ + 1 < text_.size() && text_[at_] == '/' &&
           (text_[at_ + 1] == '/' || text_[at_ + 1] == '*');
  }
  // After blanks: takes the character if it is there.
  bool accept(char c) {
    skip_blank();
    if (peek() != c) return false;
    ++at_;
    return true;
  }
  // Letters, digits, underscore; empty if none is here. Does not skip blanks.
  std::string_view word() noexcept;
  std::string_view peek_word() const noexcept;
  // A name as files have them: anything but blanks and the format's own punctuation.
  std::string_view name() noexcept;
  std::optional<NumberToken> number();
  std::optional<StringToken> string(StringContext context);
  // True if a statement keyword stands at `position`.
  bool keyword_at(std::size_t position) const noexcept;
  std::size_t line_end_from(std::size_t position) const noexcept;
  // The rest of the line, but no more than `longest` of it.
  std::string_view line_rest(std::size_t position, std::size_t longest) const noexcept {
    const std::string_view rest = text_.substr(std::min(position, text_.size()), longest);
    return rest.substr(0, rest.find_first_of("\r\n"));
  }
  // From `position` to past the ";" that ends a statement, or to the line on which the next starts.
  std::size_t statement_end_from(std::size_t position) const noexcept;

  const std::vector<SourceComment>& comments() const noexcept { return comments_; }

 private:
  bool closes(std::size_t after, StringContext context, bool escaped) const noexcept;
  bool stray_quote(std::size_t after, std::size_t next_quote) const noexcept;
  bool ends_statement(std::size_t semicolon) const noexcept;
  std::size_t block_end_from(std::size_t position) noexcept;

  std::string_view text_;
  std::size_t at_ = 0;
  std::vector<SourceComment> comments_;
  std::size_t comments_end_ = 0;  // comments before this offset are already listed
  // From anywhere in it, `end` comes next: a line break, or "*/" (npos: none).
  struct Stretch {
    std::size_t begin = 1;
    std::size_t end = 0;
  };
  mutable Stretch line_;
  Stretch block_;
};

}  // namespace beltgrip::can::dbc
