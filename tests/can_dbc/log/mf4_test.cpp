// Bus logs in MDF 4: files of loggers in the field and files put together by hand, both against a
// reader in Python that shares no code with ours.
#include <gtest/gtest.h>
#include <zlib.h>

#include <algorithm>
#include <bit>
#include <cstdlib>
#include <filesystem>
#include <sstream>

#include "tests/can_dbc/log/log_file.h"
#include "tests/support/process.h"

namespace beltgrip::test {
namespace {

using std::chrono_literals::operator""s;
constexpr auto kLimit = 120s;
constexpr std::uint64_t kStart_ns = 1'700'000'000'000'000'000;

std::vector<std::string> by_python(const std::string& path) {
  const RunResult result = run({"/usr/bin/python3", BELTGRIP_MDF_READER, "frames", path}, kLimit);
  EXPECT_EQ(result.status, 0) << result.err;
  std::vector<std::string> frames;
  std::istringstream lines(result.out);
  for (std::string line; std::getline(lines, line);) {
    const std::size_t digits = 10;  // of seconds
    frames.push_back(line.substr(0, digits) + '.' + line.substr(digits));
  }
  return frames;
}

std::vector<std::string> without_direction(std::vector<std::string> frames) {
  for (std::string& frame : frames) {
    if (frame.ends_with(" T")) frame.resize(frame.size() - 2);
  }
  return frames;
}

std::vector<std::string> sorted(std::vector<std::string> frames) {
  std::sort(frames.begin(), frames.end());
  return frames;
}

TEST(Mf4, FilesOfTheField) {
  const char* folder = std::getenv("BELTGRIP_CORPUS");
  if (folder == nullptr) GTEST_SKIP() << "BELTGRIP_CORPUS is not set: no log was checked";
  std::size_t files = 0;
  for (const auto& entry :
       std::filesystem::directory_iterator(std::filesystem::path(folder) / "logs")) {
    if (entry.path().extension() != ".mf4") continue;
    SCOPED_TRACE(entry.path().filename().string());
    const ReadLog log = read_log(entry.path().string());
    EXPECT_EQ(log.stats.lines_bad, 0U);
    EXPECT_GT(log.frames.size(), 9000U);
    EXPECT_TRUE(sorted(without_direction(log.frames)) == sorted(by_python(entry.path().string())));
    ++files;
  }
  EXPECT_GT(files, 0U);
}

// Blocks one behind the other, each at a place that others link to.
class Mdf {
 public:
  explicit Mdf(bool finished = true) {
    file_.text(finished ? "MDF     " : "UnFinMF ")
        .text("4.10    ")
        .text("by hand ")
        .u32(0)
        .u16(410)
        .zeros(30)
        .u16(finished ? 0 : 37)
        .u16(0);
    EXPECT_EQ(file_.size(), 64U);
    header_at_ = block("HD", {0, 0, 0, 0, 0, 0}, Bytes().u64(kStart_ns).zeros(24).str());
  }
  std::uint64_t block(std::string_view id, const std::vector<std::uint64_t>& links,
                      const std::string& body, std::uint64_t length = 0) {
    file_.align(8);
    const std::uint64_t at = file_.size();
    file_.text("##")
        .text(id)
        .u32(0)
        .u64(length > 0 ? length : 24 + 8 * links.size() + body.size())
        .u64(links.size());
    for (const std::uint64_t link : links) file_.u64(link);
    file_.text(body);
    return at;
  }
  std::uint64_t text(const std::string& text) { return block("TX", {}, text + '\0'); }
  struct Position {
    unsigned type = 0, data_type = 0, bit = 0, byte = 0, bits = 8;
    std::uint64_t data = 0, conversion = 0;
  };
  std::uint64_t channel(const std::string& name, const Position& place, std::uint64_t next = 0,
                        std::uint64_t parts = 0) {
    const std::uint64_t name_at = text(name);
    return block("CN", {next, parts, name_at, 0, place.conversion, place.data, 0, 0},
                 Bytes()
                     .u8(place.type)
                     .u8(place.type == 2 ? 1 : 0)
                     .u8(place.data_type)
                     .u8(place.bit)
                     .u32(place.byte)
                     .u32(place.bits)
                     .u32(0)
                     .u32(0)
                     .zeros(52)
                     .str());
  }
  std::uint64_t linear(double offset, double factor) {
    return block("CC", {0, 0, 0, 0},
                 Bytes()
                     .u8(1)
                     .u8(0)
                     .u16(0)
                     .u16(0)
                     .u16(2)
                     .zeros(16)
                     .u64(std::bit_cast<std::uint64_t>(offset))
                     .u64(std::bit_cast<std::uint64_t>(factor))
                     .str());
  }
  std::uint64_t group(std::uint64_t channels, unsigned identifier, std::uint64_t cycles,
                      unsigned size, unsigned flags = 0, std::uint64_t next = 0) {
    return block(
        "CG", {next, channels, 0, 0, 0, 0},
        Bytes().u64(identifier).u64(cycles).u16(flags).u16(0).u32(0).u32(size).u32(0).str());
  }
  std::uint64_t data_group(std::uint64_t groups, std::uint64_t data, unsigned identifier_bytes,
                           std::uint64_t next = 0) {
    return block("DG", {next, groups, data, 0}, Bytes().u8(identifier_bytes).zeros(7).str());
  }
  // With the first data group known.
  std::string file(std::uint64_t first) const {
    std::string file = file_.str();
    const std::string link = Bytes().u64(first).str();
    file.replace(header_at_ + 24, link.size(), link);
    return file;
  }
  std::size_t size() const { return file_.size(); }

