#include "tools/sim/scenario.h"

#include <toml++/toml.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <numbers>
#include <sstream>
#include <variant>

#include "estimator/physics/variator_geometry.h"

namespace beltgrip::sim {

namespace {

constexpr double kDegree = std::numbers::pi / 180.0;

// A number that belongs to the scenario itself or to its variator.
struct NumberKey {
  const char* name;
  std::variant<double Scenario::*, double VariatorModel::*> field;
  double minimum, maximum;
  const char* reason;
  double factor = 1.0;  // value in the file -> SI

  double& in(Scenario& scenario) const {
    if (const auto* own = std::get_if<double Scenario::*>(&field)) return scenario.**own;
    return scenario.variator.*std::get<double VariatorModel::*>(field);
  }
};

constexpr const char* kPositiveInertia = "a rotating mass has a positive inertia";
constexpr const char* kNoise = "a standard deviation is not negative";
const NumberKey kNumbers[] = {
    {"variator.belt_length_m", &VariatorModel::belt_length_m, 0.1, 3.0, "a pushbelt's length"},
    {"variator.centre_distance_m", &VariatorModel::centre_distance_m, 0.03, 1.0,
     "the distance of the shafts"},
    {"variator.half_wedge_angle_deg", &VariatorModel::half_wedge_angle_rad, 5.0, 30.0,
     "a wedge that neither locks nor slides", kDegree},
    {"variator.ratio", &VariatorModel::ratio, 0.2, 5.0, "secondary speed over primary speed"},
    {"variator.deformation_per_N", &VariatorModel::deformation_per_N, -2e-5, 2e-5,
     "pulleys yield by a few percent at most"},
    {"variator.secondary_piston_area_m2", &Scenario::secondary_piston_area_m2, 1e-4, 0.1,
     "pressure makes force on an area"},
    {"variator.secondary_spring_force_N", &Scenario::secondary_spring_force_N, 0.0, 1e4,
     "the spring clamps"},
    {"driveline.primary_speed_rad_s", &Scenario::primary_speed_rad_s, 10.0, 1000.0,
     "the machine drives forward"},
    {"driveline.primary_torque_Nm", &Scenario::primary_torque_Nm, -500.0, 500.0,
     "what a pushbelt carries"},
    {"driveline.primary_inertia_kg_m2", &VariatorModel::primary_inertia_kg_m2, 1e-4, 100.0,
     kPositiveInertia},
    {"driveline.secondary_inertia_kg_m2", &VariatorModel::secondary_inertia_kg_m2, 1e-4, 100.0,
     kPositiveInertia},
    {"driveline.secondary_drag_Nm", &VariatorModel::secondary_drag_Nm, 0.0, 100.0, "drag brakes"},
    {"driveline.secondary_drag_Nm_s", &VariatorModel::secondary_drag_Nm_s, 0.0, 10.0,
     "drag brakes"},
    {"driveline.speed_controller_Nm_s", &Scenario::speed_controller_Nm_s, 0.1, 1e4,
     "the controller acts against the error"},
    {"driveline.speed_controller_Nm", &Scenario::speed_controller_Nm, 0.0, 1e5,
     "the controller acts against the error"},
    {"clamp.start_force_N", &Scenario::start_force_N, 100.0, 1e5, "the belt must be clamped"},
    {"clamp.hold_s", &Scenario::hold_s, 0.0, 1e4, "a duration"},
    {"clamp.ramp_N_per_s", &Scenario::ramp_N_per_s, 1.0, 1e5, "the force falls at this rate"},
    {"clamp.actuator_lag_s", &Scenario::actuator_lag_s, 0.0, 10.0, "oil follows, it does not lead"},
    {"operator.slip_percent", &Scenario::operator_slip_percent, 0.1, 100.0, "slip that is noticed"},
    {"operator.reaction_s", &Scenario::reaction_s, 0.0, 60.0, "a duration"},
    {"operator.restore_N_per_s", &Scenario::restore_N_per_s, 1.0, 1e6,
     "the force returns at this rate"},
    {"operator.rest_s", &Scenario::rest_s, 0.0, 1e4, "a duration"},
    {"run.duration_s", &Scenario::duration_s, 0.1, 1e6, "a duration"},
    {"run.step_s", &Scenario::step_s, 1e-5, 1e-3, "at least 1 kHz"},
    {"run.cycles", &Scenario::cycles, 1.0, 1e6, "a number of experiments"},
    {"run.oil_degC", &Scenario::oil_degC, -40.0, 150.0, "oil that flows and does not burn"},
    {"sensors.primary_speed_noise_rad_s", &Scenario::primary_speed_noise_rad_s, 0.0, 100.0, kNoise},
    {"sensors.secondary_speed_noise_rad_s", &Scenario::secondary_speed_noise_rad_s, 0.0, 100.0,
     kNoise},
    {"sensors.torque_noise_Nm", &Scenario::torque_noise_Nm, 0.0, 100.0, kNoise},
    {"sensors.torque_bias_Nm", &Scenario::torque_bias_Nm, -100.0, 100.0, "an error, not a fault"},
    {"sensors.pressure_noise_Pa", &Scenario::pressure_noise_Pa, 0.0, 1e6, kNoise},
    {"sensors.pressure_bias_Pa", &Scenario::pressure_bias_Pa, -1e6, 1e6, "an error, not a fault"},
    {"sensors.frame_delay_s", &Scenario::frame_delay_s, 0.0, 1.0,
     "a frame follows its measurement"},
    {"sensors.frame_jitter_s", &Scenario::frame_jitter_s, 0.0, 1.0,
     "a frame follows its measurement"},
};

struct BeltKey {
  const char* name;
  double FrictionCurve::*field;
  double minimum, maximum;
  const char* reason;
};
const BeltKey kBeltNumbers[] = {
    {"mu_max", &FrictionCurve::mu_max, 0.005, 1.0, "a friction coefficient of a pushbelt"},
    {"peak_slip_percent", &FrictionCurve::peak_slip_percent, 0.1, 50.0,
     "friction needs some slip to reach its peak"},
    {"fall_per_percent", &FrictionCurve::fall_per_percent, 0.0, 0.1,
     "friction falls beyond its peak"},
};

template <typename Enum>
struct Choice {
  const char* text;
  Enum value;
};
constexpr Choice<OperatorAction> kActions[] = {{"restore", OperatorAction::kRestore},
                                               {"hold", OperatorAction::kHold},
                                               {"none", OperatorAction::kNone}};
constexpr Choice<CurveShape> kShapes[] = {{"tanh_fall", CurveShape::kTanhFall},
                                          {"magic_formula", CurveShape::kMagicFormula},
                                          {"saturating", CurveShape::kSaturating},
                                          {"two_peaks", CurveShape::kTwoPeaks}};

std::string number_text(double value) {
  char buffer[32];
  return {buffer, std::to_chars(buffer, buffer + sizeof buffer, value).ptr};
}

std::string found_text(const toml::node& node) {
  std::ostringstream out;
  node.visit([&out](const auto& value) { out << value; });
  std::string text = out.str();
  if (const auto line_end = text.find('\n'); line_end != std::string::npos) {
    text = text.substr(0, line_end) + "...";
  }
  return text;
}

class Parser {
 public:
  void apply(const ScenarioLayer& layer) {
    source_ = layer.source;
    toml::table table;
    try {
      table = toml::parse(layer.text);
    } catch (const toml::parse_error& error) {
      result_.errors.push_back(place(error.source().begin.line) +
                               ": not TOML: " + std::string(error.description()));
      return;
    }
    apply_table(table, "");
  }

