// Numbers as text: one number, one way to write it. Not on the real-time thread.
#pragma once

#include <cstdint>
#include <string>

namespace beltgrip {

std::string number_text(double value);                   // the shortest that reads back to it
std::string fixed_text(double value, int decimals);      // always with so many
std::string rounded_text(double value, int digits = 4);  // for a person, as %g has it
std::string hex_text(std::uint32_t value);               // "1F"

}  // namespace beltgrip
