// Residuals of the model in units of their noise, and their derivatives.
//   friction: signed distance of the measured (slip, torque) from the curve, errors in both counted
//             (orthogonal distance): valid on either side of the peak
//   balance:  torque in against torque out (needs secondary_torque)
//   tracking: pressure against its command (needs secondary_pressure_command)
#pragma once

#include <Eigen/Core>
#include <array>
#include <vector>

#include "tools/diagnose/effects/effect.h"
#include "tools/diagnose/experiment_data.h"
#include "tools/diagnose/variator_model.h"

namespace beltgrip::diagnose {

enum ResidualKind : int { kFrictionResidual, kBalanceResidual, kTrackingResidual, kResidualKinds };

// One sigma of the noise of one grid sample, from differences of neighbours.
struct NoiseLevels {
  double slip = 1e-4;
  double torque_Nm = 0.1;
  double balance_Nm = 0.1;
  double tracking_Pa = 1e3;
};

struct ModelState {
  Eigen::VectorXd nuisance;
  Eigen::VectorXd effects;  // one per slot
};

// Data and model of one diagnosis; everything that no hypothesis changes.
struct Campaign {
  std::vector<ExperimentData> runs;
  estimator::VariatorParameters variator;
  NuisanceTable nuisances;
  std::vector<Slot> slots;
  Eigen::VectorXd switched_on;  // sizes that the model file gives; states come on top
  NoiseLevels noise;
  bool has_balance = false;
  bool has_tracking = false;
};

// Residuals of one experiment and what their derivatives need.
struct Residuals {
  std::array<Eigen::ArrayXd, kResidualKinds> value;  // empty where the kind does not exist
  Eigen::ArrayXd foot;      // x = slip / slip at the peak, of the foot point
  Eigen::ArrayXd slope;     // dT/d(slip) there
  Eigen::ArrayXd model_Nm;  // curve at the foot point
  Eigen::ArrayXd weight;    // 1 / (noise of the distance)
  Eigen::ArrayXd capacity;
  ExperimentData clean;  // torques at the foot point: their noise must not enter a regressor
};

Residuals residuals_of(const Campaign& campaign, int run, const ModelState& state);

// d(residual)/d(parameter). Parameters are numbered: nuisances first, then slots.
using ResidualColumns = std::array<Eigen::ArrayXd, kResidualKinds>;
ResidualColumns derivative(const Campaign& campaign, int run, const ModelState& state,
                           const Residuals& at, int parameter);

// Effect of a change of slip, torque, ln(capacity), balance and tracking on the residuals.
struct QuantityChange {
  Eigen::ArrayXd slip, torque, ln_capacity, balance, tracking;  // empty: none
};
ResidualColumns propagate(const Campaign& campaign, const Residuals& at,
                          const QuantityChange& change);

NoiseLevels estimate_noise_levels(const Campaign& campaign, const ModelState& state);

}  // namespace beltgrip::diagnose
