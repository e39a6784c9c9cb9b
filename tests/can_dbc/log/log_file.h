// Logs for tests: bytes put together by hand, read back frame by frame.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "can_dbc/log/can_log.h"

namespace beltgrip::test {

// Numbers in a stated byte order, one behind the other.
class Bytes {
 public:
  explicit Bytes(bool big_endian = false) : big_(big_endian) {}
  Bytes& u8(std::uint64_t value) { return put(value, 1); }
  Bytes& u16(std::uint64_t value) { return put(value, 2); }
  Bytes& u32(std::uint64_t value) { return put(value, 4); }
  Bytes& u64(std::uint64_t value) { return put(value, 8); }
  Bytes& text(std::string_view text) {
    bytes_ += text;
    return *this;
  }
  Bytes& zeros(std::size_t count) {
    bytes_.append(count, '\0');
    return *this;
  }
  // Up to a multiple of `step`.
  Bytes& align(std::size_t step) { return zeros((step - bytes_.size() % step) % step); }
  const std::string& str() const { return bytes_; }
  std::size_t size() const { return bytes_.size(); }

 private:
  Bytes& put(std::uint64_t value, unsigned size) {
    for (unsigned i = 0; i < size; ++i) {
      const unsigned place = big_ ? size - 1 - i : i;
      bytes_ += static_cast<char>((value >> (8U * place)) & 0xFFU);
    }
    return *this;
  }
  bool big_;
  std::string bytes_;
};

struct ReadLog {
  std::vector<std::string> frames;  // "1700000000.123456789 can0 123#0011", sent ones end in " T"
  can::LogStats stats;
};
ReadLog read_log(const std::string& path);

// A file that is gone with the object.
class LogFile {
 public:
  explicit LogFile(std::string_view content);
  ~LogFile();
  LogFile(const LogFile&) = delete;
  LogFile& operator=(const LogFile&) = delete;
  const std::string& path() const { return path_; }

 private:
  std::string path_;
};

}  // namespace beltgrip::test
