// Streaming readers of CAN logs. Memory flat in the length of the log; one
// line, or record of a binary log, at a time. A broken one is counted and reported with its place,
// never fatal. Tools only.
#pragma once

#include <cstdint>
#include <limits>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "can_dbc/frame/can_frame.h"

namespace beltgrip::can {

struct LogRecord {
  std::int64_t t_ns = 0;  // as in the log: exact decimal, 9 digits
  CanFrame frame;
  std::string_view interface;  // valid until the next call of next()
  bool sent = false;           // candump: marked "T", sent by the one who recorded
  std::string_view note;       // where notes are asked for; then there is no frame
};

struct BadLine {
  std::uint64_t line = 0;  // 1-based; 0 in a binary log
  std::uint64_t byte = 0;  // binary log: offset of the record in the (unpacked) file
  std::string reason;
  std::string place() const;  // "17", "byte 4096"
};

struct LogStats {
  bool binary = false;
  std::uint64_t lines = 0;  // binary log: records
  std::uint64_t frames = 0;
  std::uint64_t lines_bad = 0;     // neither a frame nor a comment nor empty
  std::vector<BadLine> first_bad;  // at most 10, the first ones
};

class LogReader {
 public:
  virtual ~LogReader() = default;
  virtual bool next(LogRecord& record) = 0;  // false at the end
  virtual const LogStats& stats() const = 0;
  // How much of its file is read, 0 to 1; no number: it is a stream.
  double share_read() const { return *share_read_; }

  // path "-" is standard input. .gz and .zst are unpacked by content, the format is found from the
  // content. Throws LogOpenError when the file is missing or unreadable.
  // notes: lines that begin with "# " come as records with a note, without that beginning.
  static std::unique_ptr<LogReader> open(const std::string& path, bool notes = false);

 private:
  std::shared_ptr<const double> share_read_ =
      std::make_shared<double>(std::numeric_limits<double>::quiet_NaN());
};

// The line that names the columns of a table (.csv) of frames: time, identifier, data.
bool is_head_of_frames(std::string_view line);

struct LogOpenError {
  std::string text;  // one line: path and reason
};

}  // namespace beltgrip::can
