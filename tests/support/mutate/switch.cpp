#include "tests/support/mutate/switch.h"

#include <array>
#include <cstdio>
#include <cstdlib>

namespace mutant {

namespace {

constexpr int kMost = 1 << 16;  // beyond it the array says so and the program fails

struct Chosen {
  int which = -1;
  std::array<bool, kMost> reached{};
  Chosen() {
    if (const char* told = std::getenv("BELTGRIP_MUTANT")) which = std::atoi(told);
  }
  ~Chosen() {
    const char* name = std::getenv("BELTGRIP_MUTANTS_REACHED");
    std::FILE* file = name != nullptr ? std::fopen(name, "w") : nullptr;
    if (file == nullptr) return;
    for (int i = 0; i < kMost; ++i) {
      if (reached.at(static_cast<std::size_t>(i))) std::fprintf(file, "%d\n", i);
    }
    std::fclose(file);
  }
};

Chosen& chosen() {
  static Chosen all;
  return all;
}

}  // namespace

bool on(int which) noexcept {
  Chosen& all = chosen();
  all.reached.at(static_cast<std::size_t>(which)) = true;
  return all.which == which;
}

}  // namespace mutant
