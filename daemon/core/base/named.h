// The table of an enumeration that leaves the daemon: one row for each value, in the order of the
// wire values, with its text.
#pragma once

#include <array>
#include <cstddef>
#include <string_view>

namespace beltgrip::daemon {

template <typename Enum>
struct Named {
  Enum value;  // wire value
  std::string_view name;
};

// Row i is that of wire value i.
template <typename Row, std::size_t kRows>
constexpr bool in_wire_order(const std::array<Row, kRows>& rows) {
  for (std::size_t i = 0; i < kRows; ++i) {
    if (static_cast<std::size_t>(rows[i].value) != i || rows[i].name.empty()) return false;
  }
  return true;
}

}  // namespace beltgrip::daemon
