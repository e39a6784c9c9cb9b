// What the three steps of the DBC parser share: parser.cpp reads the statements, in any order;
// resolve.cpp brings together what refers to each other; lint.cpp looks at the result.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "can_dbc/dbc/model.h"
#include "can_dbc/dbc/scanner.h"

namespace beltgrip::can::dbc {

// Longer ones are refused: every further mention would be a copy.
inline constexpr std::size_t kNameLengthMax = 1024;

struct SignalSource {
  std::size_t offset = 0;  // of the name
  bool multiplexed = false;
  std::uint64_t selector_value = 0;  // of "m3", with multiplexed
};

struct MessageSource {
  std::size_t offset = 0;    // of the statement
  std::uint32_t raw_id = 0;  // as written, with the flag bits; other statements refer by it
  std::vector<SignalSource> signals;
};

// A statement that refers to objects by identifier and name.
struct Reference {
  std::size_t offset = 0;  // of the statement
  std::size_t end = 0;
  std::string_view object;  // "BU_", "BO_", "SG_", "EV_"; empty: the network
  std::uint32_t raw_id = 0;
  std::string_view name;  // of the signal, node or variable
};

struct CommentRef : Reference {
  std::string text;
};
struct AttributeRef : Reference {
  std::string attribute;
  std::string value;
};
struct RelationRef : Reference {
  std::string attribute;
  std::string_view kind;
  std::string_view node;
  std::string value;
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
  std::vector<std::pair<std::uint64_t, std::uint64_t>> ranges;
};
struct SendersRef : Reference {
  std::vector<std::string> senders;
};
struct GroupRef : Reference {
  SignalGroup group;
};
struct DataBytesRef : Reference {
  std::uint64_t bytes = 0;
};

struct Draft {
  explicit Draft(std::string_view dbc_text) : text(dbc_text) {}

  std::string_view text;
  bool text_is_utf8 = true;
  Database database;
  std::vector<MessageSource> messages;    // beside database.messages
  std::vector<std::size_t> node_offsets;  // beside database.nodes
  std::vector<CommentRef> comments;
  std::vector<AttributeRef> attributes;
  std::vector<RelationRef> relations;
  std::vector<ValuesRef> values;
  std::vector<ValueTypeRef> value_types;
  std::vector<MultiplexRef> multiplexes;
  std::vector<SendersRef> senders;
  std::vector<GroupRef> groups;
  std::vector<DataBytesRef> data_bytes;
  std::vector<Reference> kept;  // spans that go to other_statements as text
  ProblemList problems;

  // A piece of the file as UTF-8.
  std::string utf8(std::string_view piece);
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
