// Second step of the DBC parser: statements that refer to messages, signals, nodes and variables
// find them, wherever they stand in the file; attributes take effect (long names, frame format,
// cycle time); multiplexing becomes one rule per signal.
#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <map>
#include <numeric>
#include <set>
#include <span>
#include <utility>

#include "can_dbc/dbc/draft.h"
#include "can_dbc/dbc/gathered.h"
#include "can_dbc/text/encoding.h"

namespace beltgrip::can::dbc {

namespace {

// Objects of one name or identifier beyond this many are not looked at: copies would multiply.
constexpr std::size_t kDuplicatesMax = 8;
// Copies of long text would multiply too.
constexpr std::size_t kChoiceLengthMax = 255;
constexpr std::size_t kLongNameLengthMax = 255;

using Indices = std::span<const std::uint32_t>;

// What is looked for by name in one message.
class FoundSignals {
 public:
  void add(std::uint32_t signal) { signals_[count_++] = signal; }
  bool is_full() const { return count_ == signals_.size(); }
  bool empty() const { return count_ == 0; }
  std::uint32_t operator[](std::size_t i) const { return signals_[i]; }
  const std::uint32_t* begin() const { return signals_.data(); }
  const std::uint32_t* end() const { return signals_.data() + count_; }

 private:
  std::array<std::uint32_t, kDuplicatesMax> signals_{};
  std::size_t count_ = 0;
};

class Resolver {
 public:
  explicit Resolver(Draft& draft) : draft_(draft), db_(draft.database) {}
  void run();

 private:
  void index_messages();
  Indices find_messages(std::uint32_t raw_id);
  FoundSignals find_signals(std::uint32_t message, std::string_view name);
  // Calls action(signal, its source) for each signal referred to; warns and keeps the statement if
  // there is none.
  template <typename Action>
  void for_signals(const Reference& reference, Action action);
  template <typename Action>
  void for_messages(const Reference& reference, Action action);
  EnvironmentVariable* find_variable(std::string_view name);
  void unresolved(const Reference& reference, const char* code, const std::string& what);

  void comments();
  Text joined(const std::vector<const CommentRef*>& references, bool network);
  void value_tables();
  void data_bytes();
  void attribute_defaults();
  void attributes();
  struct AttributeValue {
    const AttributeRef* reference = nullptr;
    Text text;
    Text name() const { return reference->attribute; }
  };
  Attributes attribute_table(std::vector<AttributeValue>& values);
  void relations();
  void values();
  void value_types();
  void senders();
  void groups();
  void multiplexing();
  void multiplex_message(std::uint32_t message, std::span<const MultiplexRef* const> rules);
  void frame_formats();
  void cycle_times();
  void long_names();
  void unassigned();
  void kept_text();

  const AttributeDef* definition_of(std::string_view name) const;
  Text attribute_text(const AttributeRef& reference);
  Text message_attribute(const MessageDef& message, const char* name) const;

