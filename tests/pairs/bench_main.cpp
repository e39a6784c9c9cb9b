// tests/bench: our work beside that of others, in one run.
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <string_view>

#include "tests/pairs/bench_pairs.h"

namespace beltgrip::test {

namespace {

void show(const Pair& pair, int rounds, bool markdown) {
  const Comparison c = compare(pair, rounds);
  const double ours_ns = c.ours_s / pair.items * 1e9;
  const double other_ns = c.other_s / pair.items * 1e9;
  std::printf(markdown ? "| %s | %.4g ns a %s | %s: %.4g ns | %.2f (%.2f to %.2f) |\n"
                       : "%-38s %8.4g ns a %-6s  %-20s %8.4g ns  ratio %.2f (%.2f to %.2f)\n",
              pair.name.c_str(), ours_ns, pair.item.c_str(), pair.other.c_str(), other_ns, c.ratio,
              c.low, c.high);
  std::fflush(stdout);
}

int run(int argc, char** argv) {
  int rounds = 9;
  bool markdown = false;
  bool large = false;
  std::string other, only;
  for (int i = 1; i < argc; ++i) {
    const std::string_view word = argv[i];
    const bool has_value = i + 1 < argc;
    if (word == "--markdown") {
      markdown = true;
    } else if (word == "--large") {
      large = true;
    } else if (word == "--rounds" && has_value) {
      rounds = std::atoi(argv[++i]);
    } else if (word == "--other" && has_value) {
      other = argv[++i];
    } else if (word == "--only" && has_value) {
      only = argv[++i];
    } else {
      std::fputs(
          "usage: bench [--markdown] [--rounds N] [--only codec|logs|programs|growth] [--large] "
          "[--other PROGRAM]\n",
          stderr);
      return 64;
    }
  }
  if (rounds < 1) rounds = 1;
  const Folder folder;
  if (markdown) {
    std::puts(
        "| work | here | beside it | ratio (10 % to 90 % of the rounds) |\n|---|---|---|---|");
  }
  const auto show_all = [&](const std::vector<Pair>& pairs) {
    for (const Pair& pair : pairs) show(pair, rounds, markdown);
  };
  const auto asked = [&](const char* group) { return only.empty() || only == group; };
  if (asked("codec")) show_all(codec_pairs());
  if (asked("logs")) show_all(log_pairs(folder));
  if (asked("programs")) show_all(program_pairs(folder, BELTGRIP_PROGRAM, other));
  if (asked("growth")) show_growth(folder, BELTGRIP_PROGRAM, large);
  return 0;
}

}  // namespace

}  // namespace beltgrip::test

int main(int argc, char** argv) {
  try {
    return beltgrip::test::run(argc, argv);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "bench: %s\n", error.what());
    return 1;
  }
}
