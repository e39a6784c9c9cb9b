#include "tools/cli/machine_model.h"

#include <map>

#include "daemon/core/config/options/config_model.h"
#include "tools/cli/failure.h"

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

}  // namespace

void apply_model(const std::string& path, sim::RigScenario& scenario) {
  const bool low = scenario.variator.ratio < 1.0;
  estimator::VariatorParameters variator;
  variator.half_wedge_angle_rad = scenario.variator.half_wedge_angle_rad;
  (low ? variator.ratio_low : variator.ratio_overdrive) = scenario.variator.ratio;
  variator.secondary_piston_area_m2 = scenario.variator.secondary_piston_area_m2;
  variator.secondary_spring_force_N = scenario.variator.secondary_spring_force_N;
  const ModelFile model = read(path, variator);
  scenario.variator.half_wedge_angle_rad = model.variator.half_wedge_angle_rad;
  scenario.variator.ratio = low ? model.variator.ratio_low : model.variator.ratio_overdrive;
  scenario.variator.secondary_piston_area_m2 = model.variator.secondary_piston_area_m2;
  scenario.variator.secondary_spring_force_N = model.variator.secondary_spring_force_N;
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
  variator.primary_inertia_kg_m2 = scenario.engine.inertia_kg_m2 + v.primary_inertia_kg_m2;
  const double known_inertia = variator.primary_inertia_kg_m2;
  const ModelFile model = read(path, variator);
  v.half_wedge_angle_rad = model.variator.half_wedge_angle_rad;
  v.ratio_low = model.variator.ratio_low;
  v.ratio_overdrive = model.variator.ratio_overdrive;
  v.secondary_piston_area_m2 = model.variator.secondary_piston_area_m2;
  v.secondary_spring_force_N = model.variator.secondary_spring_force_N;
  v.secondary_centrifugal_N_s2 = model.variator.secondary_centrifugal_N_s2;
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
