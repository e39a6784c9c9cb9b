#include "daemon/core/base/rounded_text.h"

#include <array>
#include <charconv>

namespace beltgrip::daemon {

std::string rounded_text(double value) {
  std::array<char, 32> text;
  const auto end =
      std::to_chars(text.data(), text.data() + text.size(), value, std::chars_format::general, 4);
  return {text.data(), end.ptr};
}

}  // namespace beltgrip::daemon
