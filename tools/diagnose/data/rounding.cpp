#include "tools/diagnose/data/rounding.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "estimator/statistics/order.h"
#include "tools/diagnose/data/unrounded.h"

namespace beltgrip::diagnose {
namespace {

// Of twelve coarse campaigns of other make, each of these a fifth less or more: the same, but with
// kRepeats more, where one healthy one alarms.
constexpr double kRepeats = 0.6;  // derived: of samples on steps of three sigmas of their noise
// What is repeated until its next value comes moves by many steps then.
constexpr double kManySteps = 2.5;
constexpr std::size_t kOneIn = 100;  // one change in so many is no step

Rounding rounding_of(std::span<const SignalTable* const> tables, Role role, const Reach& reach) {
  std::vector<double> changes;
  Repeats repeats;
  for (const SignalTable* table : tables) {
    const std::vector<double>& x = (*table)[role].value;
    for (std::size_t i = 1; i < x.size(); ++i) {
      if (x[i] != x[i - 1]) changes.push_back(std::abs(x[i] - x[i - 1]));
    }
    repeats.add((*table)[role], reach);
  }
  if (changes.empty()) return {};
  Rounding out;
  out.step = estimator::at_rank(changes, changes.size() / kOneIn);
  out.rests =
      repeats.elsewhere.share() > kRepeats &&
      estimator::median(changes) < kManySteps * *std::min_element(changes.begin(), changes.end());
  return out;
}

}  // namespace

void Repeats::add(const Channel& channel, const Reach& reach) {
  for (std::size_t i = 1; i < channel.value.size(); ++i) {
    const double here = channel.value[i];
    Share& place = here == reach.lowest ? on_low : here == reach.highest ? on_high : elsewhere;
    place.samples += 1.0;
    if (here == channel.value[i - 1]) place.repeats += 1.0;
  }
}

Sensors sensors_of(std::span<const SignalTable* const> tables) {
  Sensors out;
  for (const SignalTable* table : tables) widen(out.reached, *table);
  for (std::size_t role = 0; role < out.roundings.size(); ++role) {
    out.roundings[role] = rounding_of(tables, static_cast<Role>(role), out.reached[role]);
  }
  Rounding& pressure = out.roundings[static_cast<std::size_t>(Role::kSecondaryPressure)];
  if (pressure.rests) {
    std::vector<const Channel*> channels;
    for (const SignalTable* table : tables) {
      channels.push_back(&(*table)[Role::kSecondaryPressure]);
    }
    pressure.noise = noise_before_rounding(channels, pressure.step);
  }
  return out;
}

double held_rounding(const Channel& channel, const Rounding& rounding) {
  const std::vector<double>& x = channel.value;
  if (x.size() < 3) return 0.0;
  double held = 0.0;
  for (std::size_t i = 1; i + 1 < x.size(); ++i) {
    held += x[i - 1] == x[i] && x[i] == x[i + 1] ? 1.0 : 0.0;
  }
  return rounding.step / std::sqrt(12.0) * std::sqrt(held / static_cast<double>(x.size() - 2));
}

double held_rounding_share(const Channel& channel, const Rounding& rounding) {
  double sum = 0.0;
  for (const double each : channel.value) sum += std::abs(each);
  if (sum == 0.0) return 0.0;
  return held_rounding(channel, rounding) / (sum / static_cast<double>(channel.value.size()));
}

}  // namespace beltgrip::diagnose
