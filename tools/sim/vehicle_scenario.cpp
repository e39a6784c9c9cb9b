#include "tools/sim/vehicle_scenario.h"

#include <toml++/toml.h>

#include "can_dbc/text/number_text.h"
#include "tools/sim/configuration.h"
#include "tools/sim/resources.h"
#include "tools/sim/scenario_effects.h"

namespace beltgrip::sim {

namespace {

constexpr const char* kBase = "coast-overdrive";

using Belt = BeltParameters;
constexpr NumberKey<Belt> kBelt[] = {
    {"low_mu_factor", &Belt::low_mu_factor, 0.5, 2.0, "friction depends little on ratio"},
    {"low_peak_slip_percent", &Belt::low_peak_slip_percent, 0.1, 50.0,
     "friction needs some slip to reach its peak"},
    {"temperature_per_K", &Belt::temperature_per_K, -0.01, 0.01, "a few percent in 50 K"},
    {"speed_per_ln", &Belt::speed_per_ln, -0.3, 0.3, "a few percent"},
    {"load_exponent", &Belt::load_exponent, -0.5, 0.5, "a few percent"},
    {"wear_step", &Belt::wear_step, 0.0, 0.9, "a share of the friction"},
    {"wear_at_s", &Belt::wear_at_s, 0.0, 1e6, "an instant of the run"},
};

using Engine = EngineParameters;
constexpr NumberKey<Engine> kEngine[] = {
    {"inertia_kg_m2", &Engine::inertia_kg_m2, 1e-3, 10.0, kPositiveInertia},
    {"torque_max_Nm", &Engine::torque_max_Nm, 1.0, 1000.0, "the engine drives"},
    {"overrun_torque_Nm", &Engine::overrun_torque_Nm, 0.0, 200.0,
     "drag of the engine, a positive number"},
    {"overrun_torque_Nm_s", &Engine::overrun_slope_Nm_s, 0.0, 1.0, "drag grows with speed"},
    {"idle_rad_s", &Engine::idle_rad_s, 30.0, 200.0, "an idling speed"},
    {"fuel_cut_above_rad_s", &Engine::fuel_cut_above_rad_s, 30.0, 400.0, "fuel is cut above idle"},
    {"stall_rad_s", &Engine::stall_rad_s, 5.0, 100.0, "an engine stalls below idle"},
    {"torque_lag_s", &Engine::torque_lag_s, 1e-3, 2.0, "an intake fills in some time"},
    {"torque_rise_Nm_s", &Engine::torque_rise_Nm_s, 10.0, 1e5, "a pedal step is shaped"},
    {"accessories_Nm", &Engine::accessories_Nm, 0.0, 50.0, "accessories brake"},
};

using Body = VehicleBody;
constexpr NumberKey<Body> kBody[] = {
    {"mass_kg", &Body::mass_kg, 100.0, 10e3, "a vehicle has mass"},
    {"wheel_radius_m", &Body::wheel_radius_m, 0.1, 1.0, "a wheel's radius"},
    {"final_drive", &Body::final_drive, 0.5, 20.0, "secondary turns per wheel turn"},
    {"rolling_resistance", &Body::rolling_resistance, 0.0, 0.1, "tyres brake"},
    {"drag_area_m2", &Body::drag_area_m2, 0.0, 10.0, "air brakes"},
    {"grade_percent", &Body::grade_percent, -30.0, 30.0, "a road"},
};

using Oil = HydraulicParameters;
constexpr NumberKey<Oil> kHydraulics[] = {
    {"lag_s", &Oil::lag_s, 1e-3, 2.0, "oil follows, it does not lead"},
    {"dead_time_s", &Oil::dead_time_s, 0.0, 0.25, "oil follows, it does not lead"},
    {"cold_factor", &Oil::cold_factor, 1.0, 10.0, "cold oil is slower"},
    {"pressure_floor_Pa", &Oil::pressure_floor_Pa, 0.0, 2e6, "a valve holds some pressure"},
    {"pressure_max_Pa", &Oil::pressure_max_Pa, 1e5, 20e6, "the pump's pressure"},
    {"friction_force_N", &Oil::friction_force_N, 0.0, 1000.0, "friction resists"},
    {"oil_start_degC", &Oil::oil_start_degC, -40.0, 150.0, "oil, neither ice nor gas"},
    {"oil_end_degC", &Oil::oil_end_degC, -40.0, 150.0, "oil, neither ice nor gas"},
    {"oil_warming_s", &Oil::oil_warming_s, 1.0, 1e5, kDuration},
};

using Tcu = TcuParameters;
constexpr NumberKey<Tcu> kController[] = {
    {"cycle_s", &Tcu::cycle_s, 1e-3, 0.05, "a controller's cycle"},
    {"torque_reserve_Nm", &Tcu::torque_reserve_Nm, 0.0, 500.0, "a safety margin"},
    {"design_friction", &Tcu::design_friction, 0.01, 0.5, "a friction coefficient of a pushbelt"},
    {"force_floor_N", &Tcu::force_floor_N, 0.0, 1e5, "the belt must be clamped"},
    {"force_fall_max_N_per_s", &Tcu::force_fall_max_N_per_s, 1.0, 1e5,
     "the force falls at this rate"},
    {"own_fall_max_N_per_s", &Tcu::own_fall_max_N_per_s, 1.0, 1e9, "a rate of its own force"},
    {"coast_engine_speed_rad_s", &Tcu::coast_engine_speed_rad_s, 50.0, 500.0,
     "an engine speed above idle"},
    {"full_engine_speed_rad_s", &Tcu::full_engine_speed_rad_s, 50.0, 800.0, "an engine speed"},
    {"lockup_above_km_h", &Tcu::lockup_above_m_s, 1.0, 200.0, "a vehicle speed", kKmh},
    {"oil_permit_degC", &Tcu::oil_permit_degC, -40.0, 150.0, "an oil temperature"},
};

using Known = KnownOfVehicle;
constexpr NumberKey<Known> kKnown[] = {
    {"torque_offset_Nm", &Known::torque_offset_Nm, -50.0, 50.0, "accessories and losses"},
    {"torque_bias_Nm", &Known::torque_bias_Nm, 0.0, 50.0, kNoise},
    {"torque_gain", &Known::torque_gain, 0.0, 0.5, kNoise},
    {"pressure_bias_Pa", &Known::pressure_bias_Pa, 0.0, 1e6, kNoise},
    {"pressure_gain", &Known::pressure_gain, 0.0, 0.5, kNoise},
    {"ramp_rate_max_N_per_s", &Known::ramp_rate_max_N_per_s, 0.0, 10e3, "a rate"},
    {"cooldown_s", &Known::cooldown_s, 1.0, 86400.0, kDuration},
    {"cooldown_m", &Known::cooldown_m, 0.0, 1e6, "a way"},
};

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

void check_whole(ScenarioReader& r, const VehicleScenario& s) {
  check_geometry(r, s.variator,
                 {{"variator.ratio_low", s.variator.ratio_low},
                  {"variator.ratio_overdrive", s.variator.ratio_overdrive}});
  check_curve(r, "belt.curve", s.belt.overdrive);
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
  check_faults(r, Plant::kVehicle, s, vehicle_database());
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
  constexpr Plant kPlant = Plant::kVehicle;
  ScenarioReader reader("a vehicle scenario");
  reader.choice("plant", {"vehicle"}, [](std::size_t) {});
  name_world(reader, kPlant, s);
  ScenarioEffects effects;
  effects.name(reader);
  name_curve(reader, "belt.", s.belt.overdrive);
  name_numbers<Belt>(reader, "belt.", s.belt, kBelt, kPlant);
  name_numbers<Engine>(reader, "engine.", s.engine, kEngine, kPlant);
  name_numbers<Body>(reader, "vehicle.", s.body, kBody, kPlant);
  name_numbers<Oil>(reader, "hydraulics.", s.hydraulics, kHydraulics, kPlant);
  name_numbers<Tcu>(reader, "controller.", s.tcu, kController, kPlant);
  name_driver(reader, s.driver);
  reader.choice("beltgrip.trigger", {"coast_down", "steady"},
                [&s](std::size_t i) { s.known.steady = i == 1; });
  name_numbers<Known>(reader, "beltgrip.", s.known, kKnown, kPlant);
  reader.apply({std::string(kBase) + ".toml", std::string(shipped(std::string(kBase) + ".toml"))});
  for (const ScenarioLayer& layer : layers) reader.apply(layer);
  if (reader.errors().empty()) {
    effects.put(reader, s.effects);
    check_whole(reader, s);
  }
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
