// What is said of a role or across roles: a sentence, and how much it weighs. Tools only.
#pragma once

#include <string>
#include <vector>

namespace beltgrip::check {

enum class Weight {
  kNote,   // nothing to be done
  kDoubt,  // may be: the data cannot tell it from a healthy car
  kWrong   // no healthy car shows this
};

struct Finding {
  Weight weight = Weight::kNote;
  std::string text;
};
using Findings = std::vector<Finding>;

inline bool any_wrong(const Findings& findings) {
  for (const Finding& each : findings) {
    if (each.weight == Weight::kWrong) return true;
  }
  return false;
}

}  // namespace beltgrip::check
