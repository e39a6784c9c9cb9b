// The result as one HTML file with plots.
#pragma once

#include <string>

#include "tools/diagnose/diagnosis.h"
#include "tools/diagnose/plots.h"

namespace beltgrip::diagnose {
std::string html_text(const Diagnosis& diagnosis, const Plots& plots);
}  // namespace beltgrip::diagnose
