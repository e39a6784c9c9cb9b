#include "daemon/core/config/options/config_model.h"

#include <algorithm>
#include <cmath>

#include "can_dbc/text/number_text.h"
#include "daemon/core/config/options/config_options.h"
#include "daemon/core/config/options/option_reader.h"
#include "daemon/core/config/toml/config_document.h"

namespace beltgrip::daemon {
namespace {

using estimator::effect_rows;
using estimator::EffectRow;
using estimator::MachineEffects;

constexpr std::size_t kFileSizeMax = std::size_t{1} << 20;

using Kind = OptionRow::Kind;

constexpr OptionRow key(std::string_view section, std::string_view name, std::string_view unit,
                        std::string_view help) {
  OptionRow row;
  row.section = section;
  row.key = name;
  row.kind = Kind::kNumber;
  row.unit = unit;
  row.help = help;
  return row;
}

constexpr OptionRow kFriction[] = {
    key("friction", "mu_max", "", "Peak of the traction curve."),
    key("friction", "peak_slip_overdrive_percent", "%",
        "Slip at the peak, at the overdrive end stop."),
    key("friction", "peak_slip_low_percent", "%", "The same at the low end stop."),
    key("friction", "shape_N_overdrive", "",
        "Departure of the traction curve from the nominal one at its knot N, at the overdrive end "
        "stop."),
    key("friction", "shape_N_low", "", "The same at the low end stop."),
};

constexpr OptionRow kDriveline[] = {
    key("driveline", "deformation_per_kN", "1/kN",
        "Share of the ratio that the deformation of the pulleys takes, per clamping force."),
    key("driveline", "deformation_per_kN2", "1/kN^2", "And per square of it."),
    key("driveline", "loss_constant_Nm", "Nm", "Torque that is lost before the belt, constant."),
    key("driveline", "loss_per_rad_s_Nm", "Nm s/rad", "And per speed of the primary pulley."),
    key("driveline", "loss_per_kN_Nm", "Nm/kN", "And per clamping force."),
    key("driveline", "ratio_overdrive_relative", "",
        "By which share the ratio at the overdrive end stop is greater than in [variator]."),
    key("driveline", "ratio_low_relative", "", "The same at the low end stop."),
    key("driveline", "secondary_inertia_kg_m2", "kg m2",
        "Inertia between the belt and secondary_torque."),
    key("driveline", "secondary_loss_constant_Nm", "Nm",
        "Torque that is lost between the belt and secondary_torque, constant."),
    key("driveline", "secondary_loss_per_rad_s_Nm", "Nm s/rad",
        "And per speed of the secondary pulley."),
    key("driveline", "secondary_loss_per_kN_Nm", "Nm/kN", "And per clamping force."),
    key("driveline", "command_offset_Pa", "Pa",
        "By how much the secondary pressure is above its command."),
    key("driveline", "command_gain", "", "And by which share of the command."),
};

// "shape_N_low" stands for any N.
bool is_called(const OptionRow& option, std::string_view name) {
  constexpr std::string_view kAny = "_N_";
  const std::size_t any = option.key.find(kAny);
  if (any == std::string_view::npos) return name == option.key;
  return name.starts_with(option.key.substr(0, any + 1)) &&
         name.ends_with(option.key.substr(any + kAny.size() - 1));
}

const OptionRow* row_of(std::span<const OptionRow> options, std::string_view name) {
  for (const OptionRow& option : options) {
    if (is_called(option, name)) return &option;
  }
  return nullptr;
}

std::string decimal_text(double value) {
  std::string text = number_text(value);
  if (text.find_first_of(".en") == std::string::npos) text += ".0";
  return text;
}

class Reader {
 public:
  Reader(const std::string& name, const ModelFile& base) : errors_(name, found_), model_(base) {}

  ModelFile read(const std::string& text) {
    const auto parsed = parse_toml(text);
    if (parsed) {
      for (const TomlNode& section : parsed->children) read_section(section);
    } else {
      errors_.add(parsed.error().line, "syntax", in_quotes(parsed.error().text), "TOML");
    }
    if (!found_.empty()) throw ModelError{false, found_.front().text};
    return model_;
  }

 private:
  void read_section(const TomlNode& section) {
    const std::vector<std::string> names{"variator", "friction", "driveline", "effects", "learned"};
    if (section.type != TomlType::kTable) {
      errors_.add(section.line, section.key, section.found(), "a section");
    } else if (section.key == "variator") {
      read_variator(section);
    } else if (section.key == "friction") {
      read_numbers(section, kFriction, model_.friction);
    } else if (section.key == "driveline") {
      read_numbers(section, kDriveline, model_.driveline);
    } else if (section.key == "effects") {
      for (const TomlNode& effect : section.children) read_effect(effect);
    } else if (section.key == "learned") {
      for (const TomlNode& term : section.children) {
        read_learned(term, model_.learned[term.key] = {}, errors_);
      }
    } else {
      errors_.add(section.line, section.key, "an unknown section",
                  "variator, friction, driveline, effects.ID or learned.NAME" +
                      nearest_hint(section.key, names));
    }
  }

