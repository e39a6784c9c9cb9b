// Counts what a thread allocates and frees while it is guarded. Linked into a test program it takes
// the place of malloc and its family, operator new included; under the address sanitizer it hooks
// the sanitizer's allocator instead.
#pragma once

#include <cstddef>

namespace beltgrip::test {

// Guards the calling thread from construction to destruction.
class AllocGuard {
 public:
  AllocGuard() noexcept;
  ~AllocGuard();
  AllocGuard(const AllocGuard&) = delete;
  AllocGuard& operator=(const AllocGuard&) = delete;

  // Calls that this thread made while guarded, of this guard only.
  static std::size_t allocations() noexcept;
  static std::size_t frees() noexcept;
  static std::size_t first_size() noexcept;  // bytes of the first allocation; 0: none
};

}  // namespace beltgrip::test
