// A file that is written from start to end, or standard output for "-". Failure on creation (73)
// and on writing (74) names the path. Tools only.
#pragma once

#include <cerrno>
#include <cstdio>
#include <cstring>
#include <string>
#include <string_view>

#include "tools/cli/exit_codes.h"

namespace beltgrip::cli {

class OutputFile {
 public:
  explicit OutputFile(const std::string& path)
      : path_(path), file_(path == "-" ? stdout : std::fopen(path.c_str(), "wb")) {
    if (file_ == nullptr) {
      throw Failure{kCannotCreate, path + ": cannot be created: " + std::strerror(errno)};
    }
  }
  ~OutputFile() {
    if (file_ != nullptr && file_ != stdout) std::fclose(file_);
  }
  OutputFile(const OutputFile&) = delete;
  OutputFile& operator=(const OutputFile&) = delete;

  std::FILE* get() { return file_; }
  void write(std::string_view text) { std::fwrite(text.data(), 1, text.size(), file_); }
  void flush() { std::fflush(file_); }
  // Everything is on its way, or Failure.
  void close() {
    const bool bad = std::ferror(file_) != 0;
    const bool unflushed = file_ == stdout ? std::fflush(file_) != 0 : std::fclose(file_) != 0;
    file_ = nullptr;
    if (bad || unflushed) {
      throw Failure{kCannotWrite, path_ + ": cannot be written: " + std::strerror(errno)};
    }
  }

 private:
  std::string path_;
  std::FILE* file_;
};

inline void write_file(const std::string& path, std::string_view text) {
  OutputFile file(path);
  file.write(text);
  file.close();
}

}  // namespace beltgrip::cli
