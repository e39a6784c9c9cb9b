// An MDF 4 file as blocks that point at each other: any of them may stand anywhere, so the file is
// read at places. What links can cost is bounded: they may point back. Tools only.
#pragma once

#include <cstdint>
#include <cstdio>
#include <memory>
#include <set>
#include <string>
#include <vector>

#include "can_dbc/log/byte_source.h"

namespace beltgrip::can::mdf {

struct MdfError {
  std::uint64_t byte = 0;
  std::string reason;
};

inline constexpr std::uint64_t kBlockHeader = 24;

struct Block {
  std::uint64_t at = 0;
  std::string id;            // "##DG"
  std::uint64_t length = 0;  // with the header
  std::vector<std::uint64_t> links;
  std::uint64_t data_at = 0;  // behind the links
  std::uint64_t data_length() const { return at + length - data_at; }
};

class File {
 public:
  // Reads `path` in place where it can: a file that is not packed. Else what `source` gives is
  // written to a file without a name first. Throws MdfError.
  File(std::unique_ptr<ByteSource> source, const std::string& path);
  std::uint64_t size() const { return size_; }
  // Of the source that was unpacked: why there is not more of it.
  const std::string& fault() const { return fault_; }
  // Up to `count` bytes; fewer only at the end of the file.
  std::size_t read_at(std::uint64_t at, char* out, std::size_t count) const;

  // A block of description and the bytes behind its links, at most `most` of them. Throws MdfError.
  Block block(std::uint64_t at);
  std::string data(const Block& block, std::size_t most) const;
  // Of a TX or MD block, plain or as XML; empty for no link.
  std::string text(std::uint64_t at);
  // Notes a block of data, or a list of them, and what it holds. Throws MdfError where it was read
  // before, and once it is more than the file.
  void spend(std::uint64_t at, std::uint64_t bytes);

 private:
  std::unique_ptr<std::FILE, int (*)(std::FILE*)> file_;
  std::string fault_;
  std::uint64_t size_ = 0;
  std::uint64_t blocks_ = 0;
  std::uint64_t spent_ = 0;
  std::set<std::uint64_t> read_;  // data blocks and lists: of a real file, one every few MiB
};

}  // namespace beltgrip::can::mdf
