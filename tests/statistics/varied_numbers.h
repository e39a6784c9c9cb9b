// Numbers that decide, moved by a fifth: a program whose thresholds.h is compiled with numbers that
// are no constants (beltgrip_varied in CMakeLists.txt) writes what each decides into a document.
#pragma once

#include <algorithm>
#include <cstdio>
#include <cstring>
#include <fstream>
#include <functional>
#include <iterator>
#include <span>
#include <string>

namespace beltgrip::test {

struct VariedNumber {
  const char* name;
  double* value;
};

// In place of what stands below the heading, up to the next one. False: there is no such heading.
inline bool write_below(const char* path, const std::string& heading, const std::string& text) {
  std::ifstream in(path);
  std::string whole((std::istreambuf_iterator<char>(in)), {});
  const std::size_t found = whole.find(heading);
  if (found == std::string::npos) return false;
  const std::size_t begin = found + heading.size();
  const std::size_t end = std::min(whole.find("\n## ", begin), whole.size());
  whole.replace(begin, end - begin, text);
  std::ofstream(path) << whole;
  return true;
}

// The table, row by row as it comes; with `--write FILE` also into FILE, below the heading. answer:
// what comes out with the numbers as they are at the moment.
inline int write_varied(int argc, char** argv, const std::string& heading,
                        const std::string& introduction, std::span<const VariedNumber> numbers,
                        const std::function<std::string()>& answer) {
  const bool into_file = argc == 3 && std::strcmp(argv[1], "--write") == 0;
  if (argc != 1 && !into_file) {
    std::fprintf(stderr, "usage: %s [--write FILE]\n", argv[0]);
    return 64;
  }
  std::string table;
  const auto add = [&table](const std::string& text) {
    table += text;
    std::printf("%s", text.c_str());
    std::fflush(stdout);
  };
  add(introduction + "\n\n| number | value | a fifth less | a fifth more |\n|---|---|---|---|\n");
  for (const VariedNumber& each : numbers) {
    const double value = *each.value;
    char head[96];
    std::snprintf(head, sizeof head, "| `%s` | %g |", each.name, value);
    std::string row = head;
    for (const double share : {0.8, 1.2}) {
      *each.value = share * value;
      row += " " + answer() + " |";
    }
    *each.value = value;
    add(row + "\n");
  }
  if (into_file && !write_below(argv[2], heading, table)) {
    std::fprintf(stderr, "%s: has no heading \"%s\"\n", argv[2], heading.c_str());
    return 65;
  }
  return 0;
}

}  // namespace beltgrip::test
