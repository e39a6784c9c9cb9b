// Of a stream as long as it likes, at most kMost values, evenly spread over it: when they are
// full every second one goes, and from then on every second one comes. The same stream leaves the
// same values. Tools only.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <vector>

namespace beltgrip::check {

template <typename Value>
class Thinned {
 public:
  static constexpr std::size_t kMost = 8192;

  void add(const Value& value) {
    if (count_++ % stride_ != 0) return;
    kept_.push_back(value);
    if (kept_.size() < kMost) return;
    for (std::size_t i = 0; 2 * i < kept_.size(); ++i) kept_[i] = kept_[2 * i];
    kept_.resize((kept_.size() + 1) / 2);
    stride_ *= 2;
  }
  const std::vector<Value>& values() const { return kept_; }
  std::uint64_t count() const { return count_; }
  bool empty() const { return kept_.empty(); }

 private:
  std::vector<Value> kept_;
  std::uint64_t count_ = 0;
  std::uint64_t stride_ = 1;
};

// NaN of none.
inline double quantile(std::vector<double> values, double share) {
  if (values.empty()) return std::numeric_limits<double>::quiet_NaN();
  const auto at =
      static_cast<std::ptrdiff_t>(std::llround(share * static_cast<double>(values.size() - 1)));
  std::nth_element(values.begin(), values.begin() + at, values.end());
  return values[static_cast<std::size_t>(at)];
}

}  // namespace beltgrip::check
