// Frames as candump writes them. Apart from the readers, of which the daemon links none.
#pragma once

#include <cstdint>
#include <cstdio>
#include <string>
#include <string_view>

#include "can_dbc/frame/can_frame.h"

namespace beltgrip::can {

// candump -L format: (1700000000.000000) vcan0 123#0011. Nine digits when a stamp needs them.
class CandumpWriter {
 public:
  explicit CandumpWriter(std::FILE* out) : out_(out) {}
  void write(std::int64_t t_ns, std::string_view interface, const CanFrame& frame);

 private:
  std::FILE* out_;
  std::string line_;  // reused: no allocation per frame
};

// One frame in candump's compact notation, "123#0011", "00000123##10011", "123#R8", "20000004#..."
std::string frame_text(const CanFrame& frame);

}  // namespace beltgrip::can
