#include "tools/diagnose/model_file.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <string_view>
#include <variant>

#include "daemon/core/config_binding.h"
#include "daemon/core/config_document.h"
#include "daemon/core/config_options.h"
#include "tools/diagnose/effects/effect.h"
#include "tools/diagnose/variator_model.h"

namespace beltgrip::diagnose {
namespace {

using daemon::TomlNode;
using daemon::TomlType;

constexpr std::size_t kFileSizeMax = std::size_t{1} << 20;

bool is_friction(std::string_view name) {
  return name.starts_with("mu_") || name.starts_with("peak_") || name.starts_with("shape_");
}

// Name in the file and conversion of a nuisance.
struct Named {
  std::string name;
  double value;
};
Named to_file(int index, double value) {
  switch (index) {
    case kLnMuMax:
      return {"mu_max", std::exp(value)};
    case kLnPeakSlipOverdrive:
      return {"peak_slip_overdrive_percent", 100.0 * std::exp(value)};
    case kLnPeakSlipLow:
      return {"peak_slip_low_percent", 100.0 * std::exp(value)};
    case kLnRatioOverdrive:
      return {"ratio_overdrive_relative", std::expm1(value)};
    case kLnRatioLow:
      return {"ratio_low_relative", std::expm1(value)};
    default:
      return {std::string(default_nuisances()[static_cast<std::size_t>(index)].name), value};
  }
}

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
    auto parsed = daemon::parse_toml(text);
    if (const auto* error = std::get_if<daemon::TomlSyntaxError>(&parsed)) {
      fail(error->line, "syntax: " + error->text);
    }
    for (const TomlNode& section : std::get<TomlNode>(parsed).children) {
      if (section.type != TomlType::kTable) {
        fail(section.line, section.key + ": found " + section.found() + ", expected a section");
      }
      if (section.key == "variator") {
        read_variator(section);
      } else if (section.key == "friction") {
        read_numbers(section, model_.friction);
      } else if (section.key == "driveline") {
        read_numbers(section, model_.driveline);
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
    daemon::Config config;
    config.variator = model_.variator;
    for (const TomlNode& node : section.children) {
      const auto options = daemon::option_table();
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
    }
    model_.variator = config.variator;
  }

  void read_numbers(const TomlNode& section, std::map<std::string, double>& into) {
    for (const TomlNode& node : section.children) {
      if (!into.contains(node.key)) {
        std::string names;
        for (const auto& [name, value] : into) names += (names.empty() ? "" : ", ") + name;
        fail(node.line,
             section.key + "." + node.key + ": found an unknown key, expected one of " + names);
      }
      into[node.key] = number_of(section.key, node);
    }
  }

  void read_effect(const TomlNode& section) {
    const auto rows = effect_rows();
    if (std::none_of(rows.begin(), rows.end(),
                     [&](const EffectRow& row) { return row.id == section.key; })) {
      fail(section.line, "effects." + section.key + ": found an unknown effect");
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
      const bool known =
          node.key == "at" || std::any_of(rows.begin(), rows.end(), [&](const EffectRow& row) {
            return row.id == section.key && row.parameter == node.key;
          });
      if (!known) {
        fail(node.line, "effects." + section.key + "." + node.key + ": found an unknown key");
      }
      effect.parameters[node.key] = number_of("effects." + section.key, node);
    }
    model_.effects[section.key] = effect;
  }

  std::string name_;
  ModelFile model_;
};

}  // namespace

ModelFile parse_model(const std::string& text, const std::string& name, const ModelFile& base) {
  return Reader(name, base).read(text);
}

ModelFile read_model(const std::string& path, const ModelFile& base) {
  std::string text;
  if (const std::string reason = daemon::read_text_file(path, kFileSizeMax, text);
      !reason.empty()) {
    throw ModelError{true, path + ": found no readable file (" + reason + "), expected a model"};
  }
  return parse_model(text, path, base);
}

ModelFile nominal_model(const estimator::VariatorParameters& variator) {
  ModelFile out;
  out.variator = variator;
  const NuisanceTable table = default_nuisances();
  for (int i = 0; i < kNuisanceCount; ++i) {
    const Named named = to_file(i, table[static_cast<std::size_t>(i)].nominal);
    (is_friction(named.name) ? out.friction : out.driveline)[named.name] = named.value;
  }
  return out;
}

NuisanceTable nuisances_of(const ModelFile& model) {
  NuisanceTable table = default_nuisances();
  for (int i = 0; i < kNuisanceCount; ++i) {
    auto& row = table[static_cast<std::size_t>(i)];
    const std::string name = to_file(i, row.nominal).name;
    const auto& section = is_friction(name) ? model.friction : model.driveline;
    const auto found = section.find(name);
    if (found == section.end()) continue;
    switch (i) {
      case kLnMuMax:
        row.nominal = std::log(found->second);
        break;
      case kLnPeakSlipOverdrive:
      case kLnPeakSlipLow:
        row.nominal = std::log(0.01 * found->second);
        break;
      case kLnRatioOverdrive:
      case kLnRatioLow:
        row.nominal = std::log1p(found->second);
        break;
      default:
        row.nominal = found->second;
    }
  }
  return table;
}

void store_machine(const Eigen::VectorXd& nuisance, ModelFile& model) {
  for (int i = 0; i < kNuisanceCount; ++i) {
    const Named named = to_file(i, nuisance[i]);
    (is_friction(named.name) ? model.friction : model.driveline)[named.name] = named.value;
  }
}

Eigen::VectorXd slot_values(const ModelFile& model, const std::vector<Slot>& slots) {
  Eigen::VectorXd out = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(slots.size()));
  for (std::size_t i = 0; i < slots.size(); ++i) {
    const Slot& slot = slots[i];
    const auto effect = model.effects.find(std::string(slot.row->id));
    if (effect == model.effects.end()) continue;
    const auto value = effect->second.parameters.find(std::string(slot.row->parameter));
    if (value == effect->second.parameters.end()) continue;
    const auto at = effect->second.parameters.find("at");
    const bool counted = slot.counts_experiments();
    if (counted && (at == effect->second.parameters.end() || at->second != slot.index)) continue;
    if (slot.row->id == "channel_skew" && effect->second.role != slot.role) continue;
    // A slot of several inputs: the first one that exists.
    if (slot.row->id != "channel_skew" && !slot.role.empty() && slot.role != effect->second.role) {
      continue;
    }
    out[static_cast<Eigen::Index>(i)] = slot.from_contract(value->second, model.friction);
  }
  return out;
}

void store_effects(const std::vector<Slot>& slots, const Eigen::VectorXd& value,
                   const Eigen::VectorXd& nuisance, ModelFile& model) {
  for (std::size_t i = 0; i < slots.size(); ++i) {
    const double v = value[static_cast<Eigen::Index>(i)];
    if (v == 0.0) continue;
    const Slot& slot = slots[i];
    ModelEffect& effect = model.effects[std::string(slot.row->id)];
    effect.parameters[std::string(slot.row->parameter)] = slot.to_contract(v, nuisance);
    if (slot.counts_experiments()) effect.parameters["at"] = slot.index;
    if (!slot.role.empty()) effect.role = std::string(slot.role);
  }
}

std::string model_text(const ModelFile& model) {
  std::string out;
  for (const std::string& line : model.comments) out += "# " + line + "\n";
  out += "\n[variator]\n";
  daemon::Config config;
  config.variator = model.variator;
  for (const daemon::Option& option : daemon::option_table()) {
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

}  // namespace beltgrip::diagnose
