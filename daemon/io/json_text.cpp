#include "daemon/io/json_text.h"

#include <nlohmann/json.hpp>

namespace beltgrip::daemon {

namespace {

nlohmann::ordered_json parsed(const std::string& text, bool throws) {
  return nlohmann::ordered_json::parse(text, nullptr, throws);
}

}  // namespace

nlohmann::ordered_json json_of(const std::string& text) { return parsed(text, true); }
nlohmann::ordered_json json_if_any(const std::string& text) { return parsed(text, false); }

}  // namespace beltgrip::daemon
