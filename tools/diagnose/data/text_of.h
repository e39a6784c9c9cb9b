// A figure as notes have it.
#pragma once

#include <string>

namespace beltgrip::diagnose {

std::string text_of(double value);  // three digits

}  // namespace beltgrip::diagnose
