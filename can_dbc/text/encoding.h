// Text of DBC files to UTF-8: UTF-8 stays, Windows-1252 (what most editors of the format write) is
// converted, UTF-16 with a byte order mark too. Pure functions.
#pragma once

#include <optional>
#include <string>
#include <string_view>

namespace beltgrip::can {

bool is_ascii(std::string_view text) noexcept;
bool is_utf8(std::string_view text) noexcept;
// The five bytes that Windows-1252 leaves undefined become the control characters of that number.
std::string utf8_from_windows_1252(std::string_view text);
// Nothing unless text starts with a UTF-16 byte order mark. Lone surrogates become U+FFFD.
std::optional<std::string> utf8_from_utf16(std::string_view text);

}  // namespace beltgrip::can
