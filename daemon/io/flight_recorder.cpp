#include "daemon/io/flight_recorder.h"

#include <poll.h>
#include <unistd.h>
#include <zstd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <ctime>
#include <filesystem>
#include <system_error>
#include <utility>

#include "can_dbc/log/candump_writer.h"
#include "can_dbc/text/number_text.h"

namespace beltgrip::daemon {

namespace {

namespace fs = std::filesystem;

constexpr int kTurn_ms = 50;
constexpr std::int64_t kSecond_ns = kSecond.ns();
constexpr Duration kFlush = kSecond;
constexpr Duration kRetry = 60 * kSecond;
constexpr std::size_t kBeforeMost = 65536;  // items in memory: 6000 a second and more
constexpr std::string_view kEnding = ".log.zst";
// By the library's own choice the packing holds 3.7 MB, 2 of them the text that is behind it; so it
// is half a megabyte, and a log of frames, which repeats itself within a second, no longer.
constexpr int kPackLevel = 1, kPackWindow = 16;  // level; log2 of the bytes it looks back

// In a file's name.
std::string plain_name(std::string name) {
  std::replace_if(
      name.begin(), name.end(), [](char c) { return c == '/' || c == ':'; }, '_');
  return name;
}

std::string stamp_text(std::int64_t t_ns) {
  std::array<char, 40> text;
  const int length = std::snprintf(text.data(), text.size(), "(%lld.%09lld)",
                                   static_cast<long long>(t_ns / kSecond_ns),
                                   static_cast<long long>(t_ns % kSecond_ns));
  return {text.data(), static_cast<std::size_t>(length)};
}

std::string file_name(const std::string& interface, std::int64_t wall_ns) {
  const std::time_t seconds = wall_ns / kSecond_ns;
  std::tm date{};
  gmtime_r(&seconds, &date);
  std::array<char, 48> text;
  const int length =
      std::snprintf(text.data(), text.size(), "-%04d%02d%02dT%02d%02d%02d.%03dZ",
                    date.tm_year + 1900, date.tm_mon + 1, date.tm_mday, date.tm_hour, date.tm_min,
                    date.tm_sec, static_cast<int>(wall_ns % kSecond_ns / kMillisecond.ns()));
  return "beltgrip-" + plain_name(interface) +
         std::string(text.data(), static_cast<std::size_t>(length)) + std::string(kEnding);
}

}  // namespace

// One packed file. A write that fails says why and leaves the file as it is.
class FlightRecorder::File {
 public:
  explicit File(std::string path)
      : path_(std::move(path)),
        file_(std::fopen(path_.c_str(), "wxe")),
        stream_(ZSTD_createCStream()),
        packed_(ZSTD_CStreamOutSize()) {
    ZSTD_CCtx_setParameter(stream_, ZSTD_c_compressionLevel, kPackLevel);
    ZSTD_CCtx_setParameter(stream_, ZSTD_c_windowLog, kPackWindow);
    if (file_ == nullptr) {
      failed_ = std::strerror(errno);
    } else {
      std::setvbuf(file_, nullptr, _IONBF, 0);
    }
  }
  ~File() {
    pack("", ZSTD_e_end);
    if (file_ != nullptr) {
      fdatasync(fileno(file_));
      std::fclose(file_);
    }
    ZSTD_freeCStream(stream_);
  }
  File(const File&) = delete;
  File& operator=(const File&) = delete;

  void write(std::string_view text) { pack(text, ZSTD_e_continue); }
  // What was written can be read from here on.
  void flush(MonoTime t) {
    if (t < flush_at_) return;
    flush_at_ = t + kFlush;
    pack("", ZSTD_e_flush);
  }
  const std::string& path() const { return path_; }
  const std::string& failed() const { return failed_; }  // empty: all is well
  std::uint64_t size() const { return size_; }

 private:
  void pack(std::string_view text, ZSTD_EndDirective how) {
    if (!failed_.empty()) return;
    ZSTD_inBuffer in{text.data(), text.size(), 0};
    for (std::size_t left = 1; left != 0 || in.pos < in.size;) {
      ZSTD_outBuffer out{packed_.data(), packed_.size(), 0};
      left = ZSTD_compressStream2(stream_, &out, &in, how);
      if (std::fwrite(packed_.data(), 1, out.pos, file_) != out.pos) {
        failed_ = std::strerror(errno);
        return;
      }
      size_ += out.pos;
      if (how == ZSTD_e_continue && in.pos == in.size) return;
    }
  }

