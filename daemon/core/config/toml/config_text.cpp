#include "daemon/core/config/toml/config_text.h"

#include <cerrno>
#include <cstring>
#include <filesystem>
#include <fstream>

namespace beltgrip::daemon {

Result<std::string, Unreadable> read_text_file(const std::string& path, std::size_t limit,
                                               FileKind kind) {
  std::error_code none;
  const std::filesystem::file_status found = std::filesystem::status(path, none);
  if (std::filesystem::is_directory(found)) return Unreadable{"it is a directory"};
  if (kind == FileKind::kRegular && std::filesystem::exists(found) &&
      !std::filesystem::is_regular_file(found)) {
    return Unreadable{"it is no regular file"};
  }
  errno = 0;
  std::ifstream in(path, std::ios::binary);
  if (!in.is_open()) return Unreadable{errno != 0 ? std::strerror(errno) : "it cannot be opened"};
  constexpr std::size_t kChunk = 1U << 16;
  std::string text;
  std::size_t size = 0;
  while (size <= limit && in) {
    text.resize(size + kChunk);
    in.read(text.data() + size, kChunk);
    size += static_cast<std::size_t>(in.gcount());
  }
  text.resize(size);
  if (in.bad()) return Unreadable{"it cannot be read"};
  return text;
}

}  // namespace beltgrip::daemon
