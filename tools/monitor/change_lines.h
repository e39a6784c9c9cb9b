// What changes, a line each, with the stamp of candump -L, so that both sort into one file. Pure.
// Tools only.
#pragma once

#include <cstdint>
#include <string>

#include "tools/monitor/view.h"

namespace beltgrip::monitor {

class ChangeLines {
 public:
  // The lines of what is new since the last call; empty: nothing.
  std::string update(const View& view);

 private:
  void line(const View& view, const std::string& text);
  void compare_trust(const View& view);
  void compare_reasons(const View& view);
  void compare_request(const View& view);

  View before_;
  std::int64_t distrust_said_ns_ = 0;
  std::uint64_t distrusted_ = 0;  // that have been told
  std::string lines_;
};

}  // namespace beltgrip::monitor
