#include "daemon/core/config/config.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <iterator>

#include "daemon/core/config/config_binding.h"
#include "daemon/core/config/config_document.h"
#include "daemon/core/config/config_model.h"
#include "daemon/core/config/config_options.h"
#include "daemon/core/config/config_reload.h"
#include "daemon/core/config/config_uds.h"

namespace beltgrip::daemon {

namespace {

constexpr int kExitNoInput = 66;
constexpr std::size_t kSizeMax = std::size_t{1} << 20;  // of a configuration, with all its files
constexpr std::size_t kIncludeDepthMax = 8;             // files within each other
constexpr std::size_t kIncludedMax = 64;
constexpr std::size_t kInterfaceNameMax = 15;  // IFNAMSIZ - 1

// Reads one configuration; the steps in the order of load().
class Loader {
 public:
  Loader(const std::string& path, FileKind kind, ConfigResult& result)
      : path_(path),
        directory_(std::filesystem::path(path).parent_path().string()),
        kind_(kind),
        result_(result),
        errors_(path, result.errors),
        catalogue_(kind),
        further_catalogue_(kind) {}

  void load(ConfigScope scope);

 private:
  bool read_document();
  bool read_file(const std::string& path, const std::string& shown, const std::string& folder,
                 std::uint32_t first_line, std::uint32_t included_at, TomlNode& root);
  bool read_included(const std::string& path, const std::string& folder, TomlNode& own,
                     TomlNode& root);
  static void count_lines_from(std::uint32_t first_line, TomlNode& node);
  static void see_from(const std::string& folder, TomlNode& root);
  void put_over(TomlNode& own, TomlNode& root);
  void check_keys();
  void read_options();
  void read_option(const Option& option, const TomlNode& node);
  void read_number(const Option& option, const TomlNode& node);
  void read_paths(const std::string& key, const TomlNode& node, std::vector<std::string>& paths);
  void read_further_bus(const TomlNode& node);
  void read_identifiers(const TomlNode& node);
  void read_sensors();
  void read_sensor(Role role, const TomlNode& node);
  void read_signals();
  void read_protections();
  void check_required_roles(const TomlNode* signals);
  void read_catalogue(const std::vector<std::string>& paths, const std::string& key,
                      std::uint32_t line, SignalCatalogue& catalogue);
  // The bus that the role's value names; nothing when an error was added.
  std::optional<std::uint8_t> bus_of(const std::string& key, const TomlNode& node);
  void check_across();
  void check_interface(const std::string& key, std::uint32_t line, const std::string& name);
  void check_further_bus();
  void check_command();
  void read_model_file();
  void assume();
  void assume_constants();
  void assume_accuracy(Role role, bool decides);

  const TomlNode* section(std::string_view name) const;
  // The line of a key, else of its section, else 1.
  std::uint32_t line_of(std::string_view section_name, std::string_view key) const;
  bool has_role(Role role) const;

