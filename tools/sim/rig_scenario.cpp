#include "tools/sim/rig_scenario.h"

#include <cmath>

#include "can_dbc/text/number_text.h"
#include "estimator/physics/variator_geometry.h"
#include "tools/sim/configuration.h"
#include "tools/sim/resources.h"
#include "tools/sim/scenario_effects.h"

namespace beltgrip::sim {

namespace {

constexpr const char* kBase = "paper-rig.toml";

using Rig = RigScenario;
constexpr NumberKey<Rig> kDriveline[] = {
    {"primary_speed_rad_s", &Rig::primary_speed_rad_s, 10.0, 1000.0, "the machine drives forward"},
    {"primary_torque_Nm", &Rig::primary_torque_Nm, -500.0, 500.0, "what a pushbelt carries"},
    {"speed_controller_Nm_s", &Rig::speed_controller_Nm_s, 0.1, 1e4,
     "the controller acts against the error"},
    {"speed_controller_Nm", &Rig::speed_controller_Nm, 0.0, 1e5,
     "the controller acts against the error"},
};

constexpr NumberKey<VariatorParameters> kShafts[] = {
    {"primary_inertia_kg_m2", &VariatorParameters::primary_inertia_kg_m2, 1e-4, 100.0,
     kPositiveInertia},
    {"secondary_inertia_kg_m2", &VariatorParameters::secondary_inertia_kg_m2, 1e-4, 100.0,
     kPositiveInertia},
    {"secondary_drag_Nm", &VariatorParameters::secondary_loss_Nm, 0.0, 100.0, "drag brakes"},
    {"secondary_drag_Nm_s", &VariatorParameters::secondary_loss_Nm_s, 0.0, 10.0, "drag brakes"},
};

constexpr NumberKey<Rig> kClamp[] = {
    {"start_force_N", &Rig::start_force_N, 100.0, 1e5, "the belt must be clamped"},
    {"hold_s", &Rig::hold_s, 0.0, 1e4, "a duration"},
    {"ramp_N_per_s", &Rig::ramp_N_per_s, 1.0, 1e5, "the force falls at this rate"},
    {"actuator_lag_s", &Rig::actuator_lag_s, 0.0, 10.0, "oil follows, it does not lead"},
};

constexpr NumberKey<Rig> kOperator[] = {
    {"slip_percent", &Rig::operator_slip_percent, 0.1, 100.0, "slip that is noticed"},
    {"reaction_s", &Rig::reaction_s, 0.0, 60.0, "a duration"},
    {"grip_step_N", &Rig::grip_step_N, 0.0, 1e6,
     "the force is raised by so much at once where it returns, so that the belt grips"},
    {"restore_N_per_s", &Rig::restore_N_per_s, 1.0, 1e6, "the force returns at this rate"},
    {"rest_s", &Rig::rest_s, 0.0, 1e4, "a duration"},
};

constexpr NumberKey<Rig> kRun[] = {
    {"cycles", &Rig::cycles, 1.0, 1e6, "a number of experiments"},
    {"oil_degC", &Rig::oil_degC, -40.0, 150.0, "oil that flows and does not burn"},
};

void check_force(ScenarioReader& r, const RigScenario& s) {
  const double radius_m = estimator::running_radii(s.variator.ratio, s.variator.belt_length_m,
                                                   s.variator.centre_distance_m)
                              .primary_m;
  const double needed_N = std::abs(s.primary_torque_Nm) *
                          std::cos(s.variator.half_wedge_angle_rad) /
                          (2.0 * radius_m * s.friction().mu_max);
  if (needed_N >= s.start_force_N) {
    r.contradiction("clamp.start_force_N",
                    "found " + number_text(s.start_force_N) + ": the belt slips from the start, " +
                        number_text(s.primary_torque_Nm) + " Nm need more than " +
                        number_text(std::ceil(needed_N)) + " N");
  }
}

void check_whole(ScenarioReader& r, const RigScenario& s) {
  if (!s.belts.contains(s.belt)) {
    std::string names;
    for (const auto& belt : s.belts) names += (names.empty() ? "" : ", ") + belt.first;
    r.contradiction("belt", "found \"" + s.belt + "\", expected one of the belts: " + names);
    return;
  }
  for (const auto& [name, curve] : s.belts) check_curve(r, "belts." + name, curve);
  if (check_geometry(r, s.variator, {{"variator.ratio", s.variator.ratio}})) check_force(r, s);
  const double spring_N = s.variator.secondary_spring_force_N;
  if (s.start_force_N < spring_N) {
    r.contradiction("clamp.start_force_N",
                    "found " + number_text(s.start_force_N) + ": below the spring force of " +
                        number_text(spring_N) + " N, which no pressure takes away");
  }
  if (s.sensors.frame_jitter_s > s.step_s) {
    r.contradiction("sensors.frame_jitter_s", "found " + number_text(s.sensors.frame_jitter_s) +
                                                  " s, expected at most run.step_s: frames would "
                                                  "overtake each other");
  }
  check_faults(r, Plant::kRig, s, rig_database());
}

}  // namespace

RigScenarioResult parse_rig_scenario(const std::vector<ScenarioLayer>& layers) {
  RigScenarioResult result;
  RigScenario& s = result.scenario;
  constexpr Plant kPlant = Plant::kRig;
  ScenarioReader reader("a rig's scenario; that of a car begins with plant = \"vehicle\"");
  name_world(reader, kPlant, s);
  ScenarioEffects effects;
  effects.name(reader);
  reader.text("belt", s.belt);
  reader.sections("belts", "a belt", [&s](const std::string& name, ScenarioReader& section) {
    name_curve(section, "", s.belts[name]);
  });
  name_numbers<Rig>(reader, "driveline.", s, kDriveline, kPlant);
  name_numbers<VariatorParameters>(reader, "driveline.", s.variator, kShafts, kPlant);
  name_numbers<Rig>(reader, "clamp.", s, kClamp, kPlant);
  name_numbers<Rig>(reader, "operator.", s, kOperator, kPlant);
  reader.choice("operator.action", {"restore", "hold", "none"},
                [&s](std::size_t i) { s.action = static_cast<OperatorAction>(i); });
  name_numbers<Rig>(reader, "run.", s, kRun, kPlant);
  reader.apply({kBase, std::string(shipped(kBase))});
  for (const ScenarioLayer& layer : layers) reader.apply(layer);
  if (reader.errors().empty()) {
    effects.put(reader, s.effects);
    check_whole(reader, s);
  }
  result.errors = reader.errors();
  return result;
}

}  // namespace beltgrip::sim
