// protection.MESSAGE = { ... }.
#include "daemon/core/config/load/signal_catalogue.h"
#include "daemon/core/config/options/config_options.h"
#include "daemon/core/config/options/option_reader.h"

namespace beltgrip::daemon {

namespace {

constexpr std::uint32_t kByte = 8;

// One entry and the message that it names.
struct Entry {
  const std::string& key;
  const TomlNode& node;
  const can::MessageDef& message;
  ConfigErrors& errors;

  void wrong(std::uint32_t line, std::string_view child, const std::string& found,
             const std::string& expected) const {
    errors.add(line, child.empty() ? key : key_of(key, child), found, expected);
  }
};

// A plain unsigned signal of the message, or null with an error.
const can::SignalDef* signal_of(const Entry& entry, const TomlNode& child) {
  const can::SignalDef* signal =
      child.type == TomlType::kText ? entry.message.find_signal(child.text) : nullptr;
  if (signal == nullptr || signal->type != can::ValueType::kUnsigned || signal->multiplexed_by ||
      signal->length > kByte || !can::SignalCodec(*signal).fits(entry.message.length)) {
    entry.wrong(
        child.line, child.key, child.found(),
        "an unsigned signal of " + entry.message.name + " of up to 8 bits, not multiplexed");
    return nullptr;
  }
  return signal;
}

// What an entry must have, whatever the DBC says.
void check_keys(const Entry& entry) {
  const TomlNode& node = entry.node;
  const bool counter = node.find("counter") != nullptr;
  const TomlNode* counter_max = node.find("counter_max");
  const TomlNode* crc = node.find("crc");
  const TomlNode* data_id = node.find("data_id");
  if (entry.message.j1939) {
    entry.wrong(node.line, "", "a message of a J1939 group", "one with an identifier of its own");
  }
  if (!counter && crc == nullptr) {
    entry.wrong(node.line, "", "neither counter nor crc", "one of them");
  }
  if (!counter && counter_max != nullptr) {
    entry.wrong(counter_max->line, "counter_max", "no counter", "counter = \"Signal\"");
  }
  if ((crc == nullptr) != (data_id == nullptr)) {
    entry.wrong((crc != nullptr ? crc : data_id)->line, "",
                crc != nullptr ? "no data_id" : "no crc", "crc = \"Signal\" and data_id = 0x123");
  }
}

std::optional<CounterProtection> read_counter(const Entry& entry) {
  const TomlNode* node = entry.node.find("counter");
  const can::SignalDef* signal = node == nullptr ? nullptr : signal_of(entry, *node);
  if (signal == nullptr) return {};
  CounterProtection counter;
  counter.codec = can::SignalCodec(*signal);
  counter.maximum = static_cast<std::uint32_t>(counter.codec.mask());
  const TomlNode* given = entry.node.find("counter_max");
  if (given == nullptr) return counter;
  if (given->type != TomlType::kInteger || given->integer < 1 || given->integer > counter.maximum) {
    entry.wrong(given->line, given->key, given->found(),
                "an integer from 1 to " + std::to_string(counter.maximum));
    return {};
  }
  counter.maximum = static_cast<std::uint32_t>(given->integer);
  return counter;
}

std::optional<CrcProtection> read_crc(const Entry& entry, const ProtectionText& text) {
  const TomlNode* node = entry.node.find("crc");
  const can::SignalDef* signal = node == nullptr ? nullptr : signal_of(entry, *node);
  if (signal == nullptr) return {};
  const std::uint32_t first = signal->byte_order == can::ByteOrder::kLittle ? 0 : kByte - 1;
  if (signal->length != kByte || signal->start_bit % kByte != first) {
    entry.wrong(node->line, "crc", node->found(), "a signal that is one byte of the frame");
  }
  return CrcProtection{signal->start_bit / kByte, text.data_id};
}

}  // namespace

std::optional<MessageProtection> SignalCatalogue::protect(const TomlNode& node,
                                                          ConfigErrors& errors) const {
  const std::string key = key_of("protection", node.key);
  if (node.type != TomlType::kTable) {
    errors.add(node.line, key, node.found(), "{ counter = \"Signal\", ... }");
    return {};
  }
  const std::optional<Found> found = find_message(node.key, key, node.line, errors);
  if (!found) return {};
  const std::size_t errors_before = errors.count();
  const Entry entry{key, node, *found->message, errors};
  ProtectionText text;
  read_keys(protection_options(), key, node, text, errors);
  check_keys(entry);
  MessageProtection out;
  out.id = found->message->id;
  out.counter = read_counter(entry);
  out.crc = read_crc(entry, text);
  return errors.count() == errors_before ? std::optional(out) : std::nullopt;
}

}  // namespace beltgrip::daemon