 private:
  Bytes file_;
  std::uint64_t header_at_;
};

// Time in microseconds (8 bytes), identifier (4), flags of the frame (1: IDE, EDL, BRS, ESI, Dir),
// channel (1), length (1), and the payload: so many bytes, or where it stands (8).
constexpr unsigned kHead = 15;
std::uint64_t frame_channels(Mdf& mdf, unsigned payload, std::uint64_t payload_link = 0) {
  const bool elsewhere = payload_link != 0;
  const unsigned bits = 8 * payload;
  std::uint64_t next = 0;
  next = mdf.channel("CAN_DataFrame.DataBytes",
                     {elsewhere ? 1U : 0U, 10, 0, kHead, bits, payload_link}, next);
  next = mdf.channel("CAN_DataFrame.DataLength", {0, 0, 0, 14, 8}, next);
  next = mdf.channel("CAN_DataFrame.BusChannel", {0, 0, 0, 13, 8}, next);
  next = mdf.channel("CAN_DataFrame.Dir", {0, 0, 4, 12, 1}, next);
  next = mdf.channel("CAN_DataFrame.ESI", {0, 0, 3, 12, 1}, next);
  next = mdf.channel("CAN_DataFrame.BRS", {0, 0, 2, 12, 1}, next);
  next = mdf.channel("CAN_DataFrame.EDL", {0, 0, 1, 12, 1}, next);
  next = mdf.channel("CAN_DataFrame.IDE", {0, 0, 0, 12, 1}, next);
  next = mdf.channel("CAN_DataFrame.ID", {0, 0, 0, 8, 29}, next);
  const std::uint64_t whole = mdf.channel("CAN_DataFrame", {0, 10, 0, 8, 56}, 0, next);
  return mdf.channel("t", {2, 0, 0, 0, 64, 0, mdf.linear(0.0, 1e-6)}, whole);
}

std::string record(std::uint64_t time_us, std::uint64_t id, unsigned flags,
                   std::string_view payload, std::size_t room) {
  return Bytes()
      .u64(time_us)
      .u32(id)
      .u8(flags)
      .u8(2)
      .u8(payload.size())
      .text(payload)
      .zeros(room - payload.size())
      .str();
}

std::string record_elsewhere(std::uint64_t time_us, std::uint64_t id, unsigned flags,
                             unsigned length, std::uint64_t offset) {
  return Bytes().u64(time_us).u32(id).u8(flags).u8(2).u8(length).u64(offset).str();
}

std::string variable(std::string_view bytes) { return Bytes().u32(bytes.size()).text(bytes).str(); }

std::string packed(std::string_view kind, const std::string& content, unsigned columns) {
  std::string turned = content;
  if (columns > 0) {
    const std::size_t rows = content.size() / columns;
    for (std::size_t row = 0; row < rows; ++row) {
      for (std::size_t column = 0; column < columns; ++column) {
        turned[column * rows + row] = content[row * columns + column];
      }
    }
  }
  uLongf size = compressBound(turned.size());
  std::string data(size, '\0');
  EXPECT_EQ(compress(reinterpret_cast<Bytef*>(data.data()), &size,
                     reinterpret_cast<const Bytef*>(turned.data()), turned.size()),
            Z_OK);
  data.resize(size);
  return Bytes()
      .text(kind)
      .u8(columns > 0 ? 1 : 0)
      .u8(0)
      .u32(columns)
      .u64(content.size())
      .u64(data.size())
      .text(data)
      .str();
}

std::uint64_t list(Mdf& mdf, const std::vector<std::uint64_t>& blocks, std::uint64_t next = 0) {
  std::vector<std::uint64_t> links{next};
  links.insert(links.end(), blocks.begin(), blocks.end());
  return mdf.block("DL", links,
                   Bytes().u8(0).zeros(3).u32(blocks.size()).zeros(8 * blocks.size()).str());
}

const std::vector<std::string> kThree{"1700000000.000001000 2 123#616263",
                                      "1700000000.000002000 2 18FFEE00##13132333435363738 T",
                                      "1700000000.250000000 2 7FF#"};
std::string three_records() {
  return record(1, 0x123, 0, "abc", 8) + record(2, 0x18FFEE00, 0x17, "12345678", 8) +
         record(250'000, 0x7FF, 0, "", 8);
}

void expect_frames(const std::string& content, const std::vector<std::string>& frames) {
  const LogFile file(content);
  const ReadLog log = read_log(file.path());
  EXPECT_EQ(log.frames, frames);
  EXPECT_EQ(log.stats.lines_bad, 0U)
      << (log.stats.first_bad.empty() ? "" : log.stats.first_bad[0].reason);
  EXPECT_EQ(without_direction(log.frames), by_python(file.path()));
}

TEST(Mf4, DataInOneBlockInListsAndPacked) {
  const std::string all = three_records();
  const std::string front = all.substr(0, 30);
  const std::string back = all.substr(30);
  const std::vector<std::function<std::uint64_t(Mdf&)>> ways{
      [&](Mdf& mdf) { return mdf.block("DT", {}, all); },
      [&](Mdf& mdf) { return mdf.block("DZ", {}, packed("DT", all, 0)); },
      [&](Mdf& mdf) { return mdf.block("DZ", {}, packed("DT", all + "", 23)); },
      [&](Mdf& mdf) { return mdf.block("DZ", {}, packed("DT", all, 10)); },  // with a rest
      [&](Mdf& mdf) {
        const auto first = mdf.block("DT", {}, front);
        return list(mdf, {first, mdf.block("DT", {}, back)});
      },
      [&](Mdf& mdf) {
        const auto second = list(mdf, {mdf.block("DZ", {}, packed("DT", back, 7))});
        const auto first = list(mdf, {mdf.block("DZ", {}, packed("DT", front, 0))}, second);
        return mdf.block("HL", {first}, Bytes().u64(0).str());
      }};
  for (std::size_t i = 0; i < ways.size(); ++i) {
    SCOPED_TRACE(i);
    Mdf mdf;
    const auto channels = frame_channels(mdf, 8);
    const auto data = ways[i](mdf);
    expect_frames(mdf.file(mdf.data_group(mdf.group(channels, 0, 3, kHead + 8), data, 0)), kThree);
  }
}

// Packed content that is longer than every buffer, and hardly longer packed than its end.
TEST(Mf4, LargePackedBlocksLoseNothing) {
  for (const unsigned columns : {0U, kHead + 8}) {
    for (const std::size_t count : {2849U, 2850U, 100'000U}) {
      SCOPED_TRACE(std::to_string(columns) + ' ' + std::to_string(count));
      std::string records;
      for (std::size_t i = 0; i < count; ++i) records += record(7, 0x123, 0, "abc", 8);
      Mdf mdf;
      const auto channels = frame_channels(mdf, 8);
      std::vector<std::uint64_t> blocks;
      for (int i = 0; i < 5; ++i)
        blocks.push_back(mdf.block("DZ", {}, packed("DT", records, columns)));
      const auto data = list(mdf, blocks);
      const LogFile file(mdf.file(mdf.data_group(mdf.group(channels, 0, 0, kHead + 8), data, 0)));
      const ReadLog log = read_log(file.path());
      EXPECT_EQ(log.frames.size(), 5 * count);
      EXPECT_EQ(log.stats.lines_bad, 0U)
          << (log.stats.first_bad.empty() ? "" : log.stats.first_bad[0].reason);
    }
  }
}

TEST(Mf4, SortedGroupsAreMergedByTime) {
  Mdf mdf;
  const auto one = mdf.group(frame_channels(mdf, 8), 0, 2, kHead + 8);
  const auto data_one = mdf.block("DT", {}, record(1, 1, 0, "a", 8) + record(30, 3, 0, "c", 8));
  const auto two = mdf.group(frame_channels(mdf, 64), 0, 2, kHead + 64);
  const auto data_two =
      mdf.block("DT", {}, record(2, 2, 0, "b", 64) + record(40, 4, 2, std::string(64, 'd'), 64));
  const auto second = mdf.data_group(two, data_two, 0);
  std::string long_frame = "1700000000.000040000 2 004##0";
  for (int i = 0; i < 64; ++i) long_frame += "64";
  expect_frames(mdf.file(mdf.data_group(one, data_one, 0, second)),
                {"1700000000.000001000 2 001#61", "1700000000.000002000 2 002#62",
                 "1700000000.000030000 2 003#63", long_frame});
}

TEST(Mf4, PayloadsOfVariableLength) {
  const std::string values = variable("abc") + variable("12345678");
  const std::string records = record_elsewhere(1, 0x123, 0, 3, 0) +
                              record_elsewhere(2, 0x18FFEE00, 0x17, 8, 7) +
                              record_elsewhere(250'000, 0x7FF, 0, 0, 19);
  for (const bool pack : {false, true}) {
    SCOPED_TRACE(pack);
    Mdf mdf;
    const auto payloads =
        pack ? mdf.block("DZ", {}, packed("SD", values, 0)) : mdf.block("SD", {}, values);
    const auto channels = frame_channels(mdf, 8, payloads);
    const auto data = mdf.block("DT", {}, records);
    // The third has no bytes: the Python reader looks for them all the same.
    const LogFile file(mdf.file(mdf.data_group(mdf.group(channels, 0, 3, kHead + 8), data, 0)));
    const ReadLog log = read_log(file.path());
    EXPECT_EQ(log.frames, kThree);
    EXPECT_EQ(log.stats.lines_bad, 0U);
  }
}

// As loggers write it while they run: records of all groups in one stream, payloads behind theirs,
// no length, no counts.
std::string unsorted(bool finished, bool payload_first, const std::string& tail = "") {
  Mdf mdf(finished);
  const auto payloads = mdf.group(0, 2, 0, 0, 1);
  const auto channels = frame_channels(mdf, 8, payloads);
  auto next = mdf.channel("CAN_ErrorFrame.BusChannel", {0, 0, 0, 8, 8});
  next = mdf.channel("t", {2, 4, 0, 0, 64, 0, mdf.linear(0.0, 1e-9)}, next);
  const auto errors = mdf.group(next, 3, 0, 9, 0, payloads);
  next = mdf.channel("CAN_RemoteFrame.DLC", {0, 0, 0, 12, 4});
  next = mdf.channel("CAN_RemoteFrame.ID", {0, 0, 0, 8, 32}, next);
  next = mdf.channel("t", {2, 1, 0, 0, 64, 0, mdf.linear(0.0, 1e-3)}, next);
  const auto remote = mdf.group(next, 4, 0, 13, 0, errors);
  const auto foreign = mdf.group(mdf.channel("LIN_Frame.ID", {0, 0, 0, 0, 8}), 5, 0, 3, 0, remote);
  const auto frames = mdf.group(channels, 1, 0, kHead + 8, 0, foreign);
  const auto pair = [&](const std::string& record, const std::string& value) {
    const std::string one = "\1" + record;
    const std::string two = "\2" + variable(value);
    return payload_first ? two + one : one + two;
  };
  const std::string records = pair(record_elsewhere(1, 0x123, 0, 3, 0), "abc") + "\5xyz" +
                              pair(record_elsewhere(2, 0x321, 2, 5, 7), "12345") + "\3" +
                              Bytes().u64(std::bit_cast<std::uint64_t>(3000.0)).u8(7).str() + "\4" +
                              Bytes(true).u64(4).str() + Bytes().u32(0x80000001).u8(8).str() + tail;
  const auto group = mdf.data_group(frames, mdf.size() + (8 - mdf.size() % 8) % 8 + 64, 1);
  mdf.block("DT", {}, records, finished ? 0 : 24);
  return mdf.file(group);
}

const std::vector<std::string> kUnsorted{
    "1700000000.000001000 2 123#616263", "1700000000.000002000 2 321##03132333435",
    "1700000000.000003000 7 20000080#0000000000000000", "1700000000.004000000 1 00000001#R8"};

TEST(Mf4, UnsortedFinishedOrNot) {
  for (const bool finished : {false, true}) {
    for (const bool payload_first : {false, true}) {
      SCOPED_TRACE(std::to_string(finished) + std::to_string(payload_first));
      const LogFile file(unsorted(finished, payload_first));
      const ReadLog log = read_log(file.path());
      EXPECT_EQ(log.frames, kUnsorted);
      EXPECT_EQ(log.stats.lines_bad, 0U)
          << (log.stats.first_bad.empty() ? "" : log.stats.first_bad[0].reason);
    }
  }
}

TEST(Mf4, PackedOrPipedFilesAreReadToo) {
  const std::string content = unsorted(false, false);
  const LogFile plain(content);
  const LogFile file("");
  gzFile gz = gzopen(file.path().c_str(), "wb");
  ASSERT_NE(gz, nullptr);
  EXPECT_EQ(gzwrite(gz, content.data(), static_cast<unsigned>(content.size())),
            static_cast<int>(content.size()));
  gzclose(gz);
  const ReadLog log = read_log(file.path());
  EXPECT_EQ(log.frames, kUnsorted);
  EXPECT_EQ(log.stats.lines_bad, 0U);
}

struct Trouble {
  std::string content;
  std::string reason;
  std::size_t frames;
};

std::string with_data(const std::function<std::uint64_t(Mdf&)>& data, unsigned size = kHead + 8) {
  Mdf mdf;
  const auto channels = frame_channels(mdf, 8);
  const auto at = data(mdf);
  return mdf.file(mdf.data_group(mdf.group(channels, 0, 3, size), at, 0));
}

TEST(Mf4, WhatIsWrongIsTold) {
  const std::string all = three_records();
  const std::string good = with_data([&](Mdf& mdf) { return mdf.block("DT", {}, all); });
  std::string old = good;
  old.replace(8, 4, "3.30").replace(28, 2, "\x4A\x01");
  const std::string table = [] {
    Mdf mdf;
    auto next = mdf.channel("speed", {0, 4, 0, 8, 64});
    next = mdf.channel("t", {2, 4, 0, 0, 64}, next);
    return mdf.file(mdf.data_group(mdf.group(next, 0, 0, 16), 0, 0));
  }();
  const std::string without_id = [] {
    Mdf mdf;
    auto next = mdf.channel("CAN_DataFrame.DLC", {0, 0, 0, 8, 8});
    next = mdf.channel("t", {2, 4, 0, 0, 64}, next);
    return mdf.file(mdf.data_group(mdf.group(next, 0, 0, 16), 0, 0));
  }();
  const std::string round_channels = [] {
    Mdf mdf;
    const auto next = mdf.channel("a", {});
    std::string file = mdf.file(mdf.data_group(mdf.group(next, 0, 0, 16), 0, 0));
    return file.replace(next + 24, 8, Bytes().u64(next).str());
  }();
  const std::string round_groups = [] {
    Mdf mdf;
    const auto group = mdf.data_group(0, 0, 0);
    return mdf.file(group).replace(group + 24, 8, Bytes().u64(group).str());
  }();
  const std::string round_list = with_data([&](Mdf& mdf) {
    const auto data = mdf.block("DT", {}, all);
    return list(mdf, std::vector<std::uint64_t>(200, data));
  });
  const std::vector<Trouble> troubles{
      {good.substr(0, 40), "the file's identification is cut off", 0},
      {good.substr(0, 64), "a link to byte 64, where no block is: the file has 64 bytes", 0},
      {old, "an MDF measurement of version 3.30, expected 4", 0},
      {table, "an MDF measurement without CAN frames, of 1 group of signals", 0},
      {without_id, "a group of CAN_DataFrame without ID", 0},
      {round_channels, "more channels in a group than 65536", 0},
      {round_groups, "more than 1000000 blocks of description: links that point back", 0},
      {round_list, "data that were read before: links that point back", 3},
      {unsorted(true, false).substr(0, unsorted(true, false).size() - 3),
       "the data are cut off by the end of the file", 3},
      {with_data([&](Mdf& mdf) { return mdf.block("DT", {}, all.substr(0, 50)); }),
       "a record is cut off by the end of the data", 2},
      {with_data([&](Mdf& mdf) { return mdf.block("XX", {}, all); }), "a block ##XX, expected data",
       0},
      {with_data([&](Mdf& mdf) {
         return mdf.block("DZ", {}, packed("DT", all, 0).replace(30, 2, "\xFF\xFF"));
       }),
       "damaged packed data", 0},
      {with_data([&](Mdf& mdf) {
         return mdf.block("DZ", {},
                          packed("DT", all, 0).replace(8, 8, Bytes().u64(~std::uint64_t{0}).str()));
       }),
       "a packed block gives less than it should", 3},
      {with_data([&](Mdf& mdf) {
         return mdf.block(
             "DZ", {}, packed("DT", all, 23).replace(8, 8, Bytes().u64(~std::uint64_t{0}).str()));
       }),
       "a transposed block of 18446744073709551615 bytes in rows of 23", 0},
      {with_data(
           [&](Mdf& mdf) { return mdf.block("DZ", {}, packed("DT", all, 0).replace(2, 1, "\7")); }),
       "a block packed by method 7", 0},
      {with_data([&](Mdf& mdf) { return mdf.block("DT", {}, all); }, 17),
       "CAN_DataFrame.DataBytes is not a row", 0},
      {with_data([&](Mdf& mdf) {
         return mdf.block("DT", {}, record(1, 1, 0, "123456789", 9) + "12345678901234");
       }),
       "data length above 64, or above 8 without CAN FD", 0},
      {with_data(
           [&](Mdf& mdf) { return mdf.block("DT", {}, record(~std::uint64_t{0}, 1, 0, "1", 8)); }),
       "time stamp beyond the range", 0},
      {unsorted(false, false, "\x09"), "a record of group 9, which the file does not describe", 4},
      {unsorted(false, false, "\1" + record_elsewhere(9, 1, 0, 3, 16)),
       "a frame whose data bytes are not in the file", 4},
      {unsorted(false, false, "\1" + record_elsewhere(9, 1, 0, 3, 16) + "\2" + variable("ab")),
       "fewer data bytes than the frame's length says", 4},
      {unsorted(false, false, "\1half"), "a record is cut off by the end of the data", 4}};
  for (const Trouble& trouble : troubles) {
    SCOPED_TRACE(trouble.reason);
    const LogFile file(trouble.content);
    const ReadLog log = read_log(file.path());
    EXPECT_EQ(log.frames.size(), trouble.frames);
    ASSERT_GE(log.stats.lines_bad, 1U);
    EXPECT_TRUE(log.stats.first_bad[0].reason.starts_with(trouble.reason))
        << log.stats.first_bad[0].reason;
    EXPECT_LE(log.stats.first_bad[0].byte, trouble.content.size());
  }
}

}  // namespace
}  // namespace beltgrip::test
