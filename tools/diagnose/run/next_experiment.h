// Which experiment to make next, and what for.
#pragma once

#include <optional>

#include "tools/diagnose/data/diagnosis.h"
#include "tools/diagnose/decide/learn.h"
#include "tools/diagnose/decide/namer.h"
#include "tools/diagnose/infer/uncertainty.h"

namespace beltgrip::diagnose {

// From where on the scatter of experiments is known.
inline constexpr std::size_t kExperimentsMin = 3;

// d: all but this. Nothing: no ramp of the clamp force shows what is still open.
std::optional<Recipe> next_experiment(const Engine& engine, const Naming& naming,
                                      const Learning& learning, const Diagnosis& d,
                                      const LeftOpen& open);

}  // namespace beltgrip::diagnose
