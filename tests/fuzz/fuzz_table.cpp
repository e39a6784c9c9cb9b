// Any bytes as a table of signals: an error in one line, or channels whose stamps rise strictly and
// whose values are numbers, also after its gaps are closed, which then has none left to close.
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <string_view>

#include "tools/diagnose/data/signal_table.h"

namespace {

using namespace beltgrip::diagnose;

void require(bool condition, int line = __builtin_LINE()) {
  if (condition) return;
  std::fprintf(stderr, "fuzz_table.cpp:%d\n", line);
  std::abort();
}

void check(const SignalTable& table) {
  for (const Channel& channel : table.channels) {
    require(channel.t_s.size() == channel.value.size());
    for (std::size_t i = 0; i < channel.t_s.size(); ++i) {
      require(std::isfinite(channel.t_s[i]) && std::isfinite(channel.value[i]));
      require(i == 0 || channel.t_s[i] > channel.t_s[i - 1]);
    }
  }
  for (const std::string& note : table.notes) require(note.find('\n') == std::string::npos);
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  try {
    SignalTable table = parse_csv({reinterpret_cast<const char*>(data), size}, "t.csv");
    check(table);
    close_gaps(table);
    check(table);
    const std::size_t notes = table.notes.size();
    close_gaps(table);
    require(table.notes.size() == notes);
  } catch (const TableError& error) {
    require(!error.text.empty() && error.text.find('\n') == std::string::npos);
    require(!error.missing_file);
  }
  return 0;
}
