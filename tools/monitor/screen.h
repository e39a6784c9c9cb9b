// A terminal, taken over and given back as it was on any way out: at the end of its life, and
// through restore() from the handler of a signal that ends the program. Tools only.
#pragma once

#include <optional>
#include <vector>

#include "tools/monitor/layout.h"

namespace beltgrip::monitor {

enum class Key {
  kQuit,
  kPause,
  kStep,
  kBack,
  kOn,
  kFarBack,
  kFarOn,
  kBegin,
  kFaster,
  kSlower,
  kResized
};

class Screen {
 public:
  // Standard input and output are a terminal that can place text.
  static bool possible();
  Screen();  // std::runtime_error: terminfo does not know the terminal
  ~Screen();
  Screen(const Screen&) = delete;
  Screen& operator=(const Screen&) = delete;

  Size size() const;
  void draw(const std::vector<Line>& lines);
  // What has been pressed since; does not wait.
  std::optional<Key> key();

  // Async-signal-safe; nothing where no screen is open. The signals of a crash call it too.
  static void restore() noexcept;
};

}  // namespace beltgrip::monitor
