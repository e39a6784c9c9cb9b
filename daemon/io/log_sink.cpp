#include "daemon/io/log_sink.h"

#include <spdlog/sinks/stdout_sinks.h>
#include <spdlog/spdlog.h>

namespace beltgrip::daemon {

struct LogSink::Logger {
  spdlog::logger log{"beltgripd", std::make_shared<spdlog::sinks::stderr_sink_st>()};
};

const std::vector<std::string>& LogSink::level_names() {
  static const std::vector<std::string> names{"trace", "debug",    "info", "warning",
                                              "error", "critical", "off"};
  return names;
}

LogSink::LogSink(const std::string& level) : logger_(std::make_unique<Logger>()) {
  logger_->log.set_pattern("%Y-%m-%dT%H:%M:%S.%e beltgripd %l: %v");
  logger_->log.set_level(spdlog::level::from_str(level));
}
LogSink::~LogSink() = default;

void LogSink::info(const std::string& line) { logger_->log.info(line); }
void LogSink::warning(const std::string& line) { logger_->log.warn(line); }
void LogSink::flush() { logger_->log.flush(); }

void LogSink::event(const Event& event) {
  if (event.t - second_ >= kSecond || event.t < second_) {
    if (suppressed_ != 0) logger_->log.warn("{} more events in the second before", suppressed_);
    second_ = event.t;
    lines_ = 0;
    suppressed_ = 0;
  }
  if (lines_ == kLinesPerSecond) {
    ++suppressed_;
    return;
  }
  ++lines_;
  logger_->log.log(
      level_of(event) == EventLevel::kWarning ? spdlog::level::warn : spdlog::level::info,
      text_of(event));
}

}  // namespace beltgrip::daemon
