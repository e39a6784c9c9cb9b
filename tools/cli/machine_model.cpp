#include "tools/cli/machine_model.h"

#include <map>

#include "can_dbc/text/number_text.h"
#include "daemon/core/config/options/config_model.h"
#include "estimator/physics/variator_geometry.h"
#include "tools/cli/failure.h"
#include "tools/text/terminal.h"

namespace beltgrip::cli {
namespace {

using daemon::ModelFile;
using estimator::MachineEffects;

ModelFile read(const std::string& path, const estimator::VariatorParameters& variator) {
  ModelFile base;
  base.variator = variator;
  try {
    return daemon::read_model(path, base);
  } catch (const daemon::ModelError& error) {
    throw Failure{error.missing_file ? kNoInput : kConfiguration, error.text};
  }
}

void take(const std::map<std::string, double>& section, const char* key, double& target,
          double factor = 1.0) {
  if (const auto found = section.find(key); found != section.end()) {
    target = factor * found->second;
  }
}

// What the model says replaces what the scenario has; what it does not say stays.
void lay(const MachineEffects& model, MachineEffects& machine) {
  const auto one = [&](double MachineEffects::*value) {
    if (value != nullptr && model.*value != 0.0) machine.*value = model.*value;
  };
  for (const estimator::EffectRow& row : estimator::effect_rows()) {
    one(row.value);
    for (const estimator::EffectRole& each : row.roles) one(each.value);
  }
}

// The running radius follows from belt and centre distance: of a radius that the model states, the
// belt that has it.
template <typename Variator>
void take_radius(double stated_m, double own_m, double ratio, Variator& variator) {
  if (stated_m == own_m) return;
  variator.belt_length_m =
      estimator::belt_length_m(stated_m, stated_m / ratio, variator.centre_distance_m);
}

// Beyond the box of a function the machine has its value at the edge: made up, so it is said.
void warn_beyond_box(const estimator::LearnedTerm& term, const sim::RigScenario& scenario) {
  using enum estimator::LearnedVariable;
  const auto warn = [&](const char* role, double value, const char* unit) {
    if (term.covers(value)) return;
    text::warn("[learned." + std::string(term.name.data()) + "]: " + role + " of " +
               number_text(value) + " " + unit + " lies outside the box (" +
               number_text(term.knot[0]) + " to " + number_text(term.knot[term.count - 1]) +
               "); the machine has its value at the edge there");
  };
  if (term.variable == kOilTemperature) warn("oil_temperature", scenario.oil_degC, "degC");
  if (term.variable == kPrimarySpeed) warn("primary_speed", scenario.primary_speed_rad_s, "rad/s");
  if (term.variable == kTorque) warn("primary_torque", scenario.primary_torque_Nm, "Nm");
}

}  // namespace

void apply_model(const std::string& path, sim::RigScenario& scenario) {
  const bool low = scenario.variator.ratio < 1.0;
  estimator::VariatorParameters variator;
  variator.half_wedge_angle_rad = scenario.variator.half_wedge_angle_rad;
  (low ? variator.ratio_low : variator.ratio_overdrive) = scenario.variator.ratio;
  variator.secondary_piston_area_m2 = scenario.variator.secondary_piston_area_m2;
  variator.secondary_spring_force_N = scenario.variator.secondary_spring_force_N;
  double& own_radius_m = low ? variator.primary_radius_low_m : variator.primary_radius_overdrive_m;
  own_radius_m = estimator::running_radii(scenario.variator.ratio, scenario.variator.belt_length_m,
                                          scenario.variator.centre_distance_m)
                     .primary_m;
  const ModelFile model = read(path, variator);
  scenario.variator.half_wedge_angle_rad = model.variator.half_wedge_angle_rad;
  scenario.variator.ratio = low ? model.variator.ratio_low : model.variator.ratio_overdrive;
  scenario.variator.secondary_piston_area_m2 = model.variator.secondary_piston_area_m2;
  scenario.variator.secondary_spring_force_N = model.variator.secondary_spring_force_N;
  take_radius(low ? model.variator.primary_radius_low_m : model.variator.primary_radius_overdrive_m,
              own_radius_m, scenario.variator.ratio, scenario.variator);
  take(model.driveline, "deformation_per_kN", scenario.variator.deformation_per_N, 1e-3);
  sim::FrictionCurve& belt = scenario.belts.at(scenario.belt);
  take(model.friction, "mu_max", belt.mu_max);
  take(model.friction, low ? "peak_slip_low_percent" : "peak_slip_overdrive_percent",
       belt.peak_slip_percent);
  take(model.driveline, "secondary_loss_constant_Nm", scenario.variator.secondary_loss_Nm);
  take(model.driveline, "secondary_loss_per_rad_s_Nm", scenario.variator.secondary_loss_Nm_s);
  take(model.driveline, "secondary_loss_per_kN_Nm", scenario.variator.secondary_loss_Nm_per_N,
       1e-3);
  ModelFile rest = model;  // these are the variator's
  for (const char* key : {"deformation_per_kN", "secondary_loss_constant_Nm",
                          "secondary_loss_per_rad_s_Nm", "secondary_loss_per_kN_Nm"}) {
    rest.driveline.erase(key);
  }
  MachineEffects whole = daemon::whole_machine(rest);
  whole.centrifugal_N_s2 += model.variator.secondary_centrifugal_N_s2;
  lay(whole, scenario.effects);
  scenario.learned = daemon::learned_terms(model);
  for (const estimator::LearnedTerm& each : scenario.learned) warn_beyond_box(each, scenario);
}

void apply_model(const std::string& path, sim::VehicleScenario& scenario) {
  sim::VariatorParameters& v = scenario.variator;
  estimator::VariatorParameters variator;
  variator.half_wedge_angle_rad = v.half_wedge_angle_rad;
  variator.ratio_low = v.ratio_low;
  variator.ratio_overdrive = v.ratio_overdrive;
  variator.secondary_piston_area_m2 = v.secondary_piston_area_m2;
  variator.secondary_spring_force_N = v.secondary_spring_force_N;
  variator.secondary_centrifugal_N_s2 = v.secondary_centrifugal_N_s2;
  variator.primary_radius_overdrive_m =
      estimator::running_radii(v.ratio_overdrive, v.belt_length_m, v.centre_distance_m).primary_m;
  const double own_radius_m = variator.primary_radius_overdrive_m;
  variator.primary_inertia_kg_m2 = scenario.engine.inertia_kg_m2 + v.primary_inertia_kg_m2;
  const double known_inertia = variator.primary_inertia_kg_m2;
  const ModelFile model = read(path, variator);
  v.half_wedge_angle_rad = model.variator.half_wedge_angle_rad;
  v.ratio_low = model.variator.ratio_low;
  v.ratio_overdrive = model.variator.ratio_overdrive;
  v.secondary_piston_area_m2 = model.variator.secondary_piston_area_m2;
  v.secondary_spring_force_N = model.variator.secondary_spring_force_N;
  v.secondary_centrifugal_N_s2 = model.variator.secondary_centrifugal_N_s2;
  // One belt has both radii: that of the overdrive counts.
  take_radius(model.variator.primary_radius_overdrive_m, own_radius_m, v.ratio_overdrive, v);
  v.primary_inertia_kg_m2 += model.variator.primary_inertia_kg_m2 - known_inertia;
  take(model.driveline, "deformation_per_kN", v.deformation_per_N, 1e-3);
  take(model.driveline, "loss_constant_Nm", v.primary_loss_Nm);
  take(model.driveline, "loss_per_kN_Nm", v.primary_loss_Nm_per_N, 1e-3);
  take(model.friction, "mu_max", scenario.belt.overdrive.mu_max);
  take(model.friction, "peak_slip_overdrive_percent", scenario.belt.overdrive.peak_slip_percent);
  take(model.friction, "peak_slip_low_percent", scenario.belt.low_peak_slip_percent);
  // The first three are the variator's; the drag at the wheels' side no model of a car has
  // measured.
  ModelFile rest = model;
  for (const char* key :
       {"deformation_per_kN", "loss_constant_Nm", "loss_per_kN_Nm", "secondary_loss_constant_Nm",
        "secondary_loss_per_rad_s_Nm", "secondary_loss_per_kN_Nm"}) {
    rest.driveline.erase(key);
  }
  lay(daemon::whole_machine(rest), scenario.effects);
  scenario.learned = daemon::learned_terms(model);
}

}  // namespace beltgrip::cli
