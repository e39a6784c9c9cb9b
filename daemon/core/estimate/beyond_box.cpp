#include "daemon/core/estimate/beyond_box.h"

#include <algorithm>
#include <cmath>

#include "can_dbc/text/number_text.h"
#include "can_dbc/text/unit_text.h"

namespace beltgrip::daemon {

namespace {

// Widths of the box beyond it; what is not known lies furthest out.
double widths_out(const BeyondBox& beyond) noexcept {
  if (std::isnan(beyond.figure)) return std::numeric_limits<double>::infinity();
  const double out = std::max(beyond.least - beyond.figure, beyond.figure - beyond.most);
  return out / (beyond.most - beyond.least);
}

}  // namespace

void BeyondBox::take(const BeyondBox& other) noexcept {
  if (!other) return;
  const std::int64_t all = samples + other.samples;
  if (samples == 0 || widths_out(other) > widths_out(*this)) *this = other;
  samples = all;
}

std::string beyond_text(const BeyondBox& beyond) {
  const std::string role(role_name(beyond.role));
  const std::string box = "[learned." + std::string(beyond.term.data()) + "] of the model file";
  const std::string range = rounded_text(beyond.least) + " .. " + rounded_text(beyond.most) + " " +
                            std::string(can::si_unit_text(role_dimension(beyond.role)));
  if (std::isnan(beyond.figure)) {
    return role + " is not known, which " + box + " depends on (box " + range + ")";
  }
  return role + " at " + rounded_text(beyond.figure) + " lies outside the box of " + box + ", " +
         range;
}

}  // namespace beltgrip::daemon
