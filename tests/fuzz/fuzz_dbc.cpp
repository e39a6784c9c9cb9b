// Any bytes as a DBC file: no crash, no hang; every text is UTF-8, every problem has a place; where
// names and texts are plain, what was read, written down and read again is the same text (a fixed
// point); every message decodes payloads of every length.
#include <charconv>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <span>
#include <string>

#include "can_dbc/dbc/message_codec.h"
#include "can_dbc/dbc/message_index.h"
#include "can_dbc/dbc/parser.h"
#include "can_dbc/text/encoding.h"

namespace {

using namespace beltgrip::can;

void require(bool condition, int line = __builtin_LINE()) {
  if (condition) return;
  std::fprintf(stderr, "fuzz_dbc.cpp:%d\n", line);
  std::abort();
}

// Looks at every text of the model; remembers whether all of it can be written down as it is.
class Texts {
 public:
  void name(std::string_view text) {
    require(is_utf8(text));
    const bool plain = !text.empty() && text.find_first_not_of(
                                            "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ"
                                            "0123456789_") == std::string::npos;
    // A word of the format is no name once it stands at the start of a line.
    if (!plain || text.back() == '_' || text == "FILTER" || text == "VERSION") writable_ = false;
  }
  void quoted(std::string_view text) {
    require(is_utf8(text));
    if (text.find_first_of("\"\\\r\n") != std::string::npos) writable_ = false;
  }
  void refuse() { writable_ = false; }
  bool writable() const { return writable_; }

