#include "can_dbc/text/printable.h"

#include <cstdint>

#include "can_dbc/text/encoding.h"

namespace beltgrip::can {

namespace {

constexpr std::string_view kHex = "0123456789abcdef";

unsigned char byte_at(std::string_view text, std::size_t i) {
  return static_cast<unsigned char>(text[i]);
}

// Bytes of the character that begins here, 0: none does.
std::size_t length_at(std::string_view text, std::size_t i) {
  const unsigned char first = byte_at(text, i);
  const std::size_t length = first < 0x80                     ? 1
                             : first >= 0xC2 && first <= 0xDF ? 2
                             : first >= 0xE0 && first <= 0xEF ? 3
                             : first >= 0xF0 && first <= 0xF4 ? 4
                                                              : 0;
  if (length == 0 || i + length > text.size()) return 0;
  return is_utf8(text.substr(i, length)) ? length : 0;
}

std::uint32_t code_of(std::string_view character) {
  if (character.size() == 1) return byte_at(character, 0);
  std::uint32_t code = byte_at(character, 0) & (0x7FU >> character.size());
  for (std::size_t i = 1; i < character.size(); ++i) {
    code = code << 6 | (byte_at(character, i) & 0x3FU);
  }
  return code;
}

bool steers(std::uint32_t code) {
  return code < 0x20 || (code >= 0x7F && code < 0xA0) || (code >= 0x200E && code <= 0x200F) ||
         (code >= 0x2028 && code <= 0x202E) || (code >= 0x2066 && code <= 0x2069);
}

void append_hex(std::string& out, std::uint32_t value, int digits) {
  while (digits-- > 0) out += kHex[value >> (4 * digits) & 15U];
}

std::string shown(std::string_view text, bool keep_lines) {
  std::string out;
  out.reserve(text.size());
  for (std::size_t i = 0; i < text.size();) {
    const std::size_t length = length_at(text, i);
    if (length == 0) {
      out += "\\x";
      append_hex(out, byte_at(text, i++), 2);
      continue;
    }
    const std::string_view character = text.substr(i, length);
    i += length;
    if (keep_lines && character == "\n") {
      out += '\n';
    } else if (character == "\n" || character == "\r" || character == "\t") {
      out += ' ';
    } else if (const std::uint32_t code = code_of(character); steers(code)) {
      out += "\\u";
      append_hex(out, code, 4);
    } else {
      out += character;
    }
  }
  return out;
}

}  // namespace

std::string printable(std::string_view text) { return shown(text, false); }
std::string printable_lines(std::string_view text) { return shown(text, true); }

}  // namespace beltgrip::can
