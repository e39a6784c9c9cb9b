// Causes that have no name: where the tests of the residuals fail and no effect fits, a function of
// a recorded variable is learned, and kept only where it is what heals them.
#pragma once

#include <functional>
#include <string>
#include <string_view>
#include <vector>

#include "tools/diagnose/decide/criticism.h"
#include "tools/diagnose/infer/learned_fit.h"

namespace beltgrip::diagnose {

struct Learned {
  LearnedFit fit;
  // Other cells, as "acts_on over role", that these data cannot tell from it.
  std::vector<std::string> aliases;
};

struct Learning {
  std::vector<Learned> terms;  // the engine's state has them, in this order
  Criticism left;              // of the state with them
  // What a cause seems to follow, which was set at too few levels to learn anything; empty: none.
  std::string needs_levels;
};

// The role of a model file that an index variable is; the torque is the one that is recorded.
std::string role_of(const Campaign& campaign, const IndexVariable& variable);

// False where it is larger than any machine is off by.
bool is_possible(const LearnedFit& fit);

// failed: of the engine's present state. What is not kept leaves no trace in the engine.
// holds: of a function in the engine, beyond what the tests say of it.
Learning learn(Engine& engine, const Criticism& failed, const std::function<bool()>& stop,
               const std::function<bool(const Engine&, const LearnedFit&)>& holds);

// Laws within odds of 20 to 1 of the best, that first.
std::vector<LawEvidence> possible_laws(const LearnedFit& fit);
// The one law that stands alone and predicts levels left out as well as the free function; null:
// none does.
const LawEvidence* named_law(const LearnedFit& fit, const std::vector<LawEvidence>& possible);

// Names are put to the same test as a function: false where the failed tests lost most of their
// excess, or where what is left acts elsewhere than any of them.
bool is_shadowed(const Campaign& campaign, const std::vector<int>& accepted,
                 const Criticism& without, const Criticism& with);

// Whether any of the tests that failed passes.
bool passes_any(const Criticism& before, const Criticism& after);

// Share of the failed tests' excess over their limits that is left, of the one that keeps most;
// those named in `apart` do not count.
double excess_left(const Criticism& before, const Criticism& after,
                   const std::vector<std::string>& apart = {});

// Failed tests of how experiments scatter elsewhere than at `point` (friction, ratio, torque),
// where that is the lesser cause: twice the log likelihood that so many experiments gain by their
// scatter is less than the function's gain. They do not speak against the function, which cannot
// heal them; they go on failing beside it.
std::vector<std::string> lesser_scatter(const Criticism& criticism, std::string_view point,
                                        double gain, std::size_t experiments);

}  // namespace beltgrip::diagnose
