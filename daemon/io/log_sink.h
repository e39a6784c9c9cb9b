// The log: spdlog on standard error, journal-friendly. Helper thread and start-up only.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "daemon/core/event.h"

namespace beltgrip::daemon {

class LogSink {
 public:
  static const std::vector<std::string>& level_names();  // "trace" ... "off"
  explicit LogSink(const std::string& level);
  ~LogSink();

  void info(const std::string& line);
  void warning(const std::string& line);
  // At most kLinesPerSecond of them; the rest is counted and the number logged.
  void event(const Event& event);
  void flush();

 private:
  static constexpr int kLinesPerSecond = 10;
  struct Logger;
  std::unique_ptr<Logger> logger_;
  MonoTime second_ = 0;
  int lines_ = 0;
  std::uint64_t suppressed_ = 0;
};

}  // namespace beltgrip::daemon
