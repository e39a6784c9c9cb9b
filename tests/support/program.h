// The program beltgrip in a directory of its own: run it, read and write files beside it.
#pragma once

#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "tests/support/process.h"

namespace beltgrip::test {

class Workplace {
 public:
  Workplace();
  ~Workplace();
  Workplace(const Workplace&) = delete;
  Workplace& operator=(const Workplace&) = delete;

  std::string path(const std::string& name) const { return (directory_ / name).string(); }
  std::string read(const std::string& name) const;
  void write(const std::string& name, std::string_view content) const;

 private:
  std::filesystem::path directory_;
};

std::string program_path(const std::string& name = "beltgrip");

// beltgrip ARGUMENT...
RunResult beltgrip(std::vector<std::string> arguments, const std::string& stdin_file = "/dev/null");

// Number of newline characters.
long lines(std::string_view text);

}  // namespace beltgrip::test
