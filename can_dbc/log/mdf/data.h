// The data behind a link of an MDF 4 file as one stream: of a single block, or of lists of them,
// packed or not. Tools only.
#pragma once

#include <zlib.h>

#include <array>
#include <deque>

#include "can_dbc/log/mdf/file.h"

namespace beltgrip::can::mdf {

class DataSource : public ByteSource {
 public:
  // `open_end`: a block of data without a length reaches to the end of the file (not finished).
  DataSource(File& file, std::uint64_t link, bool open_end);
  ~DataSource() override;
  DataSource(const DataSource&) = delete;
  DataSource& operator=(const DataSource&) = delete;

  std::size_t read(std::span<char> out) override;
  const std::string& fault() const override { return fault_; }
  bool ready(int) override { return true; }
  // Where in the file this byte of the stream stands; of packed data the block. Asked with growing
  // places.
  std::uint64_t place_of(std::uint64_t streamed);

 private:
  struct Piece {
    std::uint64_t streamed, in_file;
    bool packed;
  };
  std::size_t read_some(std::span<char> out);
  bool next_block();
  void open_list(std::uint64_t link);
  void open_data(const Block& block);
  void open_packed(const Block& block);
  void unpack_transposed(std::uint64_t at, std::uint32_t columns, std::uint64_t size);
  std::size_t unpack(std::span<char> out);
  void begin_piece(std::uint64_t at, bool packed);
  void close();

  File& file_;
  bool open_end_;
  std::uint64_t next_list_ = 0;
  std::vector<std::uint64_t> blocks_;  // of the list being read
  std::size_t block_ = 0;
  std::uint64_t at_ = 0;        // of the bytes not read yet
  std::uint64_t left_ = 0;      // of them
  std::uint64_t unpacked_ = 0;  // bytes that packed data should still give
  bool packed_ = false;
  z_stream stream_{};
  std::vector<char> packed_bytes_;
  std::string whole_;  // a block that had to be unpacked as a whole
  std::size_t whole_given_ = 0;
  std::uint64_t given_ = 0;
  std::deque<Piece> pieces_;
  std::string fault_;
};

}  // namespace beltgrip::can::mdf
