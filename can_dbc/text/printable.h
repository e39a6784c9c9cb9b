// Text of others (DBC files, keys of a configuration, names of files) as it may reach a terminal:
// what would steer one becomes visible. Pure functions.
#pragma once

#include <string>
#include <string_view>

namespace beltgrip::can {

// On one line: line ends and tabs are blanks; other control characters, those of UTF-8's second
// block and marks that turn the direction of writing are \u0000; a byte that is no UTF-8 is \x00.
std::string printable(std::string_view text);
// The same, but it may have several lines.
std::string printable_lines(std::string_view text);

}  // namespace beltgrip::can
