// Asks the processor for memory before its turn comes: with ten thousand messages what one frame
// needs has left the nearer caches since the message came last, and fetching it piece by piece
// takes longer than decoding. A hint alone: any address will do.
#pragma once

#include <cstddef>

namespace beltgrip::can {

inline void bring_near(const void* begin, std::size_t bytes) noexcept {
  constexpr std::size_t kLine = 64;  // bytes of a cache line on all machines that this runs on
  const char* const at = static_cast<const char*>(begin);
  for (std::size_t i = 0; i < bytes; i += kLine) __builtin_prefetch(at + i);
  if (bytes > 0) __builtin_prefetch(at + bytes - 1);
}

template <typename Values>
void bring_near(const Values& values) noexcept {
  bring_near(values.data(), values.size() * sizeof(*values.data()));
}

}  // namespace beltgrip::can
