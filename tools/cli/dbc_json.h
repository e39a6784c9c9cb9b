// A DBC file's content as one JSON object: everything that the file says. Tools only.
#pragma once

#include <string>

#include "can_dbc/dbc/model.h"

namespace beltgrip::cli {

std::string database_json(const can::Database& database);

}  // namespace beltgrip::cli
