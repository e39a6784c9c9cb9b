// The effects as a diagnosis fits them: each row of the table of effects with its equation, and the
// slots that data can carry.
#pragma once

#include <functional>
#include <map>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "estimator/physics/learned_term.h"
#include "estimator/physics/machine_effects.h"
#include "tools/diagnose/model/variator_model.h"

namespace beltgrip::diagnose {

using estimator::Stage;

// What a set of experiments can show.
struct Carried {
  int experiments = 0;
  bool temperature = false, command = false;
  bool low = false, overdrive = false;  // end stops
  bool pressure_varies = false;         // at different rates
  bool secondary_torque = false;
};

inline constexpr std::span<const double> kNoFarSizes;

struct Slot;
using AddSlot = std::function<void(int index, std::string_view role)>;

// What a diagnosis adds to a row of the table of effects; it stands beside its equation.
struct Equation {
  std::string_view id, parameter;
  void (*apply)(Context&, const Slot&, double value);  // none: found in the order spectrum
  // The slots that these data can carry; none given: one, always.
  void (*slots)(const Carried& data, const AddSlot& add) = nullptr;
  bool counts_experiments = false;  // a slot's index is the experiment it begins with
  // Between what is fitted, relative to the nominal curve, and what files hold; none: the same.
  double (*to_contract)(double value, double peak_percent, double mu_max) = nullptr;
  double (*from_contract)(double value, double peak_percent, double mu_max) = nullptr;
  // Sizes at which its equation does another thing than near zero: what is left of a step a while
  // behind it, what is left of play that has been crossed. A fit sets out from there as well.
  std::span<const double> far_sizes = kNoFarSizes;
};
std::span<const Equation> measurement_equations();  // what the bus says differs from what is there
std::span<const Equation> clamping_equations();     // from the measured pressure to the force
std::span<const Equation> driveline_equations();    // torque on its way to the belt; radii, ratio
std::span<const Equation> friction_equations();

struct EffectRow : estimator::EffectRow, Equation {
  using estimator::EffectRow::id, estimator::EffectRow::parameter;
};

struct Slot {
  const EffectRow* row = nullptr;
  int index = 0;
  // Of channel_skew; the input of hydraulic_lag; what clamp_hysteresis rests from at the start.
  std::string_view role;
  double step() const { return 0.2 * row->typical; }
  std::string label() const;  // "wear.step@4"
  bool counts_experiments() const { return row->counts_experiments; }
  // friction_shape's parameters are absolute in the contract, relative to the nominal curve here.
  double to_contract(double value, const Eigen::VectorXd& nuisance) const;
  double from_contract(double value, const std::map<std::string, double>& friction) const;
  // It does what the machine's own play does (kPlay_N), and has all of it where it is there.
  bool is_play() const { return row->id == "clamp_hysteresis"; }
};

// The library, in the order of the table. What is no size is left out: wear.at.
std::span<const EffectRow> effect_rows();

// Slots that these data can carry at all.
std::vector<Slot> make_slots(const std::vector<ExperimentData>& runs);

// Values of all slots; zero is off.
struct Effects {
  const std::vector<Slot>* slots = nullptr;
  Eigen::VectorXd value;
  std::span<const estimator::LearnedTerm> learned, learned_too;  // what has no slot
  // Of what kSecondaryTorqueGain says both torques differ by: the share that is the primary one's,
  // which reads so much less.
  double primary_share_of_gain = 0.0;
};

}  // namespace beltgrip::diagnose
