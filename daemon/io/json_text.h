// JSON text to values: read here alone, as the parser costs the compiler two seconds wherever it
// stands. Not on the real-time thread.
#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>

namespace beltgrip::daemon {

nlohmann::ordered_json json_of(const std::string& text);  // throws nlohmann's parse_error
// Discarded (is_discarded()) where the text is no JSON.
nlohmann::ordered_json json_if_any(const std::string& text);

}  // namespace beltgrip::daemon
