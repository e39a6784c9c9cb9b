// Bounded ring between one producing and one consuming thread. Wait-free; a full ring drops the new
// element and counts it. No allocation.
#pragma once

#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <type_traits>

namespace beltgrip::daemon {

template <typename T, std::size_t kCapacity>
class SpscRing {
  static_assert((kCapacity & (kCapacity - 1)) == 0, "a power of two");
  static_assert(std::is_trivially_copyable_v<T>, "elements cross as plain data");

 public:
  bool push(const T& element) noexcept {  // producer
    const std::uint64_t tail = tail_.load(std::memory_order_relaxed);
    if (tail - head_.load(std::memory_order_acquire) == kCapacity) {
      dropped_.fetch_add(1, std::memory_order_relaxed);
      return false;
    }
    elements_[tail % kCapacity] = element;
    tail_.store(tail + 1, std::memory_order_release);
    return true;
  }
  bool pop(T& element) noexcept {  // consumer
    const std::uint64_t head = head_.load(std::memory_order_relaxed);
    if (head == tail_.load(std::memory_order_acquire)) return false;
    element = elements_[head % kCapacity];
    head_.store(head + 1, std::memory_order_release);
    return true;
  }
  std::uint64_t dropped() const noexcept { return dropped_.load(std::memory_order_relaxed); }

 private:
  static constexpr std::size_t kCacheLine = 64;
  alignas(kCacheLine) std::atomic<std::uint64_t> head_{0};
  alignas(kCacheLine) std::atomic<std::uint64_t> tail_{0};
  std::atomic<std::uint64_t> dropped_{0};
  alignas(kCacheLine) std::array<T, kCapacity> elements_{};
};

}  // namespace beltgrip::daemon
