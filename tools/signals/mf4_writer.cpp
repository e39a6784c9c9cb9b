// MDF 4.1 as small as it may be: one group of channels, all 64-bit floating point, the first of
// them the time, and one block of data at the end of the file. Every block begins at a multiple of
// eight bytes. The number of rows and the length of the data are written when they are known.
#include <bit>
#include <cmath>
#include <limits>

#include "tools/signals/signal_writer.h"

namespace beltgrip::signals {

namespace {

constexpr std::uint64_t kBlockHeader = 24;
constexpr std::uint64_t kLinkSize = 8;
constexpr std::uint64_t kLengthAt = 8;  // in the header of a block
constexpr std::uint16_t kVersion = 410;
constexpr std::uint8_t kMaster = 2, kTimeSync = 1, kRealLittleEndian = 4;
constexpr std::uint8_t kOffsetsValid =
    2;  // of the time zone: there are none, the time is universal
constexpr unsigned kValueBits = 64;

class Bytes {
 public:
  Bytes& u8(std::uint64_t value) { return put(value, 1); }
  Bytes& u16(std::uint64_t value) { return put(value, 2); }
  Bytes& u32(std::uint64_t value) { return put(value, 4); }
  Bytes& u64(std::uint64_t value) { return put(value, 8); }
  Bytes& real(double value) { return u64(std::bit_cast<std::uint64_t>(value)); }
  Bytes& zeros(std::size_t count) {
    bytes_.append(count, '\0');
    return *this;
  }
  const std::string& str() const { return bytes_; }

 private:
  Bytes& put(std::uint64_t value, unsigned size) {
    for (unsigned i = 0; i < size; ++i) {
      bytes_ += static_cast<char>((value >> (8 * i)) & 0xFFU);
    }
    return *this;
  }
  std::string bytes_;
};

class Mf4Writer final : public SignalWriter {
 public:
  Mf4Writer(std::FILE* out, const std::vector<Signal>& signals)
      : out_(out), columns_(signals.size() + 1) {
    describe(signals);
    std::fwrite(front_.data(), 1, front_.size(), out_);
  }

  void row(std::int64_t t_ns, std::span<const double> values) override {
    if (rows_ == 0) start_ns_ = t_ns < 0 ? 0 : t_ns;
    ++rows_;
    constexpr double kNanosecond_s = 1e-9;
    Bytes record;
    record.real(static_cast<double>(t_ns - start_ns_) * kNanosecond_s);
    for (const double value : values) {
      record.real(std::isfinite(value) ? value : std::numeric_limits<double>::quiet_NaN());
    }
    std::fwrite(record.str().data(), 1, record.str().size(), out_);
  }

  void finish() override {
    const std::uint64_t data = rows_ * columns_ * sizeof(double);
    patch(start_at_, static_cast<std::uint64_t>(start_ns_));
    patch(history_at_, static_cast<std::uint64_t>(start_ns_));
    patch(rows_at_, rows_);
    patch(data_at_ + kLengthAt, kBlockHeader + data);
    if (std::fseek(out_, 0, SEEK_END) != 0) return;  // seen as the file is closed
  }

 private:
  // Where it begins.
  std::uint64_t block(const char* id, const std::vector<std::uint64_t>& links,
                      const std::string& body) {
    front_.append((8 - front_.size() % 8) % 8, '\0');
    const std::uint64_t at = front_.size();
    Bytes head;
    head.u32(0).u64(kBlockHeader + kLinkSize * links.size() + body.size()).u64(links.size());
    for (const std::uint64_t link : links) head.u64(link);
    front_ += std::string("##") + id + head.str() + body;
    return at;
  }

  // With its end, and filled up to eight bytes.
  std::uint64_t text(const char* id, std::string content) {
    content += '\0';
    content.append((8 - content.size() % 8) % 8, '\0');
    return block(id, {}, content);
  }

  std::uint64_t channel(const Signal& signal, std::uint64_t next, std::size_t column) {
    const std::uint64_t name = text("TX", signal.name);
    const std::uint64_t unit = signal.unit.empty() ? 0 : text("TX", signal.unit);
    const bool time = column == 0;
    constexpr std::size_t kRanges = 6;  // of values, limits, extended limits: not told
    return block("CN", {next, 0, name, 0, 0, 0, unit, 0},
                 Bytes()
                     .u8(time ? kMaster : 0)
                     .u8(time ? kTimeSync : 0)
                     .u8(kRealLittleEndian)
                     .u8(0)
                     .u32(column * sizeof(double))
                     .u32(kValueBits)
                     .u32(0)
                     .u32(0)
                     .u8(0)
                     .u8(0)
                     .u16(0)
                     .zeros(kRanges * sizeof(double))
                     .str());
  }

  void describe(const std::vector<Signal>& signals) {
    front_ = "MDF     4.10    BeltGrip" + Bytes().u32(0).u16(kVersion).zeros(34).str();
    // Links to what follows are filled in below.
    const std::uint64_t header =
        block("HD", {0, 0, 0, 0, 0, 0},
              Bytes().u64(0).u16(0).u16(0).u8(kOffsetsValid).zeros(3).real(0.0).real(0.0).str());
    start_at_ = header + kBlockHeader + 6 * kLinkSize;
    const std::uint64_t comment =
        text("MD",
             "<FHcomment><TX>signals of a log</TX><tool_id>beltgrip</tool_id>"
             "<tool_vendor>BeltGrip</tool_vendor><tool_version>" BELTGRIP_VERSION
             "</tool_version></FHcomment>");
    const std::uint64_t history =
        block("FH", {0, comment}, Bytes().u64(0).u16(0).u16(0).u8(kOffsetsValid).zeros(3).str());
    history_at_ = history + kBlockHeader + 2 * kLinkSize;
    std::uint64_t next = 0;
    for (std::size_t i = signals.size(); i-- > 0;) next = channel(signals[i], next, i + 1);
    next = channel({"t", "s"}, next, 0);
    const std::uint64_t group = block(
        "CG", {0, next, 0, 0, 0, 0},
        Bytes().u64(0).u64(0).u16(0).u16(0).u32(0).u32(columns_ * sizeof(double)).u32(0).str());
    rows_at_ = group + kBlockHeader + 6 * kLinkSize + 8;
    const std::uint64_t data_group = block("DG", {0, group, 0, 0}, Bytes().u8(0).zeros(7).str());
    data_at_ = block("DT", {}, "");
    link(header, 0, data_group);
    link(header, 1, history);
    link(data_group, 2, data_at_);
  }

  void link(std::uint64_t block, std::size_t number, std::uint64_t to) {
    front_.replace(block + kBlockHeader + kLinkSize * number, kLinkSize, Bytes().u64(to).str());
  }

  void patch(std::uint64_t at, std::uint64_t value) {
    const std::string bytes = Bytes().u64(value).str();
    if (std::fseek(out_, static_cast<long>(at), SEEK_SET) != 0) return;
    std::fwrite(bytes.data(), 1, bytes.size(), out_);
  }

  std::FILE* out_;
  std::size_t columns_;
  std::string front_;
  std::uint64_t start_at_ = 0, history_at_ = 0, rows_at_ = 0, data_at_ = 0;
  std::int64_t start_ns_ = 0;
  std::uint64_t rows_ = 0;
};

}  // namespace

std::unique_ptr<SignalWriter> make_mf4_writer(std::FILE* out, const std::vector<Signal>& signals) {
  return std::make_unique<Mf4Writer>(out, signals);
}

}  // namespace beltgrip::signals
