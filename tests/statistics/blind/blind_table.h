// The ledger of the blind test as a table.
#pragma once

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

namespace beltgrip::blind {
std::string table_text(const std::vector<nlohmann::json>& entries);
}  // namespace beltgrip::blind
