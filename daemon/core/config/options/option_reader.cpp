#include "daemon/core/config/options/option_reader.h"

#include <algorithm>
#include <cmath>

#include "can_dbc/text/number_text.h"

namespace beltgrip::daemon {

namespace {

using Kind = OptionRow::Kind;

bool is_endless(const OptionRow& option) {
  return std::isinf(option.minimum) && std::isinf(option.maximum);
}

std::string integer_text(double value, bool hexadecimal) {
  if (hexadecimal && value != 0.0) return "0x" + hex_text(static_cast<std::uint32_t>(value));
  return std::to_string(static_cast<std::int64_t>(value));
}

}  // namespace

std::string value_text(double value) {
  TomlNode node;
  node.type = TomlType::kNumber;
  node.number = value;
  return node.found();
}

std::string range_text(double minimum, double maximum) {
  return "a number from " + value_text(minimum) + " to " + value_text(maximum);
}

std::string expected_text(const OptionRow& option) {
  if (!option.expected.empty()) return std::string(option.expected);
  switch (option.kind) {
    case Kind::kNumber:
      if (!is_endless(option)) return range_text(option.minimum, option.maximum);
      return option.is_nonzero ? "a finite number other than 0" : "a finite number";
    case Kind::kInteger:
      return "an integer from " + integer_text(option.minimum, option.is_hexadecimal) + " to " +
             integer_text(option.maximum, option.is_hexadecimal) +
             (option.unit.empty() ? "" : " (" + std::string(option.unit) + ")");
    case Kind::kChoice: {
      std::string text;
      for (const std::string_view each : option.choices) {
        text += (text.empty() ? "" : " or ") + in_quotes(each);
      }
      return text;
    }
    case Kind::kFlag:
      return "true or false";
    default:
      return "text in quotes";
  }
}

bool fits(const OptionRow& option, const TomlNode& node) {
  switch (option.kind) {
    case Kind::kNumber:
      return node.is_number() && node.number >= option.minimum && node.number <= option.maximum &&
             std::isfinite(node.number) && !(option.is_nonzero && node.number == 0.0);
    case Kind::kInteger:
      return node.type == TomlType::kInteger &&
             node.integer >= static_cast<std::int64_t>(option.minimum) &&
             node.integer <= static_cast<std::int64_t>(option.maximum);
    case Kind::kText:
      return node.type == TomlType::kText;
    case Kind::kChoice:
      return node.type == TomlType::kText && std::find(option.choices.begin(), option.choices.end(),
                                                       node.text) != option.choices.end();
    case Kind::kFlag:
      return node.type == TomlType::kFlag;
    default:
      return true;
  }
}

std::string names_text(const std::vector<std::string>& all) {
  std::string text;
  for (const std::string& each : all) {
    text += (text.empty() ? "" : &each == &all.back() ? " or " : ", ") + each;
  }
  return text;
}

void add_unknown_key(const std::string& table, const TomlNode& node,
                     const std::vector<std::string>& keys, ConfigErrors& errors) {
  errors.add(node.line, key_of(table, node.key), "an unknown key",
             names_text(keys) + nearest_hint(node.key, keys));
}

bool read_paths(const OptionRow& option, const std::string& key, const TomlNode& node,
                std::vector<std::string>& paths, ConfigErrors& errors) {
  if (node.type != TomlType::kArray) {
    errors.add(node.line, key, node.found(), std::string(option.expected));
    return false;
  }
  bool good = true;
  for (const TomlNode& each : node.children) {
    if (each.type == TomlType::kText && !each.text.empty()) {
      paths.push_back(each.text);
    } else {
      errors.add(each.line, key, each.found(), "the path of a DBC file in quotes");
      good = false;
    }
  }
  return good;
}

}  // namespace beltgrip::daemon
