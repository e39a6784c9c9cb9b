#include "daemon/core/config/load/load_config.h"
#include "daemon/core/config/options/config.h"

#include <algorithm>
#include <cmath>
#include <filesystem>

#include "daemon/core/config/load/config_assumed.h"
#include "daemon/core/config/load/config_checks.h"
#include "daemon/core/config/load/config_include.h"
#include "daemon/core/config/load/config_reload.h"
#include "daemon/core/config/load/signal_catalogue.h"
#include "daemon/core/config/options/config_bus.h"
#include "daemon/core/config/options/config_model.h"
#include "daemon/core/config/options/config_uds.h"
#include "daemon/core/config/options/option_reader.h"

namespace beltgrip::daemon {

namespace {

// Reads one configuration; the steps in the order of load().
class Loader {
 public:
  Loader(const std::string& path, FileKind kind, ConfigResult& result)
      : file_{path, kind},
        directory_(std::filesystem::path(path).parent_path().string()),
        result_(result),
        errors_(path, result.errors),
        catalogue_(kind),
        further_catalogue_(kind) {}

  void load(ConfigScope scope);
  void read_instead(std::shared_ptr<const TableSource> table) { config_.table = std::move(table); }

 private:
  void check_keys();
  void check_keys_of(const TomlNode& section);
  void read_options();
  void read_sensors();
  void read_signals();
  void read_columns();
  void read_roles(const TomlNode& signals);
  void read_protections();
  void read_catalogue(const std::vector<std::string>& paths, const std::string& key,
                      std::uint32_t line, SignalCatalogue& catalogue);
  // The bus that the role's value names; nothing when an error was added.
  std::optional<std::uint8_t> bus_of(const std::string& key, const TomlNode& node);
  void read_model_file();
  void settle_sensors();
  estimator::ChannelAccuracy accuracy(Role role) const;

  const TomlNode* section(std::string_view name) const { return section_of(root_, name); }
  bool has_role(Role role) const;
  bool has_further_dbc() const { return config_.further_bus && !config_.further_bus->dbc.empty(); }

