// The loop closed by machine: a hidden cause, ten ramps, a diagnosis, its next experiment carried
// out by the generator, a diagnosis again; beside it the same with experiments drawn from what the
// recipe chooses from.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "tests/statistics/blind/generator.h"

namespace beltgrip::blind {

// How a diagnosis stands to the truth.
enum class Standing {
  kAlone,    // named, and nothing beside it or in its place
  kInClass,  // named, or in the place of a name, with others
  kUnseen,   // no name, and said to be what these data cannot show
  kSilent,   // no name, nor said so
  kWrong     // a name, and the truth not among what may stand in its place
};

struct Round {
  Standing standing = Standing::kSilent;
  std::string answer;    // names, each with what may stand in its place
  std::string next;      // the recipe's scenario; empty: none
  std::string next_why;  // and its words
};

struct RoundsOfTrial {
  std::uint64_t number = 0;
  Trial trial;
  double sigmas = 0.0;  // size of the truth in the first data, the machine refitted
  Round first;
  std::vector<Round> followed;  // after one more recommended experiment, two, ...
  std::vector<Round> random;    // after as many drawn ones
};

// The planned run that a scenario asks for; what it does not say is as usual.
PlannedRun run_of(const std::string& scenario);

// A trial with one hidden cause; ten experiments that are all the same or vary in one thing.
Trial draw_open_trial(std::uint64_t number);
Round diagnosed(const Trial& trial);
// rounds 0: the first diagnosis alone.
RoundsOfTrial play(std::uint64_t number, int rounds);

}  // namespace beltgrip::blind
