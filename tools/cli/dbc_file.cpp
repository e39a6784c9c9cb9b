#include "tools/cli/dbc_file.h"

#include <sys/stat.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <memory>

#include "can_dbc/text/printable.h"
#include "tools/cli/failure.h"
#include "tools/text/terminal.h"

namespace beltgrip::cli {

namespace {

std::string read_file(const std::string& path) {
  const std::unique_ptr<std::FILE, int (*)(std::FILE*)> file(std::fopen(path.c_str(), "rb"),
                                                             &std::fclose);
  const auto fail = [&] { throw Failure{kNoInput, path + ": " + std::strerror(errno)}; };
  if (!file) fail();
  constexpr std::size_t kLargest = std::size_t{256} * 1024 * 1024;
  std::string text;
  struct stat about {};
  if (::fstat(::fileno(file.get()), &about) == 0 && S_ISREG(about.st_mode)) {
    text.reserve(std::min(kLargest, static_cast<std::size_t>(about.st_size)));
  }
  std::array<char, 65536> block;
  std::size_t size = 0;
  while ((size = std::fread(block.data(), 1, block.size(), file.get())) > 0) {
    text.append(block.data(), size);
    if (text.size() > kLargest) {
      throw Failure{kBadInput, path + ": larger than 256 MiB, expected a DBC file"};
    }
  }
  if (std::ferror(file.get()) != 0) fail();
  return text;
}

}  // namespace

can::DbcParseResult read_dbc(const std::string& path) { return can::parse_dbc(read_file(path)); }

void fail_without_message(const std::string& path) {
  throw Failure{kBadInput, path + ": no readable message (BO_) in it, expected a DBC file"};
}

ProblemCount count(const std::vector<can::Problem>& problems) {
  ProblemCount found;
  for (const can::Problem& problem : problems) {
    ++(problem.severity == can::Severity::kError ? found.errors : found.warnings);
  }
  return found;
}

std::string counted(std::size_t count, const char* what) {
  return std::to_string(count) + ' ' + what + (count == 1 ? "" : "s");
}

std::string text_of(const ProblemCount& problems) {
  return counted(problems.errors, "error") + ", " + counted(problems.warnings, "warning");
}

void mention_problems(const std::string& path, const std::vector<can::Problem>& problems) {
  const ProblemCount found = count(problems);
  if (found.warnings + found.errors == 0) return;
  text::print(stderr,
              can::printable(path) + ": " + text_of(found) + " (beltgrip dbc check lists them)\n");
}

}  // namespace beltgrip::cli
