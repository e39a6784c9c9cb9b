#include "tools/cli/dbc_json.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <map>
#include <span>
#include <string_view>

#include "tools/text/json_writer.h"

namespace beltgrip::cli {

namespace {

using can::Attributes;
using can::Database;
using can::MessageDef;
using can::SignalDef;
using can::ValueTable;

class DatabaseWriter {
 public:
  explicit DatabaseWriter(const Database& database) : database_(database) {
    for (const can::AttributeDef& definition : database.attribute_definitions) {
      const bool number =
          definition.type == "INT" || definition.type == "HEX" || definition.type == "FLOAT";
      is_number_[definition.name] = number;
    }
  }

  std::string write() {
    json_.begin_object();
    json_.field("version", database_.version).field("comment", database_.comment);
    nodes();
    json_.key("messages").begin_array();
    for (const MessageDef& message : database_.messages) write(message);
    json_.end_array();
    json_.key("attributes");
    write(database_.attributes);
    rest();
    json_.end_object();
    return json_.take();
  }

 private:
  void nodes() {
    json_.key("nodes").begin_array();
    for (const can::Text name : database_.nodes) {
      static const can::NodeDef kNone;
      const auto found = database_.node_details.find(name);
      const can::NodeDef& node = found == database_.node_details.end() ? kNone : found->second;
      json_.begin_object().field("name", name).field("comment", node.comment).key("attributes");
      write(node.attributes);
      short_name(node.short_name);
      json_.end_object();
    }
    json_.end_array();
  }

  void write(const MessageDef& message) {
    json_.begin_object();
    json_.field("name", message.name);
    json_.field("id", message.id.value);
    json_.field("extended", message.id.extended);
    json_.field("length", message.length);
    json_.field("fd", message.fd);
    json_.field("j1939", message.j1939);
    json_.key("cycle_ms");
    if (message.cycle_ms) {
      json_.value(*message.cycle_ms);
    } else {
      json_.null();
    }
    json_.field("comment", message.comment);
    json_.key("attributes");
    write(message.attributes);
    json_.field("transmitter", message.transmitter);
    json_.key("senders");
    write(message.senders);
    short_name(message.short_name);
    json_.key("groups").begin_array();
    for (const can::SignalGroup& group : message.groups) {
      json_.begin_object().field("name", group.name).field("repetitions", group.repetitions);
      json_.key("signals");
      write(group.signals);
      json_.end_object();
    }
    json_.end_array();
    json_.key("signals").begin_array();
    for (const SignalDef& signal : message.signals) write(signal);
    json_.end_array();
    json_.end_object();
  }

  void write(const SignalDef& signal) {
    const bool is_float =
        signal.type == can::ValueType::kFloat32 || signal.type == can::ValueType::kFloat64;
    json_.begin_object();
    json_.field("name", signal.name);
    json_.field("start_bit", signal.start_bit);
    json_.field("length", signal.length);
    json_.field("byte_order", signal.byte_order == can::ByteOrder::kLittle ? "little" : "big");
    json_.field("signed", is_float || signal.type == can::ValueType::kSigned);
    json_.field("float", is_float);
    json_.field("scale", signal.scale).field("offset", signal.offset);
    json_.field("min", signal.usage->minimum).field("max", signal.usage->maximum);
    json_.field("unit", signal.unit);
    json_.field("comment", signal.comment);
    json_.field("is_multiplexer", signal.is_multiplexer);
    json_.key("multiplexed_by");
    if (signal.multiplexed_by) {
      json_.begin_object().key(signal.multiplexed_by->selector).begin_array();
      for (const auto& [low, high] : signal.multiplexed_by->ranges) {
        json_.begin_array().value(low).value(high).end_array();
      }
      json_.end_array().end_object();
    } else {
      json_.null();
    }
    json_.key("values").begin_object();
    for (const auto& [key, text] : signal.values)
      json_.field(can::value_key_text(signal, key), text);
    json_.end_object();
    json_.key("attributes");
    write(signal.attributes);
    json_.key("receivers");
    write(signal.usage->receivers);
    short_name(signal.short_name);
    json_.end_object();
  }

