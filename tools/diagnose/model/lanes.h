// Several numbers at once, in registers of the compiler's vector extension.
#pragma once

#include <cstddef>
#include <cstdint>

namespace beltgrip::diagnose {

// A comparison gives all bits of a lane or none.
template <int kCount>
struct LanesOf {
  using Value [[gnu::vector_size(kCount * sizeof(double))]] = double;
  using Mask [[gnu::vector_size(kCount * sizeof(double))]] = std::int64_t;
  using Index [[gnu::vector_size(kCount * sizeof(std::int32_t))]] = std::int32_t;
};

// In a function for another processor all of it has to be inline.
#define BELTGRIP_INLINE __attribute__((always_inline))
#define BELTGRIP_LANES [[gnu::always_inline]] inline

// Registers of four numbers, not of two only, as every processor has them.
#if defined(__x86_64__)
#define BELTGRIP_FOUR [[gnu::target("avx2")]]
inline bool has_four() { return __builtin_cpu_supports("avx2") != 0; }
#else
#define BELTGRIP_FOUR
inline bool has_four() { return false; }
#endif

// row(k) for each k, which touches nothing that another one writes: many at a time. The same
// arithmetic by any registers: the same bits. Clang, which has no such promise, looks for itself.
template <typename Row>
BELTGRIP_LANES void all_rows(std::ptrdiff_t count, Row row) {
#ifndef __clang__
#pragma GCC ivdep
#endif
  for (std::ptrdiff_t k = 0; k < count; ++k) row(k);
}
// row by value: what stands in no memory but its own is kept in registers.
template <typename Row>
BELTGRIP_FOUR void rows_by_four(std::ptrdiff_t count, Row row) {
  all_rows(count, row);
}
template <typename Row>
void rows_by_two(std::ptrdiff_t count, Row row) {
  all_rows(count, row);
}
template <typename Row>
void for_rows(std::ptrdiff_t count, const Row& row) {
  static const bool kHasFour = has_four();
  kHasFour ? rows_by_four(count, row) : rows_by_two(count, row);
}

}  // namespace beltgrip::diagnose
