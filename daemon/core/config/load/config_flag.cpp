#include "daemon/core/config/load/config_flag.h"

#include <algorithm>
#include <cmath>

namespace beltgrip::daemon {

namespace {

bool is_named(const RoleBinding& flag, std::int64_t raw) {
  return std::find(flag.true_when.begin(), flag.true_when.end(), raw) != flag.true_when.end();
}

bool in_range(const RoleBinding& flag, std::uint64_t raw) {
  if (flag.minimum >= flag.maximum) {
    return !flag.codec.is_all_ones(raw) || raw == ~std::uint64_t{0};
  }
  const double spare = 1e-9 * std::max(std::abs(flag.minimum), std::abs(flag.maximum));
  const double physical = flag.codec.physical(raw);
  return physical >= flag.minimum - spare && physical <= flag.maximum + spare;
}

// By scale and offset: only the raw value that is nearest can be it.
bool reads_as(const RoleBinding& flag, double value) {
  const std::uint64_t raw = flag.codec.raw_from_physical((value - flag.shift) / flag.factor);
  return in_range(flag, raw) && flag.factor * flag.codec.physical(raw) + flag.shift == value;
}

// A raw value that is in the range and not among those at which the flag is 1: they are few, so one
// is soon found from the lower end on.
bool has_other(const RoleBinding& flag, const can::SignalDef& signal) {
  RawRange range = raw_range(signal);
  if (flag.minimum < flag.maximum) {
    const auto raw_at = [&](double physical) {
      const auto raw = static_cast<std::int64_t>(flag.codec.raw_from_physical(physical));
      return std::clamp(raw, range.low, range.high);
    };
    const auto [low, high] = std::minmax({raw_at(flag.minimum), raw_at(flag.maximum)});
    range = {low, high};
  }
  constexpr std::size_t kAtTheEnds = 2;  // derived: at each end one may lie outside by a rounding
  std::size_t looked_at = 0;
  for (std::int64_t raw = range.low; looked_at <= flag.true_when.size() + kAtTheEnds; ++looked_at) {
    if (!is_named(flag, raw) && in_range(flag, static_cast<std::uint64_t>(raw))) return true;
    if (raw++ == range.high) return false;
  }
  return false;
}

}  // namespace

RawRange raw_range(const can::SignalDef& signal) {
  constexpr std::uint32_t kMost = 63;  // what lies beyond has no labels
  const bool is_signed = signal.type == can::ValueType::kSigned;
  const std::uint32_t bits = std::min(is_signed ? signal.length - 1 : signal.length, kMost);
  const auto high = static_cast<std::int64_t>((std::uint64_t{1} << bits) - 1);
  return {is_signed ? -high - 1 : 0, high};
}

std::string raw_range_text(const can::SignalDef& signal) {
  const RawRange range = raw_range(signal);
  return std::to_string(range.low) + " to " + std::to_string(range.high);
}

FlagValues flag_values(const RoleBinding& flag, const can::SignalDef& signal) {
  if (flag.true_when.empty()) return {reads_as(flag, 0.0), reads_as(flag, 1.0)};
  const RawRange range = raw_range(signal);
  const bool one = std::any_of(flag.true_when.begin(), flag.true_when.end(), [&](std::int64_t raw) {
    return raw >= range.low && raw <= range.high;
  });
  return {has_other(flag, signal), one};
}

}  // namespace beltgrip::daemon
