#include "can_dbc/log/can_log.h"

#include <algorithm>
#include <array>
#include <cstring>

#include "can_dbc/log/binary.h"
#include "can_dbc/log/byte_source.h"
#include "can_dbc/log/format.h"

namespace beltgrip::can {

namespace {

constexpr std::size_t kBufferSize = std::size_t{256} * 1024;
constexpr std::size_t kLineMax = 65536;
constexpr std::size_t kSampleBytes = 65536;
constexpr std::size_t kSampleLines = 2000;
constexpr std::size_t kBadLinesKept = 10;

// Lines of a byte stream in one buffer of fixed size.
class LineBuffer {
 public:
  explicit LineBuffer(std::unique_ptr<ByteSource> source)
      : source_(std::move(source)), buffer_(std::make_unique_for_overwrite<char[]>(kBufferSize)) {}

  // What is there soon, at most kSampleBytes of it: whole lines.
  Sample sample() {
    constexpr int kPatience_ms = 200;
    for (bool first = true; end_ < kSampleBytes && (first || source_->ready(kPatience_ms));
         first = false) {
      const std::size_t count = source_->read({buffer_.get() + end_, kSampleBytes - end_});
      if (count == 0) {
        ended_ = true;
        break;
      }
      end_ += count;
    }
    Sample lines;
    std::string_view text(buffer_.get(), end_);
    while (!text.empty() && lines.size() < kSampleLines) {
      const std::size_t length = text.find('\n');
      if (length == std::string_view::npos && !(ended_ || lines.empty())) break;
      lines.push_back(text.substr(0, length));
      if (length == std::string_view::npos) break;
      text.remove_prefix(length + 1);
    }
    return lines;
  }

  std::string_view peek() const { return {buffer_.get() + begin_, end_ - begin_}; }
  void skip(std::size_t bytes) { begin_ += bytes; }
  // The same, but nothing where a line has already begun.
  std::string_view whole_lines() const { return skipping_ ? std::string_view() : peek(); }
  void skip_to(const char* text) { begin_ = static_cast<std::size_t>(text - buffer_.get()); }

  // False at the end. A line that does not fit comes cut, with `whole` false.
  bool next(std::string_view& line, bool& whole) {
    whole = true;
    for (;;) {
      const char* const start = buffer_.get() + begin_;
      const auto* const found = static_cast<const char*>(std::memchr(start, '\n', end_ - begin_));
      if (found != nullptr) {
        const auto length = static_cast<std::size_t>(found - start);
        line = {start, length};
        begin_ += length + 1;
        if (skipping_) {
          skipping_ = false;
          continue;
        }
        return true;
      }
      if (ended_) {
        line = {start, end_ - begin_};
        begin_ = end_;
        // What a damaged source breaks off in is not a line: its frame would have lost its end.
        if (!source_->fault().empty()) return false;
        return !line.empty() && !skipping_;
      }
      if (end_ - begin_ > kLineMax) {
        begin_ = end_;
        if (skipping_) continue;
        line = {start, kLineMax};
        whole = false;
        skipping_ = true;  // the rest of this line
        return true;
      }
      refill();
    }
  }

  const std::string& fault() const { return source_->fault(); }

 private:
  void refill() {
    std::memmove(buffer_.get(), buffer_.get() + begin_, end_ - begin_);
    end_ -= begin_;
    begin_ = 0;
    const std::size_t count = source_->read({buffer_.get() + end_, kBufferSize - end_});
    if (count == 0) ended_ = true;
    end_ += count;
  }

