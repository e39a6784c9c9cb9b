// Which effects are there: screens all, refits the best, accepts what no chance and no scatter
// between experiments would do, keeps those that the data cannot tell apart as one class, and looks
// for what no effect of the library explains.
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "tools/diagnose/infer/engine.h"

namespace beltgrip::diagnose {

struct Accepted {
  int slot = 0;
  double sigma = 0.0;      // one sigma of its size, the larger of what noise and experiments say
  double degrees = 0.0;    // of freedom of that
  double stability = 0.0;  // share of the fits without one experiment in which it is there, 95 %
  double chi2 = 0.0;
  double probability = 0.0;
  double ln_odds = 0.0;                  // against its not being there, nor anything in its place
  std::vector<int> aliases;              // slots of other effects that fit as well
  std::vector<Hypothesis> in_its_place;  // with each of these instead
  bool is_usual = false;                 // one of them is what sensors were stated to be off by,
                                         // or any machine has
  double left_out_gain = 0.0;  // of the log predictive density of experiments left out of the fit
};

struct UnknownGroup {
  std::string acts_on, depends_on;
  double chi2 = 0.0;                  // equivalent chi-square(1)
  double limit = 0.0;                 // above which that counts
  double gain = 0.0;                  // of twice the log likelihood
  double share = 0.0;                 // of the residual's energy
  double size = 0.0;                  // rms over the samples, in sizes that begin to matter
  double left_out_gain = 0.0;         // of the log predictive density of experiments left out
  std::vector<double> accepted_chi2;  // of the accepted effects, with the group beside them
};

struct Ripple {
  std::string shaft;  // primary, secondary: the parameter of speed_ripple
  double amplitude = 0.0, sigma = 0.0, chi2 = 0.0;
  bool found = false;
};

struct Naming {
  std::vector<Accepted> accepted;
  std::optional<UnknownGroup> unknown;
  Hypothesis hypothesis;           // all accepted ones
  std::vector<Score> last_screen;  // on top of the accepted ones: what is not there
  // What fitted as well as the last effect in its place, where its own fit ended.
  std::vector<Hypothesis> runners_up;
  std::vector<Ripple> ripples;  // both shafts
  double threshold = 0.0;
  // Effects that were found, but do not help to predict experiments left out of the fit.
  std::vector<int> not_confirmed;
  Nominal nominal;  // the machine without any effect
  // The same by the noise of the sensors alone, which decides what an effect is worth.
  Nominal sharp;
  std::vector<UnknownGroup> nominal_groups;  // dependences of its residual
};

// stop() is asked between steps, on any of the threads; true ends early with what is known.
Naming name_effects(Engine& engine, const std::function<bool()>& stop);
// The same of an engine whose machine is fitted already.
Naming name_fitted(Engine& engine, const std::function<bool()>& stop);

// The same once more from the engine's present state, which has learned something since: what that
// makes superfluous goes, what it hid is found.
void name_anew(Engine& engine, Naming& naming, const std::function<bool()>& stop);

// Without the name that came last.
void forget_last(Engine& engine, Naming& naming, const std::function<bool()>& stop);

// The machine alone, as it was before anything was named: the engine's state and the naming.
void forget_names(Engine& engine, Naming& naming);

// Chi-square(1) value that the largest of so many candidates exceeds by chance with this
// probability.
double chance_threshold(int candidates, double probability);

}  // namespace beltgrip::diagnose
