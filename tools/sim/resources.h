// Files that are part of the program: shipped scenarios and DBC files, so that it needs none beside
// it. Generated from tools/scenarios at build. Tools only.
#pragma once

#include <optional>
#include <string_view>
#include <vector>

namespace beltgrip::sim {

std::optional<std::string_view> resource(std::string_view name);
// The same for a file that is known to be shipped: std::logic_error when it is not.
std::string_view shipped(std::string_view name);
std::vector<std::string_view> resource_names();

}  // namespace beltgrip::sim
