#include "can_dbc/log/mdf/file.h"

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <filesystem>
#include <string_view>

#include "can_dbc/log/binary.h"

namespace beltgrip::can::mdf {

namespace {

// Chosen: far more than descriptions of any bus log have (100,000 are a large one).
constexpr std::uint64_t kBlocksMost = 1'000'000;
constexpr std::uint64_t kLinksMost = 65'536;  // of one block; a list of data of 250 GB has as many
constexpr std::size_t kTextMost = 4096;
// Chosen: what a packed or piped measurement may fill of the disk while it is read.
constexpr std::uint64_t kUnpackedMost = std::uint64_t{16} << 30U;

using Handle = std::unique_ptr<std::FILE, int (*)(std::FILE*)>;

// Nothing where it is packed, or no file at all.
Handle plain_file(const std::string& path) {
  std::error_code none;
  if (path == "-" || !std::filesystem::is_regular_file(path, none)) return {nullptr, std::fclose};
  Handle file{std::fopen(path.c_str(), "rbe"), std::fclose};
  std::array<char, 4> front{};
  if (!file || std::fread(front.data(), 1, front.size(), file.get()) != front.size()) {
    return {nullptr, std::fclose};
  }
  const std::string_view magic(front.data(), front.size());
  if (magic != "MDF " && magic != "UnFi") file.reset();
  return file;
}

[[noreturn]] void fail(const char* what) {
  throw MdfError{0, std::string(what) + ": " + std::strerror(errno)};
}

Handle unpacked(ByteSource& source) {
  Handle file{std::tmpfile(), std::fclose};  // without a name
  if (!file) fail("no temporary file to unpack it into");
  std::vector<char> piece(std::size_t{64} * 1024);
  std::uint64_t written = 0;
  while (const std::size_t count = source.read(piece)) {
    written += count;
    if (written > kUnpackedMost) {
      throw MdfError{0, "unpacks to more than 16 GiB; unpack it into a file first"};
    }
    if (std::fwrite(piece.data(), 1, count, file.get()) != count) {
      fail("cannot be unpacked into a temporary file");
    }
  }
  if (std::fflush(file.get()) != 0) fail("cannot be unpacked into a temporary file");
  return file;
}

}  // namespace

File::File(std::unique_ptr<ByteSource> source, const std::string& path) : file_(plain_file(path)) {
  if (!file_) {
    file_ = unpacked(*source);
    fault_ = source->fault();
  }
  if (::fseeko(file_.get(), 0, SEEK_END) == 0) {
    size_ = static_cast<std::uint64_t>(std::max<off_t>(::ftello(file_.get()), 0));
  }
}

std::size_t File::read_at(std::uint64_t at, char* out, std::size_t count) const {
  if (at >= size_ || ::fseeko(file_.get(), static_cast<off_t>(at), SEEK_SET) != 0) return 0;
  return std::fread(out, 1, count, file_.get());
}

Block File::block(std::uint64_t at) {
  if (++blocks_ > kBlocksMost) {
    throw MdfError{at, "more than 1000000 blocks of description: links that point back"};
  }
  std::string head(kBlockHeader, '\0');
  if (at >= size_ || size_ - at < kBlockHeader ||
      read_at(at, head.data(), head.size()) < kBlockHeader) {
    throw MdfError{std::min(at, size_), "a link to byte " + std::to_string(at) +
                                            ", where no block is: the file has " +
                                            std::to_string(size_) + " bytes"};
  }
  Block block;
  block.at = at;
  block.id = head.substr(0, 4);
  const Fields fields(head);
  block.length = fields.u64(8);
  const std::uint64_t count = fields.u64(16);
  if (!block.id.starts_with("##")) throw MdfError{at, "no block where a link points, expected ##"};
  if (count > kLinksMost || block.length < kBlockHeader + 8 * count) {
    throw MdfError{at, "a block " + block.id + " of " + std::to_string(block.length) +
                           " bytes with " + std::to_string(count) + " links"};
  }
  block.data_at = at + kBlockHeader + 8 * count;
  std::string links(8 * count, '\0');
  if (read_at(at + kBlockHeader, links.data(), links.size()) < links.size()) {
    throw MdfError{at, "a block " + block.id + " is cut off by the end of the file"};
  }
  for (std::size_t i = 0; i < count; ++i) block.links.push_back(Fields(links).u64(8 * i));
  return block;
}

std::string File::data(const Block& block, std::size_t most) const {
  std::string bytes(static_cast<std::size_t>(std::min<std::uint64_t>(block.data_length(), most)),
                    '\0');
  bytes.resize(read_at(block.data_at, bytes.data(), bytes.size()));
  return bytes;
}

std::string File::text(std::uint64_t at) {
  if (at == 0) return {};
  std::string text = data(block(at), kTextMost);
  text.resize(std::min(text.find('\0'), text.size()));
  return text;
}

void File::spend(std::uint64_t at, std::uint64_t bytes) {
  if (!read_.insert(at).second || bytes > size_ || spent_ > size_ - bytes) {
    throw MdfError{at, "data that were read before: links that point back"};
  }
  spent_ += bytes;
}

}  // namespace beltgrip::can::mdf
