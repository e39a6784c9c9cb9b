#include "daemon/core/config/config_model.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <variant>

#include "daemon/core/config/config_binding.h"
#include "daemon/core/config/config_document.h"
#include "daemon/core/config/config_options.h"

namespace beltgrip::daemon {
namespace {

using estimator::MachineEffects;

constexpr std::size_t kFileSizeMax = std::size_t{1} << 20;
constexpr std::array<std::string_view, 5> kSkewed{
    "primary_speed", "secondary_speed", "secondary_pressure", "primary_torque", "engine_torque"};

constexpr std::array kEffectKeys{
    EffectKey{"torque_bias", "bias_Nm", &MachineEffects::torque_bias_Nm},
    EffectKey{"torque_gain", "gain", &MachineEffects::torque_gain},
    EffectKey{"inertia_torque", "inertia_kg_m2", &MachineEffects::inertia_kg_m2},
    EffectKey{"torque_delay", "delay_s", &MachineEffects::torque_delay_s},
    EffectKey{"torque_loss", "constant_Nm", &MachineEffects::loss_constant_Nm},
    EffectKey{"torque_loss", "per_kN_Nm", &MachineEffects::loss_per_kN_Nm},
    EffectKey{"torque_loss", "per_rad_s_Nm", &MachineEffects::loss_per_rad_s_Nm},
    EffectKey{"centrifugal_force", "coefficient_N_s2", &MachineEffects::centrifugal_N_s2},
    EffectKey{"pressure_offset", "offset_Pa", &MachineEffects::pressure_offset_Pa},
    EffectKey{"pressure_gain", "gain", &MachineEffects::pressure_gain},
    EffectKey{"spring_force", "force_N", &MachineEffects::spring_N},
    EffectKey{"hydraulic_lag", "time_constant_s", &MachineEffects::lag_time_constant_s},
    EffectKey{"hydraulic_lag", "delay_s", &MachineEffects::lag_delay_s},
    EffectKey{"clamp_hysteresis", "force_N", &MachineEffects::hysteresis_N},
    EffectKey{"pulley_deformation", "per_kN", &MachineEffects::deformation_per_kN},
    EffectKey{"pulley_deformation", "per_kN2", &MachineEffects::deformation_per_kN2},
    EffectKey{"radius_tilt", "per_Nm", &MachineEffects::tilt_per_Nm},
    EffectKey{"end_stop_ratio", "low", &MachineEffects::end_stop_low},
    EffectKey{"end_stop_ratio", "overdrive", &MachineEffects::end_stop_overdrive},
    EffectKey{"ratio_creep", "rate", &MachineEffects::creep_rate},
    EffectKey{"friction_temperature", "per_K", &MachineEffects::friction_per_K},
    EffectKey{"friction_speed", "per_ln_speed", &MachineEffects::friction_per_ln_speed},
    EffectKey{"friction_load", "exponent", &MachineEffects::friction_load_exponent},
    EffectKey{"friction_ratio", "relative", &MachineEffects::friction_low_relative},
    EffectKey{"friction_shape", "peak_slip_percent", &MachineEffects::peak_slip_percent},
    EffectKey{"friction_shape", "fall_per_percent", &MachineEffects::fall_per_percent},
    EffectKey{"wear", "step", &MachineEffects::wear_step},
    EffectKey{"wear", "at", &MachineEffects::wear_from},
    EffectKey{"wear", "per_experiment", &MachineEffects::wear_per_experiment},
    EffectKey{"warm_up_drift", "per_kJ", &MachineEffects::warm_up_per_kJ},
    EffectKey{"warm_up_drift", "per_start", &MachineEffects::warm_up_per_start},
    EffectKey{"speed_scale", "primary", &MachineEffects::primary_speed_scale},
    EffectKey{"speed_scale", "secondary", &MachineEffects::secondary_speed_scale},
    EffectKey{"speed_ripple", "primary", &MachineEffects::primary_ripple},
    EffectKey{"speed_ripple", "secondary", &MachineEffects::secondary_ripple},
    EffectKey{"channel_skew", "delay_s", nullptr},
};

constexpr std::array<std::string_view, 8> kDrivelineKeys{
    "deformation_per_kN",       "loss_constant_Nm",   "loss_per_rad_s_Nm",
    "ratio_overdrive_relative", "ratio_low_relative", "secondary_inertia_kg_m2",
    "command_offset_Pa",        "command_gain"};

std::string number(double value) {
  char buffer[32];
  const auto end = std::to_chars(buffer, buffer + sizeof buffer, value).ptr;
  std::string text(buffer, end);
  if (text.find_first_of(".en") == std::string::npos) text += ".0";
  return text;
}

class Reader {
 public:
  Reader(const std::string& name, const ModelFile& base) : name_(name), model_(base) {}

