// The one form of an error in a configuration: "FILE:LINE: key: found ..., expected ...". Start-up
// and tools only.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "daemon/core/base/exit_code.h"

namespace beltgrip::daemon {

struct ConfigError {
  // kNoInput: a file is missing or unreadable; kBadInput: a DBC without a readable message.
  int exit_code = kConfiguration;
  std::string text;  // "FILE:LINE: key: found ..., expected ..."
};

// Collects errors with their position.
class ConfigErrors {
 public:
  ConfigErrors(std::string file, std::vector<ConfigError>& errors)
      : files_{std::move(file)}, errors_(errors) {}
  // A file that is included: what its lines are counted from, so that a line tells its file.
  std::uint32_t add_file(const std::string& file);
  std::string place(std::uint32_t line) const;  // "FILE:LINE"
  void add(std::uint32_t line, const std::string& key, const std::string& found,
           const std::string& expected, int exit_code = kConfiguration);
  // Of a file as a whole.
  void add_of_file(const std::string& file, const std::string& found, const std::string& expected,
                   int exit_code);
  std::size_t count() const { return errors_.size(); }

 private:
  static constexpr unsigned kLineBits = 22;  // a file of 1 MiB has fewer lines
  static constexpr std::uint32_t kFirstLine = std::uint32_t{1} << kLineBits;
  std::vector<std::string> files_;
  std::vector<ConfigError>& errors_;
};

std::string key_of(std::string_view table, std::string_view key);  // "table.key"
// The name in `names` nearest to `name`, where one is near enough to be a slip of the pen:
// "; nearest is \"x\"", else nothing.
std::string nearest_hint(std::string_view name, const std::vector<std::string>& names);

}  // namespace beltgrip::daemon
