#include "daemon/io/log_sink.h"

#include <spdlog/sinks/stdout_sinks.h>
#include <spdlog/sinks/systemd_sink.h>
#include <spdlog/spdlog.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cstdlib>

#include "can_dbc/text/printable.h"

namespace beltgrip::daemon {

namespace {

// The service manager names the stream it gave; a standard error that was led elsewhere is not it.
bool stderr_is_journal() {
  const char* stream = std::getenv("JOURNAL_STREAM");
  struct stat status {};
  if (stream == nullptr || fstat(STDERR_FILENO, &status) != 0) return false;
  return std::to_string(status.st_dev) + ":" + std::to_string(status.st_ino) == stream;
}

spdlog::sink_ptr make_sink(bool journal) {
  if (journal) return std::make_shared<spdlog::sinks::systemd_sink_st>("beltgripd");
  return std::make_shared<spdlog::sinks::stderr_sink_st>();
}

}  // namespace

struct LogSink::Logger {
  bool journal = stderr_is_journal();
  spdlog::logger log{"beltgripd", make_sink(journal)};
};

const std::vector<std::string>& LogSink::level_names() {
  static const std::vector<std::string> names{"trace", "debug",    "info", "warning",
                                              "error", "critical", "off"};
  return names;
}

LogSink::LogSink(const std::string& level) : logger_(std::make_unique<Logger>()) {
  // The journal knows time, program and level by itself.
  logger_->log.set_pattern(logger_->journal ? "%v" : "%Y-%m-%dT%H:%M:%S.%e beltgripd %l: %v");
  logger_->log.set_level(spdlog::level::from_str(level));
}
LogSink::~LogSink() = default;

void LogSink::set_level(int level) {
  const auto wanted = static_cast<spdlog::level::level_enum>(
      std::clamp<int>(level, spdlog::level::trace, spdlog::level::off));
  logger_->log.set_level(std::min(wanted, spdlog::level::warn));  // so that this is seen
  logger_->log.warn("log level {}", level_names()[static_cast<std::size_t>(wanted)]);
  logger_->log.set_level(wanted);
}
void LogSink::more() { set_level(static_cast<int>(logger_->log.level()) - 1); }
void LogSink::less() { set_level(static_cast<int>(logger_->log.level()) + 1); }

void LogSink::debug(const std::string& line) { logger_->log.debug(can::printable(line)); }
void LogSink::info(const std::string& line) { logger_->log.info(can::printable(line)); }
void LogSink::warning(const std::string& line) { logger_->log.warn(can::printable(line)); }
void LogSink::flush() { logger_->log.flush(); }

void LogSink::event(const Event& event, const std::string& figure) {
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
      text_of(event, figure));
}

}  // namespace beltgrip::daemon
