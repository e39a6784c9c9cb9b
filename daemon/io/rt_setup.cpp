#include "daemon/io/rt_setup.h"

#include <sched.h>
#include <sys/mman.h>

#include <array>
#include <cerrno>
#include <cstring>

namespace beltgrip::daemon {

namespace {

// More than the loop and what it calls use.
constexpr std::size_t kStack = std::size_t{256} << 10;

void touch_stack() {
  std::array<volatile char, kStack> stack;
  constexpr std::size_t kPage = 4096;
  for (std::size_t i = 0; i < stack.size(); i += kPage) stack[i] = 0;
}

}  // namespace

bool lock_memory(std::string& line) {
  // Not what is mapped later: that is the helper thread's business, and would count against the
  // limit.
  const bool locked = mlockall(MCL_CURRENT) == 0;
  line = locked ? "memory locked"
                : std::string("memory not locked (") + std::strerror(errno) +
                      "; LimitMEMLOCK= or CAP_IPC_LOCK permits it)";
  return locked;
}

std::string prepare_real_time() {
  touch_stack();
  std::string line;
  lock_memory(line);
  const int policy = sched_getscheduler(0) & ~SCHED_RESET_ON_FORK;
  if (policy == SCHED_FIFO || policy == SCHED_RR) return line + ", real-time scheduling";
  return line + ", ordinary scheduling (CPUSchedulingPolicy=fifo in the unit gives real time)";
}

}  // namespace beltgrip::daemon
