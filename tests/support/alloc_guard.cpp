#include "tests/support/alloc_guard.h"

#include <cerrno>
#include <cstdlib>

namespace beltgrip::test {

namespace {

struct Counts {
  bool guarded = false;
  std::size_t allocations = 0;
  std::size_t frees = 0;
  std::size_t first_size = 0;
};
thread_local Counts counts;

void note_allocation(std::size_t size) noexcept {
  if (!counts.guarded) return;
  if (counts.allocations++ == 0) counts.first_size = size;
}
void note_free(const void* pointer) noexcept {
  if (counts.guarded && pointer != nullptr) ++counts.frees;
}

}  // namespace

AllocGuard::AllocGuard() noexcept {
  counts = {};
  counts.guarded = true;
}
AllocGuard::~AllocGuard() { counts.guarded = false; }
std::size_t AllocGuard::allocations() noexcept { return counts.allocations; }
std::size_t AllocGuard::frees() noexcept { return counts.frees; }
std::size_t AllocGuard::first_size() noexcept { return counts.first_size; }

}  // namespace beltgrip::test

using beltgrip::test::note_allocation;
using beltgrip::test::note_free;

#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
#define BELTGRIP_SANITIZER_ALLOCATES
#elif defined(__has_feature)
#if __has_feature(address_sanitizer) || __has_feature(thread_sanitizer) || \
    __has_feature(memory_sanitizer)
#define BELTGRIP_SANITIZER_ALLOCATES
#endif
#endif

#ifdef BELTGRIP_SANITIZER_ALLOCATES

extern "C" {
void __sanitizer_malloc_hook(const volatile void*, std::size_t size) { note_allocation(size); }
void __sanitizer_free_hook(const volatile void* pointer) {
  note_free(const_cast<const void*>(pointer));
}
}

#else

// The C library's own, under the names it keeps for interposers.
extern "C" {
void* __libc_malloc(std::size_t size);
void* __libc_calloc(std::size_t count, std::size_t size);
void* __libc_realloc(void* pointer, std::size_t size);
void* __libc_memalign(std::size_t alignment, std::size_t size);
void __libc_free(void* pointer);

void* malloc(std::size_t size) {
  note_allocation(size);
  return __libc_malloc(size);
}
void* calloc(std::size_t count, std::size_t size) {
  note_allocation(count * size);
  return __libc_calloc(count, size);
}
void* realloc(void* pointer, std::size_t size) {
  note_allocation(size);
  return __libc_realloc(pointer, size);
}
void* memalign(std::size_t alignment, std::size_t size) {
  note_allocation(size);
  return __libc_memalign(alignment, size);
}
void* aligned_alloc(std::size_t alignment, std::size_t size) {
  note_allocation(size);
  return __libc_memalign(alignment, size);
}
int posix_memalign(void** pointer, std::size_t alignment, std::size_t size) {
  note_allocation(size);
  *pointer = __libc_memalign(alignment, size);
  return *pointer == nullptr ? ENOMEM : 0;
}
void free(void* pointer) {
  note_free(pointer);
  __libc_free(pointer);
}
}

#endif
