// The words by which signals of cars are called, in English, German, French and romanised Japanese,
// with the abbreviations of makers: which of them name a role, and which say that a signal is
// something else. Tools only.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "daemon/core/config/options/config.h"

namespace beltgrip::cli {

using WordList = std::vector<std::string_view>;

// A signal of the role is called by one word of each group; the more telling words are in front and
// count more. By an excluded one it is none of the role.
struct RoleWords {
  daemon::Role role;
  std::vector<WordList> groups;
  WordList excluded;
};
const RoleWords& words_for(daemon::Role role);

// Never a measurement: counters, checksums, validity, limits, steering, ...
const WordList& never_words();
// A message of these carries what somebody asks for, whatever its signals are called.
const WordList& asking_words();

// "N_PrimSpd2" -> n, prim, spd. Letters with accents as they are written without: ä -> ae, é -> e.
std::vector<std::string> words_of(const std::string& name);
// The same, and what is written as one word taken apart: "Motordrehzahl" -> motordrehzahl, motor,
// drehzahl; "NSek" -> n, sek.
std::vector<std::string> all_words_of(const std::string& name);

}  // namespace beltgrip::cli
