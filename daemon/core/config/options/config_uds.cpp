#include "daemon/core/config/options/config_uds.h"

#include "daemon/core/config/options/option_reader.h"

namespace beltgrip::daemon {

namespace {

// The address of all ECUs at once: 0x7DF, or normal fixed addressing with target type functional.
bool is_functional(can::CanId id) {
  constexpr std::uint32_t kEveryone = 0x7DF;
  return id.extended ? (id.value & 0x03FF'0000U) == 0x00DB'0000U : id.value == kEveryone;
}

bool is_own(const FrameIdentifiers& own, can::CanId id) {
  if (id.extended) return false;
  for (const auto& option : identifier_options()) {
    if (option.get_integer(own) == id.value) return true;
  }
  return false;
}

// The keys that it cannot do without, as in the table of its options.
std::string example() {
  std::string text;
  for (const OptionRow& option : uds_options()) {
    if (!option.is_required) continue;
    text +=
        (text.empty() ? "{ " : ", ") + std::string(option.key) + " = " + std::string(option.shown);
  }
  return text + " }";
}

// Where the role stands in the file.
struct RoleLocation {
  std::string key;
  std::uint32_t line;
};

// No other frame has the identifiers of a request and its answer.
void check_alone(const Config& config, const RoleBinding& role, const RoleLocation& place,
                 ConfigErrors& errors) {
  if (!role.uds) return;
  const UdsSource& source = *role.uds;
  for (const auto& [name, id] :
       {std::pair("request", source.request), std::pair("response", source.response)}) {
    const std::string key = key_of(place.key + ".uds", name);
    if (role.bus == 0 && is_own(config.identifiers, id)) {
      errors.add(place.line, key, "an identifier of BeltGrip's own frames",
                 "another identifier there or in bus.identifiers");
    }
    for (const RoleBinding& other : config.roles) {
      if (other.uds || other.bus != role.bus || other.id != id) continue;
      errors.add(place.line, key,
                 "the identifier of message " + other.message_name + ", the source of " +
                     std::string(role_name(other.role)),
                 "one that no broadcast message of a role has");
    }
  }
}

// An ECU has one identifier for requests and one for answers.
void check_pairs(const Config& config, const RoleBinding& role, const RoleLocation& place,
                 ConfigErrors& errors) {
  if (!role.uds) return;
  const UdsSource& source = *role.uds;
  for (const RoleBinding& other : config.roles) {
    if (!other.uds || other.bus != role.bus || other.role >= role.role) continue;
    const bool same_request = other.uds->request == source.request;
    const bool same_response = other.uds->response == source.response;
    if (same_request == same_response && other.uds->request != source.response &&
        other.uds->response != source.request) {
      continue;
    }
    errors.add(
        place.line, place.key + ".uds",
        "request and response that " + std::string(role_name(other.role)) + " pairs otherwise",
        "one response for each request on a bus");
  }
}

void check_poll(const RoleBinding& role, const RoleLocation& place, ConfigErrors& errors) {
  if (role.uds && is_functional(role.uds->request)) {
    errors.add(place.line, place.key + ".uds.request", "the address of all ECUs at once",
               "that of one ECU, as bus.diagnostics is \"poll\"");
  }
  if (!role.period_ms || *role.period_ms < kPollPeriodMinimum_ms) {
    errors.add(place.line, place.key + ".period_ms",
               role.period_ms ? "less than 10" : "no such key",
               "how often to ask, 10 to 10000, as bus.diagnostics is \"poll\"");
  }
}

}  // namespace

UdsSource usual_uds() {
  UdsSource uds;
  uds.signal.byte_order = can::ByteOrder::kBig;
  return uds;
}

bool read_role_uds(const std::string& key, const TomlNode& node, RoleText& role,
                   ConfigErrors& errors) {
  if (node.type != TomlType::kTable) {
    errors.add(node.line, key, node.found(), example());
    return false;
  }
  UdsSource uds = usual_uds();
  bool good = read_keys(uds_options(), key, node, uds, errors);
  good &= has_required(uds_options(), key, node, "a table", example(), errors);
  if (!good) return false;
  if (can::identifier_bytes(uds.service) == 1 && uds.identifier > 0xFF) {
    errors.add(node.line, key + ".did", "an identifier of two bytes",
               "0 to 0xFF, as service is 0x21");
    return false;
  }
  if (uds.bytes > 0 && !can::SignalCodec(uds.signal).fits(uds.bytes)) {
    errors.add(node.line, key + ".bytes", "fewer than the signal needs",
               "all data bytes of the identifier, or no such key");
    return false;
  }
  if (!can::SignalCodec(uds.signal).fits(kUdsDataMax)) {
    errors.add(node.line, key, "a signal that does not fit in an answer",
               "start and length inside " + std::to_string(kUdsDataMax) + " bytes of data");
    return false;
  }
  role.uds = uds;
  return true;
}

void check_uds(const Config& config, const TomlNode& signals, ConfigErrors& errors) {
  for (const RoleBinding& role : config.roles) {
    if (!role.uds) continue;
    const TomlNode* node = signals.find(role_name(role.role));
    const RoleLocation place{key_of("signals", role_name(role.role)),
                             node == nullptr ? 1 : node->line};
    if (role.uds->request == role.uds->response) {
      errors.add(place.line, place.key + ".uds.response", "the identifier of the request",
                 "that of the answer: often the request's + 8");
    }
    check_alone(config, role, place, errors);
    check_pairs(config, role, place, errors);
    if (config.diagnostics == Diagnostics::kPoll) check_poll(role, place, errors);
  }
}

}  // namespace beltgrip::daemon
