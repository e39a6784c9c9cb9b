#include "can_dbc/log/binary.h"

#include <algorithm>

#include "can_dbc/log/format.h"

namespace beltgrip::can {

namespace {

class BinaryLogReader : public LogReader {
 public:
  explicit BinaryLogReader(std::unique_ptr<BinaryParser> parser) : parser_(std::move(parser)) {
    stats_.binary = true;
  }

  bool next(LogRecord& record) override {
    record.note = {};
    record.sent = false;
    for (;;) {
      const RecordKind kind = parser_->next(record);
      if (kind == RecordKind::kEnd) return false;
      ++stats_.lines;
      if (kind == RecordKind::kBad) {
        count_bad(stats_, {0, parser_->byte(), parser_->reason()});
      } else if (kind == RecordKind::kFrame && is_of_two_kinds(record.frame)) {
        count_bad(stats_, {0, parser_->byte(), kTwoKinds});
      } else if (kind == RecordKind::kFrame) {
        ++stats_.frames;
        return true;
      }
    }
  }

  const LogStats& stats() const override { return stats_; }

 private:
  std::unique_ptr<BinaryParser> parser_;
  LogStats stats_;
};

}  // namespace

BinaryInput::BinaryInput(std::unique_ptr<ByteSource> source)
    : source_(std::move(source)), buffer_(std::make_unique_for_overwrite<char[]>(kTakeMost)) {}

std::optional<std::string_view> BinaryInput::peek(std::size_t size) {
  assert(size <= kTakeMost);
  while (end_ - begin_ < size) {
    std::memmove(buffer_.get(), buffer_.get() + begin_, end_ - begin_);
    end_ -= begin_;
    begin_ = 0;
    const std::size_t count = source_->read({buffer_.get() + end_, kTakeMost - end_});
    if (count == 0) return std::nullopt;
    end_ += count;
  }
  return std::string_view(buffer_.get() + begin_, size);
}

std::optional<std::string_view> BinaryInput::take(std::size_t size) {
  const auto bytes = peek(size);
  if (bytes) {
    begin_ += size;
    position_ += size;
  }
  return bytes;
}

bool BinaryInput::skip(std::uint64_t size) {
  while (size > 0) {
    if (at_end()) return false;
    const auto count = static_cast<std::size_t>(std::min<std::uint64_t>(size, end_ - begin_));
    begin_ += count;
    position_ += count;
    size -= count;
  }
  return true;
}

RecordKind BinaryParser::cut(std::uint64_t byte, const BinaryInput& input,
                             const std::string& what) {
  return broken(
      byte, input.fault().empty() ? what + " is cut off by the end of the file" : input.fault());
}

std::unique_ptr<LogReader> make_binary_reader(std::unique_ptr<BinaryParser> parser) {
  return std::make_unique<BinaryLogReader>(std::move(parser));
}

}  // namespace beltgrip::can
