// The pairs of tests/bench. Those that return more than one share what they work on.
#pragma once

#include <string>
#include <vector>

#include "tests/pairs/made_inputs.h"
#include "tests/pairs/pairs.h"

namespace beltgrip::test {

std::vector<Pair> codec_pairs();
std::vector<Pair> log_pairs(const Folder& folder);
// Of the program beltgrip; with the path of another, an older one say, the same work of it beside.
std::vector<Pair> program_pairs(const Folder& folder, const std::string& beltgrip,
                                const std::string& other);

// Tables of what grows with messages, length and number of logs. large: with logs of 1 and 5 GB.
void show_growth(const Folder& folder, const std::string& beltgrip, bool large);

}  // namespace beltgrip::test
