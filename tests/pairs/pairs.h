// Two ways to do the same work, timed in turns in one run: what else the machine does meets both,
// so their ratio says more than either time. Processor time, not time by the clock.
#pragma once

#include <functional>
#include <string>
#include <vector>

namespace beltgrip::test {

// Does the work once. Returns the processor time it took, in seconds.
using Work = std::function<double()>;

// The same for work that is done in this process.
Work timed(std::function<void()> work);
// And for a program: user and system time of the child. Its output goes to /dev/null. Throws
// std::runtime_error unless it ends with status 0.
Work program(std::vector<std::string> argv);

struct Pair {
  std::string name;
  std::string other;  // what it is compared with
  double items = 1.0;
  std::string item;  // "frame", "signal"
  Work ours_work;
  Work other_work;
};

struct Comparison {
  double ours_s = 0.0;   // median
  double other_s = 0.0;  // median
  double ratio = 0.0;    // median of ours / other
  double low = 0.0;      // 10 % and 90 % of the ratios
  double high = 0.0;
};

// Once unmeasured, then rounds times in turns.
Comparison compare(const Pair& pair, int rounds);

}  // namespace beltgrip::test