  ScenarioResult finish() {
    if (result_.errors.empty()) check_whole();
    return std::move(result_);
  }

 private:
  void apply_table(const toml::table& table, const std::string& prefix) {
    for (const auto& [key, node] : table) {
      const std::string name = prefix + std::string(key.str());
      if (!known(name, node)) {
        error(name, node,
              "is not a key of a rig's scenario; that of a car begins with plant = \"vehicle\"");
      }
    }
  }

  // Takes the value where the key exists.
  bool known(const std::string& name, const toml::node& node) {
    for (const NumberKey& key : kNumbers) {
      if (name == key.name) {
        take_number(name, node, key.minimum, key.maximum, key.reason, key.factor,
                    key.in(result_.scenario));
        return true;
      }
    }
    if (name == "name") return take_text(name, node, result_.scenario.name);
    if (name == "belt" && !node.is_table()) return take_text(name, node, result_.scenario.belt);
    if (name == "operator.action") {
      return take_choice(name, node, kActions, result_.scenario.action);
    }
    if (name == "belts") return take_belts(node);
    return take_section(name, node);
  }

  bool take_section(const std::string& name, const toml::node& node) {
    const std::string prefix = name + ".";
    const bool exists =
        name == "operator" ||
        std::any_of(std::begin(kNumbers), std::end(kNumbers), [&](const NumberKey& key) {
          return std::string(key.name).starts_with(prefix);
        });
    if (!exists) return false;
    if (const toml::table* section = node.as_table()) {
      apply_table(*section, prefix);
    } else {
      error(name, node, "found " + found_text(node) + ", expected a section [" + name + "]");
    }
    return true;
  }

