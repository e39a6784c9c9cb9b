// Do the data need more scatter between experiments than healthy machines have? An estimate of it
// says so too where the constants of the machine do the same, or where only a step that leads
// nowhere makes room for it.
#pragma once

#include <optional>

#include "tools/diagnose/decide/criticism.h"
#include "tools/diagnose/infer/engine.h"

namespace beltgrip::diagnose {

// The engine with the scatter that fails within its bounds, refitted, where that explains the data
// as well; else, and where none fails, nothing.
std::optional<Engine> without_needless_scatter(const Engine& engine, const Criticism& criticism);

// The same whether the data need more or not: what repeats stands in its residuals, and no scatter
// takes it.
std::optional<Engine> within_healthy_scatter(const Engine& engine, const Criticism& criticism);

}  // namespace beltgrip::diagnose