  Draft& draft_;
  Database& db_;
  std::vector<std::uint32_t> by_id_;  // messages by raw identifier, then file order
  std::map<std::uint32_t, std::vector<std::uint32_t>> by_name_;  // of large messages: their signals
  std::map<std::string_view, std::size_t> variables_;
  std::set<std::string_view> nodes_;
  std::map<std::string_view, std::size_t> definitions_;
  Indices last_messages_;
  std::vector<std::pair<Text, Text>> entries_;
};

void Resolver::index_messages() {
  by_id_.resize(db_.messages.size());
  std::iota(by_id_.begin(), by_id_.end(), 0U);
  std::stable_sort(by_id_.begin(), by_id_.end(), [&](std::uint32_t a, std::uint32_t b) {
    return draft_.messages[a].raw_id < draft_.messages[b].raw_id;
  });
  for (std::size_t i = 0; i < db_.environment_variables.size(); ++i) {
    variables_.emplace(db_.environment_variables[i].name, i);
  }
  nodes_.insert(db_.nodes.begin(), db_.nodes.end());
  for (std::size_t i = 0; i < db_.attribute_definitions.size(); ++i) {
    definitions_[db_.attribute_definitions[i].name] = i;  // the last one stands
  }
}

Indices Resolver::find_messages(std::uint32_t raw_id) {
  if (!last_messages_.empty() && draft_.messages[last_messages_[0]].raw_id == raw_id) {
    return last_messages_;
  }
  const auto less = [&](std::uint32_t message, std::uint32_t id) {
    return draft_.messages[message].raw_id < id;
  };
  const auto first = std::lower_bound(by_id_.begin(), by_id_.end(), raw_id, less);
  std::size_t count = 0;
  while (count < kDuplicatesMax && first + static_cast<std::ptrdiff_t>(count) != by_id_.end() &&
         draft_.messages[*(first + static_cast<std::ptrdiff_t>(count))].raw_id == raw_id) {
    ++count;
  }
  if (count == 0) return {};
  last_messages_ = Indices(&*first, count);
  return last_messages_;
}

FoundSignals Resolver::find_signals(std::uint32_t message, std::string_view name) {
  const std::vector<SignalDef>& signals = db_.messages[message].signals;
  FoundSignals found;
  constexpr std::size_t kLookedThrough =
      32;  // chosen: no dearer than an index, which would be kept
  if (signals.size() <= kLookedThrough) {
    for (std::uint32_t i = 0; i < signals.size() && !found.is_full(); ++i) {
      if (signals[i].name == name) found.add(i);
    }
    return found;
  }
  std::vector<std::uint32_t>& order = by_name_[message];
  if (order.size() != signals.size()) {
    order.resize(signals.size());
    std::iota(order.begin(), order.end(), 0U);
    std::stable_sort(order.begin(), order.end(), [&](std::uint32_t a, std::uint32_t b) {
      return signals[a].name < signals[b].name;
    });
  }
  const auto less = [&](std::uint32_t signal, std::string_view wanted) {
    return signals[signal].name < wanted;
  };
  for (auto at = std::lower_bound(order.begin(), order.end(), name, less);
       at != order.end() && !found.is_full() && signals[*at].name == name; ++at) {
    found.add(*at);
  }
  return found;
}

void Resolver::unresolved(const Reference& reference, const char* code, const std::string& what) {
  draft_.problems.warn(reference.offset, code, what + "; kept as text");
  draft_.keep(reference.offset, reference.end);
}

template <typename Action>
void Resolver::for_messages(const Reference& reference, Action action) {
  const Indices messages = find_messages(reference.raw_id);
  if (messages.empty()) {
    unresolved(reference, "unknown-message",
               "no message has the identifier " + std::to_string(reference.raw_id));
  }
  for (const std::uint32_t message : messages) action(db_.messages[message]);
}

template <typename Action>
void Resolver::for_signals(const Reference& reference, Action action) {
  if (reference.name.empty()) return draft_.keep(reference.offset, reference.end);  // said before
  const Indices messages = find_messages(reference.raw_id);
  if (messages.empty()) {
    unresolved(reference, "unknown-message",
               "no message has the identifier " + std::to_string(reference.raw_id));
    return;
  }
  const std::string converted = is_ascii(reference.name) ? "" : draft_.utf8(reference.name);
  const std::string_view name = converted.empty() ? reference.name : std::string_view(converted);
  bool found = false;
  for (const std::uint32_t message : messages) {
    for (const std::uint32_t signal : find_signals(message, name)) {
      found = true;
      action(db_.messages[message].signals[signal]);
    }
  }
  if (!found) {
    unresolved(reference, "unknown-signal",
               "message \"" + clip(db_.messages[messages[0]].name) + "\" has no signal \"" +
                   clip(name) + "\"");
  }
}

EnvironmentVariable* Resolver::find_variable(std::string_view name) {
  const auto found = variables_.find(name);
  return found == variables_.end() ? nullptr : &db_.environment_variables[found->second];
}

void Resolver::comments() {
  Gathered<ShortText, const CommentRef*> said(draft_.comments.size());
  for (const CommentRef& reference : draft_.comments) {
    const auto take = [&](ShortText& comment) { said.add(&comment, &reference); };
    if (reference.object == Object::kNetwork) {
      take(db_.comment);
    } else if (reference.object == Object::kMessage) {
      for_messages(reference, [&](MessageDef& message) { take(message.comment); });
    } else if (reference.object == Object::kSignal) {
      for_signals(reference, [&](SignalDef& signal) { take(signal.comment); });
    } else if (reference.name.empty()) {
      draft_.keep(reference.offset, reference.end);
    } else if (reference.object == Object::kNode) {
      const Text name = draft_.utf8(reference.name);
      if (!nodes_.contains(name)) {
        unresolved(reference, "unknown-node", "no node is named \"" + clip(name) + "\"");
      } else {
        take(db_.node_details[name].comment);
      }
    } else if (EnvironmentVariable* variable = find_variable(draft_.utf8(reference.name))) {
      take(variable->comment);
    } else {
      unresolved(reference, "unknown-variable",
                 "no environment variable is named \"" + clip(reference.name) + "\"");
    }
  }
  said.give([&](ShortText& comment, const std::vector<const CommentRef*>& references) {
    comment = draft_.arena().shorten(joined(references, &comment == &db_.comment));
  });
}

// A second comment of one object joins the first; of the network, without a break between.
Text Resolver::joined(const std::vector<const CommentRef*>& references, bool network) {
  if (references.size() == 1) return references[0]->text;
  std::string text;
  for (const CommentRef* reference : references) {
    if (!text.empty() && !network) {
      draft_.problems.warn(reference->offset, "duplicate-comment",
                           "a second comment of the same object; joined to the first");
      text += '\n';
    }
    text += reference->text;
  }
  return draft_.arena().keep(text);
}

void Resolver::data_bytes() {
  for (const DataBytesRef& reference : draft_.data_bytes) {
    if (EnvironmentVariable* variable = find_variable(draft_.utf8(reference.name))) {
      variable->data_bytes = reference.bytes;
    } else {
      unresolved(reference, "unknown-variable",
                 "no environment variable is named \"" + clip(reference.name) + "\"");
    }
  }
}

const AttributeDef* Resolver::definition_of(std::string_view name) const {
  const auto found = definitions_.find(name);
  return found == definitions_.end() ? nullptr : &db_.attribute_definitions[found->second];
}

// The value as it is shown: of an enumeration the text chosen, whether the file gives its number or
// the text itself.
Text Resolver::attribute_text(const AttributeRef& reference) {
  const AttributeDef* definition = definition_of(reference.attribute);
  if (definition == nullptr) {
    draft_.problems.warn(reference.offset, "undefined-attribute",
                         "attribute \"" + clip(reference.attribute) + "\" is not defined");
    return reference.value;
  }
  const char* const begin = reference.value.data();
  const char* const end = begin + reference.value.size();
  if (definition->type != "ENUM") {
    double value = 0.0;
    const bool is_number = std::from_chars(begin, end, value).ec == std::errc{};
    const bool has_range =
        definition->minimum && definition->maximum && *definition->minimum < *definition->maximum;
    if (is_number && has_range &&
        !(value >= *definition->minimum && value <= *definition->maximum)) {
      draft_.problems.warn(reference.offset, "attribute-range",
                           "value " + clip(reference.value) + " of attribute \"" +
                               clip(reference.attribute) + "\" is outside its range");
    }
    return reference.value;
  }
  std::size_t index = 0;
  const auto [rest, status] = std::from_chars(begin, end, index);
  if (status != std::errc{} || rest != end) {
    const auto& choices = definition->choices;
    constexpr std::size_t kChoicesLookedAt = 256;
    const auto last =
        choices.begin() + static_cast<std::ptrdiff_t>(std::min(choices.size(), kChoicesLookedAt));
    const bool known = std::find(choices.begin(), last, reference.value) != last;
    if (!known && choices.size() <= kChoicesLookedAt && !reference.value.empty()) {
      draft_.problems.warn(reference.offset, "enum-text",
                           "\"" + clip(reference.value) + "\" is no choice of attribute \"" +
                               clip(reference.attribute) + "\"");
    }
    return reference.value;
  }
  if (index >= definition->choices.size()) {
    if (!definition->choices.empty()) {
      draft_.problems.warn(reference.offset, "enum-range",
                           "number " + clip(reference.value) + " of an enumeration of " +
                               std::to_string(definition->choices.size()));
    }
    return reference.value;
  }
  const Text choice = definition->choices[index];
  return choice.size() <= kChoiceLengthMax ? choice : reference.value;
}

void Resolver::attribute_defaults() {
  for (const AttributeRef& reference : draft_.attributes) {
    if (reference.object != Object::kDefault) continue;
    const auto found = definitions_.find(reference.attribute);
    if (found == definitions_.end()) {
      unresolved(reference, "undefined-attribute",
                 "attribute \"" + clip(reference.attribute) + "\" is not defined");
      continue;
    }
    db_.attribute_definitions[found->second].default_value = attribute_text(reference);
  }
}

void Resolver::attributes() {
  Gathered<Attributes, AttributeValue> said(draft_.attributes.size());
  for (const AttributeRef& reference : draft_.attributes) {
    if (reference.object == Object::kDefault) continue;
    const AttributeValue value{&reference, attribute_text(reference)};
    const auto take = [&](Attributes& attributes) { said.add(&attributes, value); };
    if (reference.object == Object::kNetwork) {
      take(db_.attributes);
    } else if (reference.object == Object::kMessage) {
      for_messages(reference, [&](MessageDef& message) { take(message.attributes); });
    } else if (reference.object == Object::kSignal) {
      for_signals(reference, [&](SignalDef& signal) { take(signal.attributes); });
    } else if (reference.name.empty()) {
      draft_.keep(reference.offset, reference.end);  // said before
    } else if (reference.object == Object::kNode) {
      const Text name = draft_.utf8(reference.name);
      if (!nodes_.contains(name)) {
        unresolved(reference, "unknown-node", "no node is named \"" + clip(name) + "\"");
      } else {
        take(db_.node_details[name].attributes);
      }
    } else if (EnvironmentVariable* variable = find_variable(draft_.utf8(reference.name))) {
      take(variable->attributes);
    } else {
      unresolved(reference, "unknown-variable",
                 "no environment variable is named \"" + clip(reference.name) + "\"");
    }
  }
  said.give([&](Attributes& attributes, std::vector<AttributeValue>& values) {
    attributes = attribute_table(values);
  });
}

// By their names. Of several values of one the last stands.
Attributes Resolver::attribute_table(std::vector<AttributeValue>& values) {
  std::stable_sort(
      values.begin(), values.end(),
      [](const AttributeValue& a, const AttributeValue& b) { return a.name() < b.name(); });
  entries_.clear();
  for (const AttributeValue& value : values) {
    if (entries_.empty() || entries_.back().first != value.name()) {
      entries_.emplace_back(value.name(), value.text);
      continue;
    }
    entries_.back().second = value.text;
    draft_.problems.warn(
        value.reference->offset, "duplicate-attribute",
        "attribute \"" + clip(value.name()) + "\" of the same object again; this value is used");
  }
  return draft_.arena().table(entries_);
}

void Resolver::relations() {
  for (RelationRef& reference : draft_.relations) {
    RelationAttribute relation;
    relation.name = reference.attribute;
    relation.kind = Text(reference.kind);
    relation.node = draft_.utf8(reference.node);
    relation.value = reference.value;
    if (reference.kind == "BU_EV_REL_") {
      relation.object = draft_.utf8(reference.name);
    } else {
      const Indices messages = find_messages(reference.raw_id);
      if (messages.empty()) {
        unresolved(reference, "unknown-message",
                   "no message has the identifier " + std::to_string(reference.raw_id));
        continue;
      }
      relation.object = db_.messages[messages[0]].name;
      if (reference.kind == "BU_SG_REL_") {
        relation.object = draft_.arena().keep(relation.object + "." + draft_.utf8(reference.name));
      }
    }
    db_.relations.push_back(relation);
  }
}

void Resolver::values() {
  // A table used by name is copied; so much copying that the file cannot have meant it is refused.
  std::size_t budget = 16 * (draft_.text.size() + 4096);
  std::map<std::string_view, std::size_t> costs;  // of the tables used so far
  for (ValuesRef& reference : draft_.values) {
    if (!reference.table.empty()) {
      const auto table = db_.value_tables.find(draft_.utf8(reference.table));
      if (table == db_.value_tables.end()) {
        unresolved(reference, "unknown-table",
                   "no value table is named \"" + clip(reference.table) + "\"");
        continue;
      }
      const auto [place, is_new] = costs.try_emplace(table->first, 0);
      std::size_t& cost = place->second;
      if (is_new) {
        for (const auto& [key, text] : table->second) cost += 16 + text.size();
      }
      if (cost > budget) {
        unresolved(reference, "tables-too-large", "the value tables used by name are too large");
        budget = 0;
        continue;
      }
      budget -= cost;
      reference.values = table->second;
    }
    const auto take = [&](ValueTable& values) {
      if (!values.empty()) {
        draft_.problems.warn(reference.offset, "duplicate-values",
                             "values of the same object again; these are used");
      }
      values = reference.values;
    };
    if (reference.object == Object::kSignal) {
      if (reference.values.empty()) continue;
      for_signals(reference, [&](SignalDef& signal) { take(signal.values); });
    } else if (EnvironmentVariable* variable = find_variable(draft_.utf8(reference.name))) {
      take(variable->values);
    } else {
      unresolved(reference, "unknown-variable",
                 "no environment variable is named \"" + clip(reference.name) + "\"");
    }
  }
}

void Resolver::value_types() {
  for (const ValueTypeRef& reference : draft_.value_types) {
    for_signals(reference, [&](SignalDef& signal) {
      if (reference.type == 0) return;
      const bool width_known = signal.length == 16 || signal.length == 32 || signal.length == 64;
      if (reference.type > 2 || !width_known) {
        draft_.problems.warn(reference.offset, "value-type",
                             "value type " + std::to_string(reference.type) + " with " +
                                 std::to_string(signal.length) +
                                 " bits, expected 1 with 32 or 2 with 64; read as an integer");
        return;
      }
      if ((reference.type == 1) != (signal.length <= 32)) {
        draft_.problems.warn(reference.offset, "value-type",
                             "value type " + std::to_string(reference.type) + " with " +
                                 std::to_string(signal.length) + " bits; read as the float of " +
                                 std::to_string(signal.length) + " bits");
      }
      signal.type = signal.length == 64 ? ValueType::kFloat64 : ValueType::kFloat32;
    });
  }
}

void Resolver::senders() {
  Gathered<MessageDef, const SendersRef*> said(draft_.senders.size());
  for (const SendersRef& reference : draft_.senders) {
    for_messages(reference, [&](MessageDef& message) { said.add(&message, &reference); });
  }
  std::vector<Text> all;
  said.give([&](MessageDef& message, const std::vector<const SendersRef*>& references) {
    all.clear();
    for (const SendersRef* each : references) {
      all.insert(all.end(), each->senders.begin(), each->senders.end());
    }
    message.senders = draft_.arena().list(all);
  });
}

void Resolver::groups() {
  Gathered<MessageDef, SignalGroup> said(draft_.groups.size());
  for (const GroupRef& reference : draft_.groups) {
    for_messages(reference, [&](MessageDef& message) {
      for (const Text name : reference.group.signals) {
        const auto index = static_cast<std::uint32_t>(&message - db_.messages.data());
        if (!find_signals(index, name).empty()) continue;
        draft_.problems.warn(reference.offset, "unknown-signal",
                             "message \"" + clip(message.name) + "\" has no signal \"" +
                                 clip(name) + "\", which a group names");
      }
      said.add(&message, reference.group);
    });
  }
  said.give([&](MessageDef& message, const std::vector<SignalGroup>& groups) {
    message.groups = draft_.arena().list(groups);
  });
}

// One message: which signal selects which. SG_MUL_VAL_ says so where it stands; else "m3" is
// selected by the only multiplexer there is.
void Resolver::multiplex_message(std::uint32_t message,
                                 std::span<const MultiplexRef* const> rules) {
  MessageDef& definition = db_.messages[message];
  const MessageSource& source = draft_.messages[message];
  std::vector<SignalDef>& signals = definition.signals;

  struct RuleRead {
    Text selector;
    std::vector<ValueRange> ranges;
  };
  std::map<std::uint32_t, RuleRead> rules_of;  // by signal
  for (const MultiplexRef* rule : rules) {
    const FoundSignals targets = find_signals(message, draft_.utf8(rule->name));
    const FoundSignals selectors = find_signals(message, draft_.utf8(rule->selector));
    if (targets.empty() || selectors.empty()) {
      unresolved(*rule, "unknown-signal",
                 "message \"" + clip(definition.name) + "\" has no signal \"" +
                     clip(targets.empty() ? rule->name : rule->selector) + "\"");
      continue;
    }
    const SignalDef& selector = signals[selectors[0]];
    if (!selector.is_multiplexer) {
      draft_.problems.warn(rule->offset, "mux-selector",
                           "signal \"" + clip(selector.name) +
                               "\" selects others but is not marked as a multiplexer with M");
    }
    for (const std::uint32_t target : targets) {
      const auto [known, is_new] = rules_of.try_emplace(target, RuleRead{selector.name, {}});
      RuleRead& read = known->second;
      if (!is_new && read.selector != selector.name) {
        unresolved(*rule, "mux-two-selectors",
                   "signal \"" + clip(signals[target].name) +
                       "\" has a second multiplexer; the first one is used");
        continue;
      }
      read.ranges.insert(read.ranges.end(), rule->ranges.begin(), rule->ranges.end());
    }
  }
  for (const auto& [signal, read] : rules_of) {
    signals[signal].multiplexed_by =
        draft_.arena().one(MuxRule{read.selector, draft_.arena().list(read.ranges)});
  }

  std::size_t multiplexers = 0;
  std::size_t only = 0;
  for (std::size_t i = 0; i < signals.size(); ++i) {
    if (!signals[i].is_multiplexer) continue;
    ++multiplexers;
    only = i;
  }
  for (const SelectorValue& selected : source.selector_values) {
    const std::size_t i = selected.signal;
    if (signals[i].multiplexed_by != nullptr) continue;
    if (multiplexers == 1 && only != i) {
      const std::vector<ValueRange> range{{selected.value, selected.value}};
      signals[i].multiplexed_by =
          draft_.arena().one(MuxRule{signals[only].name, draft_.arena().list(range)});
      continue;
    }
    if (multiplexers == 1) continue;  // "m0M" alone: the multiplexer of the others
    draft_.problems.warn(source.name_offset(i), multiplexers == 0 ? "mux-missing" : "mux-ambiguous",
                         "signal \"" + clip(signals[i].name) +
                             "\" is multiplexed, but its message " +
                             (multiplexers == 0 ? "has no multiplexer"
                                                : "has several multiplexers and no SG_MUL_VAL_ "
                                                  "says which selects it") +
                             "; it is read in every frame");
  }
}

void Resolver::multiplexing() {
  // The rules of each message, in file order.
  std::vector<std::pair<std::uint32_t, const MultiplexRef*>> rules;
  for (const MultiplexRef& reference : draft_.multiplexes) {
    for_messages(reference, [&](MessageDef& message) {
      rules.emplace_back(static_cast<std::uint32_t>(&message - db_.messages.data()), &reference);
    });
  }
  std::stable_sort(rules.begin(), rules.end(),
                   [](const auto& a, const auto& b) { return a.first < b.first; });
  std::vector<const MultiplexRef*> own;
  std::size_t next = 0;
  for (std::uint32_t message = 0; message < db_.messages.size(); ++message) {
    own.clear();
    for (; next < rules.size() && rules[next].first == message; ++next) {
      own.push_back(rules[next].second);
    }
    multiplex_message(message, own);
  }
}

// The attribute's value for this message, or its default.
Text Resolver::message_attribute(const MessageDef& message, const char* name) const {
  const auto own = message.attributes.find(name);
  if (own != message.attributes.end()) return own->second;
  const AttributeDef* definition = definition_of(name);
  return definition != nullptr ? definition->default_value.value_or("") : "";
}

// VFrameFormat as text, or where it is a plain number by the numbers Vector's tools use: 3 J1939PG,
// 14 StandardCAN_FD, 15 ExtendedCAN_FD. Without it the network's protocol decides; a file that says
// neither but whose 29-bit identifiers all have the null source address 0xFE, which no node sends
// data with, can only mean parameter groups (NMEA 2000 files are like that).
void Resolver::frame_formats() {
  const auto network = [&](const char* name) {
    const auto own = db_.attributes.find(name);
    if (own != db_.attributes.end() && !own->second.empty()) return own->second;
    const AttributeDef* definition = definition_of(name);
    return definition != nullptr ? definition->default_value.value_or("") : Text();
  };
  const Text protocol = network("ProtocolType");
  const auto mentions = [&](std::string_view word) {
    return std::search(protocol.begin(), protocol.end(), word.begin(), word.end(),
                       [](char a, char b) { return std::toupper(a) == b; }) != protocol.end();
  };
  const bool network_j1939 = mentions("J1939") || mentions("NMEA") || mentions("N2K") ||
                             mentions("ISOBUS") || mentions("ISO11783");
  constexpr std::uint32_t kNullAddress = 0xFE;
  const bool null_sources =
      protocol.empty() &&
      std::all_of(db_.messages.begin(), db_.messages.end(), [&](const MessageDef& message) {
        return !message.id.extended || (message.id.value & 0xFFU) == kNullAddress ||
               message.name == kIndependentMessage;
      });
  for (MessageDef& message : db_.messages) {
    const Text format = message_attribute(message, "VFrameFormat");
    const bool own = message.attributes.contains("VFrameFormat");
    message.fd = format.ends_with("FD") || format == "14" || format == "15";
    if (!message.id.extended) continue;
    const bool names_j1939 = format == "J1939PG" || format == "3";
    const bool names_other = own && !format.empty() && !names_j1939;
    message.j1939 = names_j1939 || (!names_other && (network_j1939 || null_sources));
  }
}

void Resolver::cycle_times() {
  for (MessageDef& message : db_.messages) {
    const Text text = message_attribute(message, "GenMsgCycleTime");
    double period_ms = 0.0;
    const auto [end, status] = std::from_chars(text.data(), text.data() + text.size(), period_ms);
    if (status == std::errc{} && std::isfinite(period_ms) && period_ms > 0.0) {
      message.cycle_ms = period_ms;
    }
  }
}

// Long names by attribute. Last, for everything else refers by the short ones.
void Resolver::long_names() {
  const auto long_name = [](const Attributes& attributes, const char* name) -> const Text* {
    const auto* found = attributes.find(name);
    const bool usable = found != attributes.end() && !found->second.empty() &&
                        found->second.size() <= kLongNameLengthMax;
    return usable ? &found->second : nullptr;
  };

  std::map<Text, Text> nodes;  // short -> long
  for (const auto& [name, node] : db_.node_details) {
    if (const Text* replacement = long_name(node.attributes, "SystemNodeLongSymbol")) {
      if (*replacement != name) nodes.emplace(name, *replacement);
    }
  }
  const auto rename_node = [&](Text& name) {
    const auto found = nodes.find(name);
    if (found != nodes.end()) name = found->second;
  };
  if (!nodes.empty()) {
    std::map<Text, NodeDef> details;
    for (auto& [name, node] : db_.node_details) {
      const auto found = nodes.find(name);
      if (found != nodes.end()) node.short_name = draft_.arena().shorten(name);
      details.insert_or_assign(found != nodes.end() ? found->second : name, node);
    }
    db_.node_details = std::move(details);
    for (Text& name : db_.nodes) rename_node(name);
    for (RelationAttribute& relation : db_.relations) rename_node(relation.node);
  }
  for (EnvironmentVariable& variable : db_.environment_variables) {
    if (const Text* name = long_name(variable.attributes, "SystemEnvVarLongSymbol")) {
      variable.name = *name;
    }
    for (Text& node : variable.access_nodes) rename_node(node);
  }

  std::vector<Text> renamed;
  const auto rename_each = [&](List<Text>& names, const auto& rename) {
    renamed.assign(names.begin(), names.end());
    for (Text& name : renamed) rename(name);
    if (!(names == renamed)) names = draft_.arena().list(renamed);
  };
  for (MessageDef& message : db_.messages) {
    if (const Text* name = long_name(message.attributes, "SystemMessageLongSymbol")) {
      if (*name != message.name) {
        message.short_name = draft_.arena().shorten(std::exchange(message.name, *name));
      }
    }
    if (!nodes.empty()) {
      rename_node(message.transmitter);
      rename_each(message.senders, rename_node);
    }
    std::map<Text, Text> signals;  // short -> long
    for (SignalDef& signal : message.signals) {
      if (!nodes.empty()) {
        SignalUsage usage = *signal.usage;
        rename_each(usage.receivers, rename_node);
        if (!(usage.receivers == signal.usage->receivers)) signal.usage = draft_.arena().one(usage);
      }
      const Text* name = long_name(signal.attributes, "SystemSignalLongSymbol");
      if (name == nullptr || *name == signal.name) continue;
      signal.short_name = draft_.arena().shorten(signal.name);
      signals.emplace(std::exchange(signal.name, *name), *name);
    }
    if (signals.empty()) continue;
    const auto rename_signal = [&](Text& name) {
      const auto found = signals.find(name);
      if (found != signals.end()) name = found->second;
    };
    for (SignalDef& signal : message.signals) {
      if (signal.multiplexed_by == nullptr) continue;
      MuxRule rule = *signal.multiplexed_by;
      rename_signal(rule.selector);
      signal.multiplexed_by = draft_.arena().one(rule);
    }
    std::vector<SignalGroup> groups(message.groups.begin(), message.groups.end());
    for (SignalGroup& group : groups) rename_each(group.signals, rename_signal);
    message.groups = draft_.arena().list(groups);
  }
}

void Resolver::unassigned() {
  std::size_t kept = 0;
  for (std::size_t i = 0; i < db_.messages.size(); ++i) {
    const bool independent =
        db_.messages[i].name == kIndependentMessage || draft_.messages[i].raw_id == kIndependentId;
    if (independent) {
      auto& signals = db_.messages[i].signals;
      std::move(signals.begin(), signals.end(), std::back_inserter(db_.unassigned_signals));
      continue;
    }
    if (kept != i) {
      db_.messages[kept] = std::move(db_.messages[i]);
      draft_.messages[kept] = draft_.messages[i];
    }
    ++kept;
  }
  db_.messages.resize(kept);
  draft_.messages.resize(kept);
}

void Resolver::kept_text() {
  std::stable_sort(draft_.kept.begin(), draft_.kept.end(),
                   [](const Reference& a, const Reference& b) { return a.offset < b.offset; });
  LineCounter lines(draft_.text);
  std::size_t covered = 0;  // a statement is kept once, whatever the number of reasons
  for (const Reference& span : draft_.kept) {
    if (span.end <= covered) continue;
    covered = span.end;
    std::string_view text = draft_.text.substr(span.offset, span.end - span.offset);
    while (!text.empty() && static_cast<unsigned char>(text.back()) <= ' ') text.remove_suffix(1);
    db_.other_statements.push_back({lines.at(span.offset).line, draft_.utf8(text)});
  }
}

// What has been brought together is given back at once: a large file is in memory as few times as
// can be.
void Resolver::run() {
  index_messages();
  comments();
  draft_.comments = {};
  data_bytes();
  attribute_defaults();
  attributes();
  draft_.attributes = {};
  relations();
  draft_.relations = {};
  values();
  draft_.values = {};
  value_types();
  senders();
  groups();
  multiplexing();
  draft_.multiplexes = {};
  by_name_ = {};
  frame_formats();
  cycle_times();
  long_names();
  unassigned();
  kept_text();
}

}  // namespace

void resolve(Draft& draft) { Resolver(draft).run(); }

}  // namespace beltgrip::can::dbc
