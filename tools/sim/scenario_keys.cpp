#include "tools/sim/scenario_keys.h"

#include <algorithm>
#include <utility>

#include "can_dbc/text/number_text.h"
#include "estimator/physics/variator_geometry.h"
#include "tools/sim/bus.h"

namespace beltgrip::sim {

namespace {

// A pushbelt's elements do not bend around less.
constexpr double kLeastRadiusShare = 0.03;  // of its length

constexpr const char* kGain = "an error, not a fault";
constexpr const char* kAge = "a value is never younger than its measurement";
constexpr const char* kLate = "a frame follows its measurement";
constexpr const char* kPickup = "a pickup's eccentricity over its radius";

using V = VariatorParameters;
constexpr KeyOf kVehicle = KeyOf::kVehicle;
constexpr NumberKey<V> kVariator[] = {
    {"belt_length_m", &V::belt_length_m, 0.1, 3.0, "a pushbelt's length"},
    {"centre_distance_m", &V::centre_distance_m, 0.03, 1.0, "the distance of the shafts"},
    {"half_wedge_angle_deg", &V::half_wedge_angle_rad, 5.0, 30.0,
     "a wedge that neither locks nor slides", kDegree},
    {"ratio", &V::ratio, 0.2, 5.0, "secondary speed over primary speed", 1.0, KeyOf::kRig},
    {"ratio_low", &V::ratio_low, 0.1, 1.0, "LOW turns the secondary slower", 1.0, kVehicle},
    {"ratio_overdrive", &V::ratio_overdrive, 1.0, 10.0, "overdrive turns the secondary faster", 1.0,
     kVehicle},
    {"deformation_per_N", &V::deformation_per_N, -2e-5, 2e-5,
     "pulleys yield by a few percent at most"},
    {"deformation_per_Nm", &V::deformation_per_Nm, -1e-3, 1e-3,
     "pulleys tilt by a few percent at most", 1.0, kVehicle},
    {"secondary_piston_area_m2", &V::secondary_piston_area_m2, 1e-4, 0.1,
     "pressure makes force on an area"},
    {"secondary_spring_force_N", &V::secondary_spring_force_N, 0.0, 1e4, "the spring clamps"},
    {"secondary_centrifugal_N_s2", &V::secondary_centrifugal_N_s2, 0.0, 0.1,
     "rotating oil presses outwards", 1.0, kVehicle},
    {"primary_piston_area_m2", &V::primary_piston_area_m2, 1e-4, 0.1,
     "pressure makes force on an area", 1.0, kVehicle},
    {"primary_centrifugal_N_s2", &V::primary_centrifugal_N_s2, 0.0, 0.1,
     "rotating oil presses outwards", 1.0, kVehicle},
    {"primary_inertia_kg_m2", &V::primary_inertia_kg_m2, 1e-4, 10.0, kPositiveInertia, 1.0,
     kVehicle},
    {"secondary_inertia_kg_m2", &V::secondary_inertia_kg_m2, 1e-4, 10.0, kPositiveInertia, 1.0,
     kVehicle},
    {"primary_loss_Nm", &V::primary_loss_Nm, 0.0, 50.0, kLoss, 1.0, kVehicle},
    {"primary_loss_Nm_per_kN", &V::primary_loss_Nm_per_N, 0.0, 5.0, kLoss, 1e-3, kVehicle},
    {"secondary_loss_Nm", &V::secondary_loss_Nm, 0.0, 50.0, kLoss, 1.0, kVehicle},
    {"secondary_loss_Nm_s", &V::secondary_loss_Nm_s, 0.0, 1.0, kLoss, 1.0, kVehicle},
    {"shift_gain", &V::shift_gain, 1e-5, 0.1, "a pulley's deformation in rad", 1.0, kVehicle},
    {"force_ratio_slope", &V::force_ratio_slope, 0.0, 2.0,
     "overdrive needs the larger primary force", 1.0, kVehicle},
    {"force_ratio_load", &V::force_ratio_load, -1.0, 1.0,
     "load moves the force ratio by a few tenths", 1.0, kVehicle},
};

constexpr NumberKey<World> kRun[] = {
    {"duration_s", &World::duration_s, 0.1, 1e6, kDuration},
    {"step_s", &World::step_s, 1e-5, 1e-3, "at least 1 kHz"},
};

using S = SensorParameters;
constexpr NumberKey<S> kSensors[] = {
    {"primary_speed_ripple", &S::primary_ripple, 0.0, 0.1, kPickup},
    {"secondary_speed_ripple", &S::secondary_ripple, 0.0, 0.1, kPickup},
    {"frame_delay_s", &S::frame_delay_s, 0.0, 1.0, kLate, 1.0, KeyOf::kRig},
    // The frames of a car wait for the bus.
    {"frame_delay_s", &S::frame_delay_s, 1e-5, 1.0, kLate, 1.0, kVehicle},
    {"frame_jitter_s", &S::frame_jitter_s, 0.0, 1.0, kLate},
    {"pressure_period_s", &S::pressure_period_s, 0.0, 1.0, "0: as often as the DBC says", 1.0,
     kVehicle},
};

// Five keys each.
struct ChannelKeys {
  const char* name;
  const char* unit;
  ChannelError S::*error;
  double noise_max, bias_max;
  KeyOf plant = KeyOf::kBoth;
};
constexpr ChannelKeys kChannelKeys[] = {
    {"primary_speed", "rad_s", &S::primary_speed, 100.0, 100.0},
    {"secondary_speed", "rad_s", &S::secondary_speed, 100.0, 100.0},
    {"engine_speed", "rad_s", &S::engine_speed, 100.0, 100.0, kVehicle},
    {"torque", "Nm", &S::torque, 100.0, 100.0},
    {"pressure", "Pa", &S::pressure, 1e6, 1e6},
    {"temperature", "K", &S::temperature, 100.0, 100.0},
};

using F = FrictionCurve;
constexpr NumberKey<F> kCurve[] = {
    {"mu_max", &F::mu_max, 0.005, 1.0, "a friction coefficient of a pushbelt"},
    {"peak_slip_percent", &F::peak_slip_percent, 0.1, 50.0,
     "friction needs some slip to reach its peak"},
    {"fall_per_percent", &F::fall_per_percent, 0.0, 0.1, "friction falls beyond its peak"},
    {"fall_at_once", &F::fall_at_once, 0.0, 0.5, "a share of the friction"},
    {"plateau_percent", &F::plateau_percent, 0.0, 20.0, "friction that lies level for some slip"},
    {"knee_slip_percent", &F::knee_slip_percent, 0.1, 50.0,
     "the steep foot of friction has an end"},
    {"rise_per_percent", &F::rise_per_percent, 0.0, 0.1, "friction does not fall before its peak"},
};

void name_sensors(ScenarioReader& reader, Plant plant, SensorParameters& sensors) {
  for (const ChannelKeys& keys : kChannelKeys) {
    if (!has(plant, keys.plant)) continue;
    const std::string name = std::string("sensors.") + keys.name + "_";
    ChannelError& error = sensors.*keys.error;
    reader.number(name + "noise_" + keys.unit, error.noise, 0.0, keys.noise_max, kNoise);
    reader.number(name + "bias_" + keys.unit, error.bias, -keys.bias_max, keys.bias_max, kGain);
    reader.number(name + "gain", error.gain, -0.5, 0.5, kGain);
    reader.number(name + "delay_s", error.delay_s, 0.0, 1.0, kAge);
    reader.number(name + "resolution_" + keys.unit, error.resolution, 0.0, keys.bias_max,
                  "a step of the sensor");
  }
  name_numbers<S>(reader, "sensors.", sensors, kSensors, plant);
}

void name_faults(ScenarioReader& reader, std::vector<FaultStep>& faults) {
  reader.rows("fault", [&faults](ScenarioReader* row) {
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

// What a fault cannot act on, or nothing.
std::string wrong_fault(Plant plant, const FaultStep& fault, const can::Database& dbc) {
  const auto kind =
      std::find_if(fault_kinds().begin(), fault_kinds().end(),
                   [&fault](const FaultKindRow& each) { return each.kind == fault.kind; });
  if (plant == Plant::kRig && kind->channel == FaultChannel::kNone) {
    return "found kind = \"" + std::string(kind->name) +
           "\", expected one of a signal or a frame: a rig has no driver, no transmission "
           "controller and no bus of its own";
  }
  if (plant == Plant::kRig && fault.after_request) {
    return "found after_request = true, but nobody asks a rig for anything";
  }
  if (fault.channel.empty()) return {};
  const std::string found = "found channel = \"" + fault.channel + "\"";
  if (kind->channel == FaultChannel::kNone) {
    return found + ", but " + std::string(kind->name) + " has none";
  }
  std::string expected;
  for (const std::string& name :
       kind->channel == FaultChannel::kSignal ? signal_names(dbc) : message_names(dbc)) {
    if (name == fault.channel) return {};
    expected += (expected.empty() ? "" : ", ") + name;
  }
  return found + ", expected one of " + expected;
}

}  // namespace

void name_world(ScenarioReader& reader, Plant plant, World& world) {
  reader.text("name", world.name);
  name_numbers<World>(reader, "run.", world, kRun, plant);
  name_numbers<V>(reader, "variator.", world.variator, kVariator, plant);
  name_sensors(reader, plant, world.sensors);
  name_faults(reader, world.faults);
}

void name_curve(ScenarioReader& reader, const std::string& prefix, FrictionCurve& curve) {
  reader.choice(prefix + "curve",
                {"tanh_fall", "magic_formula", "saturating", "two_peaks", "broad_top"},
                [&curve](std::size_t i) { curve.shape = static_cast<CurveShape>(i); });
  name_numbers<F>(reader, prefix, curve, kCurve, Plant::kRig);
}

void check_curve(ScenarioReader& reader, const std::string& place, const FrictionCurve& curve) {
  const double along = curve.rise_per_percent * curve.peak_slip_percent;
  if (curve.shape == CurveShape::kBroadTop && along >= curve.mu_max) {
    reader.contradiction(place, "found rise_per_percent = " + number_text(curve.rise_per_percent) +
                                    ": up to the peak at " + number_text(curve.peak_slip_percent) +
                                    " % this alone is more than mu_max, " +
                                    number_text(curve.mu_max));
  }
}

bool check_geometry(ScenarioReader& reader, const VariatorParameters& v,
                    const std::vector<std::pair<std::string, double>>& ratios) {
  if (v.belt_length_m <= 2.0 * v.centre_distance_m) {
    reader.contradiction("variator.belt_length_m",
                         "found " + number_text(v.belt_length_m) +
                             ": too short, a belt around two shafts " +
                             number_text(v.centre_distance_m) + " m apart is longer than " +
                             number_text(2.0 * v.centre_distance_m) + " m");
    return false;
  }
  bool right = true;
  for (const auto& [key, ratio] : ratios) {
    const auto radii = estimator::running_radii(ratio, v.belt_length_m, v.centre_distance_m);
    if (std::min(radii.primary_m, radii.secondary_m) > kLeastRadiusShare * v.belt_length_m &&
        radii.primary_m + radii.secondary_m < v.centre_distance_m) {
      continue;
    }
    right = false;
    reader.contradiction(key, "found " + number_text(ratio) +
                                  ": out of reach, no two pulleys that fit between shafts " +
                                  number_text(v.centre_distance_m) +
                                  " m apart, and around which a belt of " +
                                  number_text(v.belt_length_m) + " m bends, have this ratio");
  }
  return right;
}

void check_faults(ScenarioReader& reader, Plant plant, const World& world,
                  const can::Database& dbc) {
  for (std::size_t i = 0; i < world.faults.size(); ++i) {
    const std::string wrong = wrong_fault(plant, world.faults[i], dbc);
    if (!wrong.empty()) reader.row_contradiction("fault", i, wrong);
  }
}

}  // namespace beltgrip::sim
