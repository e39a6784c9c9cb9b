// What a command writes. A file is written beside its place and renamed into it at the end, so that
// a run that fails, or is ended by a signal, leaves what was there; "-" is standard output, and
// what is no regular file (/dev/..., a FIFO) is written as it is. Tools only.
#pragma once

#include <sys/stat.h>

#include <cstdio>
#include <initializer_list>
#include <string>
#include <string_view>
#include <vector>

#include "tools/cli/failure.h"

namespace beltgrip::cli {

// The files that a command reads. None of them may be written: they are told by device and inode,
// so that no link hides one.
class Inputs {
 public:
  Inputs() = default;
  Inputs(std::initializer_list<std::string> paths) { add({paths}); }
  explicit Inputs(const std::vector<std::string>& paths) { add(paths); }
  // "-": standard input. A path that names nothing is none.
  void add(const std::string& path);
  void add(const std::vector<std::string>& paths);
  // Failure 64 where `path`, or standard output for "-", is one of them.
  void demand_apart(const std::string& path) const;

 private:
  struct Identity {
    dev_t device;
    ino_t inode;
    std::string path;
  };
  std::vector<Identity> files_;
};

// What is done with a file that exists. A result is replaced; what somebody may have edited is not,
// but with --force: Failure 73. What is named like a recording is no result: a shell that puts
// run*.csv behind an option makes the first of them its file. Failure 64.
enum class Existing { kReplace, kKeep, kReplaceResult };
inline Existing unless_forced(bool force) { return force ? Existing::kReplace : Existing::kKeep; }

class OutputFile {
 public:
  // Failure: 64 it is an input, a recording or another output, 73 it cannot be created or must not
  // be replaced.
  OutputFile(const std::string& path, const Inputs& inputs, Existing existing = Existing::kReplace);
  ~OutputFile();
  OutputFile(const OutputFile&) = delete;
  OutputFile& operator=(const OutputFile&) = delete;

  std::FILE* get() { return file_; }
  void write(std::string_view text) { std::fwrite(text.data(), 1, text.size(), file_); }
  void flush() { std::fflush(file_); }
  // Everything is in its place, or Failure 74.
  void close();

 private:
  void open_beside(const struct stat* there);
  void drop();
  [[noreturn]] void fail_to_create(int error) const;

  std::string path_;    // as the user said it
  std::string target_;  // where it goes: behind links; empty: written as it is
  std::string beside_;  // where it stands until then
  std::size_t slot_;
  bool replace_;
  std::FILE* file_ = nullptr;
};

void write_file(const std::string& path, const Inputs& inputs, std::string_view text,
                Existing existing = Existing::kReplace);

}  // namespace beltgrip::cli
