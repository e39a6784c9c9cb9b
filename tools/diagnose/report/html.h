// The result as one HTML file with plots.
#pragma once

#include <string>

#include "tools/diagnose/data/diagnosis.h"
#include "tools/diagnose/report/plots.h"

namespace beltgrip::diagnose {
std::string html_text(const Diagnosis& diagnosis, const Plots& plots);
}  // namespace beltgrip::diagnose
