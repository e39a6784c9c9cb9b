// A file system for SQLite that remembers every operation that changes a file, so that a test can
// make the files as they would be after a crash or a loss of power at any point, and that can fail
// the n-th of them, or the n-th read. Lies under SQLite's own, as its default, while it exists. One
// thread.
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

namespace beltgrip::test {

struct FileOperation {
  enum class Kind { kWrite, kTruncate, kSync, kDelete } kind;
  std::string file;         // without its folder
  std::int64_t offset = 0;  // kTruncate: the new size
  std::string bytes;
};

class CrashVfs {
 public:
  CrashVfs();
  ~CrashVfs();
  CrashVfs(const CrashVfs&) = delete;
  CrashVfs& operator=(const CrashVfs&) = delete;

  std::vector<FileOperation> operations;
  // Counts down at each operation; the one that reaches 0 fails, as do all later ones. < 0: none.
  int fail_at = -1;
  int fail_read_at = -1;  // the same of reads
  int fail_with = 0;      // an SQLite status
};

using Files = std::map<std::string, std::string>;

// The files after the first `count` operations on `files`; of the next one, if it writes, the first
// `partial` bytes. `lost` is the index of a write that never reached the disk; -1: none.
Files after(Files files, const std::vector<FileOperation>& operations, std::size_t count,
            std::size_t partial = 0, int lost = -1);

}  // namespace beltgrip::test
