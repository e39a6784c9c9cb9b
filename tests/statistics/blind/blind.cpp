// The blind test. A trial: the generator draws a machine, a plan, an effect (or two, or none, or
// one that the library does not have), a size and a seed, and seals the truth in an envelope; the
// tool answers from the CSV texts alone; then the envelope is opened and the ledger gets one line.
// Two trivial rivals and an oracle (linear-Gaussian classifier that knows noise, scatter and the
// sensitivity of the data to every effect) run on the same data.
//   blind --trials N [--seed S] [--ledger FILE]   resumes where the ledger ends
//   blind --table FILE                            prints the table of a ledger
#include <sys/resource.h>

#include <algorithm>
#include <charconv>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <fstream>
#include <iterator>
#include <set>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "tests/statistics/blind/blind_table.h"
#include "tests/statistics/blind/blind_trial.h"

int main(int argc, char** argv) {
  using namespace beltgrip::blind;
  int trials = 0;
  std::uint64_t seed = 1;
  std::string ledger_path = "blind-ledger.jsonl", table_path;
  for (int i = 1; i + 1 < argc; i += 2) {
    const std::string name = argv[i];
    const char* value = argv[i + 1];
    if (name == "--trials") std::from_chars(value, value + std::strlen(value), trials);
    if (name == "--seed") std::from_chars(value, value + std::strlen(value), seed);
    if (name == "--ledger") ledger_path = value;
    if (name == "--table") table_path = value;
  }
  if (trials == 0 && table_path.empty()) {
    std::fprintf(stderr, "usage: blind --trials N [--seed S] [--ledger FILE] | --table FILE\n");
    return 64;
  }
  if (table_path.empty()) {
    std::set<std::uint64_t> done;
    std::ifstream before(ledger_path);
    for (std::string line; std::getline(before, line);) {
      const auto entry = nlohmann::json::parse(line, nullptr, false);
      if (!entry.is_discarded()) done.insert(entry.at("trial").get<std::uint64_t>());
    }
    std::ofstream ledger(ledger_path, std::ios::app);
    for (int i = 0; i < trials; ++i) {
      const std::uint64_t number = seed * 1000000ULL + static_cast<std::uint64_t>(i);
      if (done.contains(number)) continue;
      ledger << run_trial(number).dump() << std::endl;
      std::fprintf(stderr, "\r%d of %d ", i + 1, trials);
    }
    table_path = ledger_path;
  }
  std::ifstream in(table_path);
  std::vector<nlohmann::json> entries;
  for (std::string line; std::getline(in, line);) {
    auto entry = nlohmann::json::parse(line, nullptr, false);
    if (!entry.is_discarded()) entries.push_back(std::move(entry));
  }
  std::fputs(table_text(entries).c_str(), stdout);
  return 0;
}
