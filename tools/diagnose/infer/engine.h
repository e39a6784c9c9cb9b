// Fits: the nominal machine to the data, the noise that is left, and any set of effects jointly
// with the machine's constants. All hypotheses at one stage share whitening and weights, so that
// their likelihoods compare.
#pragma once

#include <cmath>
#include <limits>
#include <optional>
#include <vector>

#include "tools/diagnose/infer/infer.h"
#include "tools/diagnose/infer/remembered.h"
#include "tools/diagnose/model/model_file.h"

namespace beltgrip::diagnose {

struct Hypothesis {
  std::vector<int> slots;
  ModelState state;             // at the optimum
  Fit fit;                      // linear fit there; columns: active nuisances, then slots
  double log_likelihood = 0.0;  // with priors on the machine's constants and the sizes
  double log_evidence = 0.0;    // sizes integrated out
  std::vector<double> chi2;     // per slot: equivalent chi-square(1) of its being there
  std::vector<double> degrees;  // per slot: of freedom
  // Not fitted to its end: it would not reach this log likelihood.
  double given_up_below = -std::numeric_limits<double>::infinity();
  bool is_given_up() const { return std::isfinite(given_up_below); }
};

// Of Score::in_curve. More: in these experiments the effect is no other thing than a friction curve
// that runs otherwise.
inline constexpr double kInCurveMax = 0.998;

struct Score {
  int slot = 0;
  double chi2 = 0.0;      // equivalent chi-square(1), sparse scatter counted
  double gain = 0.0;      // of twice the log likelihood
  double value = 0.0;     // linear estimate
  double sigma = 0.0;     // its one sigma
  double absorbed = 0.0;  // share of the column's energy that the machine's constants explain
  double in_curve = 0.0;  // that the friction curve alone could explain, however it runs
  // Where the slot's equation does another thing far from zero and explains more there: the state
  // that the linear fit leads to from that size.
  std::optional<ModelState> far;
};

// The machine without effects, as near to the data as its constants alone lead it. A fit by the
// sharp noise of the sensors lets scatter between experiments and correlated noise take over what
// the machine misses, and then goes far astray: where the machine misses much, it is fitted with
// as much noise as it leaves.
struct Nominal {
  ModelState state;
  NoiseLevels noise;       // that covers what it leaves
  bool is_covered = true;  // the sensors' own noise does
};

struct Optimum {
  ModelState state;
  Fit fit;
  double objective = 0.0;  // log likelihood with priors, at the state
  std::vector<Summary> summaries;
  bool given_up = false;
};

// What is lost whatever the clamp force. Where all ramps are alike, tens of Nm of it with hardly
// any friction, or a few with what belts have, fit about as well: then no more than variators lose.
enum class Losses { kAsFitted, kUsual };
// What pulleys that give way do to the ratio of the torques: that it follows the ratio of the
// speeds is what keeps the power; or as far as the data say it stays, and the belt loses speed as
// by slip.
enum class TorqueRatio { kFollows, kMayStay };

// Whether one of these slots is a play.
bool any_play(const Campaign& campaign, const std::vector<int>& slots);
// The play that effects have, whatever the side it begins from, N.
double play_of(const Campaign& campaign, const Eigen::VectorXd& effects);

struct Range {
  double least = 0.0, most = 0.0;
};

class Engine {
 public:
  // Chosen, tolerances of a constant of the machine: no healthy one is farther off. As what asks
  // for usual losses it decided once, by nine; as a bound a fifth less or more: not run.
  static constexpr double kReach = 3.0;
  // jobs: threads; the same result for any number.
  explicit Engine(Campaign campaign, int jobs = 1, Losses losses = Losses::kAsFitted,
                  TorqueRatio torque_ratio = TorqueRatio::kFollows);

  int jobs() const { return jobs_; }
  TorqueRatio torque_ratio() const { return torque_ratio_; }
  const Campaign& campaign() const { return campaign_; }
  const std::vector<int>& used() const { return used_; }  // experiments with valid samples
  const ModelState& state() const { return state_; }
  const std::vector<int>& accepted() const { return accepted_; }
  const std::vector<Summary>& summaries() const { return summaries_; }
  const Whitening& whitening() const { return whitening_; }
  const std::vector<int>& active_nuisances() const { return nuisances_; }
  const Scatter& scatter() const { return base_.scatter; }
  // Where fits of the scatter begin, and what none of them goes beyond.
  const Scatter& first_scatter() const { return first_scatter_; }
  // From the next fit on no kind of scatter is more than that variance.
  void bound_scatter(const RandomVector& most);
  // Of each experiment with valid samples: by how much it differs from the others.
  std::vector<RandomVector> offsets() const;

