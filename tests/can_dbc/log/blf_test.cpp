// Vector's .blf: what python-can writes, and files put together by hand that python-can reads.
#include <gtest/gtest.h>
#include <zlib.h>

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <sstream>

#include "tests/can_dbc/log/log_file.h"
#include "tests/support/process.h"

namespace beltgrip::test {
namespace {

using std::chrono_literals::operator""s;
constexpr auto kLimit = 60s;

std::vector<std::string> by_python(const std::string& verb, const std::string& path) {
  const RunResult result =
      run({"env", "TZ=UTC", "/usr/bin/python3", BELTGRIP_PYTHON_CAN, verb, path}, kLimit);
  EXPECT_EQ(result.status, 0) << result.err;
  std::vector<std::string> frames;
  std::istringstream lines(result.out);
  for (std::string line; std::getline(lines, line);) frames.push_back(line);
  return frames;
}

// python-can's times are binary numbers of seconds: equal to a microsecond.
void expect_alike(const std::vector<std::string>& frames, const std::vector<std::string>& python) {
  ASSERT_EQ(frames.size(), python.size());
  for (std::size_t i = 0; i < frames.size(); ++i) {
    const std::size_t ours = frames[i].find(' ');
    const std::size_t theirs = python[i].find(' ');
    ASSERT_NEAR(std::stod(frames[i].substr(0, ours)), std::stod(python[i].substr(0, theirs)),
                1.1e-6);
    std::string text = frames[i].substr(ours);
    if (const std::size_t error = text.find("20000080#"); error != std::string::npos) {
      text = text.substr(0, error) + "error";
    }
    ASSERT_EQ(text, python[i].substr(theirs)) << i;
  }
}

std::string object(unsigned type, const std::string& body, std::uint64_t ticks = 0,
                   unsigned unit = 2, unsigned version = 1) {
  const std::size_t head = version == 1 ? 32 : 40;
  Bytes bytes;
  bytes.text("LOBJ")
      .u16(head)
      .u16(version)
      .u32(head + body.size())
      .u32(type)
      .u32(unit)
      .u32(0)
      .u64(ticks);
  if (version == 2) bytes.u64(0);
  return bytes.text(body).str();
}

std::string padded(const std::string& object) {
  return object + std::string(object.size() % 4, '\0');
}

std::string container(const std::string& content, bool packed) {
  std::string data = content;
  if (packed) {
    uLongf size = compressBound(content.size());
    data.resize(size);
    EXPECT_EQ(compress(reinterpret_cast<Bytef*>(data.data()), &size,
                       reinterpret_cast<const Bytef*>(content.data()), content.size()),
              Z_OK);
    data.resize(size);
  }
  const std::string object = Bytes()
                                 .text("LOBJ")
                                 .u16(16)
                                 .u16(1)
                                 .u32(32 + data.size())
                                 .u32(10)
                                 .u16(packed ? 2 : 0)
                                 .zeros(6)
                                 .u32(content.size())
                                 .u32(0)
                                 .text(data)
                                 .str();
  return padded(object);
}

// Started on 2023-11-14, a Tuesday, at 22:13:20.250.
std::string header() {
  return Bytes()
      .text("LOGG")
      .u32(144)
      .zeros(8)
      .u64(0)
      .u64(0)
      .u32(0)
      .u32(0)
      .u16(2023)
      .u16(11)
      .u16(2)
      .u16(14)
      .u16(22)
      .u16(13)
      .u16(20)
      .u16(250)
      .zeros(144 - 56)
      .str();
}

std::string classic(std::uint64_t id, std::string_view data, unsigned flags = 0,
                    unsigned channel = 1) {
  return Bytes()
      .u16(channel)
      .u8(flags)
      .u8(data.size())
      .u32(id)
      .text(data)
      .zeros(8 - data.size())
      .str();
}

std::string fd(std::uint64_t id, std::string_view data, unsigned code, unsigned flags) {
  return Bytes()
      .u16(2)
      .u8(0)
      .u8(code)
      .u32(id)
      .u32(0)
      .u8(0)
      .u8(flags)
      .u8(data.size())
      .zeros(5)
      .text(data)
      .zeros(64 - data.size())
      .str();
}

std::string fd64(std::uint64_t id, std::string_view data, unsigned code, std::uint64_t flags) {
  return Bytes()
      .u8(3)
      .u8(code)
      .u8(data.size())
      .u8(0)
      .u32(id)
      .u32(0)
      .u32(flags)
      .zeros(16)
      .u16(0)
      .u8(1)
      .u8(0)
      .u32(0)
      .text(data)
      .str();
}

std::string error_ext() { return Bytes().u16(1).u16(8).zeros(28).str(); }

// Every kind of object that is a frame, and one that is none, with both headers and both units.
std::string objects() {
  return padded(object(1, classic(0x123, "abc"), 1000)) +
         padded(object(86, classic(0x98FFEE00, "12345678", 1, 2) + std::string(8, '\0'), 25, 1)) +
         padded(object(1, classic(0x7FF, "", 0x80), 2'000'000'000, 2, 2)) +
         padded(object(65, "a text that is no frame", 3)) +
         padded(object(100, fd(0x321, "123456789abc", 9, 7), 2'000'000'001)) +
         padded(object(100, fd(0x322, "1234", 4, 0), 2'000'000'002)) +
         padded(object(101, fd64(0x80000321, "123456789abc", 9, 0x3000), 2'000'000'003)) +
         padded(object(101, fd64(0x321, "12345", 5, 0x1000), 2'000'000'004, 2, 2)) +
         padded(object(73, error_ext(), 2'000'000'005));
}

const std::vector<std::string> kFrames{
    "1700000000.250001000 1 123#616263",
    "1700000000.250250000 2 18FFEE00#3132333435363738 T",
    "1700000002.250000000 1 7FF#R",
    "1700000002.250000001 2 321##3313233343536373839616263",
    "1700000002.250000002 2 322#31323334",
    "1700000002.250000003 3 00000321##1313233343536373839616263 T",
    "1700000002.250000004 3 321##03132333435 T",
    "1700000002.250000005 1 20000080#0000000000000000"};

TEST(Blf, WhatPythonCanWrites) {
  const LogFile file("");
  const std::string path = file.path() + ".blf";
  const auto python = by_python("write", path);
  const ReadLog log = read_log(path);
  std::filesystem::remove(path);
  EXPECT_EQ(log.stats.lines_bad, 0U);
  EXPECT_EQ(log.frames.size(), 5000U);
  expect_alike(log.frames, python);
}

TEST(Blf, EveryKindOfFrameInContainersPackedOrNot) {
  for (const bool packed : {false, true}) {
    SCOPED_TRACE(packed);
    const LogFile file(header() + container(objects(), packed));
    const ReadLog log = read_log(file.path());
    EXPECT_EQ(log.frames, kFrames);
    EXPECT_EQ(log.stats.lines_bad, 0U);
    expect_alike(log.frames, by_python("read", file.path()));
  }
}

// What has been seen in files of tests by others: marks that exclude each other, identifiers that
// only an extended one can have.
TEST(Blf, MarksThatExcludeEachOther) {
  const LogFile file(header() + container(padded(object(101, fd64(0x15555555, "abc", 3, 0x1010))) +
                                              padded(object(101, fd64(0x321, "", 3, 0x10))),
                                          true));
  const ReadLog log = read_log(file.path());
  const std::vector<std::string> frames{"1700000000.250000000 3 15555555##0616263 T",
                                        "1700000000.250000000 3 321#R3 T"};
  EXPECT_EQ(log.frames, frames);
  EXPECT_EQ(log.stats.lines_bad, 0U);
}

TEST(Blf, ObjectsThatBeginInOneContainerAndEndInAnother) {
  const std::string all = objects();
  for (std::size_t size = 1; size < 100; size += 7) {
    SCOPED_TRACE(size);
    std::string content = header();
    for (std::size_t at = 0; at < all.size(); at += size) {
      content += container(all.substr(at, size), at % 2 == 0);
    }
    const LogFile file(content);
    const ReadLog log = read_log(file.path());
    EXPECT_EQ(log.frames, kFrames);
    EXPECT_EQ(log.stats.lines_bad, 0U);
  }
}

// Packed content that is longer than every buffer, and hardly longer packed than its end.
TEST(Blf, LargeContainersLoseNothing) {
  for (const std::size_t count : {1000U, 1365U, 1366U, 20'000U}) {
    SCOPED_TRACE(count);
    std::string content;
    for (std::size_t i = 0; i < count; ++i) content += object(1, classic(0x123, "abc"), 0);
    std::string file_text = header();
    for (int i = 0; i < 5; ++i) file_text += container(content, true);
    const LogFile file(file_text);
    const ReadLog log = read_log(file.path());
    EXPECT_EQ(log.frames.size(), 5 * count);
    EXPECT_EQ(log.stats.lines_bad, 0U);
  }
}

TEST(Blf, ObjectsWithoutAContainer) {
  const LogFile file(header() + objects() + container(objects(), true));
  const ReadLog log = read_log(file.path());
  EXPECT_EQ(log.frames.size(), 2 * kFrames.size());
  EXPECT_EQ(log.stats.lines_bad, 0U);
}

TEST(Blf, FilesOfTheField) {
  const char* folder = std::getenv("BELTGRIP_CORPUS");
  if (folder == nullptr) GTEST_SKIP() << "BELTGRIP_CORPUS is not set: no log was checked";
  std::size_t files = 0;
  for (const auto& entry :
       std::filesystem::directory_iterator(std::filesystem::path(folder) / "logs")) {
    if (entry.path().extension() != ".blf") continue;
    SCOPED_TRACE(entry.path().filename().string());
    const ReadLog log = read_log(entry.path().string());
    EXPECT_EQ(log.stats.lines_bad, 0U);
    EXPECT_EQ(log.frames.size(), by_python("read", entry.path().string()).size());
    ++files;
  }
  EXPECT_GT(files, 0U);
}

TEST(Blf, UnfinishedFile) {
  const std::string full = header() + container(objects(), true);
  const LogFile file(full + container(objects(), true).substr(0, 150));
  const ReadLog log = read_log(file.path());
  EXPECT_GT(log.frames.size(), kFrames.size());  // also those of the part that is there
  EXPECT_LT(log.frames.size(), 2 * kFrames.size());
  ASSERT_EQ(log.stats.lines_bad, 1U);
  EXPECT_EQ(log.stats.first_bad[0].place(), "byte " + std::to_string(full.size()));
  EXPECT_EQ(log.stats.first_bad[0].reason, "a container is cut off by the end of the file");
}

struct Trouble {
  std::string content;
  std::size_t place;
  std::string reason;
  std::size_t frames;
};

TEST(Blf, WhatIsWrongIsToldWithItsPlace) {
  const std::string good = container(padded(object(1, classic(0x123, "abc"))), true);
  const std::size_t at = header().size() + good.size();
  std::string damaged = container(objects(), true);
  damaged[40] = static_cast<char>(damaged[40] ^ 0x55);
  std::string other_packing = container("", false);
  other_packing[16] = 7;
  const auto with = [&](const std::string& object) {
    return header() + good + container(object, true) + good;
  };
  const std::vector<Trouble> troubles{
      {header().substr(0, 60), 0, "the file's header is cut off by the end of the file", 0},
      {std::string("LOGG\4\0\0\0", 8) + header(), 0, "a file header of 4 bytes, expected 144", 0},
      {header() + good + "something else than an object", at,
       "no object where one should begin, expected LOBJ: damaged, or not finished", 1},
      {header() + good + std::string(500, '\0') + good, at,
       "no object where one should begin, expected LOBJ: damaged, or not finished", 1},
      {header() + good + other_packing, at, "a container packed by method 7, expected 0", 1},
      {header() + good + damaged, at, "a container with damaged packed data", 1},
      {with(object(1, "too short")), at, "an object too short for its type", 2},
      {with(object(101, fd64(1, "abc", 3, 0x1000).substr(0, 42))), at,
       "fewer data bytes than the length says", 2},
      {with(object(101, fd64(1, std::string(65, 'x'), 15, 0x1000))), at, "data length above 64", 2},
      {with(object(1, classic(1, ""), std::uint64_t{1} << 63U)), at, "time stamp beyond the range",
       2},
      {with(std::string("LOBJ\x10\0\1\0\4\0\0\0\1\0\0\0", 16)), at,
       "an object of 4 bytes, expected at least 16", 2},
      {header() + good +
           container(Bytes().text("LOBJ").u16(32).u16(1).u32(0xFFFFFFFF).u32(1).zeros(500).str(),
                     true) +
           good,
       at, "an object is cut off by the end of the file", 1}};
  for (const Trouble& trouble : troubles) {
    SCOPED_TRACE(trouble.reason);
    const LogFile file(trouble.content);
    const ReadLog log = read_log(file.path());
    EXPECT_EQ(log.frames.size(), trouble.frames);
    ASSERT_GE(log.stats.lines_bad, 1U);
    EXPECT_EQ(log.stats.first_bad[0].place(), "byte " + std::to_string(trouble.place));
    EXPECT_TRUE(log.stats.first_bad[0].reason.starts_with(trouble.reason))
        << log.stats.first_bad[0].reason;
  }
}

}  // namespace
}  // namespace beltgrip::test
