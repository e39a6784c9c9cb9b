#include "can_dbc/log/byte_source.h"

#include <fcntl.h>
#include <poll.h>
#include <sys/stat.h>
#include <unistd.h>
#include <zlib.h>
#include <zstd.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cerrno>
#include <cstring>
#include <string_view>
#include <vector>

#include "can_dbc/log/can_log.h"
#include "can_dbc/text/encoding.h"

namespace beltgrip::can {

namespace {

constexpr std::size_t kBlock = std::size_t{64} * 1024;
std::atomic<int> stop_descriptor{-1};

class PlainSource : public ByteSource {
 public:
  explicit PlainSource(const std::string& path) {
    const bool standard_input = path == "-";
    descriptor_ = standard_input ? STDIN_FILENO : ::open(path.c_str(), O_RDONLY | O_CLOEXEC);
    owned_ = !standard_input;
    struct stat status {};
    if (descriptor_ < 0 && errno == EINTR) throw LogOpenError{path + ": " + kStopped};
    if (descriptor_ < 0 || ::fstat(descriptor_, &status) != 0) {
      throw LogOpenError{path + ": " + std::strerror(errno)};
    }
    if (S_ISDIR(status.st_mode)) throw LogOpenError{path + ": is a directory, expected a log"};
    if (!S_ISREG(status.st_mode)) return;
    size_ = static_cast<double>(status.st_size);
    ::posix_fadvise(descriptor_, 0, 0, POSIX_FADV_SEQUENTIAL);
  }
  ~PlainSource() override {
    if (owned_ && descriptor_ >= 0) ::close(descriptor_);
  }
  PlainSource(const PlainSource&) = delete;
  PlainSource& operator=(const PlainSource&) = delete;

  std::size_t read(std::span<char> out) override {
    for (;;) {
      if (is_stopped()) {
        fault_ = kStopped;
        return 0;
      }
      const ssize_t count = ::read(descriptor_, out.data(), out.size());
      if (count >= 0) {
        taken_ += static_cast<double>(count);
        if (size_ > 0.0) *share_read_ = std::min(1.0, taken_ / size_);
        return static_cast<std::size_t>(count);
      }
      if (errno == EINTR) continue;
      fault_ = std::string("cannot be read on: ") + std::strerror(errno);
      return 0;
    }
  }
  const std::string& fault() const override { return fault_; }
  bool ready(int timeout_ms) override {
    pollfd wait{descriptor_, POLLIN, 0};
    return ::poll(&wait, 1, timeout_ms) != 0;
  }

 private:
  // Waits for more, or for the word to stop.
  bool is_stopped() const {
    if (stop_ < 0) return false;
    std::array<pollfd, 2> wait{pollfd{stop_, POLLIN, 0}, pollfd{descriptor_, POLLIN, 0}};
    while (::poll(wait.data(), wait.size(), -1) < 0 && errno == EINTR) {
    }
    return wait[0].revents != 0;
  }

  static constexpr const char* kStopped = "ended by a signal, what may have followed is not read";
  int descriptor_ = -1;
  double size_ = 0.0;  // of a file
  double taken_ = 0.0;
  int stop_ = stop_descriptor.load();
  bool owned_ = false;
  std::string fault_;
};

// Gives back the bytes that were looked at to find out what the content is.
class PeekedSource : public ByteSource {
 public:
  PeekedSource(std::unique_ptr<ByteSource> inner, std::string peeked)
      : ByteSource(*inner), inner_(std::move(inner)), peeked_(std::move(peeked)) {}
  std::size_t read(std::span<char> out) override {
    if (given_ == peeked_.size()) return inner_->read(out);
    const std::size_t count = std::min(out.size(), peeked_.size() - given_);
    std::memcpy(out.data(), peeked_.data() + given_, count);
    given_ += count;
    return count;
  }
  const std::string& fault() const override { return inner_->fault(); }
  bool ready(int timeout_ms) override {
    return given_ < peeked_.size() || inner_->ready(timeout_ms);
  }

 private:
  std::unique_ptr<ByteSource> inner_;
  std::string peeked_;
  std::size_t given_ = 0;
};

// What the unpackers share: packed bytes come in blocks, a fault ends the stream.
class PackedSource : public ByteSource {
 public:
  explicit PackedSource(std::unique_ptr<ByteSource> inner)
      : ByteSource(*inner), inner_(std::move(inner)), packed_(kBlock) {}
  const std::string& fault() const override { return fault_; }
  bool ready(int timeout_ms) override { return begin_ < end_ || inner_->ready(timeout_ms); }

 protected:
  // False at the end of the packed bytes.
  bool refill() {
    begin_ = 0;
    end_ = inner_->read(packed_);
    if (end_ == 0 && !inner_->fault().empty()) fault_ = inner_->fault();
    return end_ != 0;
  }

  std::unique_ptr<ByteSource> inner_;
  std::vector<char> packed_;
  std::size_t begin_ = 0;
  std::size_t end_ = 0;
  std::string fault_;
};

class GzipSource : public PackedSource {
 public:
  explicit GzipSource(std::unique_ptr<ByteSource> inner) : PackedSource(std::move(inner)) {
    constexpr int kGzipOnly = 15 + 16;
    if (inflateInit2(&stream_, kGzipOnly) != Z_OK) throw LogOpenError{"out of memory"};
  }
  ~GzipSource() override { inflateEnd(&stream_); }

