// What a test puts in the place of a layer that asks for clamping force: at link time, so that the
// rest of the pipeline is the product's own objects. One request at a time; one thread.
#pragma once

#include <limits>

namespace beltgrip::test {

inline constexpr double kNeverAgain_s = std::numeric_limits<double>::infinity();

// The request that stands where experiment/clamp_request should: it knows no limit and no stop.
struct Sabotage {
  double start_share = 1.0;     // of the force that acts
  double fall_N_per_s = 300.0;  // of the request; below zero it rises
  double stands_s = kNeverAgain_s;
  double gap_s = kNeverAgain_s;  // then nothing is asked for; then it stands again,
  bool remembers = false;        // from where it was, not from the force that acts
};

// Of the run under way.
Sabotage& sabotage();

}  // namespace beltgrip::test
