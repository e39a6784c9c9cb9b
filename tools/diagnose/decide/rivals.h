// What fits better in the place of a name, and says nothing against it all the same.
#pragma once

#include <functional>
#include <span>

namespace beltgrip::diagnose {

// That an effect is there. Chosen: the usual 95 %. Not varied.
inline constexpr double kThereOdds = 20.0;

struct Rival {
  bool is_no_name = false;   // itself: too small, or what the friction curve could do as well
  bool is_possible = true;   // sizes and constants that a machine can have
  bool repeats_one = false;  // all experiments are the same ramp
};

// The name beside the rival.
struct Beside {
  double ln_odds = 0.0;  // of its being there as well
  bool is_possible = true;
};

// A cause that is no name itself, or that no machine has, is in the place of another: it
// says nothing against a name that is there beside it as well. Where all experiments repeat one
// ramp, what no machine has may be several constants of the machine at once, and says that nothing
// holds. beside: a fit, asked for only where it decides.
bool stands_beside(const Rival& rival, const std::function<Beside()>& beside);

// Log likelihoods by one noise: of names, and of a function of a recorded variable that was learned
// in their place.
struct Contest {
  double by_names = 0.0, by_function = 0.0;
};

// A function that may take any course explains no less than the cause whose shadows the names are.
// Where by the noise that either leaves the data are more probable with the names all the same,
// they are none. No margin: the function's freedom speaks against it as it is.
bool are_no_shadows(std::span<const Contest> by_either_noise);

}  // namespace beltgrip::diagnose