  std::unique_ptr<ByteSource> source_;
  std::unique_ptr<char[]> buffer_;
  std::size_t begin_ = 0;
  std::size_t end_ = 0;
  bool ended_ = false;
  bool skipping_ = false;
};

constexpr std::size_t kFormats = 4;
constexpr std::size_t kCsv = 3;

std::unique_ptr<LineParser> parser_of(std::size_t format, const Sample& sample) {
  switch (format) {
    case 1:
      return make_asc_parser();
    case 2:
      return make_trc_parser();
    case kCsv:
      return make_csv_parser(sample);
    default:
      return make_candump_parser(sample);
  }
}

struct Tally {
  std::size_t frames = 0;
  std::size_t bad = 0;
};

// `enough` frames end it.
Tally tally(std::size_t format, const Sample& sample, std::size_t enough) {
  const auto parser = parser_of(format, sample);
  LogRecord record;
  Tally found;
  for (const std::string_view line : sample) {
    const LineKind kind = parser->parse(line, record);
    if (kind == LineKind::kFrame) ++found.frames;
    if (kind == LineKind::kBad) ++found.bad;
    if (found.frames == enough) break;
  }
  return found;
}

// The format in which most of the sample's lines are frames; among equals, fewest are bad. More
// than half of them are enough: hardly a line is a frame in two formats. So the one that the first
// lines speak for is tried before the others.
std::unique_ptr<LineParser> find_format(const Sample& sample) {
  constexpr std::size_t kFirstLines = 50;  // chosen: behind the header of any format
  const Sample head(sample.begin(),
                    sample.begin() + static_cast<std::ptrdiff_t>(
                                         std::min<std::size_t>(kFirstLines, sample.size())));
  std::array<std::size_t, kFormats> first{};
  std::array<std::size_t, kFormats> order{};
  bool none = true;
  for (std::size_t format = 0; format < kFormats; ++format) {
    // The heads of tables are the dearest to look for, so only where nothing else is found.
    if (format != kCsv || none) first[format] = tally(format, head, kFirstLines).frames;
    none = none && first[format] == 0;
    order[format] = format;
  }
  std::stable_sort(order.begin(), order.end(),
                   [&](std::size_t a, std::size_t b) { return first[a] > first[b]; });
  const std::size_t most = sample.size() / 2 + 1;
  std::array<Tally, kFormats> found{};
  for (const std::size_t format : order) {
    found[format] = tally(format, sample, most);
    if (found[format].frames == most) return parser_of(format, sample);
  }
  constexpr std::int64_t kFrameWeight = 1000;
  const auto score = [&](const Tally& of) {
    return kFrameWeight * static_cast<std::int64_t>(of.frames) - static_cast<std::int64_t>(of.bad);
  };
  const auto best =
      std::max_element(found.begin(), found.end(),
                       [&](const Tally& a, const Tally& b) { return score(a) < score(b); });
  return parser_of(static_cast<std::size_t>(best - found.begin()), sample);
}

// Those at the end belong to it. Any other would hide the frames behind it.
bool holds_carriage_return(std::string_view line) {
  while (line.ends_with('\r')) line.remove_suffix(1);
  return line.find('\r') != std::string_view::npos;
}

struct BinaryFormat {
  std::string_view magic;
  std::unique_ptr<BinaryParser> (*make)(std::unique_ptr<ByteSource>, const std::string& path);
};
using Source = std::unique_ptr<ByteSource>;
constexpr auto kBlf = [](Source source, const std::string&) {
  return make_blf_parser(std::move(source));
};
constexpr auto kPcap = [](Source source, const std::string&) {
  return make_pcap_parser(std::move(source));
};
constexpr auto kPcapng = [](Source source, const std::string&) {
  return make_pcapng_parser(std::move(source));
};
constexpr std::size_t kMagicMost = 8;
constexpr std::array<BinaryFormat, 8> kBinaryFormats{{{"LOGG", kBlf},
                                                      {"MDF     ", make_mdf_parser},
                                                      {"UnFinMF ", make_mdf_parser},
                                                      {"\x0A\x0D\x0D\x0A", kPcapng},
                                                      {"\xA1\xB2\xC3\xD4", kPcap},
                                                      {"\xD4\xC3\xB2\xA1", kPcap},
                                                      {"\xA1\xB2\x3C\x4D", kPcap},
                                                      {"\x4D\x3C\xB2\xA1", kPcap}}};

struct RefusedFormat {
  std::string_view magic;
  const char* reason;
};
constexpr std::array<RefusedFormat, 2> kRefusedFormats{
    {{"BZh", "packed with bzip2, which is not read; pack with gzip or zstd"},
     {"\xFD"
      "7zXZ",
      "packed with xz, which is not read; pack with gzip or zstd"}}};

class TextLogReader : public LogReader {
 public:
  TextLogReader(std::unique_ptr<ByteSource> source, bool notes)
      : lines_(std::move(source)), notes_(notes) {
    const Sample sample = lines_.sample();
    for (const RefusedFormat& format : kRefusedFormats) {
      if (!lines_.peek().starts_with(format.magic)) continue;
      stats_.lines = 1;
      report(format.reason);
      return;
    }
    parser_ = find_format(sample);
    constexpr std::string_view kByteOrderMark = "\xEF\xBB\xBF";
    if (lines_.peek().starts_with(kByteOrderMark)) lines_.skip(kByteOrderMark.size());
  }