  bool take_belts(const toml::node& node) {
    const toml::table* belts = node.as_table();
    if (belts == nullptr) {
      error("belts", node, "found " + found_text(node) + ", expected sections [belts.NAME]");
      return true;
    }
    for (const auto& [belt_name, belt_node] : *belts) {
      const std::string prefix = "belts." + std::string(belt_name.str());
      const toml::table* belt = belt_node.as_table();
      if (belt == nullptr) {
        error(prefix, belt_node, "found " + found_text(belt_node) + ", expected a section");
        continue;
      }
      FrictionCurve& curve = result_.scenario.belts[std::string(belt_name.str())];
      for (const auto& [key, value] : *belt) {
        const std::string name = prefix + "." + std::string(key.str());
        if (!take_belt_key(std::string(key.str()), name, value, curve)) {
          error(name, value, "is not a key of a belt");
        }
      }
    }
    return true;
  }

  bool take_belt_key(const std::string& key, const std::string& name, const toml::node& node,
                     FrictionCurve& curve) {
    if (key == "curve") return take_choice(name, node, kShapes, curve.shape);
    for (const BeltKey& row : kBeltNumbers) {
      if (key == row.name) {
        take_number(name, node, row.minimum, row.maximum, row.reason, 1.0, curve.*row.field);
        return true;
      }
    }
    return false;
  }

  void take_number(const std::string& name, const toml::node& node, double minimum, double maximum,
                   const char* reason, double factor, double& target) {
    remember(name, node);
    const auto value = node.is_number() ? node.value<double>() : std::nullopt;
    if (!value || !(*value >= minimum && *value <= maximum)) {
      error(name, node,
            "found " + found_text(node) + ", expected a number from " + number_text(minimum) +
                " to " + number_text(maximum) + ": " + reason);
      return;
    }
    target = *value * factor;
  }

  bool take_text(const std::string& name, const toml::node& node, std::string& target) {
    remember(name, node);
    if (const auto value = node.value<std::string>()) {
      target = *value;
    } else {
      error(name, node, "found " + found_text(node) + ", expected text");
    }
    return true;
  }

  template <typename Enum, std::size_t kCount>
  bool take_choice(const std::string& name, const toml::node& node,
                   const Choice<Enum> (&choices)[kCount], Enum& target) {
    const std::string value = node.value_or(std::string());
    std::string expected;
    for (const auto& choice : choices) {
      if (value == choice.text) {
        target = choice.value;
        return true;
      }
      expected += (expected.empty() ? "\"" : ", \"") + std::string(choice.text) + "\"";
    }
    error(name, node, "found " + found_text(node) + ", expected one of " + expected);
    return true;
  }

