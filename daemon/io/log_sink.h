// The log: spdlog, to the journal with its priorities where standard error leads there, else to
// standard error. Helper thread and start-up only.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "daemon/core/observe/event.h"

namespace beltgrip::daemon {

class LogSink {
 public:
  static const std::vector<std::string>& level_names();  // "trace" ... "off"
  explicit LogSink(const std::string& level);
  ~LogSink();

  // One level more or less is logged from now on; says so.
  void more();
  void less();
  void debug(const std::string& line);
  void info(const std::string& line);
  void warning(const std::string& line);
  // At most kLinesPerSecond of them; the rest is counted and the number logged.
  // figure: of an inhibit or a fault.
  void event(const Event& event, const std::string& figure = "");
  void flush();

 private:
  static constexpr int kLinesPerSecond = 10;
  void set_level(int level);
  struct Logger;
  std::unique_ptr<Logger> logger_;
  MonoTime second_;
  int lines_ = 0;
  std::uint64_t suppressed_ = 0;
};

}  // namespace beltgrip::daemon