  ModelFile read(const std::string& text) {
    auto parsed = parse_toml(text);
    if (const auto* error = std::get_if<TomlSyntaxError>(&parsed)) {
      fail(error->line, "syntax: " + error->text);
    }
    for (const TomlNode& section : std::get<TomlNode>(parsed).children) {
      if (section.type != TomlType::kTable) {
        fail(section.line, section.key + ": found " + section.found() + ", expected a section");
      }
      if (section.key == "variator") {
        read_variator(section);
      } else if (section.key == "friction") {
        read_numbers(section, is_friction_key, model_.friction);
      } else if (section.key == "driveline") {
        read_numbers(section, is_driveline_key, model_.driveline);
      } else if (section.key == "effects") {
        for (const TomlNode& effect : section.children) read_effect(effect);
      } else {
        fail(section.line, section.key +
                               ": found an unknown section, expected variator, friction, "
                               "driveline or effects.ID");
      }
    }
    return model_;
  }

 private:
  [[noreturn]] void fail(std::uint32_t line, const std::string& what) const {
    throw ModelError{false, name_ + ":" + std::to_string(line) + ": " + what};
  }
  double number_of(const std::string& where, const TomlNode& node) const {
    if (!node.is_number() || !std::isfinite(node.number)) {
      fail(node.line, where + "." + node.key + ": found " + node.found() + ", expected a number");
    }
    return node.number;
  }

  void read_variator(const TomlNode& section) {
    Config config;
    config.variator = model_.variator;
    for (const TomlNode& node : section.children) {
      const auto options = option_table();
      const auto option = std::find_if(options.begin(), options.end(), [&](const auto& each) {
        return each.section == "variator" && each.key == node.key;
      });
      if (option == options.end()) {
        fail(node.line, "variator." + node.key +
                            ": found an unknown key, expected one of the "
                            "configuration's [variator]");
      }
      const double value = number_of("variator", node);
      if (!(value >= option->minimum && value <= option->maximum)) {
        fail(node.line, "variator." + node.key + ": found " + node.found() +
                            ", expected a number from " + number(option->minimum) + " to " +
                            number(option->maximum));
      }
      option->number(config) = value * option->factor;
      model_.variator_keys.push_back(node.key);
    }
    model_.variator = config.variator;
  }

  void read_numbers(const TomlNode& section, bool (*known)(std::string_view),
                    std::map<std::string, double>& into) {
    for (const TomlNode& node : section.children) {
      if (!known(node.key)) {
        fail(node.line, section.key + "." + node.key + ": found an unknown key");
      }
      into[node.key] = number_of(section.key, node);
    }
  }

  void read_effect(const TomlNode& section) {
    const auto keys = effect_keys();
    const auto of_this = [&](const EffectKey& key) { return key.effect == section.key; };
    if (section.type != TomlType::kTable || std::none_of(keys.begin(), keys.end(), of_this)) {
      std::vector<std::string> names;
      for (const EffectKey& key : keys) names.emplace_back(key.effect);
      fail(section.line, "effects." + section.key + ": found an unknown effect" +
                             nearest_hint(section.key, names));
    }
    ModelEffect effect;
    for (const TomlNode& node : section.children) {
      if (node.key == "role") {
        if (node.type != TomlType::kText) {
          fail(node.line, "effects." + section.key + ".role: found " + node.found() +
                              ", expected the name of a role");
        }
        effect.role = node.text;
        continue;
      }
      std::string names;
      for (const EffectKey& key : keys) {
        if (of_this(key)) names += (names.empty() ? "" : ", ") + std::string(key.parameter);
      }
      if (std::none_of(keys.begin(), keys.end(), [&](const EffectKey& key) {
            return of_this(key) && key.parameter == node.key;
          })) {
        fail(node.line, "effects." + section.key + "." + node.key +
                            ": found an unknown key, expected one of " + names);
      }
      effect.parameters[node.key] = number_of("effects." + section.key, node);
    }
    if (section.key == "channel_skew" &&
        std::find(kSkewed.begin(), kSkewed.end(), effect.role) == kSkewed.end()) {
      fail(section.line, "effects.channel_skew.role: found " + in_quotes(effect.role) +
                             ", expected primary_speed, secondary_speed, secondary_pressure, "
                             "primary_torque or engine_torque");
    }
    model_.effects[section.key] = effect;
  }

