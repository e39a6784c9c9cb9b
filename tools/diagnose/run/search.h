// The search for the machine, the names and the functions that the data ask for.
#pragma once

#include <cstddef>
#include <functional>

#include "tools/diagnose/decide/learn.h"
#include "tools/diagnose/decide/namer.h"
#include "tools/diagnose/infer/engine.h"

namespace beltgrip::diagnose {

struct SearchOptions {
  int jobs = 1;                    // threads; the result is the same for every number
  bool may_learn = false;          // no functions of data that contradict themselves
  std::function<bool()> stop;      // true: end with what is known
  std::function<void()> on_named;  // called once, when the first machine has its names
};

struct Found {
  Engine engine;      // machine with names and functions
  Naming naming;      // names and what they were chosen among
  Learning learning;  // functions, and what the tests of the residuals leave
};

Found search(const Campaign& campaign, const SearchOptions& options);

// Experiments with samples that count.
std::size_t used_runs(const Campaign& campaign);

}  // namespace beltgrip::diagnose
