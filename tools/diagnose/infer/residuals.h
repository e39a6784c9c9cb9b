// Residuals of the model in units of their noise, and their derivatives.
//   friction: signed distance of the measured (slip, torque) from the curve, errors in both counted
//             (orthogonal distance): valid on either side of the peak
//   balance:  torque in against torque out (needs secondary_torque)
//   tracking: pressure against its command (needs secondary_pressure_command)
#pragma once

#include <Eigen/Core>
#include <array>
#include <map>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "tools/diagnose/data/experiment_data.h"
#include "tools/diagnose/infer/balance_noise.h"
#include "tools/diagnose/model/effects/effect.h"
#include "tools/diagnose/model/variator_model.h"

namespace beltgrip::diagnose {

enum ResidualKind : int { kFrictionResidual, kBalanceResidual, kTrackingResidual, kResidualKinds };

// One sigma of the noise of one grid sample, from differences of neighbours.
struct NoiseLevels {
  double slip_share = 1e-4;
  double torque_Nm = 0.1;
  std::array<BalanceNoise, kStops> balance;
  double tracking_Pa = 1e3;
  double force_N = 1.0;
  // Of its variance: what is noise of the samples. The rest, as long as a reading rests on its
  // step, does not change from one to the next.
  double force_reading_share = 1.0;
  // More is no noise of the samples either.
  NoiseLevels times(double factor) const {
    return {slip_share * factor,
            torque_Nm * factor,
            {balance[0].times(factor), balance[1].times(factor)},
            tracking_Pa * factor,
            force_N * factor,
            force_reading_share / (factor * factor)};
  }
};

struct ModelState {
  Eigen::VectorXd nuisance;
  Eigen::VectorXd effects;                      // one per slot
  std::vector<estimator::LearnedTerm> learned;  // beside those of the model file
};

// The data of a campaign. Copies share them: a fit from afar has the campaign with more noise.
class Runs {
 public:
  Runs() = default;
  // Not explicit: stands for them.
  Runs(std::vector<ExperimentData> runs)
      : runs_(std::make_shared<const std::vector<ExperimentData>>(std::move(runs))) {}
  const ExperimentData& operator[](std::size_t i) const { return (*runs_)[i]; }
  std::size_t size() const { return runs_->size(); }
  auto begin() const { return runs_->begin(); }
  auto end() const { return runs_->end(); }
  const std::vector<ExperimentData>& all() const { return *runs_; }

