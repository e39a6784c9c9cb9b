// What the three steps of the DBC parser share: parser.cpp reads the statements, in any order;
// resolve.cpp brings together what refers to each other; lint.cpp looks at the result.
#pragma once

#include <cstdint>
#include <deque>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "can_dbc/dbc/model.h"
#include "can_dbc/dbc/scanner.h"

namespace beltgrip::can::dbc {

// Longer ones are refused: every further mention would be a copy.
inline constexpr std::size_t kNameLengthMax = 1024;
// The message of the signals that stand in none.
inline constexpr std::string_view kIndependentMessage = "VECTOR__INDEPENDENT_SIG_MSG";
inline constexpr std::uint32_t kIndependentId = 0xC000'0000U;

// Of "m3": the signal's place in its message and the number, in the order of the signals.
struct SelectorValue {
  std::uint32_t signal = 0;
  std::uint64_t value = 0;
};

struct MessageSource {
  std::size_t offset = 0;    // of the statement
  std::uint32_t raw_id = 0;  // as written, with the flag bits; other statements refer by it
  // Of each signal, how far behind `offset` its name stands; UINT32_MAX: further than that.
  List<std::uint32_t> names;
  List<SelectorValue> selector_values;

  std::size_t name_offset(std::size_t signal) const { return offset + names[signal]; }
};

enum class Object : std::uint8_t { kNetwork, kNode, kMessage, kSignal, kVariable, kDefault };

// A statement that refers to objects by identifier and name.
struct Reference {
  std::size_t offset = 0;  // of the statement
  std::size_t end = 0;
  std::uint32_t raw_id = 0;
  Object object = Object::kNetwork;
  std::string_view name;  // of the signal, node or variable
};

struct CommentRef : Reference {
  Text text;
};
struct AttributeRef : Reference {
  Text attribute;
  Text value;
};
struct RelationRef : Reference {
  Text attribute;
  std::string_view kind;
  std::string_view node;
  Text value;
};
struct ValuesRef : Reference {
  ValueTable values;
  std::string_view table;  // the name of a table instead of values
};
struct ValueTypeRef : Reference {
  std::uint64_t type = 0;  // 0 integer, 1 float, 2 double
};
struct MultiplexRef : Reference {
  std::string_view selector;
  List<ValueRange> ranges;
};
struct SendersRef : Reference {
  std::vector<Text> senders;
};
struct GroupRef : Reference {
  SignalGroup group;
};
struct DataBytesRef : Reference {
  std::uint64_t bytes = 0;
};

struct Draft {
  explicit Draft(std::string dbc_text) : text(database.arena->keep_whole(std::move(dbc_text))) {}

  Database database;
  std::string_view text;  // of the file; what is read of it stays there
  bool text_is_utf8 = true;
  Arena sources;                          // of what stands in `messages`
  std::vector<MessageSource> messages;    // beside database.messages
  std::vector<std::size_t> node_offsets;  // beside database.nodes
  std::deque<CommentRef> comments;
  std::deque<AttributeRef> attributes;
  std::deque<RelationRef> relations;
  std::deque<ValuesRef> values;
  std::deque<ValueTypeRef> value_types;
  std::deque<MultiplexRef> multiplexes;
  std::deque<SendersRef> senders;
  std::deque<GroupRef> groups;
  std::deque<DataBytesRef> data_bytes;
  std::deque<Reference> kept;  // spans that go to other_statements as text
  ProblemList problems;

  Arena& arena() const { return *database.arena; }
  // A piece of the file, or of what the arena keeps, as UTF-8.
  Text utf8(std::string_view piece);
  // Keeps the statement as text.
  void keep(std::size_t begin, std::size_t end) {
    Reference span;
    span.offset = begin;
    span.end = end;
    kept.push_back(span);
  }
};

void resolve(Draft& draft);
void lint(Draft& draft);

}  // namespace beltgrip::can::dbc
