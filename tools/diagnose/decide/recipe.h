// The next experiment as a recipe: a ramp of the clamp force in words, and as a scenario.
#pragma once

#include <string>

#include "estimator/physics/parameters.h"
#include "tools/diagnose/data/diagnosis.h"
#include "tools/diagnose/infer/planned_run.h"

namespace beltgrip::diagnose {

// why: what it is for.
Recipe recipe(const estimator::VariatorParameters& variator, const Ramp& ramp,
              const std::string& why);

}  // namespace beltgrip::diagnose
