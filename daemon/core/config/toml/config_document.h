// TOML text as a tree of plain values with line numbers: all that the rest of the program sees of
// the TOML library. Start-up and tools only.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "daemon/core/base/result.h"

namespace beltgrip::daemon {

enum class TomlType : std::uint8_t { kTable, kArray, kText, kInteger, kNumber, kFlag, kTime };
std::string in_quotes(std::string_view text);
std::string_view toml_type_name(TomlType type);  // "table", "text", ...

struct TomlNode {
  std::string key;  // empty for elements of an array and the root
  std::uint32_t line = 0;
  TomlType type = TomlType::kTable;
  std::string text;                // kText
  std::int64_t integer = 0;        // kInteger
  double number = 0.0;             // kNumber, and kInteger as a number
  bool flag = false;               // kFlag
  std::vector<TomlNode> children;  // kTable (sorted by key), kArray

  const TomlNode* find(std::string_view child_key) const;
  bool is_number() const { return type == TomlType::kNumber || type == TomlType::kInteger; }
  // As found in the file, short: "text", 12, a table ...; for error messages.
  std::string found() const;
};

// A section [name] of a file; null where there is none.
const TomlNode* section_of(const TomlNode& root, std::string_view name);
// The line of a key, else of its section, else 1.
std::uint32_t line_of(const TomlNode& root, std::string_view section, std::string_view key);

struct TomlSyntaxError {
  std::uint32_t line = 0;
  std::string text;  // one line
};

Result<TomlNode, TomlSyntaxError> parse_toml(std::string_view text);

}  // namespace beltgrip::daemon