  // File and line; an argument of the command line stands for itself.
  std::string place(std::uint32_t line) const {
    return source_.starts_with("--") ? source_ : source_ + ":" + std::to_string(line);
  }

  void remember(const std::string& name, const toml::node& node) {
    position_[name] = place(node.source().begin.line);
  }

  void error(const std::string& name, const toml::node& node, const std::string& text) {
    result_.errors.push_back(place(node.source().begin.line) + ": " + name + ": " + text);
  }

  void contradiction(const std::string& name, const std::string& text) {
    result_.errors.push_back(position_[name] + ": " + name + ": " + text);
  }

  void check_whole() {
    const Scenario& s = result_.scenario;
    if (!s.belts.contains(s.belt)) {
      std::string names;
      for (const auto& belt : s.belts) names += (names.empty() ? "" : ", ") + belt.first;
      contradiction("belt", "found \"" + s.belt + "\", expected one of the belts: " + names);
      return;
    }
    const auto radii = estimator::running_radii(s.variator.ratio, s.variator.belt_length_m,
                                                s.variator.centre_distance_m);
    if (s.variator.belt_length_m <= 2.0 * s.variator.centre_distance_m) {
      contradiction("variator.belt_length_m",
                    "found " + number_text(s.variator.belt_length_m) +
                        ": too short, a belt around two shafts " +
                        number_text(s.variator.centre_distance_m) + " m apart is longer than " +
                        number_text(2.0 * s.variator.centre_distance_m) + " m");
    } else if (!(radii.primary_m > 0.0) ||
               radii.primary_m + radii.secondary_m >= s.variator.centre_distance_m) {
      contradiction("variator.ratio",
                    "found " + number_text(s.variator.ratio) +
                        ": out of reach, no two pulleys that fit between shafts " +
                        number_text(s.variator.centre_distance_m) +
                        " m apart have this ratio under a belt of " +
                        number_text(s.variator.belt_length_m) + " m");
    } else {
      check_force(radii.primary_m);
    }
    if (s.start_force_N < s.secondary_spring_force_N) {
      contradiction("clamp.start_force_N", "found " + number_text(s.start_force_N) +
                                               ": below the spring force of " +
                                               number_text(s.secondary_spring_force_N) +
                                               " N, which no pressure takes away");
    }
    if (s.frame_jitter_s > s.step_s) {
      contradiction("sensors.frame_jitter_s", "found " + number_text(s.frame_jitter_s) +
                                                  " s, expected at most run.step_s: frames would "
                                                  "overtake each other");
    }
  }

  void check_force(double primary_radius_m) {
    const Scenario& s = result_.scenario;
    const double needed_N = std::abs(s.primary_torque_Nm) *
                            std::cos(s.variator.half_wedge_angle_rad) /
                            (2.0 * primary_radius_m * s.friction().mu_max);
    if (needed_N >= s.start_force_N) {
      contradiction("clamp.start_force_N",
                    "found " + number_text(s.start_force_N) + ": the belt slips from the start, " +
                        number_text(s.primary_torque_Nm) + " Nm need more than " +
                        number_text(std::ceil(needed_N)) + " N");
    }
  }

  ScenarioResult result_;
  std::string source_;
  std::map<std::string, std::string> position_;
};

}  // namespace

ScenarioResult parse_scenario(const std::vector<ScenarioLayer>& layers) {
  Parser parser;
  for (const ScenarioLayer& layer : layers) parser.apply(layer);
  return parser.finish();
}

ScenarioLayer setting_layer(const std::string& key_and_value) {
  ScenarioLayer layer{"--set " + key_and_value, key_and_value};
  const auto equals = key_and_value.find('=');
  if (equals == std::string::npos) return layer;
  try {
    static_cast<void>(toml::parse(key_and_value));
  } catch (const toml::parse_error&) {
    layer.text = key_and_value.substr(0, equals) + "=\"" + key_and_value.substr(equals + 1) + "\"";
  }
  return layer;
}

}  // namespace beltgrip::sim
