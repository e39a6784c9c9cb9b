// The text of Chart.js, generated at build from Debian's package. Tools only.
#pragma once

#include <string_view>

namespace beltgrip::report {
std::string_view chart_js();
}  // namespace beltgrip::report
