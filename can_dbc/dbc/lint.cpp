// Third step of the DBC parser: oddities of what was read. Each is one warning at the object that
// is odd; nothing is changed here.
#include <algorithm>
#include <bitset>
#include <cmath>
#include <map>
#include <numeric>
#include <set>

#include "can_dbc/dbc/draft.h"

namespace beltgrip::can::dbc {

namespace {

constexpr std::uint32_t kClassicLengthMax = 8;
constexpr std::uint32_t kFdLengthMax = 64;
constexpr std::size_t kFdBits = 512;
constexpr std::uint32_t kJ1939LengthMax = 1785;  // transport protocol

// The bits of a signal, counted so that they are consecutive in either byte order: bit b of byte B
// is 8 B + b (little endian) or 8 B + 7 - b (big endian).
std::uint64_t first_bit(const SignalDef& signal) {
  const std::uint32_t byte = signal.start_bit / 8;
  const std::uint32_t bit = signal.start_bit % 8;
  return std::uint64_t{byte} * 8 + (signal.byte_order == ByteOrder::kLittle ? bit : 7 - bit);
}

// The bits of each byte the other way round.
constexpr std::uint64_t reversed_in_bytes(std::uint64_t bits) {
  constexpr std::uint64_t kFours = 0x0F0F'0F0F'0F0F'0F0FU;
  constexpr std::uint64_t kTwos = 0x3333'3333'3333'3333U;
  constexpr std::uint64_t kOnes = 0x5555'5555'5555'5555U;
  bits = (bits & kFours) << 4 | (bits >> 4 & kFours);
  bits = (bits & kTwos) << 2 | (bits >> 2 & kTwos);
  return (bits & kOnes) << 1 | (bits >> 1 & kOnes);
}

// Signals of one message that share bits though a frame can carry both. Two signals exclude each
// other when some selector, their own or one further up, would need two values at once.
class OverlapCheck {
 public:
  OverlapCheck(const MessageDef& message, const MessageSource& source, ProblemList& problems)
      : message_(message), source_(source), problems_(problems) {}
  void run();

 private:
  // Bounds that keep the check linear in the text; beyond them it is left out, and said.
  static constexpr std::size_t kGroupsMax = 512;
  static constexpr std::size_t kRangesMax = 1024;
  static constexpr std::size_t kDepthMax = 4;  // selectors above each other
  using Ranges = List<ValueRange>;
  using GroupSet = std::bitset<kGroupsMax>;
  struct Condition {
    std::size_t selector;  // index of the signal
    const Ranges* ranges;
  };
  // Signals of one group are in a frame under the same conditions: their own and those further up.
  using Group = std::vector<Condition>;
  struct Taken {
    GroupSet groups;
    std::size_t signal = 0;  // the last one
  };

  static bool exclude(const Group& a, const Group& b);
  bool collect_groups();

