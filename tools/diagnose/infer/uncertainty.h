// How sure a size is: what noise, disagreement between experiments, the friction curve's unknown
// form and the equations' own accuracy leave open.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "tools/diagnose/infer/engine.h"

namespace beltgrip::diagnose {

struct Uncertainty {
  double sigma = 0.0;
  double degrees = 0.0;    // of freedom, of Student's t
  double stability = 0.0;  // share of the fits without one experiment in which it is there, 95 %
};

// Per slot of the hypothesis, in its order.
std::vector<Uncertainty> uncertainties(const Engine& engine, const Hypothesis& hypothesis);

// Chosen, sigmas: an effect of that size is found with 90 % and more; and usual sizes: hardly any
// is larger. An effect that is found at that size only is not seen.
inline constexpr double kDetectable = 5.0, kRealistic = 3.0;
bool is_seen(const Score& score, const Slot& slot);

// What effects that the data do not show leave open of a quantity, were they there at their usual
// sizes (one sigma each): all at once, beside the constants of the machine, which make up for them.
struct LeftOpen {
  struct Share {
    std::string_view effect;
    double variance = 0.0;  // that would go if this effect alone were known
  };
  double variance = 0.0;
  std::vector<Share> by_effect;  // the largest first
};
// "spring_force (9.4 %)"
std::string open_share(const LeftOpen::Share& share);
// unseen: of slots that are not accepted. lever: change of the quantity per column of the fit of
// the engine's state.
LeftOpen left_open(const Engine& engine, const std::vector<Score>& unseen,
                   const Eigen::VectorXd& lever);

// What is unexplained may be any effect that explains half of what the best one does, or what does
// the same under no name: mean square of what these would have the quantity differ by, by the
// linear and no larger than machines have them.
double variance_of_halves(const Engine& engine, const std::vector<Score>& scores,
                          const Eigen::VectorXd& lever);
// What is unexplained bends the machine's constants (losses, ratios, deformation) to make up for
// it: square of what the quantity would differ by, were they the nominal ones.
double variance_of_bending(const Engine& engine, const Hypothesis& hypothesis,
                           const Eigen::VectorXd& lever);
// An error of the pressure sensor that is fitted beyond what is usual of it makes up for something
// that has no name as often as it is one: square of what the quantity would differ by without it.
double variance_of_pushed(const Engine& engine, const Hypothesis& hypothesis,
                          const Eigen::VectorXd& lever);

}  // namespace beltgrip::diagnose
