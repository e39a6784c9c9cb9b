// A whole file of text, of a bounded size. Start-up, reload and tools only.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>

#include "daemon/core/base/result.h"

namespace beltgrip::daemon {

// What is read as a file. Beside a loop that runs only regular ones: a pipe may wait for its writer
// without end.
enum class FileKind : std::uint8_t { kAny, kRegular };

struct Unreadable {
  std::string reason;
};
// One that is longer than `limit` is read a little beyond it and no further.
Result<std::string, Unreadable> read_text_file(const std::string& path, std::size_t limit,
                                               FileKind kind);

}  // namespace beltgrip::daemon
