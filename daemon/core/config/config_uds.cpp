#include "daemon/core/config/config_uds.h"

#include <array>
#include <charconv>
#include <cmath>

#include "can_dbc/uds/iso_tp.h"
#include "daemon/core/config/config_options.h"

namespace beltgrip::daemon {

namespace {

constexpr std::uint32_t kDidMax = 0xFFFF;
constexpr std::size_t kDataMax = can::kIsoTpMax - 3;  // bytes after service and identifier

can::CanId id_of(std::int64_t value) {
  const auto id = static_cast<std::uint32_t>(value);
  return {id, id > can::kStandardIdMax};
}

// The address of all ECUs at once: 0x7DF, or normal fixed addressing with target type functional.
bool is_functional(can::CanId id) {
  constexpr std::uint32_t kEveryone = 0x7DF;
  return id.extended ? (id.value & 0x03FF'0000U) == 0x00DB'0000U : id.value == kEveryone;
}

bool is_own(const FrameIdentifiers& own, can::CanId id) {
  if (id.extended) return false;
  return id.value == own.estimate || id.value == own.slip || id.value == own.clamp ||
         id.value == own.status;
}

}  // namespace

std::optional<UdsSource> read_uds(const std::string& key, const TomlNode& node,
                                  ConfigErrors& errors) {
  if (node.type != TomlType::kTable) {
    errors.add(node.line, key, node.found(),
               "{ request = 0x7E1, response = 0x7E9, did = 0x1101, start = 7, length = 16 }");
    return {};
  }
  static const std::vector<std::string> kKeys{"request",    "response", "did",    "start", "length",
                                              "byte_order", "scale",    "offset", "signed"};
  UdsSource uds;
  uds.signal.byte_order = can::ByteOrder::kBig;
  bool good = true;
  const auto wrong = [&](const TomlNode& child, const std::string& expected) {
    errors.add(child.line, key + "." + child.key, child.found(), expected);
    good = false;
  };
  // An integer from minimum to maximum.
  const auto integer = [&](const TomlNode& child, std::int64_t minimum, std::int64_t maximum,
                           const std::string& expected) {
    const bool fits =
        child.type == TomlType::kInteger && child.integer >= minimum && child.integer <= maximum;
    if (!fits) wrong(child, expected);
    return fits ? child.integer : minimum;
  };
  for (const TomlNode& child : node.children) {
    if (child.key == "request" || child.key == "response") {
      const can::CanId id = id_of(integer(child, 0, can::kExtendedIdMax,
                                          "an identifier: up to 0x7FF is 11 bit, up to 0x1FFFFFFF "
                                          "is 29 bit"));
      (child.key == "request" ? uds.request : uds.response) = id;
    } else if (child.key == "did") {
      uds.identifier =
          static_cast<std::uint16_t>(integer(child, 0, kDidMax, "an integer from 0 to 0xFFFF"));
    } else if (child.key == "start") {
      uds.signal.start_bit = static_cast<std::uint32_t>(
          integer(child, 0, std::int64_t{kDataMax} * 8 - 1,
                  "a bit of the data after the identifier, numbered as in a DBC: 7 is the highest "
                  "of the first byte"));
    } else if (child.key == "length") {
      uds.signal.length =
          static_cast<std::uint32_t>(integer(child, 1, 64, "an integer from 1 to 64 (bits)"));
    } else if (child.key == "byte_order") {
      const bool little = child.text == "little";
      if (child.type != TomlType::kText || (!little && child.text != "big")) {
        wrong(child, "\"big\" or \"little\"");
      }
      uds.signal.byte_order = little ? can::ByteOrder::kLittle : can::ByteOrder::kBig;
    } else if (child.key == "scale") {
      if (!child.is_number() || !std::isfinite(child.number) || child.number == 0.0) {
        wrong(child, "a finite number other than 0");
      }
      uds.signal.scale = child.number;
    } else if (child.key == "offset") {
      if (!child.is_number() || !std::isfinite(child.number)) wrong(child, "a finite number");
      uds.signal.offset = child.number;
    } else if (child.key == "signed") {
      if (child.type != TomlType::kFlag) wrong(child, "true or false");
      uds.signal.type = child.flag ? can::ValueType::kSigned : can::ValueType::kUnsigned;
    } else {
      errors.add(child.line, key + "." + child.key, "an unknown key",
                 "request, response, did, start, length, byte_order, scale, offset or signed" +
                     nearest_hint(child.key, kKeys));
      good = false;
    }
  }
  for (const char* required : {"request", "response", "did", "start", "length"}) {
    if (node.find(required) != nullptr) continue;
    errors.add(node.line, key, "a table without " + std::string(required),
               "{ request = 0x7E1, response = 0x7E9, did = 0x1101, start = 7, length = 16 }");
    good = false;
  }
  if (!good) return {};
  if (!can::SignalCodec(uds.signal).fits(kDataMax)) {
    errors.add(node.line, key, "a signal that does not fit in an answer",
               "start and length inside " + std::to_string(kDataMax) + " bytes of data");
    return {};
  }
  return uds;
}

void check_uds(const Config& config, const TomlNode& signals, ConfigErrors& errors) {
  for (const RoleBinding& role : config.roles) {
    if (!role.uds) continue;
    const std::string key = "signals." + std::string(role_name(role.role));
    const TomlNode* node = signals.find(role_name(role.role));
    const std::uint32_t line = node == nullptr ? 1 : node->line;
    const UdsSource& source = *role.uds;
    const auto at = [&](const char* name) { return key + ".uds." + name; };
    if (source.request == source.response) {
      errors.add(line, at("response"), "the identifier of the request",
                 "that of the answer: often the request's + 8");
    }
    for (const auto& [name, id] :
         {std::pair("request", source.request), std::pair("response", source.response)}) {
      if (role.bus == 0 && is_own(config.identifiers, id)) {
        errors.add(line, at(name), "an identifier of BeltGrip's own frames",
                   "another identifier there or in bus.identifiers");
      }
      for (const RoleBinding& other : config.roles) {
        if (other.uds || other.bus != role.bus || other.id != id) continue;
        errors.add(line, at(name),
                   "the identifier of message " + other.message_name + ", the source of " +
                       std::string(role_name(other.role)),
                   "one that no broadcast message of a role has");
      }
    }
    for (const RoleBinding& other : config.roles) {
      if (!other.uds || other.bus != role.bus || other.role >= role.role) continue;
      const bool same_request = other.uds->request == source.request;
      const bool same_response = other.uds->response == source.response;
      if (same_request == same_response && other.uds->request != source.response &&
          other.uds->response != source.request) {
        continue;
      }
      errors.add(
          line, key + ".uds",
          "request and response that " + std::string(role_name(other.role)) + " pairs otherwise",
          "one response for each request on a bus");
    }
    if (config.diagnostics != Diagnostics::kPoll) continue;
    if (is_functional(source.request)) {
      errors.add(line, at("request"), "the address of all ECUs at once",
                 "that of one ECU, as bus.diagnostics is \"poll\"");
    }
    if (!role.period_ms || *role.period_ms < kPollPeriodMinimum_ms) {
      errors.add(line, key + ".period_ms", role.period_ms ? "less than 10" : "no such key",
                 "how often to ask, 10 to 10000, as bus.diagnostics is \"poll\"");
    }
  }
}

}  // namespace beltgrip::daemon
