#include "daemon/io/rt_setup.h"

#include <sched.h>
#include <sys/mman.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cerrno>
#include <charconv>
#include <cstdint>
#include <cstring>
#include <fstream>
#include <string_view>
#include <system_error>

namespace beltgrip::daemon {

namespace {

// More than the loop and what it calls use.
constexpr std::size_t kStack = std::size_t{256} << 10;

// Libraries whose code the loop never enters: the configuration's reader, the journal's writer, the
// history's, the recorder's, the service manager's and what that has for journals. Seven megabytes
// that need not be held.
constexpr std::array<std::string_view, 12> kOfOthers{
    "/libtomlplusplus.", "/libspdlog.", "/libfmt.",  "/libsqlite3.", "/libzstd.",      "/libz.",
    "/libsystemd.",      "/libgcrypt.", "/liblzma.", "/liblz4.",     "/libgpg-error.", "/libcap."};

void touch_stack() {
  std::array<volatile char, kStack> stack;
  constexpr std::size_t kPage = 4096;
  for (std::size_t i = 0; i < stack.size(); i += kPage) stack[i] = 0;
}

// "7f00a000-7f00b000 r-xp 00000000 08:01 123   /usr/lib/libx.so.1"
struct Mapping {
  std::uintptr_t begin = 0, end = 0;
  bool held = false;    // by the loop
  bool let_go = false;  // of others, and never written
};

// Behind the number, or nullptr.
const char* read_address(const char* from, const char* end, std::uintptr_t& address) {
  const auto [behind, error] = std::from_chars(from, end, address, 16);
  return error == std::errc{} ? behind : nullptr;
}

bool read_mapping(const std::string& line, Mapping& mapping) {
  const char* const end = line.data() + line.size();
  const char* at = read_address(line.data(), end, mapping.begin);
  if (at == nullptr || at == end || *at != '-') return false;
  at = read_address(at + 1, end, mapping.end);
  constexpr std::ptrdiff_t kMay = 5;  // " r-xp"
  if (at == nullptr || end - at < kMay) return false;
  const bool readable = at[1] == 'r', writable = at[2] == 'w', executable = at[3] == 'x';
  const bool kernels = line.ends_with("[vvar]") || line.ends_with("[vvar_vclock]") ||
                       line.ends_with("[vdso]") || line.ends_with("[vsyscall]");
  const bool of_others =
      !writable && std::any_of(kOfOthers.begin(), kOfOthers.end(), [&](std::string_view each) {
        return line.find(each) != std::string::npos;
      });
  // What may neither be read nor written is a guard page.
  mapping.held = (readable || writable) && !kernels && !of_others;
  mapping.let_go = of_others && executable;
  return true;
}

// Code that the start ran and that comes back from the file when it is called again: 2.2 MB.
void let_go() {
  std::ifstream maps("/proc/self/maps");
  Mapping mapping;
  for (std::string line; std::getline(maps, line);) {
    if (!read_mapping(line, mapping) || !mapping.let_go) continue;
    madvise(std::bit_cast<void*>(mapping.begin), mapping.end - mapping.begin, MADV_DONTNEED);
  }
}

// False with errno: not all could be locked.
bool lock_mappings() {
  std::ifstream maps("/proc/self/maps");
  if (!maps) return mlockall(MCL_CURRENT) == 0;
  Mapping mapping;
  for (std::string line; std::getline(maps, line);) {
    if (!read_mapping(line, mapping) || !mapping.held) continue;
    if (mlock(std::bit_cast<const void*>(mapping.begin), mapping.end - mapping.begin) != 0) {
      return false;
    }
  }
  return true;
}

}  // namespace

bool lock_memory(std::string& line) {
  // Not what is mapped later: that is the helper thread's business, and would count against the
  // limit.
  let_go();
  const bool locked = lock_mappings();
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
