#include "tools/diagnose/data/text_of.h"

#include <cstdio>

namespace beltgrip::diagnose {

std::string text_of(double value) {
  char buffer[32];
  std::snprintf(buffer, sizeof buffer, "%.3g", value);
  return buffer;
}

}  // namespace beltgrip::diagnose
