// The line that nearly every candump log is made of, read eight characters at a time:
// "(1700000000.123456) can0 123#0011223344556677", with an identifier of three or eight digits, at
// most eight bytes, and six or nine digits of a second. Any other line is left to the parser of
// them all, which reads this one alike.
#pragma once

#include <string_view>

#include "can_dbc/log/can_log.h"

namespace beltgrip::can {

// Text that is at least as long as this holds all of such a line.
inline constexpr std::size_t kUsualLineMost = 64;

// Behind the line, or nullptr where it is another one; then the record is left as it was.
// Precondition: text.size() >= kUsualLineMost.
const char* read_usual_line(std::string_view text, LogRecord& record) noexcept;

}  // namespace beltgrip::can
