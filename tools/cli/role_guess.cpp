#include "tools/cli/role_guess.h"

#include <algorithm>
#include <array>
#include <string_view>

#include "can_dbc/text/unit_text.h"

namespace beltgrip::cli {

namespace {

using Words = std::vector<std::string_view>;

// A name must hold one word of each group; the more telling words are in front and count more.
struct RoleWords {
  daemon::Role role;
  std::vector<Words> groups;
  Words excluded;
};

const Words kSpeed = {"speed", "spd", "rpm", "rev", "revs", "revolution", "n"};
const Words kPressure = {"pressure", "press", "prs", "p"};
const Words kTorque = {"torque", "trq", "tq", "moment", "md"};
const Words kPrimary = {"primary", "prim", "pri", "turbine", "input", "inp"};
const Words kSecondary = {"secondary", "sec", "scd", "output", "outp"};
const Words kTarget = {"command", "cmd", "target", "setpoint", "desired", "demand", "req",
                       "request", "set", "limit",  "max",      "min",     "tgt",    "tg",
                       "trgt",    "rq",  "rqd",    "rqst",     "lim",     "mx",     "mn"};
// A message of these carries what somebody asks for, whatever its signals are called.
const Words kAsking = {"command", "cmd", "request", "req", "target"};
// What is no measurement of the role, or is one of something else.
const Words kNever = {"counter", "cnt",       "checksum", "crc",  "valid",    "validity", "vld",
                      "quality", "idle",      "idl",      "loss", "lss",      "gps",      "lkas",
                      "pump",    "fan",       "steering", "top",  "friction", "offset",   "pmp",
                      "acsy",    "accessory", "cruise",   "resv", "error"};
const Words kEngine = {"engine", "eng", "motor"};

Words both(Words a, const Words& b) {
  a.insert(a.end(), b.begin(), b.end());
  return a;
}

const std::vector<RoleWords>& table() {
  using daemon::Role;
  static const std::vector<RoleWords> rows = {
      {Role::kPrimarySpeed, {kPrimary, kSpeed}, both(kTarget, kSecondary)},
      {Role::kSecondarySpeed, {kSecondary, kSpeed}, both(kTarget, kPrimary)},
      {Role::kSecondaryPressure, {kSecondary, kPressure}, both(kTarget, kPrimary)},
      {Role::kEngineTorque, {kEngine, kTorque}, kTarget},
      {Role::kPrimaryTorque, {kPrimary, kTorque}, both(kTarget, both(kSecondary, kEngine))},
      {Role::kSecondaryTorque, {kSecondary, kTorque}, both(kTarget, both(kPrimary, kEngine))},
      {Role::kPrimaryPressure, {kPrimary, kPressure}, both(kTarget, kSecondary)},
      {Role::kSecondaryPressureCommand, {kSecondary, kPressure, kTarget}, kPrimary},
      {Role::kEngineSpeed, {kEngine, kSpeed}, kTarget},
      {Role::kOilTemperature,
       {{"oil", "atf", "fluid", "cvtf", "tcu", "cvt"}, {"temperature", "temp", "tmp", "t"}},
       {"engine", "eng", "coolant", "ambient"}},
      {Role::kVehicleSpeed, {{"vehicle", "veh", "car", "v"}, kSpeed}, both(kTarget, {"wheel"})},
      {Role::kAcceleratorPedal,
       {{"accelerator", "accel", "throttle", "gas", "app"}, {"pedal", "position", "pos", "app"}},
       kTarget},
      {Role::kBrakePressed,
       {{"brake", "brk"}, {"pressed", "switch", "sw", "pedal", "active", "lamp", "light"}},
       both(kTarget, {"park", "parking", "hand"})},
      {Role::kLockupClosed,
       {{"lockup", "lock", "tcc", "lu"},
        {"closed", "engaged", "state", "active", "on", "up"},
        // Doors, seats and shift levers have locks as well.
        {"lockup", "tcc", "lu", "up", "converter", "clutch"}},
       {"door", "wheel", "command", "cmd", "request", "req"}},
      {Role::kExperimentPermitted,
       {{"experiment"}, {"permitted", "permission", "allowed", "enable"}},
       {}},
      {Role::kExperimentActive, {{"experiment"}, {"active", "running", "on"}}, {}},
  };
  return rows;
}

// Points of the best word of the group that the name holds; 0: none.
int points(const Words& group, const std::vector<std::string>& words) {
  for (std::size_t i = 0; i < group.size(); ++i) {
    if (std::find(words.begin(), words.end(), group[i]) != words.end()) {
      return static_cast<int>(group.size() - i) + (group[i].size() > 2 ? 10 : 0);
    }
  }
  return 0;
}

int score(const RoleWords& row, const std::string& message, const std::string& signal) {
  const std::vector<std::string> signal_words = words_of(signal);
  const std::vector<std::string> message_words = words_of(message);
  if (points(row.excluded, signal_words) > 0 || points(kNever, signal_words) > 0) return 0;
  if (row.role != daemon::Role::kSecondaryPressureCommand && points(kAsking, message_words) > 0) {
    return 0;
  }
  int sum = 0;
  for (const Words& group : row.groups) {
    const int own = points(group, signal_words);
    // The message's name may supply a word, at half its worth.
    const int gained = own > 0 ? 2 * own : points(group, message_words);
    if (gained == 0) return 0;
    sum += gained;
  }
  return sum;
}

// A physical quantity in fewer bits is a stage or a flag; a flag in more is a quantity.
bool fits(const can::SignalDef& signal, can::Dimension dimension) {
  constexpr std::size_t kQuantityBits = 8, kFlagBits = 4;
  return dimension == can::Dimension::kNone ? signal.length <= kFlagBits
                                            : signal.length >= kQuantityBits;
}

// Names of the value at which a flag is 1, the more telling ones in front; of several such values
// the one with the shortest name.
const Words kTrue = {"locked",  "closed",    "lock",      "engaged", "pressed",
                     "applied", "depressed", "permitted", "allowed", "enabled",
                     "active",  "running",   "yes",       "true",    "on"};
const Words kNotTrue = {"not",      "no",     "un",          "in",      "slip",
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

std::vector<std::string> words_of(const std::string& name) {
  std::vector<std::string> words;
  std::string word;
  const auto is_upper = [](char c) { return c >= 'A' && c <= 'Z'; };
  const auto is_lower = [](char c) { return c >= 'a' && c <= 'z'; };
  const auto flush = [&] {
    if (!word.empty()) words.push_back(word);
    word.clear();
  };
  for (std::size_t i = 0; i < name.size(); ++i) {
    const char c = name[i];
    if (!is_upper(c) && !is_lower(c)) {
      flush();
      continue;
    }
    const bool after_lower = i > 0 && is_lower(name[i - 1]);
    const bool ends_acronym =
        i > 0 && is_upper(name[i - 1]) && i + 1 < name.size() && is_lower(name[i + 1]);
    if (is_upper(c) && (after_lower || ends_acronym)) flush();
    word += is_upper(c) ? static_cast<char>(c - 'A' + 'a') : c;
  }
  flush();
  return words;
}

std::vector<RoleCandidate> guess_role(daemon::Role role,
                                      const std::vector<can::Database>& databases) {
  const auto row = std::find_if(table().begin(), table().end(),
                                [role](const RoleWords& r) { return r.role == role; });
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
        candidate.score = score(*row, message.name, signal.name);
        if (candidate.score == 0) continue;
        if (candidate.has_unit && dimension != can::Dimension::kNone) candidate.score += 20;
        candidates.push_back(candidate);
      }
    }
  }
  std::stable_sort(
      candidates.begin(), candidates.end(),
      [](const RoleCandidate& a, const RoleCandidate& b) { return a.score > b.score; });
  return candidates;
}

}  // namespace beltgrip::cli