  void short_name(can::Text name) {
    if (!name.empty()) json_.field("short_name", name);
  }

  void write(std::span<const can::Text> texts) {
    json_.begin_array();
    for (const can::Text text : texts) json_.value(text);
    json_.end_array();
  }

  // False, and nothing written, where not all of the text is such a number.
  template <typename Number>
  bool write_as(can::Text text) {
    Number number{};
    const char* const begin = text.data();
    const char* const end = begin + text.size();
    const auto [rest, status] = std::from_chars(begin, end, number);
    if (status != std::errc{} || rest != end || !std::isfinite(static_cast<double>(number))) {
      return false;
    }
    json_.value(number);
    return true;
  }

  // Attributes defined as numbers are numbers, with every digit of a whole one; what is no number
  // that JSON has stays text.
  void write(const Attributes& attributes) {
    json_.begin_object();
    for (const auto& [name, text] : attributes) {
      json_.key(name);
      const auto definition = is_number_.find(name);
      const bool is_number = definition != is_number_.end() && definition->second;
      if (!is_number || !(write_as<std::uint64_t>(text) || write_as<std::int64_t>(text) ||
                          write_as<double>(text))) {
        json_.value(text);
      }
    }
    json_.end_object();
  }

  void write(const ValueTable& values) {
    json_.begin_object();
    for (const auto& [key, text] : values) json_.field(std::to_string(key), text);
    json_.end_object();
  }

  void write(const std::vector<can::Statement>& statements) {
    json_.begin_array();
    for (const can::Statement& statement : statements) {
      json_.begin_object().field("line", statement.line).field("text", statement.text).end_object();
    }
    json_.end_array();
  }

  // What the decoding of frames does not need.
  void rest() {
    json_.key("value_tables").begin_object();
    for (const auto& [name, values] : database_.value_tables) {
      json_.key(name);
      write(values);
    }
    json_.end_object();
    json_.key("attribute_definitions").begin_array();
    for (const can::AttributeDef& definition : database_.attribute_definitions) {
      json_.begin_object().field("name", definition.name).field("object", definition.object);
      json_.field("type", definition.type).key("choices");
      write(definition.choices);
      if (definition.minimum) json_.field("min", *definition.minimum);
      if (definition.maximum) json_.field("max", *definition.maximum);
      if (definition.default_value) json_.field("default", *definition.default_value);
      json_.end_object();
    }
    json_.end_array();
    json_.key("environment_variables").begin_array();
    for (const can::EnvironmentVariable& variable : database_.environment_variables) {
      json_.begin_object().field("name", variable.name).field("type", variable.type);
      json_.field("min", variable.minimum).field("max", variable.maximum);
      json_.field("unit", variable.unit).field("initial", variable.initial_value);
      json_.field("id", variable.id).field("access", variable.access_type).key("nodes");
      write(variable.access_nodes);
      if (variable.data_bytes) json_.field("data_bytes", *variable.data_bytes);
      json_.field("comment", variable.comment).key("values");
      write(variable.values);
      json_.key("attributes");
      write(variable.attributes);
      json_.end_object();
    }
    json_.end_array();
    json_.key("relations").begin_array();
    for (const can::RelationAttribute& relation : database_.relations) {
      json_.begin_object().field("attribute", relation.name).field("kind", relation.kind);
      json_.field("node", relation.node).field("object", relation.object);
      json_.field("value", relation.value).end_object();
    }
    json_.end_array();
    json_.key("unassigned_signals").begin_array();
    for (const SignalDef& signal : database_.unassigned_signals) write(signal);
    json_.end_array();
    json_.key("new_symbols");
    write(database_.new_symbols);
    json_.field("bit_timing", database_.bit_timing);
    json_.key("other_statements");
    write(database_.other_statements);
    json_.key("source_comments");
    write(database_.source_comments);
  }

  const Database& database_;
  text::JsonWriter json_;
  std::map<std::string_view, bool> is_number_;
};

}  // namespace

std::string database_json(const can::Database& database) {
  return DatabaseWriter(database).write();
}

}  // namespace beltgrip::cli
