#include "can_dbc/text/number_text.h"

#include <array>
#include <charconv>

namespace beltgrip {
namespace {

// Derived: the largest double has 309 digits before the point; nobody asks for 60 behind it.
constexpr std::size_t kLongest = 380;

template <typename... Form>
std::string written(auto value, Form... form) {
  std::array<char, kLongest> text;
  return {text.data(), std::to_chars(text.data(), text.data() + text.size(), value, form...).ptr};
}

}  // namespace

std::string number_text(double value) { return written(value); }

std::string fixed_text(double value, int decimals) {
  return written(value, std::chars_format::fixed, decimals);
}

std::string rounded_text(double value, int digits) {
  return written(value, std::chars_format::general, digits);
}

std::string hex_text(std::uint32_t value) {
  std::string text = written(value, 16);
  for (char& c : text) c = static_cast<char>(c >= 'a' ? c - 'a' + 'A' : c);
  return text;
}

}  // namespace beltgrip