 private:
  bool writable_ = true;
};

std::string number(double value) {
  char text[64];
  return {text, std::to_chars(text, text + sizeof text, value).ptr};
}

std::string id_text(CanId id) {
  return std::to_string(id.value | (id.extended ? 0x8000'0000U : 0U));
}

std::string values_text(const ValueTable& values) {
  std::string text;
  for (const auto& [key, label] : values) text += " " + std::to_string(key) + " \"" + label + "\"";
  return text + " ;\n";
}

std::string written(const Database& db, Texts& texts) {
  std::string text = "VERSION \"" + db.version + "\"\nBU_:";
  texts.quoted(db.version);
  for (const Text node : db.nodes) {
    texts.name(node);
    text += ' ' + node;
  }
  text += '\n';
  std::string rest;
  for (const MessageDef& message : db.messages) {
    const std::string id = id_text(message.id);
    texts.name(message.name);
    texts.name(message.transmitter.empty() ? "Vector__XXX" : message.transmitter);
    text += "BO_ " + id + ' ' + message.name + ": " + std::to_string(message.length) + ' ' +
            (message.transmitter.empty() ? "Vector__XXX" : message.transmitter) + '\n';
    if (!message.comment.empty()) rest += "CM_ BO_ " + id + " \"" + message.comment + "\";\n";
    texts.quoted(message.comment);
    for (const SignalDef& signal : message.signals) {
      texts.name(signal.name);
      texts.quoted(signal.unit);
      texts.quoted(signal.comment);
      text += " SG_ " + signal.name;
      if (signal.is_multiplexer) text += " M";
      const bool is_float =
          signal.type == ValueType::kFloat32 || signal.type == ValueType::kFloat64;
      const bool minus = is_float || signal.type == ValueType::kSigned;
      text += " : " + std::to_string(signal.start_bit) + '|' + std::to_string(signal.length) + '@' +
              (signal.byte_order == ByteOrder::kBig ? '0' : '1') + (minus ? '-' : '+') + " (" +
              number(signal.scale) + ',' + number(signal.offset) + ") [" +
              number(signal.usage->minimum) + '|' + number(signal.usage->maximum) + "] \"" +
              signal.unit + "\"";
      for (const double value :
           {signal.scale, signal.offset, signal.usage->minimum, signal.usage->maximum}) {
        if (!(value - value == 0.0)) texts.refuse();  // "inf" is no number of the format
      }
      for (std::size_t i = 0; i < signal.usage->receivers.size(); ++i) {
        texts.name(signal.usage->receivers[i]);
        text += (i == 0 ? " " : ",") + signal.usage->receivers[i];
      }
      text += '\n';
      const std::string object = id + ' ' + signal.name;
      if (is_float) {
        rest += "SIG_VALTYPE_ " + object + (signal.length == 64 ? " : 2;\n" : " : 1;\n");
      }
      if (signal.multiplexed_by) {
        texts.name(signal.multiplexed_by->selector);
        rest += "SG_MUL_VAL_ " + object + ' ' + signal.multiplexed_by->selector;
        const char* separator = " ";
        for (const auto& [low, high] : signal.multiplexed_by->ranges) {
          rest += separator + std::to_string(low) + '-' + std::to_string(high);
          separator = ", ";
        }
        rest += ";\n";
      }
      for (const auto& [key, label] : signal.values) texts.quoted(label);
      if (!signal.values.empty()) rest += "VAL_ " + object + values_text(signal.values);
      if (!signal.comment.empty()) rest += "CM_ SG_ " + object + " \"" + signal.comment + "\";\n";
    }
  }
  texts.quoted(db.comment);
  if (!db.comment.empty()) rest += "CM_ \"" + db.comment + "\";\n";
  return text + rest;
}

void check_other_texts(const Database& db) {
  for (const auto& [name, value] : db.attributes) require(is_utf8(name) && is_utf8(value));
  for (const Statement& statement : db.other_statements) {
    require(statement.line > 0 && is_utf8(statement.text));
  }
  for (const Statement& comment : db.source_comments) {
    require(comment.line > 0 && is_utf8(comment.text));
  }
  for (const EnvironmentVariable& variable : db.environment_variables) {
    require(is_utf8(variable.name) && is_utf8(variable.unit) && is_utf8(variable.comment));
  }
  for (const AttributeDef& definition : db.attribute_definitions) {
    require(is_utf8(definition.name) && is_utf8(definition.default_value.value_or("")));
    for (const Text choice : definition.choices) require(is_utf8(choice));
  }
  for (const RelationAttribute& relation : db.relations) {
    require(is_utf8(relation.name) && is_utf8(relation.node) && is_utf8(relation.object));
  }
}

// What the codec of the message found is what the codec of each signal alone finds.
void check_values(const MessageCodec& codec, std::span<const std::uint8_t> payload,
                  const DecodedMessage& values) {
  values.for_each_present([&](std::size_t i) {
    const SignalCodec& signal = codec.signal(i);
    require(signal.fits(payload.size()) && values[i].raw == signal.raw(payload));
    const double physical = signal.physical(values[i].raw);
    require(std::memcmp(&values[i].physical, &physical, sizeof physical) == 0);
  });
}

void check_decoding(const Database& db) {
  std::uint8_t payload[64];
  for (std::size_t i = 0; i < sizeof payload; ++i) payload[i] = static_cast<std::uint8_t>(i * 37);
  for (const MessageDef& message : db.messages) {
    const MessageCodec codec(message);
    DecodedMessage values(codec.signal_count());
    for (std::size_t length = 0; length <= sizeof payload; length += length < 9 ? 1 : 11) {
      codec.decode({payload, length}, values);
      require(values.count() <= message.signals.size());
      check_values(codec, {payload, length}, values);
    }
  }
  const Database* one = &db;
  const MessageIndex index(std::span<const Database* const>(&one, 1));
  for (const MessageDef& message : db.messages) require(index.lookup(message.id) != nullptr);
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::string_view text(reinterpret_cast<const char*>(data), size);
  const DbcParseResult result = parse_dbc(std::string(text));
  std::uint32_t line = 1;
  for (const Problem& problem : result.problems) {
    require(problem.line >= line && problem.column > 0 && !problem.code.empty());
    require(is_utf8(problem.text) && problem.text.find('\n') == std::string::npos);
    line = problem.line;
  }
  check_other_texts(result.database);
  check_decoding(result.database);

  Texts texts;
  const std::string once = written(result.database, texts);
  // Statements refer by identifier and name: where those repeat, they belong to more than one.
  for (const Problem& problem : result.problems) {
    if (problem.code.starts_with("duplicate") || problem.code.starts_with("mux")) texts.refuse();
  }
  if (!texts.writable()) return 0;
  Texts again;
  require(written(parse_dbc(once).database, again) == once);
  return 0;
}
