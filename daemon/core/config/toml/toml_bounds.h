// What a TOML text may be at most before a parser sees it: parsers go down a level of the stack for
// each level of the tree, and a key with 30,000 dots ends them. Start-up and tools only.
#pragma once

#include <optional>
#include <string_view>

#include "daemon/core/config/toml/config_document.h"

namespace beltgrip::daemon {

inline constexpr std::size_t kTomlSizeMax = std::size_t{1} << 20;
inline constexpr int kTomlDepthMax = 16;  // brackets within each other, and parts of one key

// Nothing, or what is too much of it and where.
std::optional<TomlSyntaxError> beyond_bounds(std::string_view text);

}  // namespace beltgrip::daemon
