#include "estimator/belt/belt_memory.h"

#include <algorithm>
#include <cmath>
#include <type_traits>

#include "estimator/statistics/interval.h"

namespace beltgrip::estimator {

void BeltMemory::take_value(std::size_t group, double mu_max, double ci95_low,
                            double relative_noise, double as_read,
                            double carried_Nm_per_N) noexcept {
  Value value{mu_max, ci95_low, relative_noise, as_read, carried_Nm_per_N, ++results, {}};
  for (std::size_t other = 0; other < kBeltGroups; ++other) {
    if (other == group) continue;
    value.others[other] = values[other].mu_max;
    // The first of a group is what its next ones are held against.
    if (values[other].known() && values[other].others[group] <= 0.0) {
      values[other].others[group] = mu_max;
    }
  }
  values[group] = value;
  slips[group] = {};
  newest = group;
}

void BeltMemory::take_slip(std::size_t group, double carried_Nm_per_N) noexcept {
  slips[group] = {carried_Nm_per_N, ++results};
}

bool BeltMemory::any_slip() const noexcept {
  return std::any_of(slips.begin(), slips.end(), [](const Slip& each) { return each.known(); });
}

double BeltMemory::share_left(std::size_t group, double scatter) const noexcept {
  const Value& own = values[group];
  double least = 1.0;
  for (std::size_t other = 0; other < kBeltGroups; ++other) {
    const Value& now = values[other];
    if (other == group || !own.known() || own.others[other] <= 0.0 || now.order < own.order) {
      continue;
    }
    const double share = now.mu_max / own.others[other];
    if (share >= least) continue;
    // Two values and what they were compared with: as noisy as each other.
    const double noise = kNormal95 * std::sqrt(2.0) * std::hypot(now.relative_noise, scatter);
    if (std::log(share) < -noise) least = share;
  }
  return least;
}

std::array<double, BeltMemory::kNumbers> BeltMemory::numbers() const {
  std::array<double, kNumbers> out{};
  std::size_t at = 0;
  visit(*this, [&](const auto& each) { out[at++] = static_cast<double>(each); });
  return out;
}

BeltMemory BeltMemory::of_numbers(std::span<const double, kNumbers> numbers) {
  BeltMemory memory;
  std::size_t at = 0;
  visit(memory, [&](auto& each) {
    each = static_cast<std::remove_reference_t<decltype(each)>>(std::max(0.0, numbers[at++]));
  });
  memory.newest = std::min(memory.newest, kBeltGroups);
  return memory;
}

}  // namespace beltgrip::estimator
