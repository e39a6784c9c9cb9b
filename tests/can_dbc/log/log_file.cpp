#include "tests/can_dbc/log/log_file.h"

#include <unistd.h>

#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>

#include "can_dbc/log/candump_writer.h"

namespace beltgrip::test {

ReadLog read_log(const std::string& path) {
  const auto reader = can::LogReader::open(path);
  ReadLog log;
  can::LogRecord record;
  while (reader->next(record)) {
    char stamp[48];
    constexpr std::int64_t kSecond_ns = 1'000'000'000;
    std::snprintf(stamp, sizeof stamp, "%lld.%09lld ",
                  static_cast<long long>(record.t_ns / kSecond_ns),
                  static_cast<long long>(record.t_ns % kSecond_ns));
    log.frames.push_back(stamp + std::string(record.interface) + ' ' +
                         can::frame_text(record.frame) + (record.sent ? " T" : ""));
  }
  log.stats = reader->stats();
  return log;
}

LogFile::LogFile(std::string_view content) {
  // mkstemp() puts a name of its own where the X stand.
  path_ = (std::filesystem::temp_directory_path() / "beltgrip_log_XXXXXX").string();
  const int descriptor = mkstemp(path_.data());
  if (descriptor < 0) std::abort();
  ::close(descriptor);
  std::ofstream(path_, std::ios::binary) << content;
}

LogFile::~LogFile() { ::unlink(path_.c_str()); }

}  // namespace beltgrip::test
