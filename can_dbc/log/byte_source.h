// A file or standard input as a stream of bytes, unpacked on the way if its content is gzip or
// zstd, in UTF-8 if it begins with the mark of UTF-16. Memory is flat in the length of the input.
// Tools only.
#pragma once

#include <cstddef>
#include <limits>
#include <memory>
#include <span>
#include <string>

namespace beltgrip::can {

class ByteSource {
 public:
  virtual ~ByteSource() = default;
  // Fills at least one byte unless the end is reached; returns how many. 0: the end, or fault()
  // says why there is no more.
  virtual std::size_t read(std::span<char> out) = 0;
  virtual const std::string& fault() const = 0;
  // True if read() has something (or the end) within that time.
  virtual bool ready(int timeout_ms) = 0;

  // How much of the file below is read, 0 to 1; no number: it is none. It outlives the source.
  std::shared_ptr<const double> share_read() const { return share_read_; }

  // The next bytes, at most `most`; fewer only at the end. They are taken: with_front() gives them
  // back.
  std::string front(std::size_t most);
  static std::unique_ptr<ByteSource> with_front(std::unique_ptr<ByteSource> source,
                                                std::string front);

  // "-" is standard input. Throws LogOpenError (can_log.h).
  static std::unique_ptr<ByteSource> open(const std::string& path);
  // Every source that is opened from now on ends with a fault once this descriptor is readable.
  static void end_with(int descriptor);

 protected:
  ByteSource() = default;
  explicit ByteSource(const ByteSource& below) : share_read_(below.share_read_) {}
  std::shared_ptr<double> share_read_ =
      std::make_shared<double>(std::numeric_limits<double>::quiet_NaN());
};

}  // namespace beltgrip::can
