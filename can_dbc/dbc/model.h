// What a DBC file says, as plain values. Filled by the parser, read by the codecs and the tools.
// Everything in the file is kept: what has no field of its own stands in other_statements as text.
// All text is UTF-8, whatever the file's encoding was.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "can_dbc/frame/can_frame.h"

namespace beltgrip::can {

enum class ByteOrder { kLittle, kBig };  // Intel (@1), Motorola (@0)
enum class ValueType { kUnsigned, kSigned, kFloat32, kFloat64 };

// A multiplexed signal is present when the raw value of `selector` lies in one of `ranges`.
struct MuxRule {
  std::string selector;                                         // name of the multiplexer signal
  std::vector<std::pair<std::uint64_t, std::uint64_t>> ranges;  // inclusive
};

// Raw value -> text. The key has the 64 bits of the raw value: above INT64_MAX they are read as
// negative (see value_key_text).
using ValueTable = std::map<std::int64_t, std::string>;
using Attributes = std::map<std::string, std::string>;  // enumerations as the text chosen

struct SignalDef {
  std::string name;
  std::uint32_t start_bit = 0;  // as written in the DBC (big endian: the most significant bit)
  std::uint32_t length = 0;     // bits, 1..64
  ByteOrder byte_order = ByteOrder::kLittle;
  ValueType type = ValueType::kUnsigned;
  double scale = 1.0;  // physical = raw * scale + offset, each operation rounded
  double offset = 0.0;
  double minimum = 0.0;
  double maximum = 0.0;
  std::string unit;  // UTF-8, as written
  std::string comment;
  std::vector<std::string> receivers;
  bool is_multiplexer = false;  // marked so (M) in the file
  std::optional<MuxRule> multiplexed_by;
  ValueTable values;
  Attributes attributes;
  std::string short_name;  // the name before a long one by attribute replaced it; else empty
};

struct SignalGroup {
  std::string name;
  std::uint64_t repetitions = 1;
  std::vector<std::string> signals;
};

struct MessageDef {
  std::string name;
  CanId id;
  std::uint32_t length = 0;  // bytes
  bool fd = false;
  bool j1939 = false;  // matched by parameter group, not by the full identifier
  std::optional<double> cycle_ms;
  std::string transmitter;
  std::string comment;
  std::vector<SignalDef> signals;
  Attributes attributes;
  std::string short_name;            // as in SignalDef
  std::vector<std::string> senders;  // further transmitters (BO_TX_BU_)
  std::vector<SignalGroup> groups;

  const SignalDef* find_signal(const std::string& signal_name) const;
};

struct NodeDef {
  std::string comment;
  Attributes attributes;
  std::string short_name;  // as in SignalDef
};

struct EnvironmentVariable {
  std::string name;
  std::uint64_t type = 0;  // 0 integer, 1 float, 2 string
  double minimum = 0.0;
  double maximum = 0.0;
  std::string unit;
  double initial_value = 0.0;
  std::uint64_t id = 0;
  std::string access_type;  // DUMMY_NODE_VECTOR0 ...
  std::vector<std::string> access_nodes;
  std::optional<std::uint64_t> data_bytes;  // ENVVAR_DATA_
  std::string comment;
  ValueTable values;
  Attributes attributes;
};

struct AttributeDef {
  std::string name;
  std::string object;  // "" network, "BU_", "BO_", "SG_", "EV_", "BU_SG_REL_", "BU_BO_REL_", ...
  std::string type;    // "INT", "HEX", "FLOAT", "STRING", "ENUM"
  std::vector<std::string> choices;  // of an enumeration
  std::optional<double> minimum;
  std::optional<double> maximum;
  std::optional<std::string> default_value;  // an enumeration's as text
};

// An attribute of a relation: a node and a signal it receives, a message it sends, a variable.
struct RelationAttribute {
  std::string name;
  std::string kind;  // "BU_SG_REL_", "BU_BO_REL_", "BU_EV_REL_"
  std::string node;
  std::string object;  // "MESSAGE", "MESSAGE.SIGNAL" or the variable's name
  std::string value;
};

struct Statement {
  std::uint32_t line = 0;
  std::string text;
};

struct Database {
  std::string version;
  std::vector<std::string> nodes;
  std::vector<MessageDef> messages;  // in file order
  std::map<std::string, ValueTable> value_tables;
  Attributes attributes;  // of the network
  std::string comment;
  std::map<std::string, NodeDef> node_details;  // by the name in `nodes`; only where there are any
  std::vector<EnvironmentVariable> environment_variables;
  std::vector<AttributeDef> attribute_definitions;
  std::vector<RelationAttribute> relations;
  std::vector<SignalDef> unassigned_signals;  // of VECTOR__INDEPENDENT_SIG_MSG
  std::vector<std::string> new_symbols;       // NS_
  std::string bit_timing;                     // BS_
  std::vector<Statement> other_statements;    // kept as text
  std::vector<Statement> source_comments;     // "//" and "/* */"

  const MessageDef* find_message(const std::string& message_name) const;
  const MessageDef* find_message(CanId id) const;  // first with exactly this identifier
};

// The raw value that a key of the signal's value table stands for, in decimal.
std::string value_key_text(const SignalDef& signal, std::int64_t key);

}  // namespace beltgrip::can
