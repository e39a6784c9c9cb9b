// The monitor's terminal, and its view as text. Tools only.
#pragma once

#include <cstdio>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string>

#include "tools/cli/failure.h"
#include "tools/cli/stop_signals.h"
#include "tools/monitor/layout.h"
#include "tools/monitor/screen.h"
#include "tools/monitor/view_json.h"
#include "tools/text/terminal.h"

namespace beltgrip::cli {

// Given back on every way out, by a signal too.
class MonitorScreen {
 public:
  MonitorScreen() : screen_(open()) { call_when_stopped(monitor::Screen::restore); }
  ~MonitorScreen() { call_when_stopped(nullptr); }
  MonitorScreen(const MonitorScreen&) = delete;
  MonitorScreen& operator=(const MonitorScreen&) = delete;

  std::optional<monitor::Key> key() { return screen_->key(); }
  void keep(const monitor::View& view) { view_ = view; }
  void draw(bool held = false) {
    monitor::View shown = view_;
    if (held) shown.source += " (held)";
    screen_->draw(monitor::layout(shown, screen_->size()));
  }

 private:
  static std::unique_ptr<monitor::Screen> open() {
    try {
      return std::make_unique<monitor::Screen>();
    } catch (const std::runtime_error& error) {
      throw Failure{kUsage,
                    std::string("monitor: ") + error.what() + "; expected another, or --plain"};
    }
  }

  std::unique_ptr<monitor::Screen> screen_;
  monitor::View view_;
};

inline void print_view(const monitor::View& view, bool json) {
  if (json) {
    text::print(stdout, monitor::view_json(view));
    return;
  }
  constexpr monitor::Size kPage{80, 34};
  std::vector<monitor::Line> lines = monitor::layout(view, kPage);
  lines.pop_back();  // the keys
  text::print(stdout, monitor::text_of(lines));
}

}  // namespace beltgrip::cli
