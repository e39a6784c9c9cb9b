#include "daemon/core/config/config_model.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <variant>

#include "daemon/core/config/config_document.h"
#include "daemon/core/config/config_options.h"

namespace beltgrip::daemon {
namespace {

using estimator::effect_rows;
using estimator::EffectRow;
using estimator::MachineEffects;

constexpr std::size_t kFileSizeMax = std::size_t{1} << 20;
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
    const auto keys = effect_rows();
    const auto of_this = [&](const EffectRow& key) { return key.id == section.key; };
    if (section.type != TomlType::kTable || std::none_of(keys.begin(), keys.end(), of_this)) {
      std::vector<std::string> names;
      for (const EffectRow& key : keys) names.emplace_back(key.id);
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
      for (const EffectRow& key : keys) {
        if (of_this(key)) names += (names.empty() ? "" : ", ") + std::string(key.parameter);
      }
      if (std::none_of(keys.begin(), keys.end(), [&](const EffectRow& key) {
            return of_this(key) && key.parameter == node.key;
          })) {
        fail(node.line, "effects." + section.key + "." + node.key +
                            ": found an unknown key, expected one of " + names);
      }
      effect.parameters[node.key] = number_of("effects." + section.key, node);
    }
    const auto row = std::find_if(keys.begin(), keys.end(), of_this);
    if (!takes_role(*row, effect.role)) {
      std::string roles;
      for (const estimator::EffectRole& each : row->roles) {
        const bool last = &each == &row->roles.back();
        roles += (roles.empty() ? "" : last ? " or " : ", ") + std::string(each.role);
      }
      fail(section.line, "effects." + section.key + ".role: found " + in_quotes(effect.role) +
                             ", expected " + roles);
    }
    model_.effects[section.key] = effect;
  }

  std::string name_;
  ModelFile model_;
};

}  // namespace

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
  for (const EffectRow& row : effect_rows()) {
    const auto effect = model.effects.find(std::string(row.id));
    if (effect == model.effects.end()) continue;
    const auto found = effect->second.parameters.find(std::string(row.parameter));
    if (found == effect->second.parameters.end()) continue;
    double MachineEffects::*const value = value_of(row, effect->second.role);
    if (value != nullptr) out.*value += found->second;
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