  std::string path_;
  std::FILE* file_;
  ZSTD_CStream* stream_;
  std::vector<char> packed_;
  std::uint64_t size_ = 0;
  std::string failed_;
  MonoTime flush_at_;
};

FlightRecorder::FlightRecorder(std::string folder, std::vector<std::string> interfaces,
                               RecordRings& rings, std::int64_t wall_offset_ns,
                               const RecordLimits& limits)
    : folder_(std::move(folder)),
      interfaces_(std::move(interfaces)),
      rings_(rings),
      wall_offset_ns_(wall_offset_ns),
      limits_(limits),
      thread_([this] { run(); }) {}

FlightRecorder::~FlightRecorder() { stop(); }

void FlightRecorder::stop() {
  ending_.store(true);
  if (thread_.joinable()) thread_.join();
}

std::vector<FlightRecorder::Message> FlightRecorder::take_messages() {
  const std::lock_guard lock(mutex_);
  return std::exchange(messages_, {});
}

void FlightRecorder::say(bool warning, const std::string& line) {
  const std::lock_guard lock(mutex_);
  messages_.push_back({warning, line});
}

void FlightRecorder::run() {
  while (!ending_.load()) {
    poll(nullptr, 0, kTurn_ms);
    drain();
  }
  drain();
  close();
}

void FlightRecorder::drain() {
  RecordItem item;
  while (rings_.items.pop(item)) take(item);
  if (const std::uint64_t dropped = rings_.items.dropped(); dropped != dropped_) {
    say(true, folder_ + ": " + std::to_string(dropped - dropped_) +
                  " frames not recorded, the disk is too slow");
    dropped_ = dropped;
  }
}

void FlightRecorder::take(const RecordItem& item) {
  if (item.kind == RecordKind::kLearned) {
    rings_.learned.pop(learned_);
    has_learned_ = true;
  }
  if (item.kind == RecordKind::kMark) judge(item);
  if (file_ == nullptr) {
    remember(item);
    if (item.t < keep_until_ && item.t >= retry_at_) open(item.t);
  } else {
    write(item);
  }
  if (file_ == nullptr) return;
  file_->flush(item.t);
  if (!file_->failed().empty()) {
    trouble(item.t, file_->path() + ": cannot be written (" + file_->failed() + ")");
    return;
  }
  if (item.t >= keep_until_) {
    close();
  } else if (item.kind == RecordKind::kReload ||
             (item.kind == RecordKind::kMark && file_->size() >= limits_.file_bytes)) {
    close();
    // The next file begins here.
    before_.push_back({.t = item.t, .kind = RecordKind::kMark});
  }
}

// Worth keeping: while an experiment runs, and some time after it or after a fault came or went.
void FlightRecorder::judge(const RecordItem& mark) {
  const bool changed = mark.number != faults_ || mark.in_experiment != in_experiment_;
  faults_ = mark.number;
  in_experiment_ = mark.in_experiment;
  if (changed || in_experiment_) keep_until_ = mark.t + limits_.after;
}

void FlightRecorder::remember(const RecordItem& item) {
  before_.push_back(item);
  while (before_.size() > kBeforeMost || before_.front().t < item.t - limits_.before) {
    before_.pop_front();
  }
}

void FlightRecorder::make_room() {
  std::vector<std::pair<std::string, std::uint64_t>> files;
  const std::string beginning = "beltgrip-" + plain_name(interfaces_[0]) + "-";
  std::uint64_t sum = limits_.file_bytes;
  std::error_code error;
  for (const fs::directory_entry& each : fs::directory_iterator(folder_, error)) {
    const std::string name = each.path().filename().string();
    if (!name.starts_with(beginning) || !name.ends_with(kEnding)) continue;
    files.emplace_back(each.path().string(), each.file_size(error));
    sum += files.back().second;
  }
  std::sort(files.begin(), files.end());
  for (auto oldest = files.begin(); oldest != files.end() && sum > limits_.folder_bytes; ++oldest) {
    if (fs::remove(oldest->first, error)) sum -= oldest->second;
  }
}

void FlightRecorder::open_file(MonoTime t) {
  std::error_code error;
  fs::create_directories(folder_, error);
  make_room();
  file_ = std::make_unique<File>(
      (fs::path(folder_) / file_name(interfaces_[0], t.ns() + wall_offset_ns_)).string());
  if (!file_->failed().empty()) {
    trouble(t, file_->path() + ": cannot be made (" + file_->failed() + ")");
    return;
  }
  say(false, "recording to " + file_->path());
  std::string header = "# beltgrip-record 3";
  for (const std::string& each : interfaces_) header += ' ' + each;
  file_->write(header + '\n');
}

// With what is remembered, from an instant of a sample on.
void FlightRecorder::open(MonoTime t) {
  const auto first = std::find_if(before_.begin(), before_.end(), [](const RecordItem& item) {
    return item.kind == RecordKind::kStart || item.kind == RecordKind::kMark;
  });
  if (first == before_.end()) return;
  open_file(t);
  if (file_ == nullptr) return;
  if (first->kind == RecordKind::kMark) {
    write_line(first->t, "start");
    // The newest: whatever had been learned within these seconds is what counts in the end.
    if (has_learned_) write_learned(first->t);
  }
  for (auto item = before_.begin(); item != before_.end(); ++item) {
    // What was learned before the start comes before it.
    if (item >= first || item->kind == RecordKind::kLearned) write(*item);
  }
  before_.clear();
}

void FlightRecorder::write_line(MonoTime t, const std::string& text) {
  file_->write("# " + stamp_text(t.ns() + wall_offset_ns_) + ' ' + text + '\n');
}

void FlightRecorder::write_learned(MonoTime t) {
  std::string memory = "memory";
  for (const double each : learned_.memory.numbers()) memory += ' ' + number_text(each);
  write_line(t, memory);
  std::string text = "learned ";
  text += learned_.doubtful ? "1 " : "0 ";
  text += learned_.unwritten ? '1' : '0';
  for (const estimator::FusedFriction& group : learned_.groups) {
    text += ' ';
    if (!group.known) {
      text += '-';
      continue;
    }
    text += number_text(group.mu_max) + '/' + number_text(group.ci95_low) + '/' +
            number_text(group.repeatability_percent);
  }
  write_line(t, text);
}

void FlightRecorder::write(const RecordItem& item) {
  switch (item.kind) {
    case RecordKind::kStart:
      write_line(item.t, "start");
      break;
    case RecordKind::kFrame: {
      if (item.number != 0) write_line(item.t, "lost " + std::to_string(item.number));
      std::string line = stamp_text(item.t.ns() + wall_offset_ns_) + ' ' +
                         interfaces_[std::min<std::size_t>(item.bus, interfaces_.size() - 1)] +
                         ' ' + can::frame_text(item.frame);
      line += item.own_echo ? " T\n" : "\n";
      file_->write(line);
      break;
    }
    case RecordKind::kAfter:
      write_line(item.t, "after");
      break;
    case RecordKind::kLate:
      write_line(item.t, "late " + std::to_string(item.now.ns() + wall_offset_ns_));
      break;
    case RecordKind::kBus:
      write_line(item.t, "bus " + std::to_string(item.bus) + ' ' +
                             std::to_string(static_cast<int>(item.state)));
      break;
    case RecordKind::kFailed:
      write_line(item.t, "failed " + std::to_string(item.bus) + ' ' + std::to_string(item.number) +
                             ' ' + std::to_string(static_cast<int>(item.sent)));
      break;
    case RecordKind::kLearned:
      write_learned(item.t);
      break;
    case RecordKind::kEnd:
      write_line(item.t, "end " + std::to_string(item.now.ns() + wall_offset_ns_));
      break;
    case RecordKind::kMark:
    case RecordKind::kReload:
      break;
  }
}

void FlightRecorder::close() {
  if (file_ == nullptr) return;
  const bool failed_before = complained_;
  file_.reset();
  if (failed_before) say(false, folder_ + ": recorded again");
  complained_ = false;
}

void FlightRecorder::trouble(MonoTime t, const std::string& what) {
  if (!complained_) say(true, what + "; not recorded, next attempt in a minute");
  complained_ = true;
  file_.reset();
  before_.clear();
  retry_at_ = t + kRetry;
}

}  // namespace beltgrip::daemon
