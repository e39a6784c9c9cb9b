#include "tools/cli/role_words.h"

#include <algorithm>
#include <array>
#include <set>

namespace beltgrip::cli {

namespace {

using daemon::Role;

const WordList kSpeed = {"speed", "spd",  "rpm",    "drehzahl", "drz", "kaitensu",  "kaitensuu",
                         "rev",   "revs", "kaiten", "regime",   "n",   "revolution"};
const WordList kPressure = {"pressure", "press", "prs",    "druck", "pression",
                            "pres",     "prsr",  "yuatsu", "p"};
const WordList kTorque = {"torque", "trq",    "tq", "drehmoment", "moment",
                          "couple", "toruku", "md", "mom"};
const WordList kPrimary = {"primary",   "prim",     "pri",   "primaer", "primaire",
                           "puraimari", "turbine",  "input", "inp",     "eingang",
                           "entree",    "nyuryoku", "prmry", "motrice", "dr"};
const WordList kSecondary = {"secondary", "sec",    "sekundaer",   "sek",    "secondaire",
                             "sekandari", "scd",    "output",      "outp",   "ausgang",
                             "abtrieb",   "sortie", "shutsuryoku", "scndry", "menee",
                             "driven",    "dn"};
const WordList kTarget = {"command", "cmd",        "cmnd",     "reqd",    "target",      "setpoint",
                          "desired", "demand",     "req",      "request", "set",         "limit",
                          "max",     "min",        "tgt",      "tg",      "trgt",        "rq",
                          "rqd",     "rqst",       "lim",      "mx",      "mn",          "limited",
                          "limiter", "soll",       "sollwert", "vorgabe", "anforderung", "wunsch",
                          "grenze",  "begrenzung", "consigne", "cible",   "demande",     "limite",
                          "mokuhyo", "shirei",     "jogen",    "kagen",   "ziel"};
const WordList kAsking = {"command", "cmd",  "request",  "req",
                          "target",  "soll", "consigne", "shirei"};
const WordList kNever = {"counter",    "cnt",       "checksum", "chksum",   "cks",
                         "crc",        "alive",     "rolling",  "zaehler",  "botschaftszaehler",
                         "pruefsumme", "compteur",  "valid",    "validity", "vld",
                         "quality",    "qf",        "gueltig",  "idle",     "idl",
                         "leerlauf",   "ralenti",   "loss",     "lss",      "verlust",
                         "perte",      "gps",       "lkas",     "pump",     "pumpe",
                         "pompe",      "fan",       "luefter",  "steering", "steer",
                         "eps",        "lenkung",   "lenkrad",  "lenk",     "volant",
                         "kaji",       "top",       "friction", "offset",   "pmp",
                         "acsy",       "accessory", "cruise",   "resv",     "error",
                         "fehler",     "display",   "dsply",    "anzeige",  "diff",
                         "delta",      "gradient",  "average",  "capped",   "wheel",
                         "roue"};
// "motor" is an engine's word in German; in English it is an electric one.
const WordList kEngine = {"engine", "eng", "moteur", "enjin", "verbrennungsmotor", "ecm", "mo"};

// Written as one word, and what it says.
struct Compound {
  std::string_view word;
  WordList means;
};
const std::vector<Compound>& compounds() {
  static const std::vector<Compound> all = {
      {"motordrehzahl", {"engine", "drehzahl"}},
      {"turbinendrehzahl", {"turbine", "drehzahl"}},
      {"eingangsdrehzahl", {"eingang", "drehzahl"}},
      {"ausgangsdrehzahl", {"ausgang", "drehzahl"}},
      {"abtriebsdrehzahl", {"abtrieb", "drehzahl"}},
      {"motormoment", {"engine", "moment"}},
      {"motordrehmoment", {"engine", "drehmoment"}},
      {"nmot", {"engine", "n"}},
      {"mdmot", {"engine", "md"}},
      {"mmot", {"engine", "moment"}},
      {"ne", {"engine", "n"}},
      {"neng", {"engine", "n"}},
      {"tqeng", {"engine", "torque"}},
      {"nin", {"input", "n"}},
      {"nout", {"output", "n"}},
      {"npri", {"pri", "n"}},
      {"nprim", {"prim", "n"}},
      {"nsec", {"sec", "n"}},
      {"nsek", {"sek", "n"}},
      {"nab", {"abtrieb", "n"}},
      {"ppri", {"pri", "p"}},
      {"pprim", {"prim", "p"}},
      {"psec", {"sec", "p"}},
      {"psek", {"sek", "p"}},
      {"vfzg", {"vehicle", "speed"}},
      {"shasoku", {"vehicle", "speed"}},
      {"vsp", {"vehicle", "speed"}},
      {"vss", {"vehicle", "speed"}},
      {"geschwindigkeit", {"speed"}},
      {"vitesse", {"speed"}},
      {"sokudo", {"speed"}},
      {"fahrzeuggeschwindigkeit", {"vehicle", "speed"}},
      {"getriebeoeltemperatur", {"getriebe", "oil", "temperature"}},
      {"oeltemperatur", {"oil", "temperature"}},
      {"oeltemp", {"oil", "temperature"}},
      {"tatf", {"atf", "temperature"}},
      {"yuon", {"oil", "temperature"}},
      {"fahrpedal", {"accelerator", "pedal"}},
      {"fahrpedalrohwert", {"accelerator", "pedal"}},
      {"apo", {"accelerator", "pedal"}},
      {"gaspedal", {"accelerator", "pedal"}},
      {"accelerateur", {"accelerator", "pedal"}},
      {"akuseru", {"accelerator", "pedal"}},
      {"bremspedal", {"brake", "pedal"}},
      {"bremslicht", {"brake", "light"}},
      {"bremse", {"brake", "pressed"}},
      {"bremst", {"brake", "pressed"}},
      {"bureeki", {"brake", "pressed"}},
      {"frein", {"brake", "pressed"}},
      {"bureki", {"brake", "pressed"}},
      {"wandlerueberbrueckung", {"lockup", "state"}},
      {"ueberbrueckungskupplung", {"lockup", "state"}},
      {"wuek", {"lockup", "state"}},
      {"wk", {"lockup", "state"}},
      {"lup", {"lockup", "state"}},
      {"luon", {"lockup", "on"}},
      {"pontage", {"lockup", "state"}},
      {"rokkuappu", {"lockup", "state"}},
  };
  return all;
}

const Compound* compound_of(std::string_view word) {
  const auto found = std::find_if(compounds().begin(), compounds().end(),
                                  [&](const Compound& each) { return each.word == word; });
  return found == compounds().end() ? nullptr : &*found;
}

WordList both(WordList a, const WordList& b) {
  a.insert(a.end(), b.begin(), b.end());
  return a;
}

const std::vector<RoleWords>& table() {
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
      // The engine has oil, too.
      {Role::kOilTemperature,
       {{"transmission", "getriebe", "gearbox", "trans", "trn", "atf", "cvtf", "cvt", "tcu",
         "boite", "bv", "ge", "hensokuki"},
        {"oil", "atf", "cvtf", "oel", "huile", "fluid"},
        {"temperature", "temp", "tmp", "temperatur", "ondo", "t"}},
       {"engine", "eng", "coolant", "ambient", "motor", "moteur"}},
      {Role::kVehicleSpeed,
       {{"vehicle", "veh", "fahrzeug", "vehicule", "car", "v"}, both(kSpeed, {"v"})},
       both(kTarget, {"rad", "vl", "vr", "hl", "hr", "fl", "fr", "rl", "rr"})},
      // A throttle is a valve, no pedal.
      {Role::kAcceleratorPedal,
       {{"accelerator", "accel", "gas", "apedpos", "aped", "app"},
        {"pedal", "pdl", "pedale", "position", "pos", "apedpos", "aped", "app"}},
       kTarget},
      {Role::kBrakePressed,
       {{"brake", "brk"}, {"pressed", "switch", "sw", "pedal", "active", "lamp", "light"}},
       both(kTarget, {"park", "parking", "hand", "parkbremse"})},
      {Role::kLockupClosed,
       {{"lockup", "lock", "tcc", "lu"},
        {"closed", "engaged", "state", "active", "clutch", "on", "up"},
        // Doors, seats and shift levers have locks as well.
        {"lockup", "tcc", "lu", "up", "converter", "clutch"}},
       {"door", "command", "cmd", "request", "req"}},
      {Role::kExperimentPermitted,
       {{"experiment"}, {"permitted", "permission", "allowed", "enable"}},
       {}},
      {Role::kExperimentActive, {{"experiment"}, {"active", "running", "on"}}, {}},
  };
  return rows;
}

// A letter of Latin-1 as it is written without its accent; empty: none of these.
std::string_view plain(unsigned char latin1) {
  switch (latin1 | 0x20U) {
    case 0xE4:
    case 0xE6:
      return "ae";
    case 0xF6:
      return "oe";
    case 0xFC:
      return "ue";
    case 0xFF:
      return "ss";  // 0xDF
    case 0xE0:
    case 0xE2:
      return "a";
    case 0xE7:
      return "c";
    case 0xE8:
    case 0xE9:
    case 0xEA:
    case 0xEB:
      return "e";
    case 0xEE:
    case 0xEF:
      return "i";
    case 0xF4:
      return "o";
    case 0xF9:
    case 0xFB:
      return "u";
    default:
      return {};
  }
}

std::string without_accents(const std::string& text) {
  constexpr unsigned char kLatin1InUtf8 = 0xC3;
  std::string out;
  for (std::size_t i = 0; i < text.size(); ++i) {
    const auto byte = static_cast<unsigned char>(text[i]);
    if (byte == kLatin1InUtf8 && i + 1 < text.size()) {
      out += plain(static_cast<unsigned char>(static_cast<unsigned char>(text[++i]) | 0xC0U));
    } else {
      out += text[i];
    }
  }
  return out;
}

// Words of four letters and more, of which one-word names are made.
const std::set<std::string_view>& building_words() {
  constexpr std::size_t kLeastLetters = 4;
  static const std::set<std::string_view> all = [] {
    std::set<std::string_view> words;
    const auto take = [&](const WordList& list) {
      for (const std::string_view each : list) {
        if (each.size() >= kLeastLetters) words.insert(each);
      }
    };
    for (const RoleWords& row : table()) {
      for (const WordList& group : row.groups) take(group);
      take(row.excluded);
    }
    take(kNever);
    return words;
  }();
  return all;
}

}  // namespace

