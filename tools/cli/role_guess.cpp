#include "tools/cli/role_guess.h"

#include <algorithm>
#include <array>
#include <string_view>

#include "can_dbc/text/unit_text.h"
#include "tools/cli/role_words.h"

namespace beltgrip::cli {

namespace {

// Points of the best word of the group that the name holds; 0: none.
int points(const WordList& group, const std::vector<std::string>& words) {
  for (std::size_t i = 0; i < group.size(); ++i) {
    if (std::find(words.begin(), words.end(), group[i]) != words.end()) {
      return static_cast<int>(group.size() - i) + (group[i].size() > 2 ? 10 : 0);
    }
  }
  return 0;
}

// A longer comment speaks of other signals, too.
constexpr std::size_t kCommentWords = 12;
// One as short as this is a name of its own.
constexpr std::size_t kNameWords = 3;
std::vector<std::string> comment_words(const std::string& comment) {
  std::vector<std::string> words = all_words_of(comment);
  if (words.size() > kCommentWords) words.clear();
  return words;
}

bool is_excluded(const RoleWords& row, const std::vector<std::string>& words) {
  return points(row.excluded, words) > 0 || points(never_words(), words) > 0;
}

// With `lacking` words of its name missing.
int score(const RoleWords& row, const can::MessageDef& message, const can::SignalDef& signal,
          int lacking = 0) {
  const std::vector<std::string> own = all_words_of(signal.name);
  const std::vector<std::string> said = comment_words(signal.comment);
  std::vector<std::string> about = all_words_of(message.name);
  std::erase_if(about, [](const std::string& word) { return word.size() < 2; });  // says nothing
  if (is_excluded(row, own)) return 0;
  if (row.role != daemon::Role::kSecondaryPressureCommand && points(asking_words(), about) > 0) {
    return 0;
  }
  // The name counts most; where it lacks a word the comment or the message's name may supply it, at
  // half its worth, but not all of them.
  int sum = 0;
  bool its_own = false, by_comment = said.size() <= kNameWords;
  for (const WordList& group : row.groups) {
    int gained = 2 * points(group, own);
    its_own = its_own || gained > 0;
    if (gained == 0) {
      gained = points(group, said);
      if (gained > 0) its_own = by_comment = true;
    }
    if (gained == 0) gained = points(group, about);
    if (gained == 0 && lacking-- == 0) return 0;
    sum += gained;
  }
  return !its_own || (by_comment && is_excluded(row, said)) ? 0 : sum;
}

// A physical quantity in fewer bits is a stage or a flag, and so is one whose values have names; a
// flag in more bits is a quantity.
bool fits(const can::SignalDef& signal, can::Dimension dimension) {
  constexpr std::size_t kQuantityBits = 8, kFlagBits = 4;
  constexpr std::size_t kNamesMost = 4;  // "not available", "error", "initialising", "reserved"
  if (dimension == can::Dimension::kNone) return signal.length <= kFlagBits;
  return signal.length >= kQuantityBits && signal.values.size() <= kNamesMost;
}

// Names of the value at which a flag is 1, the more telling ones in front; of several such values
// the one with the shortest name.
const WordList kTrue = {"locked",  "closed",    "lock",      "engaged", "pressed",
                        "applied", "depressed", "permitted", "allowed", "enabled",
                        "active",  "running",   "yes",       "true",    "on"};
const WordList kNotTrue = {"not",      "no",     "un",          "in",      "slip",
                           "slipping", "partly", "partially",   "error",   "fault",
                           "invalid",  "sna",    "unavailable", "reserved"};

int label_points(const std::string& label) {
  const std::vector<std::string> words = words_of(label);
  const bool denied = std::any_of(words.begin(), words.end(), [](const std::string& word) {
    return std::find(kNotTrue.begin(), kNotTrue.end(), word) != kNotTrue.end();
  });
  if (denied) return 0;
  constexpr int kPerWord = 100;
  const int best = points(kTrue, words);
  return best == 0 ? 0
                   : best * kPerWord - static_cast<int>(std::min<std::size_t>(words.size(), 99));
}

bool is_claimed(const can::MessageDef& message, const can::SignalDef& signal) {
  for (std::size_t i = 0; i < daemon::kRoleCount; ++i) {
    if (score(words_for(static_cast<daemon::Role>(i)), message, signal) > 0) return true;
  }
  return false;
}

void put_best_first(std::vector<RoleCandidate>& candidates) {
  std::stable_sort(
      candidates.begin(), candidates.end(),
      [](const RoleCandidate& a, const RoleCandidate& b) { return a.score > b.score; });
}

}  // namespace

TrueWhen guess_true_when(daemon::Role role, const can::SignalDef& signal) {
  TrueWhen result;
  if (daemon::role_dimension(role) != can::Dimension::kNone || signal.values.empty()) return result;
  int best = 0;
  std::int64_t at = 1;
  for (const auto& [value, label] : signal.values) {
    const int gained = label_points(label);
    if (gained <= best) continue;
    best = gained;
    at = value;
    result.label = label;
  }
  const bool plain = std::all_of(signal.values.begin(), signal.values.end(), [](const auto& each) {
    return each.first == 0 || each.first == 1;
  });
  result.needed = !plain || at != 1;
  return result;
}

std::vector<RoleCandidate> guess_role(daemon::Role role,
                                      const std::vector<can::Database>& databases) {
  const RoleWords& row = words_for(role);
  const can::Dimension dimension = daemon::role_dimension(role);
  std::vector<RoleCandidate> candidates;
  for (const can::Database& database : databases) {
    for (const can::MessageDef& message : database.messages) {
      for (const can::SignalDef& signal : message.signals) {
        if (!fits(signal, dimension)) continue;
        RoleCandidate candidate{&message, &signal};
        if (!signal.unit.empty()) {
          const auto unit = can::parse_unit(signal.unit);
          if (!unit || unit->dimension != dimension) continue;
          candidate.has_unit = true;
        } else if (dimension == can::Dimension::kNone) {
          candidate.has_unit = true;
        }
        candidate.score = score(row, message, signal);
        if (candidate.score == 0) continue;
        if (candidate.has_unit && dimension != can::Dimension::kNone) candidate.score += 20;
        candidates.push_back(candidate);
      }
    }
  }
  put_best_first(candidates);
  return candidates;
}

std::vector<RoleCandidate> guess_in_part(daemon::Role role,
                                         const std::vector<can::Database>& databases) {
  const can::Dimension dimension = daemon::role_dimension(role);
  std::vector<RoleCandidate> candidates;
  if (dimension == can::Dimension::kNone) return candidates;  // nothing speaks for a bit but words
  for (const can::Database& database : databases) {
    for (const can::MessageDef& message : database.messages) {
      for (const can::SignalDef& signal : message.signals) {
        const auto unit = can::parse_unit(signal.unit);
        if (!fits(signal, dimension) || !unit || unit->dimension != dimension) continue;
        const int gained = score(words_for(role), message, signal, 1);
        if (gained == 0 || is_claimed(message, signal)) continue;
        candidates.push_back({&message, &signal, true, gained});
      }
    }
  }
  put_best_first(candidates);
  return candidates;
}

}  // namespace beltgrip::cli
