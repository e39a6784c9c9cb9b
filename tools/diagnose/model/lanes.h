// Several numbers at once, in registers of the compiler's vector extension.
#pragma once

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

}  // namespace beltgrip::diagnose
