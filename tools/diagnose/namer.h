// Which effects are there: screens all, refits the best, accepts what no chance and no scatter
// between experiments would do, keeps those that the data cannot tell apart as one class, and looks
// for what no effect of the library explains.
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "tools/diagnose/engine.h"

namespace beltgrip::diagnose {

struct Accepted {
  int slot = 0;
  double chi2 = 0.0;
  double probability = 0.0;
  std::vector<int> aliases;  // slots of other effects that fit as well
};

struct UnknownGroup {
  std::string acts_on, depends_on;
  double chi2 = 0.0;   // equivalent chi-square(1)
  double gain = 0.0;   // of twice the log likelihood
  double share = 0.0;  // of the residual's energy
  double size = 0.0;   // rms over the samples, in sizes that begin to matter
};

struct Naming {
  std::vector<Accepted> accepted;
  std::optional<UnknownGroup> unknown;
  Hypothesis hypothesis;           // all accepted ones
  std::vector<Score> last_screen;  // on top of the accepted ones: what is not there
  double threshold = 0.0;
  ModelState nominal;                        // the nominal machine, fitted, without any effect
  std::vector<UnknownGroup> nominal_groups;  // dependences of its residual
};

// stop() is asked between steps; true ends early with what is known.
Naming name_effects(Engine& engine, const std::function<bool()>& stop);

// Chi-square(1) value that the largest of so many candidates exceeds by chance with this
// probability.
double chance_threshold(int candidates, double probability);

}  // namespace beltgrip::diagnose
