#include "tools/diagnose/decide/rivals.h"

#include <algorithm>
#include <cmath>

namespace beltgrip::diagnose {

bool stands_beside(const Rival& rival, const std::function<Beside()>& beside) {
  const bool is_in_anothers_place = rival.is_no_name || (!rival.is_possible && !rival.repeats_one);
  if (!is_in_anothers_place) return false;
  const Beside both = beside();
  return both.is_possible && both.ln_odds > std::log(kThereOdds);
}

bool are_no_shadows(std::span<const Contest> by_either_noise) {
  return std::all_of(by_either_noise.begin(), by_either_noise.end(),
                     [](const Contest& each) { return each.by_names > each.by_function; });
}

}  // namespace beltgrip::diagnose
