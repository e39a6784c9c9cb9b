// JSON text, one value after the other, without a document in memory. Numbers are the shortest text
// that reads back to the same double; NaN and infinity are null. Text that is not UTF-8 (the name
// of a file, of an interface in a log) is read as Windows-1252, for JSON is UTF-8. Tools only.
#pragma once

#include <charconv>
#include <cmath>
#include <concepts>
#include <cstdint>
#include <limits>
#include <string>
#include <string_view>

#include "can_dbc/text/encoding.h"

namespace beltgrip::text {

// As a number: null.
inline constexpr double kJsonNull = std::numeric_limits<double>::quiet_NaN();

class JsonWriter {
 public:
  JsonWriter& begin_object() { return open('{'); }
  JsonWriter& end_object() { return close('}'); }
  JsonWriter& begin_array() { return open('['); }
  JsonWriter& end_array() { return close(']'); }

  JsonWriter& key(std::string_view name) {
    separate();
    quote(name);
    text_ += ':';
    after_key_ = true;
    return *this;
  }

  JsonWriter& value(std::string_view text) {
    separate();
    quote(text);
    return *this;
  }
  JsonWriter& value(const char* text) { return value(std::string_view(text)); }
  JsonWriter& value(bool flag) { return raw(flag ? "true" : "false"); }
  JsonWriter& value(double number) {
    if (!std::isfinite(number)) return null();
    return number_text(number);
  }
  JsonWriter& value(std::integral auto number) { return number_text(number); }
  JsonWriter& null() { return raw("null"); }
  // Text that is JSON already.
  JsonWriter& raw(std::string_view json) {
    separate();
    text_ += json;
    return *this;
  }

  JsonWriter& field(std::string_view name, const auto& content) { return key(name).value(content); }

  const std::string& text() const { return text_; }
  // Hands over the text and starts again.
  std::string take() {
    std::string result;
    result.swap(text_);
    first_ = true;
    after_key_ = false;
    return result;
  }

 private:
  JsonWriter& open(char bracket) {
    separate();
    text_ += bracket;
    first_ = true;
    return *this;
  }
  JsonWriter& close(char bracket) {
    text_ += bracket;
    first_ = false;
    return *this;
  }
  void separate() {
    if (after_key_) {
      after_key_ = false;
    } else if (!first_) {
      text_ += ',';
    }
    first_ = false;
  }
  JsonWriter& number_text(auto number) {
    char buffer[32];
    const auto end = std::to_chars(buffer, buffer + sizeof buffer, number).ptr;
    return raw({buffer, static_cast<std::size_t>(end - buffer)});
  }
  // Nearly all text.
  static bool is_plain(std::string_view text) {
    bool plain = true;
    for (const char c : text) plain &= c >= 0x20 && c < 0x7F && c != '"' && c != '\\';
    return plain;
  }
  void quote(std::string_view text) {
    text_ += '"';
    if (is_plain(text)) {
      text_ += text;
    } else if (can::is_utf8(text)) {
      escape(text);
    } else {
      escape(can::utf8_from_windows_1252(text));
    }
    text_ += '"';
  }
  void escape(std::string_view text) {
    static constexpr char kHex[] = "0123456789abcdef";
    for (std::size_t i = 0; i < text.size(); ++i) {
      const char c = text[i];
      const auto byte = static_cast<unsigned char>(c);
      const auto next = static_cast<unsigned char>(i + 1 < text.size() ? text[i + 1] : '\0');
      if (c == '"' || c == '\\') {
        text_ += '\\';
        text_ += c;
      } else if (byte < 0x20 || byte == 0x7F) {
        text_ += "\\u00";
        text_ += kHex[byte >> 4];
        text_ += kHex[byte & 15];
      } else if (byte == 0xC2 && next < 0xA0) {  // U+0080 to U+009F steer terminals too
        text_ += "\\u00";
        text_ += kHex[next >> 4];
        text_ += kHex[next & 15];
        ++i;
      } else {
        text_ += c;
      }
    }
  }

  std::string text_;
  bool first_ = true;
  bool after_key_ = false;
};

}  // namespace beltgrip::text