  std::string name_;
  ModelFile model_;
};

}  // namespace

std::span<const EffectKey> effect_keys() { return kEffectKeys; }

bool is_friction_key(std::string_view name) {
  if (name == "mu_max" || name == "peak_slip_overdrive_percent" ||
      name == "peak_slip_low_percent") {
    return true;
  }
  // shape_N_overdrive, shape_N_low: departures of the curve from the nominal one.
  return name.starts_with("shape_") && (name.ends_with("_overdrive") || name.ends_with("_low"));
}

bool is_driveline_key(std::string_view name) {
  return std::find(kDrivelineKeys.begin(), kDrivelineKeys.end(), name) != kDrivelineKeys.end();
}

ModelFile parse_model(const std::string& text, const std::string& name, const ModelFile& base) {
  return Reader(name, base).read(text);
}

ModelFile read_model(const std::string& path, const ModelFile& base, FileKind kind) {
  std::string text;
  if (const std::string reason = read_text_file(path, kFileSizeMax, kind, text); !reason.empty()) {
    throw ModelError{true, path + ": found no readable file (" + reason + "), expected a model"};
  }
  return parse_model(text, path, base);
}

std::string model_text(const ModelFile& model) {
  std::string out;
  for (const std::string& line : model.comments) out += "# " + line + "\n";
  out += "\n[variator]\n";
  Config config;
  config.variator = model.variator;
  for (const Option& option : option_table()) {
    if (option.section != "variator") continue;
    out += std::string(option.key) + " = " + number(option.number(config) / option.factor) + "\n";
  }
  const auto section = [&](const char* name, const std::map<std::string, double>& values) {
    out += "\n[" + std::string(name) + "]\n";
    for (const auto& [key, value] : values) out += key + " = " + number(value) + "\n";
  };
  section("friction", model.friction);
  section("driveline", model.driveline);
  for (const auto& [id, effect] : model.effects) {
    section(("effects." + id).c_str(), effect.parameters);
    if (!effect.role.empty()) out += "role = \"" + effect.role + "\"\n";
  }
  return out;
}

MachineEffects machine_effects(const ModelFile& model) {
  MachineEffects out;
  for (const EffectKey& key : kEffectKeys) {
    const auto effect = model.effects.find(std::string(key.effect));
    if (effect == model.effects.end()) continue;
    const auto found = effect->second.parameters.find(std::string(key.parameter));
    if (found == effect->second.parameters.end()) continue;
    // Of the command: the measured pressure acts.
    if (key.effect == "hydraulic_lag" && effect->second.role == "command") continue;
    double MachineEffects::*value = key.value;
    if (value == nullptr) {
      const std::string& role = effect->second.role;
      value = role == "primary_speed"        ? &MachineEffects::primary_speed_delay_s
              : role == "secondary_speed"    ? &MachineEffects::secondary_speed_delay_s
              : role == "secondary_pressure" ? &MachineEffects::pressure_delay_s
                                             : &MachineEffects::torque_delay_s;
    }
    out.*value += found->second;
  }
  return out;
}

MachineEffects whole_machine(const ModelFile& model) {
  MachineEffects out = machine_effects(model);
  const auto given = [&](const char* name) {
    const auto found = model.driveline.find(name);
    return found == model.driveline.end() ? 0.0 : found->second;
  };
  out.loss_constant_Nm += given("loss_constant_Nm");
  out.loss_per_rad_s_Nm += given("loss_per_rad_s_Nm");
  out.deformation_per_kN += given("deformation_per_kN");
  out.end_stop_low += given("ratio_low_relative");
  out.end_stop_overdrive += given("ratio_overdrive_relative");
  return out;
}

}  // namespace beltgrip::daemon
