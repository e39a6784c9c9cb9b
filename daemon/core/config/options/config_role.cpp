#include "daemon/core/config/options/config_role.h"

#include "daemon/core/config/options/option_reader.h"

namespace beltgrip::daemon {

namespace {

// Scale and offset stand once: in uds where there is one, and not where true_when names values.
bool scale_stands_alone(const std::string& key, const TomlNode& node, std::string_view beside,
                        const std::string& expected, ConfigErrors& errors) {
  if (node.find(beside) == nullptr) return true;
  bool good = true;
  for (const char* each : {"scale", "offset"}) {
    const TomlNode* child = node.find(each);
    if (child == nullptr) continue;
    errors.add(child->line, key_of(key, each), "a key beside " + std::string(beside), expected);
    good = false;
  }
  return good;
}

}  // namespace

std::optional<RoleText> read_role(const std::string& key, const TomlNode& node,
                                  ConfigErrors& errors) {
  RoleText text;
  if (node.type == TomlType::kText) {
    text.signal = node.text;
    return text;
  }
  if (node.type != TomlType::kTable) {
    errors.add(node.line, key, node.found(), "\"Message.Signal\" or { signal = \"...\", ... }");
    return {};
  }
  bool good = read_keys(role_options(), key, node, text, errors);
  const bool by_uds = node.find("uds") != nullptr;
  const bool by_column = node.find("column") != nullptr;
  const bool by_signal = node.find("signal") != nullptr;
  if ((by_uds && by_signal) || (!by_uds && !by_signal && !by_column)) {
    errors.add(node.line, key, by_uds ? "both signal and uds" : "a table without signal",
               by_uds ? "one of them" : "signal = \"Message.Signal\"");
    good = false;
  }
  good &= scale_stands_alone(key, node, "uds", "it inside uds = { ... }", errors);
  good &= scale_stands_alone(key, node, "true_when", "one of them", errors);
  return good ? std::optional(text) : std::nullopt;
}

std::uint32_t line_in_role(const TomlNode& node, std::string_view key) {
  const TomlNode* child = node.type == TomlType::kTable ? node.find(key) : nullptr;
  return child == nullptr ? node.line : child->line;
}

}  // namespace beltgrip::daemon
