// The line that nearly every .asc and .trc log is made of: the columns of a classic data frame with
// blanks between them, the numbers hexadecimal but for time and length, read in one pass. Any other
// line is left to the format's parser, which reads this one alike.
#pragma once

#include <string_view>

#include "can_dbc/log/can_log.h"

namespace beltgrip::can {

// Such a line is no longer than this; a longer one is another line.
inline constexpr std::size_t kUsualColumnsMost = 384;

// "   1.234567 1  123x   Rx   d 8 01 02 03 04 05 06 07 08  Length = 228000". The record's time is
// what the line says, whatever it counts from.
// Both: behind the line, or nullptr where it is another one. Precondition: text.size() >=
// kUsualColumnsMost.
const char* read_usual_asc(std::string_view text, LogRecord& record) noexcept;

// "      1      1059.900 DT 1     0300 Rx -  8    01 02 03 04 05 06 07 08". columns: their letters
// (trc.cpp). What no column says stays in the record as it is.
const char* read_usual_trc(std::string_view text, std::string_view columns,
                           LogRecord& record) noexcept;

}  // namespace beltgrip::can
