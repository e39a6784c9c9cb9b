// A finding in the words of somebody who does not know its name.
#pragma once

#include <string>
#include <string_view>

#include "tools/diagnose/data/diagnosis.h"

namespace beltgrip::diagnose {

// What one parameter of one effect is, with an article; empty: the table has none.
std::string_view words_of(std::string_view effect, std::string_view parameter);
std::string_view unit_of(std::string_view effect, std::string_view parameter);  // empty: none
// "a drag that grows with the clamp force, 0.50 +- 0.01 Nm/kN (torque_loss)"
std::string in_words(const Finding& finding);

}  // namespace beltgrip::diagnose
