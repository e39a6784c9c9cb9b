// Reads a table of the file by the rows of its keys. Start-up and tools only.
#pragma once

#include <string>
#include <vector>

#include "daemon/core/config/options/option.h"
#include "daemon/core/config/toml/config_errors.h"

namespace beltgrip::daemon {

std::string value_text(double value);                         // in an error: "0.5", "10000"
std::string range_text(double minimum, double maximum);       // "a number from 0.5 to 10000"
std::string expected_text(const OptionRow& option);           // what would be right, in an error
bool fits(const OptionRow& option, const TomlNode& node);     // type and range
std::string names_text(const std::vector<std::string>& all);  // "a, b or c"
void add_unknown_key(const std::string& table, const TomlNode& node,
                     const std::vector<std::string>& keys, ConfigErrors& errors);
bool read_paths(const OptionRow& option, const std::string& key, const TomlNode& node,
                std::vector<std::string>& paths, ConfigErrors& errors);

template <typename Rows>
std::vector<std::string> key_names(const Rows& options) {
  std::vector<std::string> names;
  names.reserve(std::size(options));
  for (const OptionRow& option : options) names.emplace_back(option.key);
  return names;
}

// One value into its place. False when errors were added.
template <typename Target>
bool read_value(const OptionOf<Target>& option, const std::string& key, const TomlNode& node,
                Target& into, ConfigErrors& errors) {
  using Kind = OptionRow::Kind;
  if (option.kind == Kind::kOther) return true;
  if (option.kind == Kind::kTable) return option.table(key, node, into, errors);
  if (option.kind == Kind::kPaths) {
    return read_paths(option, key, node, option.paths(into), errors);
  }
  if (!fits(option, node)) {
    errors.add(node.line, key, node.found(), expected_text(option));
    return false;
  }
  if (option.kind == Kind::kNumber) option.number(into) = node.number * option.factor;
  if (option.kind == Kind::kInteger) option.set_integer(into, node.integer);
  if (option.kind == Kind::kText) option.text(into) = node.text;
  if (option.kind == Kind::kFlag) option.set_choice(into, node.flag ? 1 : 0);
  if (option.kind == Kind::kChoice) {
    std::size_t index = 0;
    while (option.choices[index] != node.text) ++index;
    option.set_choice(into, index);
  }
  return true;
}

// Every key of `table`, which stands at `where`. False when errors were added.
template <typename Target, typename Rows>
bool read_keys(const Rows& options, const std::string& where, const TomlNode& table, Target& into,
               ConfigErrors& errors) {
  bool good = true;
  for (const TomlNode& node : table.children) {
    const OptionOf<Target>* known = nullptr;
    for (const OptionOf<Target>& option : options) {
      if (option.key == node.key) known = &option;
    }
    if (known == nullptr) {
      add_unknown_key(where, node, key_names(options), errors);
      good = false;
    } else if (!read_value(*known, key_of(where, node.key), node, into, errors)) {
      good = false;
    }
  }
  return good;
}

// The keys without which the table, which is called `what`, says nothing.
template <typename Rows>
bool has_required(const Rows& options, const std::string& where, const TomlNode& table,
                  const std::string& what, const std::string& expected, ConfigErrors& errors) {
  bool good = true;
  for (const OptionRow& option : options) {
    if (!option.is_required || table.find(option.key) != nullptr) continue;
    errors.add(table.line, where, what + " without " + std::string(option.key), expected);
    good = false;
  }
  return good;
}

}  // namespace beltgrip::daemon
