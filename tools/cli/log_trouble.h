// What is said of a log that cannot be read, or not all of it. Tools only.
#pragma once

#include <cstdint>
#include <string>

#include "can_dbc/log/can_log.h"

namespace beltgrip::cli {

// What a LOG may be, for help.
inline constexpr const char* kLogKinds =
    "CAN log (candump, .asc, .trc, .csv, .blf, .mf4, .pcapng; .gz, .zst; - for standard input)";

// "LOG: no readable frame in 3 lines, line 1: what is wrong with it", and the hint where one fits.
std::string no_frame_text(const std::string& path, const can::LogStats& stats);

// "LOG:17: reason", "LOG: byte 4096: reason" for a binary log.
std::string bad_line_text(const std::string& path, const can::BadLine& bad);

// Of frames that were left out because of their stamps.
std::string left_out_text(std::uint64_t frames);

// "3 unreadable lines", "1 unreadable record" of a binary log.
std::string unreadable_text(const can::LogStats& stats);
// The same and the first of them: "3 unreadable lines, line 17: reason".
std::string unreadable_with_first(const can::LogStats& stats);

}  // namespace beltgrip::cli