  bool next(LogRecord& record) override {
    if (parser_ == nullptr) return false;
    if (const char* const end = parser_->quick_frame(lines_.whole_lines(), record)) {
      lines_.skip_to(end);
      record.note = {};
      ++stats_.lines;
      ++stats_.frames;
      return true;
    }
    return next_by_line(record);
  }

  const LogStats& stats() const override { return stats_; }

 private:
  bool next_by_line(LogRecord& record) {
    std::string_view line;
    bool whole = true;
    while (lines_.next(line, whole)) {
      ++stats_.lines;
      if (!whole || line.size() > kLineMax) {
        report("longer than 65536 bytes");
        continue;
      }
      if (holds_carriage_return(line)) {
        report("carriage return inside a line, expected lines that end with LF or CR LF");
        continue;
      }
      constexpr std::string_view kNote = "# ";
      if (notes_ && line.starts_with(kNote)) {
        record.note = line.substr(kNote.size());
        return true;
      }
      switch (parser_->parse(line, record)) {
        case LineKind::kFrame:
          if (is_of_two_kinds(record.frame)) {
            report(kTwoKinds);
            break;
          }
          record.note = {};
          ++stats_.frames;
          return true;
        case LineKind::kNothing:
          break;
        case LineKind::kBad:
          report(parser_->reason());
          break;
      }
    }
    if (!lines_.fault().empty()) {
      ++stats_.lines;
      report(lines_.fault());
    }
    parser_.reset();
    return false;
  }

  void report(std::string reason) { count_bad(stats_, {stats_.lines, 0, std::move(reason)}); }

  LineBuffer lines_;
  bool notes_;
  std::unique_ptr<LineParser> parser_;
  LogStats stats_;
};

}  // namespace

bool is_of_two_kinds(const CanFrame& frame) {
  return static_cast<int>(frame.remote) + static_cast<int>(frame.error) +
             static_cast<int>(frame.fd) >
         1;
}

void count_bad(LogStats& stats, BadLine bad) {
  ++stats.lines_bad;
  if (stats.first_bad.size() < kBadLinesKept) stats.first_bad.push_back(std::move(bad));
}

std::string BadLine::place() const {
  return line > 0 ? std::to_string(line) : "byte " + std::to_string(byte);
}

namespace {

std::unique_ptr<LogReader> make_reader(std::unique_ptr<ByteSource> source, const std::string& path,
                                       bool notes) {
  std::string front = source->front(kMagicMost);
  for (const BinaryFormat& format : kBinaryFormats) {
    if (!std::string_view(front).starts_with(format.magic)) continue;
    return make_binary_reader(
        format.make(ByteSource::with_front(std::move(source), std::move(front)), path));
  }
  return std::make_unique<TextLogReader>(
      ByteSource::with_front(std::move(source), std::move(front)), notes);
}

}  // namespace

std::unique_ptr<LogReader> LogReader::open(const std::string& path, bool notes) {
  auto source = ByteSource::open(path);
  const std::shared_ptr<const double> share_read = source->share_read();
  auto reader = make_reader(std::move(source), path, notes);
  reader->share_read_ = share_read;
  return reader;
}

}  // namespace beltgrip::can