  void read_variator(const TomlNode& section) {
    Config config;
    config.variator = model_.variator;
    std::vector<Option> options;
    for (const Option& option : option_table()) {
      if (option.section == "variator") options.push_back(option);
    }
    for (const TomlNode& node : section.children) {
      const std::string where = key_of(section.key, node.key);
      const auto option = std::find_if(options.begin(), options.end(),
                                       [&](const Option& each) { return each.key == node.key; });
      if (option == options.end()) {
        errors_.add(node.line, where, "an unknown key",
                    "a key of [variator]" + nearest_hint(node.key, key_names(options)));
      } else if (read_value(*option, where, node, config, errors_)) {
        model_.variator_keys.push_back(node.key);
      }
    }
    model_.variator = config.variator;
  }

  void read_numbers(const TomlNode& section, std::span<const OptionRow> options,
                    std::map<std::string, double>& into) {
    for (const TomlNode& node : section.children) {
      const OptionRow* option = row_of(options, node.key);
      if (option == nullptr) {
        add_unknown_key(section.key, node, key_names(options), errors_);
      } else if (!fits(*option, node)) {
        errors_.add(node.line, key_of(section.key, node.key), node.found(), expected_text(*option));
      } else {
        into[node.key] = node.number;
      }
    }
  }

  // Parameters and role of an effect as in its rows of the table of effects.
  void read_effect(const TomlNode& section) {
    const std::string where = key_of("effects", section.key);
    std::vector<std::string> effects;
    std::vector<OptionRow> options;
    const EffectRow* effect_row = nullptr;
    for (const EffectRow& row : effect_rows()) {
      effects.emplace_back(row.id);
      if (row.id != section.key) continue;
      if (effect_row == nullptr) effect_row = &row;
      options.push_back(key(row.id, row.parameter, row.unit, row.equation));
    }
    if (section.type != TomlType::kTable || effect_row == nullptr) {
      errors_.add(section.line, where, "an unknown effect",
                  "the name of an effect" + nearest_hint(section.key, effects));
      return;
    }
    TomlNode parameters = section;
    parameters.key = where;
    std::erase_if(parameters.children, [](const TomlNode& node) { return node.key == "role"; });
    ModelEffect& effect = model_.effects[section.key] = {};
    if (const TomlNode* role = section.find("role")) {
      effect.role = role->text;
      if (role->type != TomlType::kText) {
        errors_.add(role->line, key_of(where, "role"), role->found(), "the name of a role");
      }
    }
    read_numbers(parameters, options, effect.parameters);
    if (takes_role(*effect_row, effect.role)) return;
    std::vector<std::string> roles;
    for (const estimator::EffectRole& each : effect_row->roles) roles.emplace_back(each.role);
    errors_.add(section.line, key_of(where, "role"), in_quotes(effect.role), names_text(roles));
  }

  std::vector<ConfigError> found_;
  ConfigErrors errors_;
  ModelFile model_;
};

}  // namespace

std::span<const OptionRow> friction_options() { return kFriction; }
std::span<const OptionRow> driveline_options() { return kDriveline; }

bool is_friction_key(std::string_view name) { return row_of(kFriction, name) != nullptr; }
bool is_driveline_key(std::string_view name) { return row_of(kDriveline, name) != nullptr; }

ModelFile parse_model(const std::string& text, const std::string& name, const ModelFile& base) {
  return Reader(name, base).read(text);
}

ModelFile read_model(const std::string& path, const ModelFile& base, FileKind kind) {
  const Result<std::string, Unreadable> text = read_text_file(path, kFileSizeMax, kind);
  if (!text) {
    throw ModelError{
        true, path + ": found no readable file (" + text.error().reason + "), expected a model"};
  }
  return parse_model(*text, path, base);
}

std::string model_text(const ModelFile& model) {
  std::string out;
  for (const std::string& line : model.comments) out += "# " + line + "\n";
  out += "\n[variator]\n";
  Config config;
  config.variator = model.variator;
  for (const Option& option : option_table()) {
    if (option.section != "variator") continue;
    out += std::string(option.key) + " = " + decimal_text(option.number(config) / option.factor) +
           "\n";
  }
  const auto section = [&](const char* name, const std::map<std::string, double>& values) {
    out += "\n[" + std::string(name) + "]\n";
    for (const auto& [key, value] : values) out += key + " = " + decimal_text(value) + "\n";
  };
  section("friction", model.friction);
  section("driveline", model.driveline);
  for (const auto& [id, effect] : model.effects) {
    section(("effects." + id).c_str(), effect.parameters);
    if (!effect.role.empty()) out += "role = \"" + effect.role + "\"\n";
  }
  for (const auto& [name, learned] : model.learned) out += learned_text(name, learned);
  return out;
}

std::vector<estimator::LearnedTerm> learned_terms(const ModelFile& model) {
  std::vector<estimator::LearnedTerm> out;
  out.reserve(model.learned.size());
  for (const auto& [name, learned] : model.learned) out.push_back(term_of(name, learned));
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
  out.loss_per_kN_Nm += given("loss_per_kN_Nm");
  out.secondary_loss_constant_Nm += given("secondary_loss_constant_Nm");
  out.secondary_loss_per_rad_s_Nm += given("secondary_loss_per_rad_s_Nm");
  out.deformation_per_kN += given("deformation_per_kN");
  out.deformation_per_kN2 += given("deformation_per_kN2");
  out.end_stop_low += given("ratio_low_relative");
  out.end_stop_overdrive += given("ratio_overdrive_relative");
  return out;
}

}  // namespace beltgrip::daemon
