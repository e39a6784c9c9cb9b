// A figure for a person: four digits. Allocates; off the real-time thread.
#pragma once

#include <string>

namespace beltgrip::daemon {

std::string rounded_text(double value);

}  // namespace beltgrip::daemon