 private:
  std::shared_ptr<const std::vector<ExperimentData>> runs_ =
      std::make_shared<const std::vector<ExperimentData>>();
};

// Data and model of one diagnosis; everything that no hypothesis changes.
struct Campaign {
  Runs runs;
  estimator::VariatorParameters variator;
  NuisanceTable nuisances;
  std::vector<Slot> slots;
  Eigen::VectorXd switched_on;  // sizes that the model file gives; states come on top
  std::map<std::string, double> known_ripples;  // of the model file, by shaft
  std::vector<estimator::LearnedTerm> learned;  // of the model file
  Accuracies accuracies{};                      // stated of the sensors
  NoiseLevels noise;
  std::vector<double> slip_noise_share;  // per experiment: its noise of slip over noise.slip
  double slip_noise_share_of(int run) const {
    const auto i = static_cast<std::size_t>(run);
    return noise.slip_share * (i < slip_noise_share.size() ? slip_noise_share[i] : 1.0);
  }
  // By more than a ramp itself moves it as the belt begins to slip. What follows the torque cannot
  // be told where it does not.
  bool torque_varies = false;
  // Within an experiment, and not as the belt begins to slip or by noise: else a delay of it is the
  // friction curve's way to its peak by another name, or takes the noise off.
  bool torque_moves = false, pressure_moves = false;
  // The same of the speeds, which slip moves as well.
  bool speeds_move = false;
  // Of the gain of one torque against the other, by the accuracies stated of them.
  double primary_share_of_gain = 0.0;
  bool has_balance = false;
  bool has_tracking = false;
};

// The least that an effect may be: what its table says, and with what is configured no shaft has
// less inertia than none and no oil that turns pulls.
double least_size(const Campaign& campaign, int slot);

// Residuals of one experiment and what their derivatives need.
struct Residuals {
  std::array<Eigen::ArrayXd, kResidualKinds> value;  // empty where the kind does not exist
  Eigen::ArrayXd foot;            // x = slip / slip at the peak, of the foot point
  Eigen::ArrayXd slope;           // dT/d(slip) there
  Eigen::ArrayXd model_Nm;        // curve at the foot point, at the measured clamp force
  Eigen::ArrayXd weight;          // 1 / (noise of the distance)
  Eigen::ArrayXd balance_weight;  // 1 / (noise of the balance)
  BalanceVariance balance_variance;
  Quantities measured;  // the model at the state, on the data as they are
  // One sigma of the clamp force, in Nm of the distance: what it carries less what it takes of the
  // slip by the pulleys that give way.
  Eigen::ArrayXd of_force_Nm;
  // Of the belt by the clamp force that the samples' noise is taken off as far as the distance
  // tells it, Nm.
  Eigen::ArrayXd calm_capacity_Nm;
  // By move_to_foot only: of the belt at the foot point, and what the sensors would read there. No
  // noise in a regressor.
  Eigen::ArrayXd clean_Nm, output_torque;
  Eigen::ArrayXd clean_pressure_Pa, clean_reading_Nm;
  // By prepare_derivatives only.
  Quantities there;  // the model on those readings
  // A row per valid sample, a column per mode of the friction curve: what it does to the residual;
  // and 1 where that is the curve of the low end stop, 0 elsewhere.
  Eigen::ArrayXXd modes;
  Eigen::ArrayXd is_low;
  std::array<bool, kStops> has_stop{};
};

// The model at a state, of the campaign's data or of others in their place; its friction curves.
Quantities quantities(const Campaign& campaign, const ExperimentData& data, int run,
                      const ModelState& state);
Quantities quantities(const Campaign& campaign, const ExperimentData& data, const Readings& read,
                      int run, const ModelState& state);
std::array<CurveShape, kStops> shapes(const Eigen::VectorXd& nuisance, const Quantities& q);

Residuals residuals_of(const Campaign& campaign, int run, const ModelState& state);
// Adds what propagate() needs, unless it is there.
void move_to_foot(const Campaign& campaign, int run, Residuals& at);
// Adds what derivative_rows() needs, unless it is there; at: the residuals of this state.
void prepare_derivatives(const Campaign& campaign, int run, const ModelState& state, Residuals& at);

// d(residual)/d(parameter); empty: zero. Parameters are numbered: nuisances first, then slots.
using ResidualColumns = std::array<Eigen::ArrayXd, kResidualKinds>;
// A row per valid sample, times scale.
ResidualColumns derivative_rows(const Campaign& campaign, int run, const ModelState& state,
                                const Residuals& at, int parameter, double scale);

// The change of the residual from the state's size of a slot to another one, per unit of it.
ResidualColumns secant(const Campaign& campaign, int run, const ModelState& state,
                       const Residuals& at, int slot, double size);

// Effect of a change of slip, torque, ln(capacity), balance and tracking on the residuals, and of
// the noise of the balance.
struct QuantityChange {
  Eigen::ArrayXd slip_share, torque, ln_capacity, balance, tracking;  // empty: none
  Eigen::ArrayXd ln_balance_noise;                                    // empty: none
};
ResidualColumns propagate(const Campaign& campaign, const Residuals& at,
                          const QuantityChange& change);

// By the median; changes the values. 0: fewer than 20.
double robust_sigma(std::vector<double>& values);
NoiseLevels estimate_noise_levels(const Campaign& campaign, const ModelState& state);
// A speed sensor's noise counts the more, the slower its shaft turns.
std::vector<double> estimate_slip_noise_shares(const Campaign& campaign, const ModelState& state);

}  // namespace beltgrip::diagnose
