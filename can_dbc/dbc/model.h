// What a DBC file says, as plain values. Filled by the parser, read by the codecs and the tools.
// Everything in the file is kept: what has no field of its own stands in other_statements as text.
// All text is UTF-8, whatever the file's encoding was; text and lists live as long as the database
// or one of its copies does.
#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "can_dbc/dbc/arena.h"
#include "can_dbc/frame/can_frame.h"

namespace beltgrip::can {

enum class ByteOrder : std::uint8_t { kLittle, kBig };  // Intel (@1), Motorola (@0)
enum class ValueType : std::uint8_t { kUnsigned, kSigned, kFloat32, kFloat64 };

// A multiplexed signal is present when the raw value of `selector` lies in one of `ranges`.
using ValueRange = std::pair<std::uint64_t, std::uint64_t>;  // inclusive
struct MuxRule {
  Text selector;  // name of the multiplexer signal
  List<ValueRange> ranges;
};

// Raw value -> text. The key has the 64 bits of the raw value: above INT64_MAX they are read as
// negative (see value_key_text).
using ValueTable = Table<std::int64_t, Text>;
using Attributes = Table<Text, Text>;  // enumerations as the text chosen

// What signals that stand together mostly have alike: the range their values are meant to have, and
// who receives them.
struct SignalUsage {
  double minimum = 0.0;
  double maximum = 0.0;
  List<Text> receivers;
};
inline constexpr SignalUsage kNoUsage;

struct SignalDef {
  Text name;
  std::uint32_t start_bit = 0;  // as written in the DBC (big endian: the most significant bit)
  std::uint32_t length = 0;     // bits, 1..64
  ByteOrder byte_order = ByteOrder::kLittle;
  ValueType type = ValueType::kUnsigned;
  bool is_multiplexer = false;  // marked so (M) in the file
  double scale = 1.0;           // physical = raw * scale + offset, each operation rounded
  double offset = 0.0;
  ShortText unit;  // UTF-8, as written
  ShortText comment;
  const SignalUsage* usage = &kNoUsage;
  const MuxRule* multiplexed_by = nullptr;
  ValueTable values;
  Attributes attributes;
  ShortText short_name;  // the name before a long one by attribute replaced it; else empty
};

struct SignalGroup {
  Text name;
  std::uint64_t repetitions = 1;
  List<Text> signals;
};

struct MessageDef {
  Text name;
  CanId id;
  std::uint32_t length = 0;  // bytes
  bool fd = false;
  bool j1939 = false;  // matched by parameter group, not by the full identifier
  std::optional<double> cycle_ms;
  Text transmitter;
  ShortText comment;
  std::vector<SignalDef> signals;
  Attributes attributes;
  ShortText short_name;  // as in SignalDef
  List<Text> senders;    // further transmitters (BO_TX_BU_)
  List<SignalGroup> groups;

  const SignalDef* find_signal(std::string_view signal_name) const;
};

struct NodeDef {
  ShortText comment;
  Attributes attributes;
  ShortText short_name;  // as in SignalDef
};

struct EnvironmentVariable {
  Text name;
  std::uint64_t type = 0;  // 0 integer, 1 float, 2 string
  double minimum = 0.0;
  double maximum = 0.0;
  Text unit;
  double initial_value = 0.0;
  std::uint64_t id = 0;
  Text access_type;  // DUMMY_NODE_VECTOR0 ...
  std::vector<Text> access_nodes;
  std::optional<std::uint64_t> data_bytes;  // ENVVAR_DATA_
  ShortText comment;
  ValueTable values;
  Attributes attributes;
};

struct AttributeDef {
  Text name;
  Text object;  // "" network, "BU_", "BO_", "SG_", "EV_", "BU_SG_REL_", "BU_BO_REL_", ...
  Text type;    // "INT", "HEX", "FLOAT", "STRING", "ENUM"
  std::vector<Text> choices;  // of an enumeration
  std::optional<double> minimum;
  std::optional<double> maximum;
  std::optional<Text> default_value;  // an enumeration's as text
};

// An attribute of a relation: a node and a signal it receives, a message it sends, a variable.
struct RelationAttribute {
  Text name;
  Text kind;  // "BU_SG_REL_", "BU_BO_REL_", "BU_EV_REL_"
  Text node;
  Text object;  // "MESSAGE", "MESSAGE.SIGNAL" or the variable's name
  Text value;
};

struct Statement {
  std::uint32_t line = 0;
  Text text;
};

struct Database {
  std::shared_ptr<Arena> arena = std::make_shared<Arena>();  // of all that stands below
  Text version;
  std::vector<Text> nodes;
  std::vector<MessageDef> messages;  // in file order
  std::map<Text, ValueTable> value_tables;
  Attributes attributes;  // of the network
  ShortText comment;
  std::map<Text, NodeDef> node_details;  // by the name in `nodes`; only where there are any
  std::vector<EnvironmentVariable> environment_variables;
  std::vector<AttributeDef> attribute_definitions;
  std::vector<RelationAttribute> relations;
  std::vector<SignalDef> unassigned_signals;  // of VECTOR__INDEPENDENT_SIG_MSG
  std::vector<Text> new_symbols;              // NS_
  Text bit_timing;                            // BS_
  std::vector<Statement> other_statements;    // kept as text
  std::vector<Statement> source_comments;     // "//" and "/* */"

  const MessageDef* find_message(std::string_view message_name) const;
  const MessageDef* find_message(CanId id) const;  // first with exactly this identifier
};

// The raw value that a key of the signal's value table stands for, in decimal.
std::string value_key_text(const SignalDef& signal, std::int64_t key);

}  // namespace beltgrip::can
