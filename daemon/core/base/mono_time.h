// Instants and spans of one monotonic time line, in whole nanoseconds. Which clock it is, the Port
// says. Two types that mix neither with each other nor with a number: a span is made of the
// constants below or by one of the of_...(), and leaves by seconds(), fraction() or ns().
#pragma once

#include <cmath>
#include <compare>
#include <concepts>
#include <cstdint>
#include <iosfwd>
#include <limits>

namespace beltgrip::daemon {

class Duration {
 public:
  constexpr Duration() noexcept = default;
  static constexpr Duration of_ns(std::int64_t ns) noexcept { return Duration(ns); }
  // Cut to whole nanoseconds, as scaled() is.
  static constexpr Duration of_s(double s) noexcept {
    return Duration(static_cast<std::int64_t>(s * 1e9));
  }
  static constexpr Duration of_ms(double ms) noexcept {
    return Duration(static_cast<std::int64_t>(ms * 1e6));
  }
  static constexpr Duration max() noexcept {
    return Duration(std::numeric_limits<std::int64_t>::max());
  }
  static constexpr Duration zero() noexcept { return {}; }
  constexpr std::int64_t ns() const noexcept { return ns_; }

  friend constexpr auto operator<=>(Duration, Duration) noexcept = default;
  constexpr Duration operator-() const noexcept { return Duration(-ns_); }
  constexpr Duration& operator+=(Duration other) noexcept {
    ns_ += other.ns_;
    return *this;
  }
  constexpr Duration& operator-=(Duration other) noexcept {
    ns_ -= other.ns_;
    return *this;
  }
  friend constexpr Duration operator+(Duration a, Duration b) noexcept { return a += b; }
  friend constexpr Duration operator-(Duration a, Duration b) noexcept { return a -= b; }
  template <std::integral Count>
  friend constexpr Duration operator*(Count count, Duration each) noexcept {
    return Duration(static_cast<std::int64_t>(count) * each.ns_);
  }
  template <std::integral Count>
  friend constexpr Duration operator*(Duration each, Count count) noexcept {
    return count * each;
  }
  template <std::integral Count>
  friend constexpr Duration operator/(Duration whole, Count parts) noexcept {
    return Duration(whole.ns_ / static_cast<std::int64_t>(parts));
  }
  // How many of them fit in, and what is left then.
  friend constexpr std::int64_t operator/(Duration whole, Duration each) noexcept {
    return whole.ns_ / each.ns_;
  }
  friend constexpr Duration operator%(Duration whole, Duration each) noexcept {
    return Duration(whole.ns_ % each.ns_);
  }

 private:
  explicit constexpr Duration(std::int64_t ns) noexcept : ns_(ns) {}

  std::int64_t ns_ = 0;
};

inline constexpr Duration kNanosecond = Duration::of_ns(1);
inline constexpr Duration kMicrosecond = 1000 * kNanosecond;
inline constexpr Duration kMillisecond = 1000 * kMicrosecond;
inline constexpr Duration kSecond = 1000 * kMillisecond;

constexpr double seconds(Duration duration) noexcept {
  return static_cast<double>(duration.ns()) / 1e9;
}
constexpr double fraction(Duration part, Duration whole) noexcept {
  return static_cast<double>(part.ns()) / static_cast<double>(whole.ns());
}
constexpr Duration scaled(Duration duration, double factor) noexcept {
  return Duration::of_ns(static_cast<std::int64_t>(static_cast<double>(duration.ns()) * factor));
}
inline Duration period_of(double rate_hz) noexcept {
  return Duration::of_ns(std::llround(1e9 / rate_hz));
}

class MonoTime {
 public:
  constexpr MonoTime() noexcept = default;
  explicit constexpr MonoTime(Duration since_origin) noexcept : since_origin_(since_origin) {}
  static constexpr MonoTime of_ns(std::int64_t ns) noexcept {
    return MonoTime(Duration::of_ns(ns));
  }
  static constexpr MonoTime origin() noexcept { return {}; }  // the Port's
  static constexpr MonoTime min() noexcept {
    return of_ns(std::numeric_limits<std::int64_t>::min());
  }
  static constexpr MonoTime max() noexcept { return MonoTime(Duration::max()); }
  constexpr Duration since_origin() const noexcept { return since_origin_; }
  constexpr std::int64_t ns() const noexcept { return since_origin_.ns(); }

  friend constexpr auto operator<=>(MonoTime, MonoTime) noexcept = default;
  constexpr MonoTime& operator+=(Duration duration) noexcept {
    since_origin_ += duration;
    return *this;
  }
  constexpr MonoTime& operator-=(Duration duration) noexcept {
    since_origin_ -= duration;
    return *this;
  }
  friend constexpr MonoTime operator+(MonoTime t, Duration duration) noexcept {
    return t += duration;
  }
  friend constexpr MonoTime operator-(MonoTime t, Duration duration) noexcept {
    return t -= duration;
  }
  friend constexpr Duration operator-(MonoTime later, MonoTime earlier) noexcept {
    return later.since_origin_ - earlier.since_origin_;
  }

 private:
  Duration since_origin_;
};

// In ns, for messages.
template <typename Traits>
std::basic_ostream<char, Traits>& operator<<(std::basic_ostream<char, Traits>& out, Duration span) {
  return out << span.ns();
}
template <typename Traits>
std::basic_ostream<char, Traits>& operator<<(std::basic_ostream<char, Traits>& out, MonoTime t) {
  return out << t.ns();
}

}  // namespace beltgrip::daemon
