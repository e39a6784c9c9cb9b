// The newest value of one producing thread for one consuming thread: three places, of which each
// side owns one and the third changes hands. Wait-free on both sides, never torn, no allocation;
// what was not taken is overwritten.
#pragma once

#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <type_traits>

namespace beltgrip::daemon {

template <typename T>
class LatestSlot {
  static_assert(std::is_trivially_copyable_v<T>, "values cross as plain data");

 public:
  // Producer: fill this, then publish() it.
  T& draft() noexcept { return places_[writing_]; }
  void publish() noexcept {
    const std::uint8_t old =
        middle_.exchange(static_cast<std::uint8_t>(writing_ | kFresh), std::memory_order_acq_rel);
    writing_ = old & kPlace;
  }
  // Consumer: true if there is a newer value than at the last call; latest() is it.
  bool take() noexcept {
    if ((middle_.load(std::memory_order_relaxed) & kFresh) == 0) return false;
    reading_ = middle_.exchange(reading_, std::memory_order_acq_rel) & kPlace;
    return true;
  }
  const T& latest() const noexcept { return places_[reading_]; }

 private:
  static constexpr std::uint8_t kPlace = 3;
  static constexpr std::uint8_t kFresh = 4;
  std::array<T, 3> places_{};
  std::atomic<std::uint8_t> middle_{1};
  std::uint8_t writing_ = 0;
  std::uint8_t reading_ = 2;
};

}  // namespace beltgrip::daemon
