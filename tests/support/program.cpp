#include "tests/support/program.h"

#include <algorithm>
#include <cstdlib>
#include <fstream>
#include <sstream>
#include <stdexcept>

namespace beltgrip::test {

Workplace::Workplace() {
  std::string pattern = (std::filesystem::temp_directory_path() / "beltgrip.XXXXXX").string();
  if (mkdtemp(pattern.data()) == nullptr) throw std::runtime_error("no temporary directory");
  directory_ = pattern;
}

Workplace::~Workplace() { std::filesystem::remove_all(directory_); }

std::string Workplace::read(const std::string& name) const {
  std::ifstream file(path(name), std::ios::binary);
  if (!file) throw std::runtime_error(name + " is missing");
  std::ostringstream text;
  text << file.rdbuf();
  return text.str();
}

void Workplace::write(const std::string& name, std::string_view content) const {
  std::ofstream file(path(name), std::ios::binary);
  file << content;
  if (!file.flush()) throw std::runtime_error(name + " cannot be written");
}

std::string program_path(const std::string& name) { return BELTGRIP_PROGRAMS "/" + name; }

RunResult beltgrip(std::vector<std::string> arguments, const std::string& stdin_file) {
  arguments.insert(arguments.begin(), program_path());
  return run(arguments, Milliseconds{240000}, stdin_file);
}

long lines(std::string_view text) { return std::count(text.begin(), text.end(), '\n'); }

}  // namespace beltgrip::test
