#include "daemon/core/config/toml/config_document.h"

#include <toml++/toml.h>

#include <algorithm>
#include <array>

#include "can_dbc/text/number_text.h"
#include "daemon/core/config/toml/toml_bounds.h"

namespace beltgrip::daemon {

namespace {

TomlNode convert(const toml::node& node) {
  TomlNode result;
  result.line = node.source().begin.line;
  switch (node.type()) {
    case toml::node_type::table:
      result.type = TomlType::kTable;
      for (const auto& [key, child] : *node.as_table()) {
        result.children.push_back(convert(child));
        result.children.back().key = std::string(key.str());
        result.children.back().line = key.source().begin.line;
      }
      break;
    case toml::node_type::array:
      result.type = TomlType::kArray;
      for (const auto& child : *node.as_array()) result.children.push_back(convert(child));
      break;
    case toml::node_type::string:
      result.type = TomlType::kText;
      result.text = node.as_string()->get();
      break;
    case toml::node_type::integer:
      result.type = TomlType::kInteger;
      result.integer = node.as_integer()->get();
      result.number = static_cast<double>(result.integer);
      break;
    case toml::node_type::floating_point:
      result.type = TomlType::kNumber;
      result.number = node.as_floating_point()->get();
      break;
    case toml::node_type::boolean:
      result.type = TomlType::kFlag;
      result.flag = node.as_boolean()->get();
      break;
    default:
      result.type = TomlType::kTime;
  }
  return result;
}

}  // namespace

std::string in_quotes(std::string_view text) { return '"' + std::string(text) + '"'; }

std::string_view toml_type_name(TomlType type) {
  constexpr std::array<std::string_view, 7> kNames{
      "a table", "an array", "text", "an integer", "a number", "true or false", "a date or time"};
  return kNames[static_cast<std::size_t>(type)];
}

const TomlNode* TomlNode::find(std::string_view child_key) const {
  const auto at = std::find_if(children.begin(), children.end(),
                               [&](const TomlNode& child) { return child.key == child_key; });
  return at == children.end() ? nullptr : &*at;
}

std::string TomlNode::found() const {
  constexpr std::size_t kTextMax = 80;
  switch (type) {
    case TomlType::kText: {
      std::string shown = text.size() > kTextMax ? text.substr(0, kTextMax) + "..." : text;
      std::replace_if(
          shown.begin(), shown.end(), [](char c) { return static_cast<unsigned char>(c) < ' '; },
          ' ');
      return in_quotes(shown);
    }
    case TomlType::kInteger:
      return std::to_string(integer);
    case TomlType::kNumber:
      return number_text(number);
    case TomlType::kFlag:
      return flag ? "true" : "false";
    default:
      return std::string(toml_type_name(type));
  }
}

const TomlNode* section_of(const TomlNode& root, std::string_view name) {
  const TomlNode* found = root.find(name);
  return found != nullptr && found->type == TomlType::kTable ? found : nullptr;
}

std::uint32_t line_of(const TomlNode& root, std::string_view section, std::string_view key) {
  const TomlNode* in = section_of(root, section);
  if (in == nullptr) return 1;
  const TomlNode* at = in->find(key);
  return at == nullptr ? in->line : at->line;
}

Result<TomlNode, TomlSyntaxError> parse_toml(std::string_view text) {
  if (const auto beyond = beyond_bounds(text)) return *beyond;
  try {
    return convert(toml::parse(text));
  } catch (const toml::parse_error& error) {
    std::string description(error.description());
    std::replace(description.begin(), description.end(), '\n', ' ');
    return TomlSyntaxError{error.source().begin.line, description};
  }
}

}  // namespace beltgrip::daemon