const RoleWords& words_for(Role role) {
  return *std::find_if(table().begin(), table().end(),
                       [role](const RoleWords& each) { return each.role == role; });
}
const WordList& never_words() { return kNever; }
const WordList& asking_words() { return kAsking; }

std::vector<std::string> words_of(const std::string& given) {
  const std::string name = without_accents(given);
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

std::vector<std::string> all_words_of(const std::string& name) {
  std::vector<std::string> all;
  const std::vector<std::string> words = words_of(name);
  for (std::size_t i = 0; i < words.size(); ++i) {
    const std::string& word = words[i];
    // J1939's "wheel-based vehicle speed" is the vehicle's, no wheel's.
    if (word == "wheel" && i + 1 < words.size() && words[i + 1] == "based") continue;
    all.push_back(word);
    // "nMot", "N_Mot": what one letter and a word say together.
    if (word.size() == 1 && i + 1 < words.size()) {
      if (const Compound* pair = compound_of(word + words[i + 1])) {
        all.insert(all.end(), pair->means.begin(), pair->means.end());
      }
    }
    if (const Compound* compound = compound_of(word)) {
      all.insert(all.end(), compound->means.begin(), compound->means.end());
      continue;
    }
    const std::set<std::string_view>& known = building_words();
    for (std::size_t at = 1; at < word.size(); ++at) {
      const std::string_view head = std::string_view(word).substr(0, at);
      const std::string_view tail = std::string_view(word).substr(at);
      if (!known.contains(head) || !known.contains(tail)) continue;
      all.emplace_back(head);
      all.emplace_back(tail);
      break;
    }
  }
  return all;
}

}  // namespace beltgrip::cli