  // Constants of the nominal machine from the data: robust, from several starts.
  void fit_machine();
  // sharp: the fit of the machine alone by the noise of the sensors.
  Nominal nominal_from(const ModelState& sharp) const;
  // Noise model and matrices at the present state; call after fit_machine and accept.
  void update_noise();
  // All slots one at a time on top of the accepted ones.
  std::vector<Score> screen() const { return screen(base_, kScatterSteps); }
  // The same as if experiments scattered as healthy ones do: where they seem to scatter far more,
  // that may be the effect that is looked for, and with so much scatter nothing of it is seen.
  std::vector<Score> screen_with_usual_scatter() const;
  bool scatters_unusually() const;
  // Full non-linear fit of a set of slots (all of them, accepted or not). worth: a log likelihood
  // that the caller has no use below.
  static constexpr double kAnyWorth = -std::numeric_limits<double>::infinity();
  // Of a candidate's fit, beside those that settle; chosen. 4 and 6 give the same answers in the 24
  // campaigns of tools/DIAGNOSE.md, other last digits in 3 and in 2 of them.
  static constexpr int kSteps = 5;
  Hypothesis refine(const std::vector<int>& slots, int iterations = kSteps,
                    double worth = kAnyWorth) const;
  Hypothesis refine_from(const ModelState& start, const std::vector<int>& slots,
                         int iterations = kSteps, double worth = kAnyWorth) const;
  // The same from far away: coarse noise first, the machine's constants from where fit_machine
  // began.
  Hypothesis refine_from_afar(const std::vector<int>& slots, double worth = kAnyWorth) const;
  // Gain of twice the log likelihood of a set over the accepted one, linear, and its state.
  // Of `slots` in place of the accepted one `instead_of`, whose size goes back to zero.
  struct Replacement {
    double gain = 0.0;
    ModelState state;   // of the linear fit: a start for refine_from
    ModelState beside;  // another: the machine's constants stay, the effects alone are fitted
  };
  Replacement add(const std::vector<int>& slots) const;
  Replacement replace(const std::vector<int>& slots, int instead_of) const;
  // No friction falls before its peak or grows stiffer on the way to it. A fitted
  // curve that does has been bent to explain something else; what it hides is no longer near the
  // present state.
  static bool curve_is_possible(const ModelState& state);
  // Makes the hypothesis the present state.
  void accept(const Hypothesis& hypothesis);
  // Takes these functions instead of those it has, and fits the rest anew.
  void learn(std::vector<estimator::LearnedTerm> terms);
  // By how much the accepted effects predict experiments that were left out of the fit better than
  // the same set without one of them: sum over experiments of the log predictive density.
  double left_out_gain(int without) const;
  // The same of the whole set over none, per experiment.
  std::vector<double> left_out_gains() const;

  // An effect that does what a constant of the machine does, or some together, by another name.
  bool is_constant(int slot) const;

  double scale(int parameter) const;
  Prior prior(const std::vector<int>& parameters, const ModelState& at) const;
  // At the state reached. A play that a name stands for, or that is at its most, is held.
  Prior prior_here(const std::vector<int>& parameters) const;
  static void hold_play(const std::vector<int>& parameters, Prior& prior);
  std::vector<int> with_nuisances(const std::vector<int>& slots) const;  // parameter numbers
  double degrees(double with_scatter, double without_scatter) const;

  // Adds to the matrices, in equal shares, what the friction curves of the state do that no
  // friction does (curve_faults). Columns: the parameters (scaled), others, residual.
  void add_curve_bounds(const ModelState& state, const std::vector<int>& parameters,
                        std::vector<Summary>& summaries) const;

  // Where a constant of the machine, but the form of its friction curve, or a size may lie.
  Range range(int parameter) const;
  // Adds a scaled step, each parameter kept within its range.
  void move(const std::vector<int>& parameters, const Eigen::VectorXd& step, double share,
            ModelState& state) const;
  // The scaled step of equations by which nothing leaves its range: what would goes to its end, and
  // the others where they fit best with that. Without it they go where they would fit with what is
  // never reached. solved: the step of the equations by a prior.
  Eigen::VectorXd step_within_ranges(
      const std::vector<int>& parameters, const ModelState& from, const Prior& prior,
      const std::function<Eigen::VectorXd(const Prior&)>& solved) const;

 private:
  // Levenberg-Marquardt on the marginal likelihood, scatter re-estimated on the way.
  // scatter_iterations 0: it stays, and the state alone is asked for.
  Optimum minimise(const Campaign& campaign, const std::vector<int>& parameters,
                   const ModelState& start, const Whitening& whitening, const Scatter& scatter,
                   int iterations, int scatter_iterations, double worth = kAnyWorth) const;
  static constexpr int kScatterSteps = 8;
  // from: the fit without the slot; scatter_steps 0: by its scatter.
  std::vector<Score> screen(const Fit& from, int scatter_steps) const;
  // A column of the matrices, behind those of the parameters, for a size far from zero.
  struct FarSize {
    int slot = 0;
    double size = 0.0;
  };
  std::vector<int> columns_of(const std::vector<int>& parameters) const;
  // The matrices with the sizes of some accepted effects put back to zero.
  std::vector<Summary> summaries_without(const std::vector<int>& slots) const;
  double ln_mu_reached() const;
  Hypothesis fit_from(const ModelState& from, const std::vector<int>& slots, int iterations,
                      double worth) const;

  int jobs_;
  Losses losses_;
  TorqueRatio torque_ratio_;
  Campaign campaign_;
  std::vector<int> used_;
  std::vector<Campaign> coarse_;  // the same with more noise, falling
  std::vector<ModelState> way_;   // of the best fit of the machine alone: its state behind each
  ModelState state_;
  ModelState first_;  // where the best fit of the machine alone began
  std::vector<int> accepted_;
  std::vector<int> nuisances_;
  Whitening whitening_;
  Scatter first_scatter_ = default_scatter();
  std::vector<int> summary_parameters_;
  std::vector<FarSize> far_sizes_;  // their columns stand behind those of the parameters
  std::vector<Summary> summaries_;
  Fit base_;
  int noise_version_ = 0;  // another one wherever the whitening is another
  // What is asked again is asked soon (from afar: in every round).
  static constexpr std::size_t kHypothesesKept = 64, kFarStatesKept = 256;
  Remembered<Hypothesis> hypotheses_{kHypothesesKept};
  Remembered<ModelState> far_states_{kFarStatesKept};
};

Campaign make_campaign(std::vector<ExperimentData> runs, const ModelFile& model,
                       const Accuracies& accuracies = {});

}  // namespace beltgrip::diagnose