  ConfigFile file_;
  std::string directory_;
  ConfigResult& result_;
  ConfigErrors errors_;
  TomlNode root_;
  Config config_;
  SignalCatalogue catalogue_, further_catalogue_;
  SensorTexts sensors_;
  std::vector<std::string> model_keys_;  // of [variator], that the model file states
};

void Loader::load(ConfigScope scope) {
  if (!read_document(file_, root_, config_.files, errors_, result_.warnings)) return;
  check_keys();
  read_options();
  read_sensors();
  if (scope != ConfigScope::kVariator) read_signals();
  if (scope == ConfigScope::kAll) read_model_file();
  check_bus(config_, root_, errors_);
  check_numbers(config_, root_, errors_);
  if (scope == ConfigScope::kAll) check_command(config_, root_, errors_);
  if (!result_.errors.empty()) return;
  std::sort(config_.roles.begin(), config_.roles.end(),
            [](const RoleBinding& a, const RoleBinding& b) { return a.role < b.role; });
  config_.estimator.torque_is_engine = !has_role(Role::kPrimaryTorque);
  for (std::size_t i = 0; i < result_.stated.size(); ++i) {
    result_.stated[i] = accuracy(static_cast<Role>(i));
  }
  assume_beside(sensors_, result_);
  result_.left_out = left_out_constants(root_, model_keys_);
  if (scope == ConfigScope::kAll) assume(result_.left_out, sensors_, config_);
  settle_sensors();
  result_.config = std::move(config_);
}

estimator::ChannelAccuracy Loader::accuracy(Role role) const {
  const SensorText& text = sensors_[static_cast<std::size_t>(role)];
  return {text.bias.value_or(0.0), text.gain.value_or(0.0)};
}

void Loader::settle_sensors() {
  config_.sensors = {
      accuracy(Role::kPrimarySpeed), accuracy(Role::kSecondarySpeed),
      accuracy(Role::kSecondaryPressure),
      accuracy(config_.estimator.torque_is_engine ? Role::kEngineTorque : Role::kPrimaryTorque)};
  for (const RoleBinding& each : config_.roles) {
    if (each.role != Role::kSecondaryPressure || each.codec.is_float()) continue;
    config_.estimator.pressure_step_Pa =
        std::abs(each.factor * (each.codec.physical(1) - each.codec.physical(0)));
  }
}

bool Loader::has_role(Role role) const {
  return std::any_of(config_.roles.begin(), config_.roles.end(),
                     [&](const RoleBinding& each) { return each.role == role; });
}

void Loader::check_keys() {
  const auto sections = section_names();
  const std::vector<std::string> names(sections.begin(), sections.end());
  for (const TomlNode& node : root_.children) {
    if (std::find(sections.begin(), sections.end(), node.key) == sections.end()) {
      errors_.add(node.line, node.key,
                  node.type == TomlType::kTable ? "an unknown section" : "an unknown key",
                  "a section of the configuration" + nearest_hint(node.key, names));
    } else if (node.type != TomlType::kTable) {
      errors_.add(node.line, node.key, node.found(), "a section [" + node.key + "]");
    } else if (node.key != "protection") {  // its keys are names of messages
      check_keys_of(node);
    }
  }
}

void Loader::check_keys_of(const TomlNode& section) {
  std::vector<std::string> keys;
  for (const Option& option : option_table()) {
    if (option.section == section.key) keys.emplace_back(option.key);
  }
  for (std::size_t i = 0; i < kRoleCount; ++i) {
    const Role role = static_cast<Role>(i);
    if (section.key == "signals" ||
        (section.key == "sensors" && !sensor_options(role_dimension(role)).empty())) {
      keys.emplace_back(role_name(role));
    }
  }
  for (const TomlNode& child : section.children) {
    if (std::find(keys.begin(), keys.end(), child.key) != keys.end()) continue;
    if (section.key == "bus" && child.type == TomlType::kTable) {
      read_further_bus(child, config_, errors_);
      continue;
    }
    errors_.add(child.line, key_of(section.key, child.key), "an unknown key",
                "a key of [" + section.key + "]" + nearest_hint(child.key, keys));
  }
}

void Loader::read_options() {
  for (const Option& option : option_table()) {
    const TomlNode* in = section(option.section);
    const TomlNode* node = in == nullptr ? nullptr : in->find(option.key);
    if (node == nullptr) continue;
    read_value(option, key_of(option.section, option.key), *node, config_, errors_);
  }
}

void Loader::read_sensors() {
  const TomlNode* sensors = section("sensors");
  if (sensors == nullptr) return;
  for (std::size_t i = 0; i < kRoleCount; ++i) {
    const Role role = static_cast<Role>(i);
    const TomlNode* node = sensors->find(role_name(role));
    const auto options = sensor_options(role_dimension(role));
    if (node == nullptr || options.empty()) continue;
    const std::string key = key_of("sensors", role_name(role));
    if (node->type != TomlType::kTable) {
      errors_.add(node->line, key, node->found(),
                  "{ " + std::string(options.front().key) + " = ..., gain = ... }");
      continue;
    }
    read_keys(options, key, *node, sensors_[i], errors_);
  }
}

void Loader::read_columns() {
  read_catalogue(config_.dbc, "bus.dbc", line_of(root_, "bus", "dbc"), catalogue_);
  const TomlNode* signals = section("signals");
  for (std::size_t i = 0; i < kRoleCount; ++i) {
    const Role role = static_cast<Role>(i);
    const TomlNode* node = signals == nullptr ? nullptr : signals->find(role_name(role));
    auto binding = catalogue_.bind_column(role, node, config_.table->columns, errors_);
    if (binding) config_.roles.push_back(std::move(*binding));
  }
  config_.control = Control::kObserve;
}

void Loader::read_signals() {
  if (config_.table) {
    read_columns();
    return;
  }
  const std::uint32_t line = line_of(root_, "bus", "dbc");
  if (config_.dbc.empty()) {
    const TomlNode* bus = section("bus");
    const TomlNode* node = bus == nullptr ? nullptr : bus->find("dbc");
    // An array that holds something else than paths has been reported.
    if (node == nullptr || (node->type == TomlType::kArray && node->children.empty())) {
      errors_.add(line, "bus.dbc", "no file", "at least one DBC file: [\"vehicle.dbc\"]");
    }
    return;
  }
  read_catalogue(config_.dbc, "bus.dbc", line, catalogue_);
  const std::optional<FurtherBus>& further = config_.further_bus;
  if (further && has_further_dbc()) {
    const FurtherBus& bus = *further;
    read_catalogue(bus.dbc, key_of("bus", bus.name) + ".dbc", line_of(root_, "bus", bus.name),
                   further_catalogue_);
  }
  const TomlNode* signals = section("signals");
  if (catalogue_.complete() && further_catalogue_.complete() && signals != nullptr) {
    read_roles(*signals);
    check_uds(config_, *signals, errors_);
  }
  if (result_.errors.empty()) check_further_bus(config_, root_, errors_);
  check_required_roles(config_, root_, errors_);
  if (catalogue_.complete()) read_protections();
}

void Loader::read_roles(const TomlNode& signals) {
  for (std::size_t i = 0; i < kRoleCount; ++i) {
    const Role role = static_cast<Role>(i);
    const TomlNode* node = signals.find(role_name(role));
    if (node == nullptr) continue;
    const std::optional<std::uint8_t> bus = bus_of(key_of("signals", role_name(role)), *node);
    const SignalCatalogue& catalogue =
        bus.value_or(0) != 0 && has_further_dbc() ? further_catalogue_ : catalogue_;
    std::optional<RoleBinding> binding = catalogue.bind(role, *node, errors_);
    if (!binding || !bus) continue;
    binding->bus = *bus;
    config_.roles.push_back(std::move(*binding));
  }
}

void Loader::read_protections() {
  const TomlNode* protections = section("protection");
  if (protections == nullptr) return;
  for (const TomlNode& node : protections->children) {
    const std::optional<MessageProtection> found = catalogue_.protect(node, errors_);
    if (!found) continue;
    const bool used =
        std::any_of(config_.roles.begin(), config_.roles.end(), [&](const RoleBinding& role) {
          return !role.uds && role.bus == 0 && role.id == found->id;
        });
    const bool twice =
        std::any_of(config_.protections.begin(), config_.protections.end(),
                    [&](const MessageProtection& each) { return each.id == found->id; });
    if (!used || twice) {
      errors_.add(node.line, key_of("protection", node.key),
                  twice ? "a second entry for one message" : "a message without a role",
                  twice ? "one" : "a message of [bus] that [signals] names");
      continue;
    }
    config_.protections.push_back(*found);
  }
}

void Loader::read_catalogue(const std::vector<std::string>& paths, const std::string& key,
                            std::uint32_t line, SignalCatalogue& catalogue) {
  for (const std::string& path : paths) {
    catalogue.add_file(key, path, directory_, line, errors_, result_.warnings);
    config_.files.push_back((std::filesystem::path(directory_) / path).string());
  }
  catalogue.check_identifiers(key, line, errors_);
}

std::optional<std::uint8_t> Loader::bus_of(const std::string& key, const TomlNode& node) {
  const TomlNode* bus = node.find("bus");
  // What is no text is reported with the role's other keys.
  if (node.type != TomlType::kTable || bus == nullptr || bus->type != TomlType::kText) return 0;
  if (config_.further_bus && bus->text == config_.further_bus->name) return 1;
  errors_.add(bus->line, key + ".bus", in_quotes(bus->text),
              config_.further_bus ? in_quotes(config_.further_bus->name) + ", or no such key"
                                  : "a bus that the file has as [bus.NAME]");
  return {};
}

// The model's [variator] wins over the configuration's.
void Loader::read_model_file() {
  if (config_.model.empty()) return;
  ModelFile base;
  base.variator = config_.variator;
  const std::string path = (std::filesystem::path(directory_) / config_.model).string();
  try {
    const ModelFile model = read_model(path, base, file_.kind);
    config_.files.push_back(path);
    config_.variator = model.variator;
    model_keys_ = model.variator_keys;
    config_.corrected = whole_machine(model);
    config_.learned = learned_terms(model);
  } catch (const ModelError& error) {
    result_.errors.push_back({error.missing_file ? kNoInput : kConfiguration, error.text});
  }
}

}  // namespace

std::string assumed_text(const Config& config) {
  if (config.assumed.empty()) return {};
  std::string text = "assumed, as the configuration leaves them out: ";
  for (const std::string& key : config.assumed) {
    text += (&key == &config.assumed.front() ? "" : ", ") + key;
  }
  return text;
}

ConfigResult load_config(const std::string& path, ConfigScope scope) {
  ConfigResult result;
  Loader(path, FileKind::kAny, result).load(scope);
  return result;
}

ConfigResult load_config(const std::string& path, std::shared_ptr<const TableSource> table) {
  ConfigResult result;
  Loader loader(path, FileKind::kAny, result);
  loader.read_instead(std::move(table));
  loader.load(ConfigScope::kAll);
  return result;
}

ConfigResult reload_config(const std::string& path) {
  ConfigResult result;
  Loader(path, FileKind::kRegular, result).load(ConfigScope::kAll);
  return result;
}

}  // namespace beltgrip::daemon
