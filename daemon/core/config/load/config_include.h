// The text of a configuration: one file and what it includes, as one tree. Start-up and tools only.
#pragma once

#include <string>
#include <vector>

#include "daemon/core/config/toml/config_document.h"
#include "daemon/core/config/toml/config_errors.h"
#include "daemon/core/config/toml/config_text.h"

namespace beltgrip::daemon {

struct ConfigFile {
  std::string path;
  FileKind kind;  // of all that is read
};
// Every file that was read comes to `files`. False when errors were added.
bool read_document(const ConfigFile& file, TomlNode& root, std::vector<std::string>& files,
                   ConfigErrors& errors, std::vector<std::string>& warnings);

}  // namespace beltgrip::daemon
