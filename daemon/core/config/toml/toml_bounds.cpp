#include "daemon/core/config/toml/toml_bounds.h"

#include <algorithm>

namespace beltgrip::daemon {

namespace {

// Reads just enough of the syntax to tell what stands in quotes and comments from the rest.
class Scanner {
 public:
  explicit Scanner(std::string_view text) : text_(text) {}

  std::optional<TomlSyntaxError> scan() {
    while (at_ < text_.size()) {
      const char c = text_[at_];
      if (c == '"' || c == '\'') {
        skip_quoted(c);
      } else if (c == '#') {
        at_ = std::min(text_.find('\n', at_), text_.size());
      } else {
        ++at_;
        if (!step(c)) return TomlSyntaxError{line_, "more than 16 levels"};
      }
    }
    return {};
  }

 private:
  bool step(char c) {
    switch (c) {
      case '.':
        return ++parts_ <= kTomlDepthMax;
      case '[':
      case '{':
        parts_ = 0;
        return ++depth_ <= kTomlDepthMax;
      case ']':
      case '}':
        depth_ = std::max(0, depth_ - 1);
        break;
      case '\n':
        ++line_;
        [[fallthrough]];
      case '=':
      case ',':
        parts_ = 0;
        break;
      default:
        break;
    }
    return true;
  }

  // A text in quotes of one kind, on one line, or over several where three of them begin it.
  void skip_quoted(char quote) {
    const auto run = [&] {
      std::size_t count = 0;
      while (at_ + count < text_.size() && text_[at_ + count] == quote) ++count;
      return count;
    };
    const std::size_t opening = run();
    const bool long_text = opening >= 3;
    at_ += long_text ? 3 : 1;
    while (at_ < text_.size()) {
      const char c = text_[at_];
      if (c == '\\' && quote == '"') {
        if (at_ + 1 < text_.size() && text_[at_ + 1] == '\n') ++line_;
        at_ = std::min(at_ + 2, text_.size());
      } else if (c == '\n') {
        if (!long_text) return;  // no TOML: the parser says so
        ++line_;
        ++at_;
      } else if (c == quote && !long_text) {
        ++at_;
        return;
      } else if (c == quote) {
        const std::size_t count = run();
        at_ += std::min<std::size_t>(count, 5);  // up to two belong to the text
        if (count >= 3) return;
      } else {
        ++at_;
      }
    }
  }

  std::string_view text_;
  std::size_t at_ = 0;
  std::uint32_t line_ = 1;
  int depth_ = 0, parts_ = 0;
};

}  // namespace

std::optional<TomlSyntaxError> beyond_bounds(std::string_view text) {
  if (text.size() > kTomlSizeMax) return TomlSyntaxError{1, "more than 1 MiB"};
  return Scanner(text).scan();
}

}  // namespace beltgrip::daemon
