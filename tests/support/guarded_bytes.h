// A payload whose end is the end of a page, with one behind it that may not be touched: who reads
// or writes a byte too far ends the test program.
#pragma once

#include <sys/mman.h>
#include <unistd.h>

#include <algorithm>
#include <cstdint>
#include <span>
#include <stdexcept>

namespace beltgrip::testing {

class GuardedBytes {
 public:
  GuardedBytes() {
    if (memory_ == MAP_FAILED || mprotect(end(), page_, PROT_NONE) != 0) {
      throw std::runtime_error("no guarded page");
    }
  }
  ~GuardedBytes() { munmap(memory_, 2 * page_); }
  GuardedBytes(const GuardedBytes&) = delete;
  GuardedBytes& operator=(const GuardedBytes&) = delete;

  // The last `count` bytes before the guard; at most a page.
  std::span<std::uint8_t> last(std::size_t count) const { return {end() - count, count}; }
  std::span<const std::uint8_t> copy(std::span<const std::uint8_t> payload) const {
    std::copy(payload.begin(), payload.end(), last(payload.size()).begin());
    return last(payload.size());
  }

 private:
  std::uint8_t* end() const { return static_cast<std::uint8_t*>(memory_) + page_; }

  std::size_t page_ = static_cast<std::size_t>(sysconf(_SC_PAGESIZE));
  void* memory_ =
      mmap(nullptr, 2 * page_, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
};

}  // namespace beltgrip::testing