  const MessageDef& message_;
  const MessageSource& source_;
  ProblemList& problems_;
  std::vector<Group> groups_;
  std::vector<std::size_t> group_of_;  // each signal's
};

bool OverlapCheck::exclude(const Group& a, const Group& b) {
  const auto common = [](const Ranges& p, const Ranges& q) {
    return std::any_of(p.begin(), p.end(), [&](const auto& x) {
      return std::any_of(q.begin(), q.end(),
                         [&](const auto& y) { return x.first <= y.second && y.first <= x.second; });
    });
  };
  for (const Condition& x : a) {
    for (const Condition& y : b) {
      if (x.selector == y.selector && !common(*x.ranges, *y.ranges)) return true;
    }
  }
  return false;
}

bool OverlapCheck::collect_groups() {
  const std::vector<SignalDef>& signals = message_.signals;
  groups_.push_back({});  // in every frame
  std::map<std::string_view, std::size_t> by_name;
  std::size_t ranges = 0;
  for (std::size_t i = 0; i < signals.size(); ++i) {
    by_name.emplace(signals[i].name, i);
    const MuxRule* const rule = signals[i].multiplexed_by;
    if (rule) ranges += rule->ranges.size();
  }
  if (ranges > kRangesMax) return false;
  std::map<std::pair<std::size_t, std::vector<ValueRange>>, std::size_t> known;
  for (const SignalDef& signal : signals) {
    Group group;
    const SignalDef* at = &signal;
    while (group.size() < kDepthMax) {
      const MuxRule* const rule = at->multiplexed_by;
      if (!rule) break;
      const auto selector = by_name.find(rule->selector);
      if (selector == by_name.end()) break;
      group.push_back({selector->second, &rule->ranges});
      at = &signals[selector->second];
    }
    if (group.empty()) {
      group_of_.push_back(0);
      continue;
    }
    const auto [place, is_new] = known.try_emplace(
        {group[0].selector, {group[0].ranges->begin(), group[0].ranges->end()}}, groups_.size());
    group_of_.push_back(place->second);
    if (!is_new) continue;
    if (groups_.size() == kGroupsMax) return false;
    groups_.push_back(std::move(group));
  }
  return true;
}

void OverlapCheck::run() {
  if (!collect_groups()) {
    problems_.warn(source_.offset, "overlap-unchecked",
                   "message \"" + clip(message_.name) +
                       "\" has too many multiplexed parts to look for overlapping signals");
    return;
  }
  std::vector<GroupSet> meets(groups_.size());  // groups that one frame can carry together
  for (std::size_t a = 0; a < groups_.size(); ++a) {
    for (std::size_t b = 0; b <= a; ++b) {
      if (exclude(groups_[a], groups_[b])) continue;
      meets[a].set(b);
      meets[b].set(a);
    }
  }

  // Payload bits as byte * 8 + bit; only those that some signal has get a place.
  const auto bits_of = [](const SignalDef& signal, auto action) {
    const std::uint64_t first = first_bit(signal);
    const bool little = signal.byte_order == ByteOrder::kLittle;
    for (std::uint64_t k = first; k < first + std::min(signal.length, 64U); ++k) {
      action(little ? k : k / 8 * 8 + 7 - k % 8);
    }
  };
  std::uint64_t dense = 0;  // bits below have their number as their place
  std::vector<std::uint64_t> places;
  constexpr std::uint64_t kDenseMax = kFdBits;
  for (const SignalDef& signal : message_.signals) {
    bits_of(signal, [&](std::uint64_t bit) {
      if (bit >= kDenseMax) {
        places.push_back(bit);
      } else {
        dense = std::max(dense, bit + 1);
      }
    });
  }
  std::sort(places.begin(), places.end());
  places.erase(std::unique(places.begin(), places.end()), places.end());
  std::vector<Taken> taken(dense + places.size());

  for (std::size_t i = 0; i < message_.signals.size(); ++i) {
    const SignalDef& signal = message_.signals[i];
    bool overlaps = false;
    std::size_t other = 0;
    bits_of(signal, [&](std::uint64_t bit) {
      std::uint64_t index = bit;
      if (bit >= kDenseMax) {
        const auto found = std::lower_bound(places.begin(), places.end(), bit);
        index = dense + static_cast<std::uint64_t>(found - places.begin());
      }
      Taken& place = taken[index];
      if (!overlaps && (place.groups & meets[group_of_[i]]).any()) {
        overlaps = true;
        other = place.signal;
      }
      place.groups.set(group_of_[i]);
      place.signal = i;
    });
    if (overlaps) {
      problems_.warn(source_.name_offset(i), "overlap",
                     "signal \"" + clip(signal.name) + "\" shares bits with \"" +
                         clip(message_.signals[other].name) + "\"");
    }
  }
}

void check_signal(const MessageDef& message, const SignalDef& signal, std::size_t offset,
                  ProblemList& problems) {
  if (signal.length == 0 || signal.length > 64) {
    problems.warn(offset, "signal-length",
                  "signal \"" + clip(signal.name) + "\" has " + std::to_string(signal.length) +
                      " bits, expected 1 to 64; it is never decoded");
  } else if (first_bit(signal) + signal.length > std::uint64_t{message.length} * 8) {
    problems.warn(offset, "overhang",
                  "signal \"" + clip(signal.name) + "\" ends outside the " +
                      std::to_string(message.length) + " bytes of its message");
  }
  if (signal.scale == 0.0) {
    problems.warn(offset, "factor-zero", "signal \"" + clip(signal.name) + "\" has the factor 0");
  }
  if (!std::isfinite(signal.scale) || !std::isfinite(signal.offset)) {
    problems.warn(offset, "not-finite",
                  "factor or offset of signal \"" + clip(signal.name) + "\" is not finite");
  }
  if (signal.usage->minimum > signal.usage->maximum) {
    problems.warn(offset, "range-reversed",
                  "the minimum of signal \"" + clip(signal.name) + "\" is above its maximum");
  }
}

// Selectors that lead back to themselves: none of their signals is ever in a frame.
void check_circles(const MessageDef& message, const MessageSource& source, ProblemList& problems) {
  std::map<std::string_view, std::size_t> by_name;
  for (std::size_t i = 0; i < message.signals.size(); ++i) {
    by_name.emplace(message.signals[i].name, i);
  }
  std::vector<std::size_t> visited(message.signals.size(), 0);
  for (std::size_t i = 0; i < message.signals.size(); ++i) {
    std::size_t at = i;
    while (visited[at] == 0) {
      visited[at] = i + 1;
      const MuxRule* const rule = message.signals[at].multiplexed_by;
      if (!rule) break;
      const auto above = by_name.find(rule->selector);
      if (above == by_name.end()) break;
      at = above->second;
      if (visited[at] == i + 1) {
        problems.warn(source.name_offset(at), "mux-circle",
                      "signal \"" + clip(message.signals[at].name) +
                          "\" is selected through itself; it is never decoded");
      }
    }
  }
}

// The same of a payload of at most eight bytes, by one word: bit b of byte B is 8 B + b. Nothing
// where a signal ends beyond them.
std::optional<bool> bits_of_eight_bytes_taken_twice(const MessageDef& message) {
  std::uint64_t taken = 0;
  for (const SignalDef& signal : message.signals) {
    const std::uint64_t first = first_bit(signal);
    if (signal.length == 0) continue;
    if (signal.length > 64 || first + signal.length > 64) return std::nullopt;
    std::uint64_t bits = (~std::uint64_t{0} >> (64 - signal.length)) << first;
    if (signal.byte_order == ByteOrder::kBig) bits = reversed_in_bytes(bits);
    if ((taken & bits) != 0) return true;
    taken |= bits;
  }
  return false;
}

// Quick look before the thorough one: without multiplexing, every bit of a frame-sized payload has
// one owner.
bool bits_taken_twice(const MessageDef& message) {
  if (const std::optional<bool> known = bits_of_eight_bytes_taken_twice(message)) return *known;
  std::bitset<kFdBits> taken;
  for (const SignalDef& signal : message.signals) {
    const std::uint64_t first = first_bit(signal);
    const bool little = signal.byte_order == ByteOrder::kLittle;
    for (std::uint64_t k = first; k < first + std::min(signal.length, 64U); ++k) {
      const std::uint64_t bit = little ? k : k / 8 * 8 + 7 - k % 8;
      if (bit >= taken.size() || taken[bit]) return true;
      taken[bit] = true;
    }
  }
  return false;
}

void check_message(const MessageDef& message, const MessageSource& source, ProblemList& problems) {
  const std::uint32_t longest = message.j1939 ? kJ1939LengthMax
                                : message.fd  ? kFdLengthMax
                                              : kClassicLengthMax;
  if (message.length > longest) {
    problems.warn(source.offset, "message-length",
                  "message \"" + clip(message.name) + "\" has " + std::to_string(message.length) +
                      " bytes, more than the " + std::to_string(longest) + " of a " +
                      (message.j1939 ? "J1939 message"
                       : message.fd  ? "CAN FD frame"
                                     : "classic frame, and is not marked as CAN FD"));
  }
  std::vector<std::pair<std::size_t, std::size_t>> names;  // hash, signal
  names.reserve(message.signals.size());
  for (std::size_t i = 0; i < message.signals.size(); ++i) {
    check_signal(message, message.signals[i], source.name_offset(i), problems);
    names.emplace_back(std::hash<std::string_view>()(message.signals[i].name), i);
  }
  std::sort(names.begin(), names.end());
  for (std::size_t i = 1; i < names.size(); ++i) {
    const SignalDef& signal = message.signals[names[i].second];
    if (names[i].first != names[i - 1].first ||
        signal.name != message.signals[names[i - 1].second].name) {
      continue;
    }
    problems.warn(
        source.name_offset(names[i].second), "duplicate-signal",
        "message \"" + clip(message.name) + "\" has a second signal \"" + clip(signal.name) + "\"");
  }
  const bool multiplexed =
      std::any_of(message.signals.begin(), message.signals.end(),
                  [](const SignalDef& s) { return s.multiplexed_by != nullptr; });
  if (multiplexed) check_circles(message, source, problems);
  if (multiplexed || bits_taken_twice(message)) OverlapCheck(message, source, problems).run();
}

// The messages in the order of what `of` gives of them, those of the same in the file's.
template <typename Of>
std::vector<std::uint32_t> sorted_by(const std::vector<MessageDef>& messages, Of of) {
  std::vector<std::uint32_t> order(messages.size());
  std::iota(order.begin(), order.end(), 0U);
  std::stable_sort(order.begin(), order.end(), [&](std::uint32_t a, std::uint32_t b) {
    return of(messages[a]) < of(messages[b]);
  });
  return order;
}

void check_names(Draft& draft) {
  const std::vector<MessageDef>& messages = draft.database.messages;
  const std::vector<std::uint32_t> order =
      sorted_by(messages, [](const MessageDef& message) { return message.name; });
  for (std::size_t i = 1; i < order.size(); ++i) {
    const Text name = messages[order[i]].name;
    if (name != messages[order[i - 1]].name) continue;
    draft.problems.warn(draft.messages[order[i]].offset, "duplicate-name",
                        "a second message \"" + clip(name) + "\"");
  }
}

void check_identifiers(Draft& draft) {
  const std::vector<MessageDef>& messages = draft.database.messages;
  const std::vector<std::uint32_t> order =
      sorted_by(messages, [](const MessageDef& message) { return message.id; });
  std::uint32_t first = 0;
  for (std::size_t i = 0; i < order.size(); ++i) {
    const MessageDef& message = messages[order[i]];
    if (i == 0 || message.id != messages[first].id) {
      first = order[i];
      continue;
    }
    draft.problems.warn(draft.messages[order[i]].offset, "duplicate-id",
                        "message \"" + clip(message.name) + "\" has the identifier of \"" +
                            clip(messages[first].name) + "\"; frames are decoded by the first");
  }
}

// Each node used but not declared: once, where it is used first.
void check_nodes(Draft& draft) {
  const Database& db = draft.database;
  std::set<std::string_view> known{"Vector__XXX", "VECTOR__XXX", ""};
  for (std::size_t i = 0; i < db.nodes.size(); ++i) {
    if (!known.insert(db.nodes[i]).second) {
      draft.problems.warn(draft.node_offsets[i], "duplicate-node",
                          "a second node \"" + clip(db.nodes[i]) + "\"");
    }
  }
  std::string_view last;
  const auto used = [&](Text node, std::size_t offset) {
    if (node == last) return;
    last = node;
    if (!known.insert(node).second) return;
    draft.problems.warn(offset, "undeclared-node",
                        "node \"" + clip(node) + "\" is not declared in BU_");
  };
  for (std::size_t i = 0; i < db.messages.size(); ++i) {
    const MessageDef& message = db.messages[i];
    used(message.transmitter, draft.messages[i].offset);
    for (const Text node : message.senders) used(node, draft.messages[i].offset);
    for (std::size_t k = 0; k < message.signals.size(); ++k) {
      for (const Text node : message.signals[k].usage->receivers) {
        used(node, draft.messages[i].name_offset(k));
      }
    }
  }
}

}  // namespace

void lint(Draft& draft) {
  const Database& db = draft.database;
  check_names(draft);
  check_identifiers(draft);
  for (std::size_t i = 0; i < db.messages.size(); ++i) {
    check_message(db.messages[i], draft.messages[i], draft.problems);
  }
  check_nodes(draft);
  if (db.messages.empty()) {
    draft.problems.error(draft.text.size(), "no-message", "the file has no readable message");
  }
}

}  // namespace beltgrip::can::dbc
