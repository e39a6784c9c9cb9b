// Logs in binary formats: record by record, from a stream. Parsers keep what a format's header says
// and nothing of the length of the log; a length field never decides how much memory is taken.
// Tools only.
#pragma once

#include <bit>
#include <cassert>
#include <concepts>
#include <cstdint>
#include <cstring>
#include <memory>
#include <optional>
#include <string>
#include <string_view>

#include "can_dbc/log/byte_source.h"
#include "can_dbc/log/can_log.h"

namespace beltgrip::can {

// Numbers at known places of a piece of a file. Precondition of each: it lies within.
class Fields {
 public:
  explicit Fields(std::string_view bytes, bool big_endian = false)
      : bytes_(bytes), big_(big_endian) {}
  std::uint8_t u8(std::size_t at) const { return get<std::uint8_t>(at); }
  std::uint16_t u16(std::size_t at) const { return get<std::uint16_t>(at); }
  std::uint32_t u32(std::size_t at) const { return get<std::uint32_t>(at); }
  std::uint64_t u64(std::size_t at) const { return get<std::uint64_t>(at); }
  std::string_view text(std::size_t at, std::size_t size) const {
    assert(at <= bytes_.size() && size <= bytes_.size() - at);
    return bytes_.substr(at, size);
  }
  std::size_t size() const { return bytes_.size(); }

 private:
  template <std::unsigned_integral T>
  T get(std::size_t at) const {
    assert(at <= bytes_.size() && sizeof(T) <= bytes_.size() - at);
    T value = 0;
    for (std::size_t i = 0; i < sizeof(T); ++i) {
      const std::size_t place = big_ ? i : sizeof(T) - 1 - i;
      value = static_cast<T>((std::uint64_t{value} << 8U) |
                             static_cast<unsigned char>(bytes_[at + place]));
    }
    return value;
  }
  std::string_view bytes_;
  bool big_;
};

// A source of bytes read in pieces of known size, through one buffer of fixed size.
class BinaryInput {
 public:
  static constexpr std::size_t kTakeMost = std::size_t{64} * 1024;

  explicit BinaryInput(std::unique_ptr<ByteSource> source);
  // The next `size` bytes, valid until the next call, or nothing where fewer are left; then none of
  // them is taken. Precondition: size <= kTakeMost.
  std::optional<std::string_view> take(std::size_t size);
  // The same, left where they are.
  std::optional<std::string_view> peek(std::size_t size);
  // False where fewer are left; then all of them are passed.
  bool skip(std::uint64_t size);
  bool at_end() { return !peek(1); }
  // What take() can give without reading on.
  std::size_t buffered() const { return end_ - begin_; }
  // How many bytes were taken or skipped.
  std::uint64_t position() const { return position_; }
  const std::string& fault() const { return source_->fault(); }

 private:
  std::unique_ptr<ByteSource> source_;
  std::unique_ptr<char[]> buffer_;
  std::size_t begin_ = 0;
  std::size_t end_ = 0;
  std::uint64_t position_ = 0;
};

enum class RecordKind {
  kFrame,    // the record is filled
  kNothing,  // something that is no frame and should be none
  kBad,      // should have been a frame; reason() says what is wrong, byte() where
  kEnd
};

class BinaryParser {
 public:
  virtual ~BinaryParser() = default;
  RecordKind next(LogRecord& record) { return ended_ ? RecordKind::kEnd : step(record); }
  const std::string& reason() const { return reason_; }
  std::uint64_t byte() const { return byte_; }

 protected:
  virtual RecordKind step(LogRecord& record) = 0;

  RecordKind bad(std::uint64_t byte, std::string reason) {
    byte_ = byte;
    reason_ = std::move(reason);
    return RecordKind::kBad;
  }
  // Nothing can be read behind this.
  RecordKind broken(std::uint64_t byte, std::string reason) {
    ended_ = true;
    return bad(byte, std::move(reason));
  }
  RecordKind end() {
    ended_ = true;
    return RecordKind::kEnd;
  }
  // The input ends within `what`, which begins at `byte`.
  RecordKind cut(std::uint64_t byte, const BinaryInput& input, const std::string& what);

 private:
  bool ended_ = false;
  std::string reason_;
  std::uint64_t byte_ = 0;
};

std::unique_ptr<BinaryParser> make_blf_parser(std::unique_ptr<ByteSource> source);
// `path`: where the source came from; read in place where it can be.
std::unique_ptr<BinaryParser> make_mdf_parser(std::unique_ptr<ByteSource> source,
                                              const std::string& path);
std::unique_ptr<BinaryParser> make_pcap_parser(std::unique_ptr<ByteSource> source);
std::unique_ptr<BinaryParser> make_pcapng_parser(std::unique_ptr<ByteSource> source);

std::unique_ptr<LogReader> make_binary_reader(std::unique_ptr<BinaryParser> parser);

}  // namespace beltgrip::can
