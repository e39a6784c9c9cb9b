// From names in the configuration to signals in the DBC files of a bus: reads the files, finds what
// a role names, settles its unit. Start-up and tools only.
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "can_dbc/dbc/model.h"
#include "daemon/core/config/config.h"
#include "daemon/core/config/config_document.h"
#include "daemon/core/config/config_text.h"

namespace beltgrip::daemon {

// Collects errors with their position: "FILE:LINE: key: found ..., expected ...".
class ConfigErrors {
 public:
  ConfigErrors(std::string file, std::vector<ConfigError>& errors)
      : files_{std::move(file)}, errors_(errors) {}
  // A file that is included: what its lines are counted from, so that a line tells its file.
  std::uint32_t add_file(const std::string& file);
  std::string place(std::uint32_t line) const;  // "FILE:LINE"
  void add(std::uint32_t line, const std::string& key, const std::string& found,
           const std::string& expected, int exit_code = 78);

 private:
  static constexpr unsigned kLineBits = 22;  // a file of 1 MiB has fewer lines
  static constexpr std::uint32_t kFirstLine = std::uint32_t{1} << kLineBits;
  std::vector<std::string> files_;
  std::vector<ConfigError>& errors_;
};

// The name in `names` nearest to `name`, where one is near enough to be a slip of the pen:
// ", nearest is \"x\"", else nothing.
std::string nearest_hint(std::string_view name, const std::vector<std::string>& names);

class SignalCatalogue {
 public:
  explicit SignalCatalogue(FileKind kind) : kind_(kind) {}
  // Reads one DBC file; path as in the configuration under `key`, directory that of the
  // configuration.
  void add_file(const std::string& key, const std::string& path, const std::string& directory,
                std::uint32_t line, ConfigErrors& errors, std::vector<std::string>& warnings);
  // Every identifier in one file only.
  void check_identifiers(const std::string& key, std::uint32_t line, ConfigErrors& errors) const;
  // True when every file could be read: only then roles can be judged.
  bool complete() const { return complete_; }
  // The binding of a role from its TOML value; nothing when errors were added.
  std::optional<RoleBinding> bind(Role role, const TomlNode& node, ConfigErrors& errors) const;
  // The protection of the message that the node's key names; nothing when errors were added.
  std::optional<MessageProtection> protect(const TomlNode& node, ConfigErrors& errors) const;

 private:
  struct File {
    std::string path;
    can::Database database;
  };
  struct Found {
    const File* file = nullptr;
    const can::MessageDef* message = nullptr;
  };
  std::optional<Found> find_message(std::string_view name, const std::string& key,
                                    std::uint32_t line, ConfigErrors& errors) const;
  std::vector<std::string> message_names() const;
  // Empty unless messages of this file are told by parameter group.
  std::bitset<256> sources_of(const can::MessageDef& message) const;

  FileKind kind_;
  std::vector<File> files_;
  bool complete_ = true;
};

}  // namespace beltgrip::daemon
