// A signal as nearly all tools write it, on one line:
//   SG_ Speed m3 : 0|16@1+ (0.25,-40) [-40|23.75] "rpm" Gateway,Engine
#pragma once

#include <cstdint>
#include <optional>
#include <string_view>

namespace beltgrip::can::dbc {

struct UsualSignal {
  std::string_view name;
  bool is_multiplexer = false;
  std::optional<std::uint32_t> selector_value;  // of "m3"
  std::uint32_t start_bit = 0;
  std::uint32_t length = 0;
  bool is_big_endian = false;
  bool is_signed = false;
  double scale = 0.0;
  double offset = 0.0;
  double minimum = 0.0;
  double maximum = 0.0;
  std::string_view unit;
  std::string_view receivers;  // names with commas or blanks between them
};

// text: what stands behind "SG_". Behind the signal, at the end of its line; nullptr: it is not
// quite so, and the statement has to be read with all that it may hold.
const char* read_usual_signal(std::string_view text, UsualSignal& signal) noexcept;

// The next name of a list of receivers; empty at its end.
std::string_view take_receiver(std::string_view& receivers) noexcept;

}  // namespace beltgrip::can::dbc