  std::size_t read(std::span<char> out) override {
    stream_.next_out = reinterpret_cast<Bytef*>(out.data());
    stream_.avail_out = static_cast<uInt>(out.size());
    while (stream_.avail_out == out.size() && fault_.empty()) {
      if (begin_ == end_ && !refill()) {
        if (inside_member_ && fault_.empty()) fault_ = "gzip data ends before its end";
        break;
      }
      if (!inside_member_) {
        // Further members follow each other; zeros behind one are padding.
        constexpr char kMagic = 0x1F;
        if (packed_[begin_] == '\0') {
          ++begin_;
          continue;
        }
        if (packed_[begin_] != kMagic) {
          fault_ = "gzip data with something else behind them";
          break;
        }
        inflateReset(&stream_);
        inside_member_ = true;
      }
      stream_.next_in = reinterpret_cast<Bytef*>(packed_.data() + begin_);
      stream_.avail_in = static_cast<uInt>(end_ - begin_);
      const int status = inflate(&stream_, Z_NO_FLUSH);
      begin_ = end_ - stream_.avail_in;
      if (status == Z_STREAM_END) {
        inside_member_ = false;
      } else if (status != Z_OK && status != Z_BUF_ERROR) {
        fault_ = "damaged gzip data";
      }
    }
    return out.size() - stream_.avail_out;
  }

 private:
  z_stream stream_{};
  bool inside_member_ = true;
};

class ZstdSource : public PackedSource {
 public:
  explicit ZstdSource(std::unique_ptr<ByteSource> inner)
      : PackedSource(std::move(inner)), stream_(ZSTD_createDStream()) {
    if (stream_ == nullptr) throw LogOpenError{"out of memory"};
  }
  ~ZstdSource() override { ZSTD_freeDStream(stream_); }
  ZstdSource(const ZstdSource&) = delete;
  ZstdSource& operator=(const ZstdSource&) = delete;

  std::size_t read(std::span<char> out) override {
    ZSTD_outBuffer unpacked{out.data(), out.size(), 0};
    while (unpacked.pos == 0 && fault_.empty()) {
      if (begin_ == end_ && !pending_ && !refill()) {
        if (inside_frame_ && fault_.empty()) fault_ = "zstd data ends before its end";
        break;
      }
      ZSTD_inBuffer in{packed_.data(), end_, begin_};
      const std::size_t status = ZSTD_decompressStream(stream_, &unpacked, &in);
      begin_ = in.pos;
      if (ZSTD_isError(status) != 0) {
        fault_ = std::string("damaged zstd data: ") + ZSTD_getErrorName(status);
      } else {
        inside_frame_ = status != 0;
        pending_ = unpacked.pos == unpacked.size;  // more may wait inside the unpacker
      }
    }
    return unpacked.pos;
  }

 private:
  ZSTD_DStream* stream_;
  bool inside_frame_ = true;
  bool pending_ = false;
};

// UTF-16, as a redirection in PowerShell writes it, to UTF-8.
class Utf16Source : public PackedSource {
 public:
  using PackedSource::PackedSource;
  std::size_t read(std::span<char> out) override {
    while (given_ == text_.size()) {
      if (!refill()) {
        if (!pending_.empty() && fault_.empty()) fault_ = "UTF-16 text ends within a character";
        pending_.clear();
        return 0;
      }
      pending_.append(packed_.data(), end_);
      begin_ = end_;
      convert();
    }
    const std::size_t count = std::min(out.size(), text_.size() - given_);
    std::memcpy(out.data(), text_.data() + given_, count);
    given_ += count;
    return count;
  }
  bool ready(int timeout_ms) override { return given_ < text_.size() || inner_->ready(timeout_ms); }

 private:
  // Whole characters; half of one waits for the next block.
  void convert() {
    if (order_.empty()) {
      order_ = pending_.substr(0, 2);
      pending_.erase(0, 2);
    }
    const bool little = order_[0] == '\xFF';
    std::size_t whole = pending_.size() & ~std::size_t{1};
    constexpr unsigned kHighSurrogate = 0xD8;
    if (whole >= 2) {
      const auto high = static_cast<unsigned char>(pending_[whole - (little ? 1 : 2)]);
      if ((high & 0xFCU) == kHighSurrogate) whole -= 2;
    }
    text_ = utf8_from_utf16(order_ + pending_.substr(0, whole)).value_or("");
    given_ = 0;
    pending_.erase(0, whole);
  }

  std::string order_;    // the mark at the very start
  std::string pending_;  // not converted yet
  std::string text_;
  std::size_t given_ = 0;
};

}  // namespace

void ByteSource::end_with(int descriptor) { stop_descriptor.store(descriptor); }

std::string ByteSource::front(std::size_t most) {
  std::string bytes(most, '\0');
  std::size_t have = 0;
  while (have < most) {
    const std::size_t count = read({bytes.data() + have, most - have});
    if (count == 0) break;
    have += count;
  }
  bytes.resize(have);
  return bytes;
}

std::unique_ptr<ByteSource> ByteSource::with_front(std::unique_ptr<ByteSource> source,
                                                   std::string front) {
  return std::make_unique<PeekedSource>(std::move(source), std::move(front));
}

std::unique_ptr<ByteSource> ByteSource::open(const std::string& path) {
  auto plain = std::make_unique<PlainSource>(path);
  std::string start = plain->front(4);
  if (start.empty() && !plain->fault().empty()) throw LogOpenError{path + ": " + plain->fault()};
  const std::string_view magic = start;
  const bool gzip = magic.starts_with("\x1F\x8B");
  const bool zstd = magic.starts_with("\x28\xB5\x2F\xFD");
  const bool utf16 = magic.starts_with("\xFF\xFE") || magic.starts_with("\xFE\xFF");
  auto source = with_front(std::move(plain), std::move(start));
  if (gzip) return std::make_unique<GzipSource>(std::move(source));
  if (zstd) return std::make_unique<ZstdSource>(std::move(source));
  if (utf16) return std::make_unique<Utf16Source>(std::move(source));
  return source;
}

}  // namespace beltgrip::can
