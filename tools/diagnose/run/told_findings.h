// What was found, what was learned and what these data cannot show, as the answer has it.
#pragma once

#include <string>
#include <vector>

#include "tools/diagnose/data/diagnosis.h"
#include "tools/diagnose/decide/learn.h"
#include "tools/diagnose/decide/namer.h"
#include "tools/diagnose/infer/engine.h"
#include "tools/diagnose/infer/gain.h"

namespace beltgrip::diagnose {

// accepted: those of naming that are told.
void fill_findings(const Engine& engine, const std::vector<Accepted>& accepted,
                   const Naming& naming, const Gain& gain, Diagnosis& out);
void fill_learned(const Engine& engine, const Naming& naming, const Learning& learning,
                  const Gain& gain, Diagnosis& out);

// What an effect would have to be like to be seen; those that hardly ever are that large.
void fill_not_identifiable(const Engine& engine, const Naming& naming, Diagnosis& out);
void nothing_identifiable(const std::string& reason, Diagnosis& out);  // of all effects

}  // namespace beltgrip::diagnose
