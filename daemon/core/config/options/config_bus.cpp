#include "daemon/core/config/options/config_bus.h"

#include <algorithm>

#include "daemon/core/config/options/config_options.h"
#include "daemon/core/config/options/option_reader.h"

namespace beltgrip::daemon {

namespace {

constexpr std::string_view kInproc = "inproc:";
constexpr std::size_t kInterfaceNameMax = 15;  // IFNAMSIZ - 1

void check_interface(const std::string& key, std::uint32_t line, const std::string& name,
                     ConfigErrors& errors) {
  const bool inproc = name.starts_with(kInproc) && name.size() > kInproc.size();
  const bool socket = !name.empty() && name.size() <= kInterfaceNameMax &&
                      name.find_first_of("/: \t\n") == std::string::npos && name != "." &&
                      name != "..";
  if (!inproc && !socket) {
    errors.add(line, key, in_quotes(name), "an interface of 1 to 15 characters, or inproc:NAME");
  }
}

}  // namespace

bool read_identifiers(const std::string& key, const TomlNode& node, Config& config,
                      ConfigErrors& errors) {
  if (node.type != TomlType::kTable) {
    errors.add(node.line, key, node.found(), "{ estimate = 0x6A0, ... }");
    return false;
  }
  return read_keys(identifier_options(), key, node, config.identifiers, errors);
}

void read_further_bus(const TomlNode& node, Config& config, ConfigErrors& errors) {
  const std::string key = key_of("bus", node.key);
  if (config.further_bus) {
    errors.add(node.line, key, "a third bus", "[bus] and one [bus.NAME] at most");
    return;
  }
  FurtherBus& bus = config.further_bus.emplace();
  bus.name = node.key;
  read_keys(further_bus_options(), key, node, bus, errors);
  has_required(further_bus_options(), key, node, "a bus", "interface = \"can1\"", errors);
  const TomlNode* interface = node.find("interface");
  if (interface == nullptr || interface->type != TomlType::kText) return;
  check_interface(key + ".interface", interface->line, bus.interface, errors);
}

void check_bus(const Config& config, const TomlNode& root, ConfigErrors& errors) {
  check_interface("bus.interface", line_of(root, "bus", "interface"), config.interface, errors);
  const auto options = identifier_options();
  for (std::size_t i = 0; i < options.size(); ++i) {
    const std::int64_t identifier = options[i].get_integer(config.identifiers);
    for (std::size_t j = i + 1; j < options.size(); ++j) {
      if (identifier != options[j].get_integer(config.identifiers)) continue;
      errors.add(line_of(root, "bus", "identifiers"), "bus.identifiers",
                 "one identifier for " + std::string(options[i].key) + " and " +
                     std::string(options[j].key),
                 "four different ones");
    }
    for (const RoleBinding& role : config.roles) {
      if (role.uds || role.bus != 0 || role.id.extended || role.id.value != identifier) continue;
      errors.add(line_of(root, "signals", role_name(role.role)),
                 key_of("signals", role_name(role.role)),
                 "message " + role.message_name + " with the identifier of BeltGrip's " +
                     std::string(options[i].key) + " frame",
                 "another identifier there or in bus.identifiers");
    }
  }
}

void check_further_bus(const Config& config, const TomlNode& root, ConfigErrors& errors) {
  if (!config.further_bus) return;
  const FurtherBus& bus = *config.further_bus;
  const std::string key = key_of("bus", bus.name);
  const std::uint32_t line = line_of(root, "bus", bus.name);
  if (bus.interface == config.interface) {
    errors.add(line, key + ".interface", in_quotes(bus.interface), "another than bus.interface");
  } else if (bus.interface.starts_with(kInproc) || config.interface.starts_with(kInproc)) {
    errors.add(line, key + ".interface", "an embedded bus beside another bus",
               "two SocketCAN interfaces");
  }
  const bool used = std::any_of(config.roles.begin(), config.roles.end(),
                                [](const RoleBinding& each) { return each.bus != 0; });
  if (!used) {
    errors.add(line, key, "a bus that no role is on",
               "bus = " + in_quotes(bus.name) + " in a role of [signals]");
  }
}

}  // namespace beltgrip::daemon
