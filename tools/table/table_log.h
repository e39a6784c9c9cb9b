// A table of signals as a log of frames. Tools only.
#pragma once

#include <memory>
#include <string>

#include "can_dbc/dbc/model.h"
#include "can_dbc/log/can_log.h"

namespace beltgrip::table {

// The cells of each row as frames of the messages that are called like its columns, at the time of
// the row, or rate_Hz rows a second where no column tells it. Cells that are missing, no number, or
// no text of the value table give no frame; a row whose time cannot be read, or with another number
// of cells than the header has, is a bad line. Throws can::LogOpenError.
std::unique_ptr<can::LogReader> open(const std::string& path, const can::Database& columns,
                                     double rate_Hz);

}  // namespace beltgrip::table
