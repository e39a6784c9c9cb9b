// The next experiment as a recipe: a ramp of the clamp force through the peak that differs from
// what was done in what is still open.
#pragma once

#include <string>
#include <string_view>

#include "tools/diagnose/data/diagnosis.h"
#include "tools/diagnose/infer/residuals.h"

namespace beltgrip::diagnose {

// What the recipe varies; repeat: nothing.
enum class Varied { kRepeat, kSpeed, kTorque, kOil, kRate, kEndStop };
// Of the variable that a cause follows, as effects and cells name it.
Varied varied_by(std::string_view depends_on);

// The experiments so far decide the level: the one farthest from all of theirs. why: what it is
// for.
Recipe recipe(const Campaign& campaign, const ModelState& state, Varied varied,
              const std::string& why);

}  // namespace beltgrip::diagnose
