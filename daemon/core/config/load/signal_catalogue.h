// From names in the configuration to signals in the DBC files of a bus. Start-up and tools only.
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "can_dbc/dbc/model.h"
#include "daemon/core/config/options/config.h"
#include "daemon/core/config/toml/config_document.h"
#include "daemon/core/config/toml/config_errors.h"
#include "daemon/core/config/toml/config_text.h"

namespace beltgrip::daemon {

std::string id_text(can::CanId id);  // "0x123", "0x12345678x" (29 bit)

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
  // The binding of a role from its TOML value; nothing when errors were added (config_binding).
  std::optional<RoleBinding> bind(Role role, const TomlNode& node, ConfigErrors& errors) const;
  // The same from a column of a table: the one that the role names, that is called like the role,
  // or like its signal. `node` none: only one that is called like the role, else nothing. A column
  // that is not there gives a binding that no frame has.
  std::optional<RoleBinding> bind_column(Role role, const TomlNode* node,
                                         const can::Database& columns, ConfigErrors& errors) const;
  // The protection of the message that the node's key names; nothing when errors were added
  // (config_protection).
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
  // Name or identifier; nothing when an error was added.
  std::optional<Found> find_message(std::string_view name, const std::string& key,
                                    std::uint32_t line, ConfigErrors& errors) const;
  std::vector<std::string> message_names() const;
  // "Message.Signal" in one of the files; nullptr: in none.
  const can::SignalDef* find_signal(std::string_view name) const;
  // Empty unless messages of this file are told by parameter group.
  std::bitset<256> sources_of(const can::MessageDef& message) const;

  FileKind kind_;
  std::vector<File> files_;
  bool complete_ = true;
};

}  // namespace beltgrip::daemon
