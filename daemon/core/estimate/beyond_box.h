// A term of the model file that was asked beyond what it was learned from: then there is no
// corrected sample, and this is why. Plain data; the text is made off the real-time thread.
#pragma once

#include <array>
#include <cstdint>
#include <limits>
#include <string>

#include "daemon/core/config/options/config.h"

namespace beltgrip::daemon {

struct BeyondBox {
  estimator::LearnedTerm::Name term{};
  Role role = Role::kOilTemperature;
  double figure = std::numeric_limits<double>::quiet_NaN();  // no number: not known
  double least = 0.0, most = 0.0;
  std::int64_t samples = 0;  // 0: it was not

  explicit operator bool() const noexcept { return samples > 0; }
  // One sample more, which may lie further out.
  void take(const BeyondBox& other) noexcept;
};

// "oil_temperature at 35.2 lies outside the box of [learned.drag], 60 .. 95 degC". Allocates.
std::string beyond_text(const BeyondBox& beyond);

}  // namespace beltgrip::daemon
