// One row per parameter of an effect: its identifiers of the model file, the size it has in real
// machines, where it enters the model, and the run that tells it from its twins.
#pragma once

#include <map>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "tools/diagnose/model/variator_model.h"

namespace beltgrip::diagnose {

// Injection points, in the order of evaluation.
enum class Stage { kMeasurement, kForce, kDriveline, kRatio, kFriction };

// A parameter of one effect, ready to be fitted. `index` tells instances apart: the experiment of a
// wear step, the role of a skew, the input of a lag.
struct Slot;
using Apply = void (*)(Context&, const Slot&, double value);

struct EffectRow {
  std::string_view id;
  std::string_view parameter;
  std::string_view unit;
  Stage stage;
  double typical;    // size met in practice, one sigma of the prior, in `unit`
  double low, high;  // physical bounds
  Apply apply;
  std::string_view equation;
  std::string_view acts_on;     // friction, ratio, torque, clamp force, speed
  std::string_view depends_on;  // what the residual follows
  std::string_view separating;  // the experiment that tells it from its twins
};

struct Slot {
  const EffectRow* row = nullptr;
  int index = 0;
  // Of channel_skew; the input of hydraulic_lag; what clamp_hysteresis rests from at the start.
  std::string_view role;
  double step() const { return 0.2 * row->typical; }
  std::string label() const;        // "wear.step@4"
  bool counts_experiments() const;  // index is the experiment it begins with
  // friction_shape's parameters are absolute in the contract, relative to the nominal curve here.
  double to_contract(double value, const Eigen::VectorXd& nuisance) const;
  double from_contract(double value, const std::map<std::string, double>& friction) const;
};

// The library, in the order of the contract.
std::span<const EffectRow> effect_rows();

// Slots that these data can carry at all.
std::vector<Slot> make_slots(const std::vector<ExperimentData>& runs);

// Values of all slots; zero is off.
struct Effects {
  const std::vector<Slot>* slots = nullptr;
  Eigen::VectorXd value;
};

}  // namespace beltgrip::diagnose