  std::string path_;
  std::string directory_;
  FileKind kind_;  // of all that is read
  ConfigResult& result_;
  ConfigErrors errors_;
  TomlNode root_;
  std::vector<std::string> reading_;  // the file that is read, and those that include it
  std::size_t included_ = 0;
  std::size_t size_ = 0;  // of all that was read
  Config config_;
  SignalCatalogue catalogue_, further_catalogue_;
  std::uint32_t further_line_ = 1;  // of [bus.NAME]
  std::array<estimator::ChannelAccuracy, kRoleCount> accuracies_{};
  struct Stated {
    bool bias = false, gain = false;
  };
  std::array<Stated, kRoleCount> accuracies_stated_{};
  std::vector<std::string> model_keys_;  // of [variator], that the model file states
};

std::string key_of(std::string_view section, std::string_view key) {
  return std::string(section) + "." + std::string(key);
}

std::string number_text(double value) {
  TomlNode node;
  node.type = TomlType::kNumber;
  node.number = value;
  return node.found();
}

std::string range_text(double minimum, double maximum) {
  return "a number from " + number_text(minimum) + " to " + number_text(maximum);
}

void Loader::load(ConfigScope scope) {
  if (!read_document()) return;
  check_keys();
  read_options();
  read_sensors();
  if (scope != ConfigScope::kVariator) read_signals();
  if (scope == ConfigScope::kAll) read_model_file();
  check_across();
  if (scope == ConfigScope::kAll) check_command();
  if (!result_.errors.empty()) return;
  std::sort(config_.roles.begin(), config_.roles.end(),
            [](const RoleBinding& a, const RoleBinding& b) { return a.role < b.role; });
  config_.estimator.torque_is_engine = !has_role(Role::kPrimaryTorque);
  if (scope == ConfigScope::kAll) assume();
  const auto accuracy = [&](Role role) { return accuracies_[static_cast<std::size_t>(role)]; };
  config_.sensors = {
      accuracy(Role::kPrimarySpeed), accuracy(Role::kSecondarySpeed),
      accuracy(Role::kSecondaryPressure),
      accuracy(config_.estimator.torque_is_engine ? Role::kEngineTorque : Role::kPrimaryTorque)};
  for (const RoleBinding& each : config_.roles) {
    if (each.role != Role::kSecondaryPressure || each.codec.is_float()) continue;
    config_.estimator.pressure_step_Pa =
        std::abs(each.factor * (each.codec.physical(1) - each.codec.physical(0)));
  }
  result_.config = std::move(config_);
}

bool Loader::read_document() { return read_file(path_, path_, "", 0, 0, root_); }

// One file, with what it includes under it. path: to open; shown: in errors; folder: of it, seen
// from that of the configuration; first_line: what its lines are counted from.
bool Loader::read_file(const std::string& path, const std::string& shown, const std::string& folder,
                       std::uint32_t first_line, std::uint32_t included_at, TomlNode& root) {
  std::string text;
  const std::string reason = read_text_file(path, kSizeMax - size_, kind_, text);
  if (!reason.empty() && included_at != 0) {
    errors_.add(included_at, "include", in_quotes(shown) + " that cannot be read (" + reason + ")",
                "the path of a configuration", kExitNoInput);
    return false;
  }
  if (!reason.empty()) {
    result_.errors.push_back({kExitNoInput, path + ": found no readable file (" + reason +
                                                "), expected a configuration in TOML"});
    return false;
  }
  if (text.size() > kSizeMax - size_) {
    errors_.add(first_line + 1, "size",
                included_at == 0 ? "more than 1 MiB" : "more than 1 MiB with the files before it",
                "a configuration in TOML");
    return false;
  }
  size_ += text.size();
  auto parsed = parse_toml(text);
  if (const auto* error = std::get_if<TomlSyntaxError>(&parsed)) {
    errors_.add(first_line + error->line, "syntax", in_quotes(error->text), "TOML");
    return false;
  }
  TomlNode own = std::move(std::get<TomlNode>(parsed));
  count_lines_from(first_line, own);
  if (included_at != 0) see_from(folder, own);
  config_.files.push_back(path);
  bool good = read_included(path, folder, own, root);
  put_over(own, root);
  return good;
}

bool Loader::read_included(const std::string& path, const std::string& folder, TomlNode& own,
                           TomlNode& root) {
  const auto at = std::find_if(own.children.begin(), own.children.end(),
                               [](const TomlNode& child) { return child.key == "include"; });
  if (at == own.children.end()) return true;
  const TomlNode include = std::move(*at);
  own.children.erase(at);
  namespace fs = std::filesystem;
  std::error_code ignored;
  reading_.push_back(fs::weakly_canonical(path, ignored).string());
  std::vector<std::string> names;
  const std::size_t errors_before = result_.errors.size();
  if (include.type != TomlType::kArray) {
    errors_.add(include.line, "include", include.found(), "an array: [\"other.toml\"]");
  }
  for (const TomlNode& each : include.children) {
    if (each.type != TomlType::kText || each.text.empty()) {
      errors_.add(each.line, "include", each.found(), "the path of a configuration in quotes");
      continue;
    }
    const std::string inner = (fs::path(folder) / each.text).string();
    const std::string file = (fs::path(directory_) / inner).string();
    const std::string canonical = fs::weakly_canonical(file, ignored).string();
    if (std::find(reading_.begin(), reading_.end(), canonical) != reading_.end()) {
      errors_.add(each.line, "include", in_quotes(each.text) + ", which includes this file",
                  "files without a circle");
    } else if (reading_.size() > kIncludeDepthMax || ++included_ > kIncludedMax) {
      errors_.add(each.line, "include", "more than 8 files within each other or 64 in all",
                  "fewer");
      break;
    } else {
      read_file(file, each.text, fs::path(inner).parent_path().string(), errors_.add_file(file),
                each.line, root);
    }
  }
  reading_.pop_back();
  return result_.errors.size() == errors_before;
}

void Loader::count_lines_from(std::uint32_t first_line, TomlNode& node) {
  node.line += first_line;
  for (TomlNode& child : node.children) count_lines_from(first_line, child);
}

// Paths are relative to the file that they stand in.
void Loader::see_from(const std::string& folder, TomlNode& root) {
  const auto turn = [&](TomlNode& node) {
    const bool is_path = node.type == TomlType::kText && !node.text.empty();
    if (is_path) node.text = (std::filesystem::path(folder) / node.text).string();
    for (TomlNode& child : node.children) {
      if (child.type == TomlType::kText) {
        child.text = (std::filesystem::path(folder) / child.text).string();
      }
    }
  };
  for (TomlNode& section : root.children) {
    for (TomlNode& node : section.children) {
      const std::string key = section.key + "." + node.key;
      if (key == "bus.dbc" || key == "estimator.model" || key == "daemon.state_dir") turn(node);
      if (section.key != "bus" || node.type != TomlType::kTable) continue;
      for (TomlNode& of_bus : node.children) {
        if (of_bus.key == "dbc") turn(of_bus);
      }
    }
  }
}

// `above` over `below`, both sorted by key, as the result: one pass over both. Where both have a
// key, meet(lower, upper) leaves in the lower one what counts.
template <typename Meet>
void merge_sorted(std::vector<TomlNode>& below, std::vector<TomlNode>& above, Meet meet) {
  std::vector<TomlNode> all;
  all.reserve(below.size() + above.size());
  auto lower = below.begin();
  for (TomlNode& upper : above) {
    while (lower != below.end() && lower->key < upper.key) all.push_back(std::move(*lower++));
    if (lower == below.end() || lower->key != upper.key) {
      all.push_back(std::move(upper));
    } else {
      meet(*lower, upper);
      all.push_back(std::move(*lower++));
    }
  }
  std::move(lower, below.end(), std::back_inserter(all));
  below = std::move(all);
}

// Later keys win, one by one in each section; what is replaced is told, with both places.
void Loader::put_over(TomlNode& own, TomlNode& root) {
  merge_sorted(root.children, own.children, [&](TomlNode& before, TomlNode& section) {
    if (before.type != TomlType::kTable || section.type != TomlType::kTable) {
      before = std::move(section);
      return;
    }
    before.line = section.line;
    merge_sorted(before.children, section.children, [&](TomlNode& replaced, TomlNode& node) {
      result_.warnings.push_back(errors_.place(node.line) + ": " + section.key + "." + node.key +
                                 " takes the place of " + errors_.place(replaced.line));
      replaced = std::move(node);
    });
  });
}

const TomlNode* Loader::section(std::string_view name) const {
  const TomlNode* found = root_.find(name);
  return found != nullptr && found->type == TomlType::kTable ? found : nullptr;
}

std::uint32_t Loader::line_of(std::string_view section_name, std::string_view key) const {
  const TomlNode* in = section(section_name);
  if (in == nullptr) return 1;
  const TomlNode* at = in->find(key);
  return at == nullptr ? in->line : at->line;
}

bool Loader::has_role(Role role) const {
  return std::any_of(config_.roles.begin(), config_.roles.end(),
                     [&](const RoleBinding& each) { return each.role == role; });
}

void Loader::check_keys() {
  const auto sections = section_names();
  std::vector<std::string> names(sections.begin(), sections.end());
  for (const TomlNode& node : root_.children) {
    if (std::find(sections.begin(), sections.end(), node.key) == sections.end()) {
      errors_.add(node.line, node.key,
                  node.type == TomlType::kTable ? "an unknown section" : "an unknown key",
                  "a section of the configuration" + nearest_hint(node.key, names));
      continue;
    }
    if (node.type != TomlType::kTable) {
      errors_.add(node.line, node.key, node.found(), "a section [" + node.key + "]");
      continue;
    }
    if (node.key == "protection") continue;  // its keys are names of messages
    std::vector<std::string> keys;
    for (const Option& option : option_table()) {
      if (option.section == node.key) keys.emplace_back(option.key);
    }
    for (std::size_t i = 0; i < kRoleCount; ++i) {
      const Role role = static_cast<Role>(i);
      if (node.key == "signals" ||
          (node.key == "sensors" && !bias_key(role_dimension(role)).empty())) {
        keys.emplace_back(role_name(role));
      }
    }
    for (const TomlNode& child : node.children) {
      if (std::find(keys.begin(), keys.end(), child.key) != keys.end()) continue;
      if (node.key == "bus" && child.type == TomlType::kTable) {
        read_further_bus(child);
        continue;
      }
      errors_.add(child.line, key_of(node.key, child.key), "an unknown key",
                  "a key of [" + node.key + "]" + nearest_hint(child.key, keys));
    }
  }
}

void Loader::read_options() {
  for (const Option& option : option_table()) {
    const TomlNode* in = section(option.section);
    const TomlNode* node = in == nullptr ? nullptr : in->find(option.key);
    if (node != nullptr) read_option(option, *node);
  }
}

void Loader::read_option(const Option& option, const TomlNode& node) {
  const std::string key = key_of(option.section, option.key);
  switch (option.kind) {
    case Option::Kind::kNumber:
      read_number(option, node);
      break;
    case Option::Kind::kText:
      if (node.type == TomlType::kText) {
        option.text(config_) = node.text;
      } else {
        errors_.add(node.line, key, node.found(), "text in quotes");
      }
      break;
    case Option::Kind::kChoice: {
      const auto at = std::find(option.choices.begin(), option.choices.end(), node.text);
      if (node.type == TomlType::kText && at != option.choices.end()) {
        option.set_choice(config_, static_cast<std::size_t>(at - option.choices.begin()));
        break;
      }
      std::string expected;
      for (const std::string_view each : option.choices) {
        expected += (expected.empty() ? "" : " or ") + in_quotes(each);
      }
      errors_.add(node.line, key, node.found(), expected);
      break;
    }
    case Option::Kind::kTexts:
      read_paths(key, node, config_.dbc);
      break;
    case Option::Kind::kIdentifiers:
      read_identifiers(node);
      break;
  }
}

void Loader::read_number(const Option& option, const TomlNode& node) {
  if (!node.is_number() || !(node.number >= option.minimum) || !(node.number <= option.maximum)) {
    errors_.add(node.line, key_of(option.section, option.key), node.found(),
                range_text(option.minimum, option.maximum));
    return;
  }
  option.number(config_) = node.number * option.factor;
}

void Loader::read_paths(const std::string& key, const TomlNode& node,
                        std::vector<std::string>& paths) {
  if (node.type != TomlType::kArray) {
    errors_.add(node.line, key, node.found(), "an array of paths: [\"vehicle.dbc\"]");
    return;
  }
  for (const TomlNode& each : node.children) {
    if (each.type == TomlType::kText && !each.text.empty()) {
      paths.push_back(each.text);
    } else {
      errors_.add(each.line, key, each.found(), "the path of a DBC file in quotes");
    }
  }
}

void Loader::read_further_bus(const TomlNode& node) {
  const std::string key = "bus." + node.key;
  if (config_.further_bus) {
    errors_.add(node.line, key, "a third bus", "[bus] and one [bus.NAME] at most");
    return;
  }
  FurtherBus& bus = config_.further_bus.emplace();
  bus.name = node.key;
  further_line_ = node.line;
  for (const TomlNode& child : node.children) {
    if (child.key == "interface" && child.type == TomlType::kText) {
      bus.interface = child.text;
      check_interface(key + ".interface", child.line, bus.interface);
    } else if (child.key == "interface") {
      errors_.add(child.line, key + ".interface", child.found(), "text in quotes");
    } else if (child.key == "dbc") {
      read_paths(key + ".dbc", child, bus.dbc);
    } else {
      errors_.add(child.line, key + "." + child.key, "an unknown key",
                  "interface or dbc" + nearest_hint(child.key, {"interface", "dbc"}));
    }
  }
  if (node.find("interface") == nullptr) {
    errors_.add(node.line, key, "a bus without interface", "interface = \"can1\"");
  }
}

void Loader::read_identifiers(const TomlNode& node) {
  if (node.type != TomlType::kTable) {
    errors_.add(node.line, "bus.identifiers", node.found(), "{ estimate = 0x6A0, ... }");
    return;
  }
  std::vector<std::string> names;
  for (const IdentifierKey& each : identifier_keys()) names.emplace_back(each.key);
  for (const TomlNode& child : node.children) {
    const std::string key = "bus.identifiers." + child.key;
    const auto keys = identifier_keys();
    const auto at = std::find_if(keys.begin(), keys.end(),
                                 [&](const IdentifierKey& each) { return each.key == child.key; });
    if (at == keys.end()) {
      errors_.add(child.line, key, "an unknown key",
                  "estimate, slip, clamp or status" + nearest_hint(child.key, names));
    } else if (child.type != TomlType::kInteger || child.integer < 0 ||
               child.integer > static_cast<std::int64_t>(can::kStandardIdMax)) {
      errors_.add(child.line, key, child.found(), "an integer from 0 to 0x7FF");
    } else {
      config_.identifiers.*at->field = static_cast<std::uint32_t>(child.integer);
    }
  }
}

void Loader::read_sensors() {
  const TomlNode* sensors = section("sensors");
  if (sensors == nullptr) return;
  for (std::size_t i = 0; i < kRoleCount; ++i) {
    const Role role = static_cast<Role>(i);
    const TomlNode* node = sensors->find(role_name(role));
    if (node != nullptr && !bias_key(role_dimension(role)).empty()) read_sensor(role, *node);
  }
}

void Loader::read_sensor(Role role, const TomlNode& node) {
  const std::string key = key_of("sensors", role_name(role));
  const std::string bias(bias_key(role_dimension(role)));
  if (node.type != TomlType::kTable) {
    errors_.add(node.line, key, node.found(), "{ " + bias + " = ..., gain = ... }");
    return;
  }
  estimator::ChannelAccuracy& accuracy = accuracies_[static_cast<std::size_t>(role)];
  for (const TomlNode& child : node.children) {
    const bool is_bias = child.key == bias;
    if (!is_bias && child.key != "gain") {
      errors_.add(child.line, key + "." + child.key, "an unknown key", bias + " or gain");
      continue;
    }
    const double maximum = is_bias ? bias_maximum(role_dimension(role)) : kGainMaximum;
    if (!child.is_number() || !(child.number >= 0.0) || !(child.number <= maximum)) {
      errors_.add(child.line, key + "." + child.key, child.found(), range_text(0.0, maximum));
      continue;
    }
    (is_bias ? accuracy.bias : accuracy.gain) = child.number;
    Stated& stated = accuracies_stated_[static_cast<std::size_t>(role)];
    (is_bias ? stated.bias : stated.gain) = true;
  }
}

void Loader::read_signals() {
  const std::uint32_t line = line_of("bus", "dbc");
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
  const bool further_dbc = config_.further_bus && !config_.further_bus->dbc.empty();
  if (further_dbc) {
    read_catalogue(config_.further_bus->dbc, "bus." + config_.further_bus->name + ".dbc",
                   further_line_, further_catalogue_);
  }
  const TomlNode* signals = section("signals");
  if (catalogue_.complete() && further_catalogue_.complete() && signals != nullptr) {
    for (std::size_t i = 0; i < kRoleCount; ++i) {
      const Role role = static_cast<Role>(i);
      const TomlNode* node = signals->find(role_name(role));
      if (node == nullptr) continue;
      const std::optional<std::uint8_t> bus = bus_of(key_of("signals", role_name(role)), *node);
      const SignalCatalogue& catalogue =
          bus.value_or(0) != 0 && further_dbc ? further_catalogue_ : catalogue_;
      std::optional<RoleBinding> binding = catalogue.bind(role, *node, errors_);
      if (!binding || !bus) continue;
      binding->bus = *bus;
      config_.roles.push_back(std::move(*binding));
    }
    check_uds(config_, *signals, errors_);
  }
  check_further_bus();
  check_required_roles(signals);
  if (catalogue_.complete()) read_protections();
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

// A second interface is there for a role, and is one that can be waited for together with the
// first.
void Loader::check_further_bus() {
  if (!config_.further_bus || !result_.errors.empty()) return;
  const FurtherBus& bus = *config_.further_bus;
  const std::string key = "bus." + bus.name;
  constexpr std::string_view kInproc = "inproc:";
  if (bus.interface == config_.interface) {
    errors_.add(further_line_, key + ".interface", in_quotes(bus.interface),
                "another than bus.interface");
  } else if (bus.interface.starts_with(kInproc) || config_.interface.starts_with(kInproc)) {
    errors_.add(further_line_, key + ".interface", "an embedded bus beside another bus",
                "two SocketCAN interfaces");
  }
  const bool used = std::any_of(config_.roles.begin(), config_.roles.end(),
                                [](const RoleBinding& each) { return each.bus != 0; });
  if (!used) {
    errors_.add(further_line_, key, "a bus that no role is on",
                "bus = " + in_quotes(bus.name) + " in a role of [signals]");
  }
}

void Loader::check_required_roles(const TomlNode* signals) {
  const auto named = [&](Role role) {
    return signals != nullptr && signals->find(role_name(role)) != nullptr;
  };
  const std::uint32_t line = signals == nullptr ? 1 : signals->line;
  const auto require = [&](Role role, const std::string& expected) {
    errors_.add(line, key_of("signals", role_name(role)), "no such key", expected);
  };
  for (const Role role : {Role::kPrimarySpeed, Role::kSecondarySpeed, Role::kSecondaryPressure}) {
    if (!named(role)) require(role, "a signal: \"Message.Signal\"");
  }
  if (!named(Role::kEngineTorque) && !named(Role::kPrimaryTorque)) {
    require(Role::kEngineTorque, "a signal: \"Message.Signal\", here or as primary_torque");
  }
  if (config_.trigger == Trigger::kSignal && !named(Role::kExperimentActive)) {
    require(Role::kExperimentActive, "a signal, as experiment.trigger is \"signal\"");
  }
  if (config_.control != Control::kCommand) return;
  for (const Role role : {Role::kExperimentPermitted, Role::kAcceleratorPedal, Role::kBrakePressed,
                          Role::kLockupClosed, Role::kOilTemperature, Role::kVehicleSpeed}) {
    if (!named(role)) require(role, "a signal, as experiment.control is \"command\"");
  }
}

void Loader::check_interface(const std::string& key, std::uint32_t line, const std::string& name) {
  constexpr std::string_view kInproc = "inproc:";
  const bool inproc = name.starts_with(kInproc) && name.size() > kInproc.size();
  const bool socket = !name.empty() && name.size() <= kInterfaceNameMax &&
                      name.find_first_of("/: \t\n") == std::string::npos && name != "." &&
                      name != "..";
  if (!inproc && !socket) {
    errors_.add(line, key, in_quotes(name), "an interface of 1 to 15 characters, or inproc:NAME");
  }
}

void Loader::check_across() {
  check_interface("bus.interface", line_of("bus", "interface"), config_.interface);

  const auto keys = identifier_keys();
  for (std::size_t i = 0; i < keys.size(); ++i) {
    for (std::size_t j = i + 1; j < keys.size(); ++j) {
      if (config_.identifiers.*keys[i].field != config_.identifiers.*keys[j].field) continue;
      errors_.add(
          line_of("bus", "identifiers"), "bus.identifiers",
          "one identifier for " + std::string(keys[i].key) + " and " + std::string(keys[j].key),
          "four different ones");
    }
    for (const RoleBinding& role : config_.roles) {
      if (role.uds || role.bus != 0 || role.id.extended ||
          role.id.value != config_.identifiers.*keys[i].field) {
        continue;
      }
      errors_.add(line_of("signals", role_name(role.role)), key_of("signals", role_name(role.role)),
                  "message " + role.message_name + " with the identifier of BeltGrip's " +
                      std::string(keys[i].key) + " frame",
                  "another identifier there or in bus.identifiers");
    }
  }

  const estimator::VariatorParameters& variator = config_.variator;
  if (variator.ratio_low >= variator.ratio_overdrive) {
    errors_.add(line_of("variator", "ratio_low"), "variator.ratio_low",
                number_text(variator.ratio_low),
                "less than ratio_overdrive, " + number_text(variator.ratio_overdrive));
  }
  if (variator.primary_radius_low_m >= variator.primary_radius_overdrive_m) {
    errors_.add(line_of("variator", "primary_radius_low_m"), "variator.primary_radius_low_m",
                number_text(variator.primary_radius_low_m),
                "less than primary_radius_overdrive_m, " +
                    number_text(variator.primary_radius_overdrive_m));
  }
  const estimator::EstimatorSettings& settings = config_.estimator;
  if (settings.stop_slope >= settings.peak_slope) {
    errors_.add(line_of("estimator", "stop_slope"), "estimator.stop_slope",
                number_text(settings.stop_slope),
                "less than peak_slope, " + number_text(settings.peak_slope));
  }
  if (settings.lowpass_hz >= settings.sample_rate_hz / 2.0) {
    errors_.add(line_of("estimator", "lowpass_hz"), "estimator.lowpass_hz",
                number_text(settings.lowpass_hz),
                "less than half of sample_rate_hz, " + number_text(settings.sample_rate_hz / 2.0));
  }
  if (settings.method == estimator::Method::kPaper &&
      settings.stop_rule == estimator::StopRule::kConfidence) {
    errors_.add(line_of("experiment", "stop"), "experiment.stop", "\"confidence\"",
                "\"peak\", as estimator.method is \"paper\": it has no interval before the peak");
  }
}

// What a request for clamping force needs beyond what observation does.
void Loader::check_command() {
  if (config_.control != Control::kCommand) return;
  if (config_.trigger != Trigger::kCoastDown && config_.trigger != Trigger::kSteady) {
    errors_.add(line_of("experiment", "trigger"), "experiment.trigger",
                config_.trigger == Trigger::kSignal ? "\"signal\"" : "\"always\"",
                "\"coast_down\" or \"steady\", as experiment.control is \"command\"");
  }
  if (config_.variator.primary_inertia_kg_m2 <= 0.0) {
    errors_.add(line_of("variator", "primary_inertia_kg_m2"), "variator.primary_inertia_kg_m2",
                number_text(config_.variator.primary_inertia_kg_m2),
                "the inertia, as experiment.control is \"command\": the slip limits rest on it");
  }
}

// The model's [variator] wins over the configuration's.
void Loader::read_model_file() {
  if (config_.model.empty()) return;
  ModelFile base;
  base.variator = config_.variator;
  const std::string path = (std::filesystem::path(directory_) / config_.model).string();
  try {
    const ModelFile model = read_model(path, base, kind_);
    config_.files.push_back(path);
    config_.variator = model.variator;
    model_keys_ = model.variator_keys;
    config_.corrected = whole_machine(model);
  } catch (const ModelError& error) {
    result_.errors.push_back({error.missing_file ? kExitNoInput : 78, error.text});
  }
}

// What is left out is not known exactly: a result says what it rests on.
void Loader::assume() {
  assume_constants();
  assume_accuracy(Role::kPrimarySpeed, false);
  assume_accuracy(Role::kSecondarySpeed, false);
  assume_accuracy(Role::kSecondaryPressure, true);
  assume_accuracy(config_.estimator.torque_is_engine ? Role::kEngineTorque : Role::kPrimaryTorque,
                  true);
  // Beyond what a reading may be off by at the ends of the assumptions.
  constexpr double kReach = 3.0;
  if (config_.friction_is_assumed) config_.estimator.reading_reach = kReach;
}

void Loader::assume_constants() {
  using estimator::Constant;
  using estimator::RatioChoice;
  const TomlNode* stated = section("variator");
  const auto is_needed = [&](Constant constant) {
    switch (constant) {
      case Constant::kRadiusOverdrive:
        return config_.estimator.ratio != RatioChoice::kLow;
      case Constant::kRadiusLow:
        return config_.estimator.ratio != RatioChoice::kOverdrive;
      case Constant::kPrimaryInertia:
        return config_.estimator.torque_is_engine;
      default:
        return true;
    }
  };
  for (std::size_t i = 0; i < estimator::kConstantCount; ++i) {
    const estimator::Assumption& each = estimator::assumptions()[i];
    const bool in_model =
        std::find(model_keys_.begin(), model_keys_.end(), each.key) != model_keys_.end();
    const bool in_file = stated != nullptr && stated->find(each.key) != nullptr;
    if (in_model || in_file || !is_needed(static_cast<Constant>(i))) continue;
    config_.assumed_constants.set(i);
    config_.assumed.push_back(key_of("variator", each.key));
    config_.friction_is_assumed = true;
  }
}

void Loader::assume_accuracy(Role role, bool decides) {
  const auto index = static_cast<std::size_t>(role);
  const auto sensor = sensor_of(role);
  if (!sensor) return;
  const estimator::ChannelAccuracy& typical = estimator::typical_accuracy(*sensor).accuracy;
  const std::string key = key_of("sensors", role_name(role)) + ".";
  if (!accuracies_stated_[index].bias) {
    accuracies_[index].bias = typical.bias;
    config_.assumed.push_back(key + std::string(bias_key(role_dimension(role))));
    config_.friction_is_assumed |= decides;
  }
  if (!accuracies_stated_[index].gain) {
    accuracies_[index].gain = typical.gain;
    config_.assumed.push_back(key + "gain");
    config_.friction_is_assumed |= decides;
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

ConfigResult reload_config(const std::string& path) {
  ConfigResult result;
  Loader(path, FileKind::kRegular, result).load(ConfigScope::kAll);
  return result;
}

}  // namespace beltgrip::daemon
