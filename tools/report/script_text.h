// Text that stands in a page: as HTML, and in its script. Tools only.
#pragma once

#include <string>
#include <string_view>

namespace beltgrip::report {

std::string escaped(std::string_view text);  // for HTML
// The same with what stands `so` as code, as BeltGrip's texts mark names and commands.
std::string marked_up(std::string_view text);
// A JavaScript string that cannot end the script element either.
std::string quoted(std::string_view text);
// What is not finite is null. Six digits suffice for a place on a plot, not for a time.
inline constexpr int kPlotDigits = 6, kTimeDigits = 17;
void append_number(std::string& out, double value, int digits = kPlotDigits);

}  // namespace beltgrip::report
