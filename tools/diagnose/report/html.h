// The result as one HTML file with plots.
#pragma once

#include <string>

#include "tools/diagnose/data/diagnosis.h"
#include "tools/diagnose/report/plots.h"

namespace beltgrip::diagnose {

// What the page says of how it was made.
struct PageFacts {
  std::string program;        // name and version
  std::string date;           // of the day on which it was made, as 2026-11-26
  std::string configuration;  // files
  std::string model;          // empty: the usual machine
};

std::string html_text(const Diagnosis& diagnosis, const Plots& plots, const PageFacts& facts);

}  // namespace beltgrip::diagnose
