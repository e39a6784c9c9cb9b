#include "tools/sim/vehicle_scenario.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include <toml++/toml.h>

#include "estimator/physics/variator_geometry.h"
#include "tools/sim/resources.h"
#include "tools/sim/scenario_reader.h"
#include "tools/sim/vehicle_bus.h"

namespace beltgrip::sim {

namespace {

constexpr double kDegree = std::numbers::pi / 180.0;
constexpr double kKmh = 1.0 / 3.6;
constexpr double kPercent = 0.01;

// A pushbelt's elements do not bend around less.
constexpr double kLeastRadiusShare = 0.03;  // of its length

constexpr const char* kBase = "coast-overdrive";
constexpr const char* kPositiveInertia = "a rotating mass has a positive inertia";
constexpr const char* kNoise = "a standard deviation is not negative";
constexpr const char* kGain = "an error, not a fault";
constexpr const char* kAge = "a value is never younger than its measurement";
constexpr const char* kLoss = "losses brake";
constexpr const char* kDuration = "a duration";

void name_variator(ScenarioReader& r, VariatorParameters& v) {
  r.number("variator.belt_length_m", v.belt_length_m, 0.1, 3.0, "a pushbelt's length");
  r.number("variator.centre_distance_m", v.centre_distance_m, 0.03, 1.0,
           "the distance of the shafts");
  r.number("variator.half_wedge_angle_deg", v.half_wedge_angle_rad, 5.0, 30.0,
           "a wedge that neither locks nor slides", kDegree);
  r.number("variator.ratio_low", v.ratio_low, 0.1, 1.0, "LOW turns the secondary slower");
  r.number("variator.ratio_overdrive", v.ratio_overdrive, 1.0, 10.0,
           "overdrive turns the secondary faster");
  r.number("variator.deformation_per_N", v.deformation_per_N, -2e-5, 2e-5,
           "pulleys yield by a few percent at most");
  r.number("variator.deformation_per_Nm", v.deformation_per_Nm, -1e-3, 1e-3,
           "pulleys tilt by a few percent at most");
  r.number("variator.secondary_piston_area_m2", v.secondary_piston_area_m2, 1e-4, 0.1,
           "pressure makes force on an area");
  r.number("variator.secondary_spring_force_N", v.secondary_spring_force_N, 0.0, 1e4,
           "the spring clamps");
  r.number("variator.secondary_centrifugal_N_s2", v.secondary_centrifugal_N_s2, 0.0, 0.1,
           "rotating oil presses outwards");
  r.number("variator.primary_piston_area_m2", v.primary_piston_area_m2, 1e-4, 0.1,
           "pressure makes force on an area");
  r.number("variator.primary_centrifugal_N_s2", v.primary_centrifugal_N_s2, 0.0, 0.1,
           "rotating oil presses outwards");
  r.number("variator.primary_inertia_kg_m2", v.primary_inertia_kg_m2, 1e-4, 10.0, kPositiveInertia);
  r.number("variator.secondary_inertia_kg_m2", v.secondary_inertia_kg_m2, 1e-4, 10.0,
           kPositiveInertia);
  r.number("variator.primary_loss_Nm", v.primary_loss_Nm, 0.0, 50.0, kLoss);
  r.number("variator.primary_loss_Nm_per_kN", v.primary_loss_Nm_per_N, 0.0, 5.0, kLoss, 1e-3);
  r.number("variator.secondary_loss_Nm", v.secondary_loss_Nm, 0.0, 50.0, kLoss);
  r.number("variator.secondary_loss_Nm_s", v.secondary_loss_Nm_s, 0.0, 1.0, kLoss);
  r.number("variator.shift_gain", v.shift_gain, 1e-5, 0.1, "a pulley's deformation in rad");
  r.number("variator.force_ratio_slope", v.force_ratio_slope, 0.0, 2.0,
           "overdrive needs the larger primary force");
  r.number("variator.force_ratio_load", v.force_ratio_load, -1.0, 1.0,
           "load moves the force ratio by a few tenths");
}

void name_belt(ScenarioReader& r, BeltParameters& b) {
  r.choice("belt.curve", {"tanh_fall", "magic_formula", "saturating", "two_peaks"},
           [&b](std::size_t i) { b.overdrive.shape = static_cast<CurveShape>(i); });
  r.number("belt.mu_max", b.overdrive.mu_max, 0.005, 1.0, "a friction coefficient of a pushbelt");
  r.number("belt.peak_slip_percent", b.overdrive.peak_slip_percent, 0.1, 50.0,
           "friction needs some slip to reach its peak");
  r.number("belt.fall_per_percent", b.overdrive.fall_per_percent, 0.0, 0.1,
           "friction falls beyond its peak");
  r.number("belt.fall_at_once", b.overdrive.fall_at_once, 0.0, 0.5, "a share of the friction");
  r.number("belt.low_mu_factor", b.low_mu_factor, 0.5, 2.0, "friction depends little on ratio");
  r.number("belt.low_peak_slip_percent", b.low_peak_slip_percent, 0.1, 50.0,
           "friction needs some slip to reach its peak");
  r.number("belt.temperature_per_K", b.temperature_per_K, -0.01, 0.01, "a few percent in 50 K");
  r.number("belt.speed_per_ln", b.speed_per_ln, -0.3, 0.3, "a few percent");
  r.number("belt.load_exponent", b.load_exponent, -0.5, 0.5, "a few percent");
  r.number("belt.wear_step", b.wear_step, 0.0, 0.9, "a share of the friction");
  r.number("belt.wear_at_s", b.wear_at_s, 0.0, 1e6, "an instant of the run");
}

void name_engine(ScenarioReader& r, EngineParameters& e) {
  r.number("engine.inertia_kg_m2", e.inertia_kg_m2, 1e-3, 10.0, kPositiveInertia);
  r.number("engine.torque_max_Nm", e.torque_max_Nm, 1.0, 1000.0, "the engine drives");
  r.number("engine.overrun_torque_Nm", e.overrun_torque_Nm, 0.0, 200.0,
           "drag of the engine, a positive number");
  r.number("engine.overrun_torque_Nm_s", e.overrun_slope_Nm_s, 0.0, 1.0, "drag grows with speed");
  r.number("engine.idle_rad_s", e.idle_rad_s, 30.0, 200.0, "an idling speed");
  r.number("engine.fuel_cut_above_rad_s", e.fuel_cut_above_rad_s, 30.0, 400.0,
           "fuel is cut above idle");
  r.number("engine.stall_rad_s", e.stall_rad_s, 5.0, 100.0, "an engine stalls below idle");
  r.number("engine.torque_lag_s", e.torque_lag_s, 1e-3, 2.0, "an intake fills in some time");
  r.number("engine.torque_rise_Nm_s", e.torque_rise_Nm_s, 10.0, 1e5, "a pedal step is shaped");
  r.number("engine.accessories_Nm", e.accessories_Nm, 0.0, 50.0, "accessories brake");
}

void name_body(ScenarioReader& r, VehicleBody& b) {
  r.number("vehicle.mass_kg", b.mass_kg, 100.0, 10e3, "a vehicle has mass");
  r.number("vehicle.wheel_radius_m", b.wheel_radius_m, 0.1, 1.0, "a wheel's radius");
  r.number("vehicle.final_drive", b.final_drive, 0.5, 20.0, "secondary turns per wheel turn");
  r.number("vehicle.rolling_resistance", b.rolling_resistance, 0.0, 0.1, "tyres brake");
  r.number("vehicle.drag_area_m2", b.drag_area_m2, 0.0, 10.0, "air brakes");
  r.number("vehicle.grade_percent", b.grade_percent, -30.0, 30.0, "a road");
}

void name_hydraulics(ScenarioReader& r, HydraulicParameters& h) {
  r.number("hydraulics.lag_s", h.lag_s, 1e-3, 2.0, "oil follows, it does not lead");
  r.number("hydraulics.dead_time_s", h.dead_time_s, 0.0, 0.25, "oil follows, it does not lead");
  r.number("hydraulics.cold_factor", h.cold_factor, 1.0, 10.0, "cold oil is slower");
  r.number("hydraulics.pressure_floor_Pa", h.pressure_floor_Pa, 0.0, 2e6,
           "a valve holds some pressure");
  r.number("hydraulics.pressure_max_Pa", h.pressure_max_Pa, 1e5, 20e6, "the pump's pressure");
  r.number("hydraulics.friction_force_N", h.friction_force_N, 0.0, 1000.0, "friction resists");
  r.number("hydraulics.oil_start_degC", h.oil_start_degC, -40.0, 150.0, "oil, neither ice nor gas");
  r.number("hydraulics.oil_end_degC", h.oil_end_degC, -40.0, 150.0, "oil, neither ice nor gas");
  r.number("hydraulics.oil_warming_s", h.oil_warming_s, 1.0, 1e5, kDuration);
}

void name_controller(ScenarioReader& r, TcuParameters& t) {
  r.number("controller.cycle_s", t.cycle_s, 1e-3, 0.05, "a controller's cycle");
  r.number("controller.torque_reserve_Nm", t.torque_reserve_Nm, 0.0, 500.0, "a safety margin");
  r.number("controller.design_friction", t.design_friction, 0.01, 0.5,
           "a friction coefficient of a pushbelt");
  r.number("controller.force_floor_N", t.force_floor_N, 0.0, 1e5, "the belt must be clamped");
  r.number("controller.force_fall_max_N_per_s", t.force_fall_max_N_per_s, 1.0, 1e5,
           "the force falls at this rate");
  r.number("controller.own_fall_max_N_per_s", t.own_fall_max_N_per_s, 1.0, 1e9,
           "a rate of its own force");
  r.number("controller.coast_engine_speed_rad_s", t.coast_engine_speed_rad_s, 50.0, 500.0,
           "an engine speed above idle");
  r.number("controller.full_engine_speed_rad_s", t.full_engine_speed_rad_s, 50.0, 800.0,
           "an engine speed");
  r.number("controller.lockup_above_km_h", t.lockup_above_m_s, 1.0, 200.0, "a vehicle speed", kKmh);
  r.number("controller.oil_permit_degC", t.oil_permit_degC, -40.0, 150.0, "an oil temperature");
}

void name_channel(ScenarioReader& r, const std::string& name, const std::string& unit,
                  ChannelError& e, double noise_max, double bias_max) {
  r.number("sensors." + name + "_noise_" + unit, e.noise, 0.0, noise_max, kNoise);
  r.number("sensors." + name + "_bias_" + unit, e.bias, -bias_max, bias_max, kGain);
  r.number("sensors." + name + "_gain", e.gain, -0.5, 0.5, kGain);
  r.number("sensors." + name + "_delay_s", e.delay_s, 0.0, 1.0, kAge);
  r.number("sensors." + name + "_resolution_" + unit, e.resolution, 0.0, bias_max,
           "a step of the sensor");
}

void name_sensors(ScenarioReader& r, SensorParameters& s) {
  name_channel(r, "primary_speed", "rad_s", s.primary_speed, 100.0, 100.0);
  name_channel(r, "secondary_speed", "rad_s", s.secondary_speed, 100.0, 100.0);
  name_channel(r, "engine_speed", "rad_s", s.engine_speed, 100.0, 100.0);
  name_channel(r, "torque", "Nm", s.torque, 100.0, 100.0);
  name_channel(r, "pressure", "Pa", s.pressure, 1e6, 1e6);
  name_channel(r, "temperature", "K", s.temperature, 100.0, 100.0);
  r.number("sensors.primary_speed_ripple", s.primary_ripple, 0.0, 0.1,
           "a pickup's eccentricity over its radius");
  r.number("sensors.secondary_speed_ripple", s.secondary_ripple, 0.0, 0.1,
           "a pickup's eccentricity over its radius");
  r.number("sensors.frame_delay_s", s.frame_delay_s, 1e-5, 1.0, "a frame follows its measurement");
  r.number("sensors.frame_jitter_s", s.frame_jitter_s, 0.0, 1.0, "a frame follows its measurement");
}

void name_known(ScenarioReader& r, KnownOfVehicle& k) {
  r.choice("beltgrip.trigger", {"coast_down", "steady"},
           [&k](std::size_t i) { k.steady = i == 1; });
  r.number("beltgrip.torque_offset_Nm", k.torque_offset_Nm, -50.0, 50.0, "accessories and losses");
  r.number("beltgrip.torque_bias_Nm", k.torque_bias_Nm, 0.0, 50.0, kNoise);
  r.number("beltgrip.torque_gain", k.torque_gain, 0.0, 0.5, kNoise);
  r.number("beltgrip.pressure_bias_Pa", k.pressure_bias_Pa, 0.0, 1e6, kNoise);
  r.number("beltgrip.pressure_gain", k.pressure_gain, 0.0, 0.5, kNoise);
  r.number("beltgrip.cooldown_s", k.cooldown_s, 1.0, 86400.0, kDuration);
  r.number("beltgrip.cooldown_m", k.cooldown_m, 0.0, 1e6, "a way");
}

void name_driver(ScenarioReader& r, DriverParameters& d) {
  r.choice("driver.pattern", {"steps", "city"},
           [&d](std::size_t i) { d.pattern = static_cast<DriverPattern>(i); });
  r.number("driver.start_speed_km_h", d.start_speed_m_s, 0.0, 250.0, "the vehicle drives forward",
           kKmh);
  r.rows("driver.step", [&d](ScenarioReader* row) {
    if (row == nullptr) {
      d.steps.clear();
      return;
    }
    DriverStep& step = d.steps.emplace_back();
    row->number("at_s", step.at_s, 0.0, 1e6, "an instant of the run");
    row->number("hold_speed_km_h", step.hold_speed_m_s, 0.0, 250.0, "the vehicle drives forward",
                kKmh);
    row->number("accelerator_percent", step.accelerator, 0.0, 100.0, "a pedal", kPercent);
    row->number("brake_m_s2", step.brake_m_s2, 0.0, 12.0, "tyres on a road");
  });
}

void name_faults(ScenarioReader& r, std::vector<FaultStep>& faults) {
  r.rows("fault", [&faults](ScenarioReader* row) {
    if (row == nullptr) {
      faults.clear();
      return;
    }
    FaultStep& fault = faults.emplace_back();
    std::vector<std::string> names;
    for (const FaultKindRow& kind : fault_kinds()) names.emplace_back(kind.name);
    row->choice("kind", names, [&fault](std::size_t i) { fault.kind = fault_kinds()[i].kind; });
    row->text("channel", fault.channel);
    row->number("at_s", fault.at_s, -10.0, 1e6, "an instant of the run");
    row->flag("after_request", fault.after_request);
    row->number("for_s", fault.for_s, 0.0, 1e6, kDuration);
    row->number("size", fault.size, -1e9, 1e9, "a number");
  });
}

bool check_geometry(ScenarioReader& r, const VariatorParameters& v) {
  const auto fits = [&v](double ratio) {
    const auto radii = estimator::running_radii(ratio, v.belt_length_m, v.centre_distance_m);
    return std::min(radii.primary_m, radii.secondary_m) > kLeastRadiusShare * v.belt_length_m &&
           radii.primary_m + radii.secondary_m < v.centre_distance_m;
  };
  if (v.belt_length_m <= 2.0 * v.centre_distance_m) {
    r.contradiction("variator.belt_length_m", "found " + number_text(v.belt_length_m) +
                                                  ": too short, a belt around two shafts " +
                                                  number_text(v.centre_distance_m) +
                                                  " m apart is longer than " +
                                                  number_text(2.0 * v.centre_distance_m) + " m");
    return false;
  }
  bool right = true;
  for (const auto& [key, ratio] : {std::pair{"variator.ratio_low", v.ratio_low},
                                   std::pair{"variator.ratio_overdrive", v.ratio_overdrive}}) {
    if (fits(ratio)) continue;
    right = false;
    r.contradiction(key, "found " + number_text(ratio) +
                             ": out of reach, no two pulleys that fit between shafts " +
                             number_text(v.centre_distance_m) +
                             " m apart, and around which a belt of " +
                             number_text(v.belt_length_m) + " m bends, have this ratio");
  }
  return right;
}

// A name that no one has would be a fault without effect.
void check_channel(ScenarioReader& r, std::size_t row, const FaultStep& fault) {
  if (fault.channel.empty()) return;
  const auto kind =
      std::find_if(fault_kinds().begin(), fault_kinds().end(),
                   [&fault](const FaultKindRow& each) { return each.kind == fault.kind; });
  const std::string found = "found channel = \"" + fault.channel + "\"";
  if (kind->channel == FaultChannel::kNone) {
    r.row_contradiction("fault", row, found + ", but " + std::string(kind->name) + " has none");
    return;
  }
  std::string expected;
  for (const std::string& name :
       kind->channel == FaultChannel::kSignal ? vehicle_signal_names() : vehicle_message_names()) {
    if (name == fault.channel) return;
    expected += (expected.empty() ? "" : ", ") + name;
  }
  r.row_contradiction("fault", row, found + ", expected one of " + expected);
}

void check_whole(ScenarioReader& r, const VehicleScenario& s) {
  check_geometry(r, s.variator);
  if (s.engine.stall_rad_s >= s.engine.idle_rad_s) {
    r.contradiction("engine.stall_rad_s", "found " + number_text(s.engine.stall_rad_s) +
                                              ", expected less than engine.idle_rad_s: the engine "
                                              "would never idle");
  }
  if (s.hydraulics.pressure_floor_Pa >= s.hydraulics.pressure_max_Pa) {
    r.contradiction("hydraulics.pressure_floor_Pa",
                    "found " + number_text(s.hydraulics.pressure_floor_Pa) +
                        ", expected less than hydraulics.pressure_max_Pa");
  }
  for (std::size_t i = 1; i < s.driver.steps.size(); ++i) {
    if (s.driver.steps[i].at_s >= s.driver.steps[i - 1].at_s) continue;
    r.row_contradiction("driver.step", i,
                        "found at_s = " + number_text(s.driver.steps[i].at_s) + " after " +
                            number_text(s.driver.steps[i - 1].at_s) +
                            ": the steps are not in order of time");
  }
  for (std::size_t i = 0; i < s.faults.size(); ++i) check_channel(r, i, s.faults[i]);
}

}  // namespace

bool is_vehicle_scenario(std::string_view text) {
  try {
    return toml::parse(text)["plant"].value_or(std::string()) == "vehicle";
  } catch (const toml::parse_error&) {
    return false;
  }
}

VehicleScenarioResult parse_vehicle_scenario(const std::vector<ScenarioLayer>& layers) {
  VehicleScenarioResult result;
  VehicleScenario& s = result.scenario;
  ScenarioReader reader;
  reader.choice("plant", {"vehicle"}, [](std::size_t) {});
  reader.text("name", s.name);
  reader.number("run.duration_s", s.duration_s, 0.1, 1e6, kDuration);
  reader.number("run.step_s", s.step_s, 1e-5, 1e-3, "at least 1 kHz");
  name_variator(reader, s.variator);
  name_belt(reader, s.belt);
  name_engine(reader, s.engine);
  name_body(reader, s.body);
  name_hydraulics(reader, s.hydraulics);
  name_controller(reader, s.tcu);
  name_driver(reader, s.driver);
  name_sensors(reader, s.sensors);
  name_known(reader, s.known);
  name_faults(reader, s.faults);
  reader.apply({std::string(kBase) + ".toml", std::string(shipped(std::string(kBase) + ".toml"))});
  for (const ScenarioLayer& layer : layers) reader.apply(layer);
  if (reader.errors().empty()) check_whole(reader, s);
  result.errors = reader.errors();
  return result;
}

VehicleScenarioResult shipped_vehicle_scenario(std::string_view name,
                                               const std::vector<ScenarioLayer>& layers) {
  const std::string file = std::string(name) + ".toml";
  const auto text = resource(file);
  if (!text) return {{}, {file + ": no such scenario"}};
  std::vector<ScenarioLayer> all;
  if (name != kBase) all.push_back({file, std::string(*text)});
  all.insert(all.end(), layers.begin(), layers.end());
  return parse_vehicle_scenario(all);
}

}  // namespace beltgrip::sim
