#include "can_dbc/log/mdf/data.h"

#include <algorithm>

#include "can_dbc/log/binary.h"

namespace beltgrip::can::mdf {

namespace {

constexpr std::uint64_t kTransposedMost = std::uint64_t{16} << 20U;  // the standard allows 4 MiB
constexpr std::size_t kPackedPiece = std::size_t{16} * 1024;
constexpr std::size_t kPackedFields = 24;
enum Packing : std::uint8_t { kDeflate = 0, kTransposeDeflate = 1 };

}  // namespace

DataSource::DataSource(File& file, std::uint64_t link, bool open_end)
    : file_(file), open_end_(open_end), packed_bytes_(kPackedPiece) {
  if (link != 0) blocks_.push_back(link);
}

DataSource::~DataSource() { close(); }

std::uint64_t DataSource::place_of(std::uint64_t streamed) {
  while (pieces_.size() > 1 && pieces_[1].streamed <= streamed) pieces_.pop_front();
  if (pieces_.empty()) return at_;
  const Piece& piece = pieces_.front();
  return piece.packed ? piece.in_file : piece.in_file + (streamed - piece.streamed);
}

std::size_t DataSource::read(std::span<char> out) {
  if (!fault_.empty()) return 0;
  try {
    const std::size_t count = read_some(out);
    given_ += count;
    return count;
  } catch (const MdfError& error) {
    fault_ = error.reason;
    begin_piece(error.byte, true);
    return 0;
  }
}

std::size_t DataSource::read_some(std::span<char> out) {
  for (;;) {
    if (whole_given_ < whole_.size()) {
      const std::size_t count = std::min(out.size(), whole_.size() - whole_given_);
      std::copy_n(whole_.begin() + static_cast<std::ptrdiff_t>(whole_given_), count, out.begin());
      whole_given_ += count;
      return count;
    }
    if (packed_) {
      const std::size_t count = unpack(out);
      if (count > 0) return count;
      continue;
    }
    if (left_ > 0) {
      const auto most = static_cast<std::size_t>(std::min<std::uint64_t>(out.size(), left_));
      const std::size_t count = file_.read_at(at_, out.data(), most);
      if (count == 0) throw MdfError{at_, "the data are cut off by the end of the file"};
      at_ += count;
      left_ -= count;
      return count;
    }
    if (!next_block()) return 0;
  }
}

bool DataSource::next_block() {
  while (block_ == blocks_.size()) {
    if (next_list_ == 0) return false;
    open_list(next_list_);
  }
  const std::uint64_t link = blocks_[block_++];
  if (link == 0) return true;
  const Block block = file_.block(link);
  if (block.id == "##HL" || block.id == "##DL" || block.id == "##LD") {
    open_list(link);
  } else if (block.id == "##DZ") {
    open_packed(block);
  } else if (block.id == "##DT" || block.id == "##SD" || block.id == "##DV") {
    open_data(block);
  } else {
    throw MdfError{link,
                   "a block " + block.id + ", expected data (DT, SD, DV, DZ) or a list of them"};
  }
  return true;
}

// A list's first link is the next list; a head of lists has only that.
void DataSource::open_list(std::uint64_t link) {
  const Block list = file_.block(link);
  file_.spend(link, std::min(list.length, file_.size()));
  next_list_ = list.links.empty() ? 0 : list.links[0];
  blocks_.clear();
  block_ = 0;
  if (list.id == "##HL") return;
  if (list.id != "##DL" && list.id != "##LD") {
    throw MdfError{link, "a block " + list.id + ", expected a list of data (DL, LD)"};
  }
  blocks_.assign(list.links.begin() + (list.links.empty() ? 0 : 1), list.links.end());
  if (list.id == "##LD") {
    // Links to validity stand between, or behind, those to the data.
    const std::string fields = file_.data(list, 4);
    constexpr std::uint32_t kHasValidity = 0x8000'0000;
    if (fields.size() == 4 && (Fields(fields).u32(0) & kHasValidity) != 0) {
      blocks_.resize((blocks_.size() + 1) / 2);
    }
  }
}

void DataSource::open_data(const Block& block) {
  at_ = block.data_at;
  left_ = block.data_length();
  if (open_end_ && (left_ == 0 || left_ > file_.size() - at_)) left_ = file_.size() - at_;
  file_.spend(block.at, std::min(left_, file_.size()));
  begin_piece(at_, false);
}

void DataSource::open_packed(const Block& block) {
  const std::string head = file_.data(block, kPackedFields);
  if (head.size() < kPackedFields) throw MdfError{block.at, "a packed block without its header"};
  const Fields fields(head);
  const std::uint8_t packing = fields.u8(2);
  const std::uint32_t columns = fields.u32(4);
  const std::uint64_t size = fields.u64(8);
  at_ = block.data_at + kPackedFields;
  left_ = std::min(fields.u64(16), block.data_length() - kPackedFields);
  file_.spend(block.at, std::min(left_, file_.size()));
  if (packing > kTransposeDeflate) {
    throw MdfError{block.at, "a block packed by method " + std::to_string(packing) +
                                 ", expected 0 (deflate) or 1 (transposed)"};
  }
  close();
  stream_ = {};
  if (inflateInit(&stream_) != Z_OK) throw MdfError{block.at, "out of memory"};
  packed_ = true;
  unpacked_ = size;
  begin_piece(block.at, true);
  if (packing == kTransposeDeflate) unpack_transposed(block.at, columns, size);
}

void DataSource::unpack_transposed(std::uint64_t at, std::uint32_t columns, std::uint64_t size) {
  if (size > kTransposedMost || columns == 0) {
    throw MdfError{at, "a transposed block of " + std::to_string(size) + " bytes in rows of " +
                           std::to_string(columns) + ", expected at most 16 MiB"};
  }
  std::string turned;
  std::array<char, kPackedPiece> piece{};
  while (packed_) turned.append(piece.data(), unpack(piece));
  const std::size_t rows = turned.size() / columns;
  whole_.resize(turned.size());
  whole_given_ = 0;
  for (std::size_t column = 0; column < columns && rows > 0; ++column) {
    for (std::size_t row = 0; row < rows; ++row) {
      whole_[row * columns + column] = turned[column * rows + row];
    }
  }
  const std::size_t whole_rows = rows * columns;
  std::copy(turned.begin() + static_cast<std::ptrdiff_t>(whole_rows), turned.end(),
            whole_.begin() + static_cast<std::ptrdiff_t>(whole_rows));
}

// 0 at the end of the packed block.
std::size_t DataSource::unpack(std::span<char> out) {
  stream_.next_out = reinterpret_cast<Bytef*>(out.data());
  stream_.avail_out = static_cast<uInt>(std::min<std::uint64_t>(out.size(), unpacked_));
  const uInt asked = stream_.avail_out;
  while (stream_.avail_out == asked && asked > 0) {
    if (stream_.avail_in == 0 && left_ > 0) {
      const auto most = static_cast<std::size_t>(std::min<std::uint64_t>(left_, kPackedPiece));
      const std::size_t count = file_.read_at(at_, packed_bytes_.data(), most);
      if (count == 0) throw MdfError{at_, "a packed block is cut off by the end of the file"};
      at_ += count;
      left_ -= count;
      stream_.next_in = reinterpret_cast<Bytef*>(packed_bytes_.data());
      stream_.avail_in = static_cast<uInt>(count);
    }
    // Without a byte going in, more may still come out.
    const bool fed = stream_.avail_in > 0;
    const int status = inflate(&stream_, Z_NO_FLUSH);
    if (status == Z_STREAM_END) break;
    if (status != Z_OK && status != Z_BUF_ERROR) throw MdfError{at_, "damaged packed data"};
    if (!fed && stream_.avail_out == asked) break;
  }
  const std::size_t count = asked - stream_.avail_out;
  unpacked_ -= count;
  if (count == 0 && unpacked_ > 0) throw MdfError{at_, "a packed block gives less than it should"};
  if (unpacked_ == 0) {
    close();
    left_ = 0;
  }
  return count;
}

void DataSource::begin_piece(std::uint64_t at, bool packed) {
  if (!pieces_.empty() && pieces_.back().streamed == given_) pieces_.pop_back();
  pieces_.push_back({given_, at, packed});
  // The reader of the stream is behind by no more bytes than these.
  if (pieces_.size() > BinaryInput::kTakeMost) pieces_.pop_front();
}

void DataSource::close() {
  if (packed_) inflateEnd(&stream_);
  packed_ = false;
}

}  // namespace beltgrip::can::mdf
