// What a DBC file says, as plain values. Filled by dbc_parser, read by the codecs and the tools.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "can_dbc/can_frame.h"

namespace beltgrip::can {

enum class ByteOrder { kLittle, kBig };  // Intel (@1), Motorola (@0)
enum class ValueType { kUnsigned, kSigned, kFloat32, kFloat64 };

// A multiplexed signal is present when the raw value of `selector` lies in one of `ranges`.
struct MuxRule {
  std::string selector;                                         // name of the multiplexer signal
  std::vector<std::pair<std::uint64_t, std::uint64_t>> ranges;  // inclusive
};

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
  bool is_multiplexer = false;
  std::optional<MuxRule> multiplexed_by;
  std::map<std::int64_t, std::string> values;  // value table: raw -> text
  std::map<std::string, std::string> attributes;
};

struct MessageDef {
  std::string name;
  CanId id;
  std::uint32_t length = 0;  // bytes
  bool fd = false;
  std::optional<double> cycle_ms;
  std::string transmitter;
  std::string comment;
  std::vector<SignalDef> signals;
  std::map<std::string, std::string> attributes;

  const SignalDef* find_signal(const std::string& signal_name) const;
};

struct Database {
  std::string version;
  std::vector<std::string> nodes;
  std::vector<MessageDef> messages;  // in file order
  std::map<std::string, std::map<std::int64_t, std::string>> value_tables;
  std::map<std::string, std::string> attributes;  // of the network
  std::string comment;

  const MessageDef* find_message(const std::string& message_name) const;
  const MessageDef* find_message(CanId id) const;  // first with exactly this identifier
};

}  // namespace beltgrip::can
