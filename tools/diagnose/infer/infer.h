// From residuals to evidence: whitening, scatter between experiments as random effects, one small
// matrix per experiment; after that every question is algebra on these matrices.
#pragma once

#include <Eigen/Core>
#include <functional>
#include <limits>
#include <vector>

#include "tools/diagnose/infer/residuals.h"

namespace beltgrip::diagnose {

// What varies from experiment to experiment in a healthy machine: level of friction, seat of the
// ratio, zero of the torque, slip at the peak, zero of the secondary torque, zero of the tracking.
inline constexpr int kRandomEffects = 6;
using RandomVector = Eigen::Array<double, kRandomEffects, 1>;

// Whitened columns of one residual; those that are zero there (the other end stop's, what another
// residual alone sees) are left out: half of them.
struct WhiteBlock {
  std::vector<int> columns;
  Eigen::MatrixXd rows;  // one column per entry
};

// Prediction-error filter per residual: order p from the data, lower orders for the first samples
// of a segment. Weights: Huber, per sample, fixed for all hypotheses.
struct Whitening {
  static constexpr int kOrder = 6;
  struct Filter {
    std::vector<Eigen::VectorXd> coefficient;  // [order] -> a_1..a_order
    std::vector<double> sigma;                 // innovation, per order
  };
  std::array<Filter, kResidualKinds> filter;
  // An error that is the same as long as a reading rests on its step: what one sigma of it comes to
  // in the rows from the first on. Taken out before the filter, as far as it may be that.
  struct Rest {
    int first = 0;
    Eigen::VectorXd by;
  };
  std::vector<std::array<std::vector<Rest>, kResidualKinds>> rest;  // per experiment; may be empty
  double cross = 0.0;  // correlation of the whitened friction and balance residuals
  std::vector<std::array<Eigen::ArrayXd, kResidualKinds>> weight;  // per experiment
  // Columns of the random effects per experiment, whitened, at the state they were made of. Empty:
  // from the state at hand.
  std::vector<std::vector<WhiteBlock>> random;
  std::vector<std::vector<Eigen::MatrixXd>> random_products;  // of these columns with each other
};

// Whitened normal equations of one experiment. Columns: parameters asked for, then the residual.
struct Summary {
  Eigen::MatrixXd aa;  // (n + 1) x (n + 1)
  Eigen::MatrixXd ua;  // random effects x (n + 1)
  Eigen::MatrixXd uu;
  int samples = 0;
};

// Of symmetric equations, positive definite or (ldlt) not; compiled once, as the templates of a
// decomposition cost the compiler seconds wherever they stand.
Eigen::VectorXd solved_llt(const Eigen::MatrixXd& matrix, const Eigen::VectorXd& right);
Eigen::MatrixXd solved_llt(const Eigen::MatrixXd& matrix, const Eigen::MatrixXd& right);
Eigen::VectorXd solved_ldlt(const Eigen::MatrixXd& matrix, const Eigen::VectorXd& right);
Eigen::MatrixXd solved_ldlt(const Eigen::MatrixXd& matrix, const Eigen::MatrixXd& right);

struct Scatter {
  RandomVector variance;
  // No fit goes beyond.
  RandomVector most = RandomVector::Constant(std::numeric_limits<double>::infinity());
};
// What rigs usually scatter by, and what is an effect and no scatter.
Scatter default_scatter();
// Of the friction's level: more than any scatter is, so that its estimate ends at a bound.
bool is_beyond_scatter(const Scatter& scatter);
// Of each kind: by more than experiments with one machine do.
Eigen::Array<bool, kRandomEffects, 1> is_unusual(const Scatter& scatter);
// A cause that acts in every experiment makes them more alike. What fits within each of them and
// drives them apart is none: a noise in the regressors that it happens to divide.
bool parts_experiments(const Scatter& without, const Scatter& with);
// What differed by more than experiments with one machine do, in any kind, no longer does.
bool gathers_experiments(const Scatter& without, const Scatter& with);

// Parameters in play: their columns in the summaries, the prior (in scaled units around the
// linearisation point).
struct Prior {
  Eigen::VectorXd pull;       // mean minus present value, scaled
  Eigen::VectorXd precision;  // scaled
};

struct Fit {
  Eigen::VectorXd step;        // scaled, from the linearisation point
  Eigen::MatrixXd covariance;  // scaled
  Scatter scatter;
  double log_likelihood = 0.0;
  double misfit = 0.0;  // whitened sum of squares, random effects taken out
};

// columns: indices into the summaries' columns. Scatter is estimated (restricted likelihood with a
// prior worth kScatterPriorRuns experiments) unless fixed. The covariance at the end costs as much
// as all else.
enum class Wanted { kCovariance, kStep };
Fit fit_linear(const std::vector<Summary>& summaries, const std::vector<int>& columns,
               const Prior& prior, const Scatter& start, int scatter_iterations,
               Wanted wanted = Wanted::kCovariance);

// The same in two steps, where one scatter serves for several priors: the matrices of all
// experiments together, the random effects taken out; then the step alone.
struct NormalEquations {
  Eigen::MatrixXd total;  // (n + 1) x (n + 1)
  double ln_det = 0.0;    // of the random effects
};
NormalEquations normal_equations(const std::vector<Summary>& summaries,
                                 const std::vector<int>& columns, const Scatter& scatter);
Fit fit_linear(const NormalEquations& equations, const Prior& prior, const Scatter& scatter);
// Where no step is made, without the prior.
double log_likelihood(const NormalEquations& equations, const Scatter& scatter);

// Log predictive density of each experiment, by a fit to the others; their scatter too.
std::vector<double> left_out_densities(const std::vector<Summary>& summaries,
                                       const std::vector<int>& columns, const Prior& prior,
                                       const Scatter& start);
// Their sum.
double left_out_density(const std::vector<Summary>& summaries, const std::vector<int>& columns,
                        const Prior& prior, const Scatter& start);

// Information on one column given the others, with the scatter and without: its loss tells how much
// of the evidence lies between experiments.
struct Information {
  double with_scatter = 0.0;
  double without_scatter = 0.0;
};
Information information_on(const std::vector<Summary>& summaries, const std::vector<int>& others,
                           const Prior& prior, int column, const Scatter& scatter);

// Experiments that what rigs usually scatter by counts for: where the data scatter by more, and
// where by less, for a good rig scatters by a tenth of a bad one.
inline constexpr double kScatterPriorRuns = 4.0, kScatterPriorRunsBelow = 1.0;
// The variance that is most probable of so many experiments whose squares have this mean, and its
// inverse; minus twice the log of the prior, 0 at the usual scatter.
RandomVector scatter_variance(const RandomVector& mean_square, double runs);
RandomVector mean_square_of(const RandomVector& scatter_variance, double runs);
double scatter_penalty(const RandomVector& variance);

Whitening identity_whitening(const Campaign& campaign);

// Further columns of one experiment, behind the parameters.
using ExtraColumns = std::function<std::vector<ResidualColumns>(int run, const Residuals& at)>;

// The valid samples of a column on the grid.
ResidualColumns valid_rows(const ExperimentData& data, const ResidualColumns& column,
                           double scale = 1.0);

// Columns of one experiment, a row per valid sample: parameters (scaled), further columns,
// residual, and with with_random the random effects.
struct RawColumns {
  std::vector<ResidualColumns> columns;
  bool with_random = false;
};
// at: the residuals of this state; what the columns need is added to them.
RawColumns raw_columns(const Campaign& campaign, int run, const ModelState& state, Residuals& at,
                       const std::vector<int>& parameters, const Eigen::VectorXd& scale,
                       bool with_random, const ExtraColumns& extra = {});
Summary summary_of(const Campaign& campaign, int run, const RawColumns& raw,
                   const Whitening& whitening);
// Both at once, with the residuals or without.
Summary summarise(const Campaign& campaign, int run, const ModelState& state, Residuals& at,
                  const std::vector<int>& parameters, const Eigen::VectorXd& scale,
                  const Whitening& whitening, const ExtraColumns& extra = {});
Summary summarise(const Campaign& campaign, int run, const ModelState& state,
                  const std::vector<int>& parameters, const Eigen::VectorXd& scale,
                  const Whitening& whitening, const ExtraColumns& extra = {});

// The residuals of a state, whitened, what the scatter between experiments explains taken out; one
// row per valid sample, empty where the kind does not exist.
std::array<Eigen::VectorXd, kResidualKinds> white_residuals(const Campaign& campaign, int run,
                                                            const ModelState& state,
                                                            const Whitening& whitening,
                                                            const Scatter& scatter);

// Filters, weights and the cross correlation from the residual that is left after the best linear
// fit of everything (parameters with the prior), so that no effect leaks into the noise. raw: with
// random effects, one per experiment.
Whitening fit_whitening(const Campaign& campaign, const std::vector<RawColumns>& raw,
                        const Prior& prior, const Whitening& before, int jobs);

// The chi-square(1) value with the same two-sided p-value as Student's t.
double chi2_of_student(double t, double degrees);
// The same for an F value.
double chi2_of_f(double f, double numerator_degrees, double denominator_degrees);

}  // namespace beltgrip::diagnose
