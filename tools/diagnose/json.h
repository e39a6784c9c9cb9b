// A diagnosis as JSON (one object) and as text for people.
#pragma once

#include <string>

#include "tools/diagnose/diagnosis.h"

namespace beltgrip::diagnose {
std::string json_text(const Diagnosis& diagnosis);
std::string headline(const Diagnosis& diagnosis);  // the verdict in one line
std::string plain_text(const Diagnosis& diagnosis);
}  // namespace beltgrip::diagnose
