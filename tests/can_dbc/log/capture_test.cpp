// Captures of network programs (.pcapng, .pcap): files put together by hand after the formats'
// descriptions, and what tshark, text2pcap and editcap make of the same frames.
#include <gtest/gtest.h>

#include <array>
#include <filesystem>
#include <sstream>

#include "tests/can_dbc/log/log_file.h"
#include "tests/support/process.h"

namespace beltgrip::test {
namespace {

using std::chrono_literals::operator""s;
constexpr auto kLimit = 60s;

std::string block(bool big, std::uint32_t type, const Bytes& body) {
  const std::string padded = Bytes(big).text(body.str()).align(4).str();
  const std::uint64_t size = padded.size() + 12;
  return Bytes(big).u32(type).u32(size).text(padded).u32(size).str();
}

std::string section(bool big) {
  return block(big, 0x0A0D0D0A, Bytes(big).u32(0x1A2B3C4D).u16(1).u16(0).u64(~std::uint64_t{0}));
}

std::string option(bool big, unsigned code, std::string_view value) {
  return Bytes(big).u16(code).u16(value.size()).text(value).align(4).str();
}

std::string interface(bool big, unsigned link_type, const std::string& options = {}) {
  return block(big, 1,
               Bytes(big).u16(link_type).u16(0).u32(0).text(
                   options.empty() ? "" : options + option(big, 0, "")));
}

std::string packet(bool big, unsigned interface_number, std::uint64_t time,
                   const std::string& bytes) {
  return block(big, 6,
               Bytes(big)
                   .u32(interface_number)
                   .u32(time >> 32U)
                   .u32(time & 0xFFFFFFFFU)
                   .u32(bytes.size())
                   .u32(bytes.size())
                   .text(bytes));
}

std::string frame(std::uint64_t id, std::string_view data, unsigned flags = 0,
                  std::size_t size = 16, bool big = true, int length = -1) {
  const std::string text = Bytes(big)
                               .u32(id)
                               .u8(length < 0 ? data.size() : static_cast<std::size_t>(length))
                               .u8(flags)
                               .u16(0)
                               .text(data)
                               .str();
  return text + std::string(size - text.size(), '\0');
}

std::string cooked(unsigned protocol, const std::string& bytes, unsigned kind = 0) {
  return Bytes(true).u16(kind).u16(280).u16(0).zeros(8).u16(protocol).text(bytes).str();
}

std::string cooked2(unsigned protocol, const std::string& bytes, unsigned index,
                    unsigned kind = 0) {
  return Bytes(true)
      .u16(protocol)
      .u16(0)
      .u32(index)
      .u16(280)
      .u8(kind)
      .u8(0)
      .zeros(8)
      .text(bytes)
      .str();
}

constexpr std::uint64_t kTime_ns = 1'700'000'000'123'456'789;
constexpr std::uint64_t kTime_us = kTime_ns / 1000;

std::string counting(std::size_t count) {
  std::string bytes;
  while (bytes.size() < count) bytes += static_cast<char>(bytes.size());
  return bytes;
}

// One section with every kind of interface and of frame.
std::string every_kind(bool big) {
  std::string offset = Bytes(big).u64(1'600'000'000).str();
  std::string file = section(big);
  file += interface(big, 227, option(big, 2, "can0") + option(big, 9, "\x09"));
  file += interface(big, 227, option(big, 9, "\x94") + option(big, 14, offset));
  file += interface(big, 113) + interface(big, 276) + interface(big, 1);
  file += block(big, 5, Bytes(big).u32(0).u64(kTime_us));  // statistics
  file += packet(big, 0, kTime_ns, frame(0x123, counting(8)));
  file += packet(big, 0, kTime_ns + 1, frame(0x80000000 | 0x18FFEE00, "abc"));
  file +=
      packet(big, 1, (std::uint64_t{100} << 20U) + 0x80001, frame(0x40000123, "", 0, 16, true, 4));
  file += packet(big, 0, kTime_ns + 2, frame(0x20000080, std::string(8, '\0')));
  file += packet(big, 0, kTime_ns + 3, frame(0x321, counting(64), 5, 72));
  file += packet(big, 2, kTime_us, cooked(12, frame(0x123, "abc", 0, 16, big)));
  file += packet(big, 2, kTime_us, cooked(13, frame(0x123, counting(16), 6, 72, big), 4));
  file += packet(big, 2, kTime_us, cooked(0x0800, std::string(40, 'x')));
  file += packet(big, 3, kTime_us, cooked2(12, frame(0x80012345, "abc", 0, 16, big), 7, 4));
  file += packet(big, 3, kTime_us, cooked2(13, frame(0x123, counting(16), 5, 72, big), 8));
  file += packet(big, 4, kTime_us, std::string(60, 'x'));
  return file;
}

const std::vector<std::string> kEveryKind{
    "1700000000.123456789 can0 123#0001020304050607",
    "1700000000.123456790 can0 18FFEE00#616263",
    "1600000100.500000953 1 123#R4",
    "1700000000.123456791 can0 20000080#0000000000000000",
    "1700000000.123456792 can0 321##1"
    "000102030405060708090A0B0C0D0E0F101112131415161718191A1B1C1D1E1F"
    "202122232425262728292A2B2C2D2E2F303132333435363738393A3B3C3D3E3F",
    "1700000000.123456000 2 123#616263",
    "1700000000.123456000 2 123##2000102030405060708090A0B0C0D0E0F T",
    "1700000000.123456000 7 00012345#616263 T",
    "1700000000.123456000 8 123##1000102030405060708090A0B0C0D0E0F"};

std::vector<std::string> cells(const std::string& line) {
  std::vector<std::string> cells;
  std::istringstream text(line);
  for (std::string cell; std::getline(text, cell, '\t');) cells.push_back(cell);
  constexpr std::size_t kCells = 10;
  cells.resize(kCells);
  return cells;
}

// As tshark sees the frames: time, identifier with its flags, data.
std::vector<std::string> by_tshark(const std::string& path) {
  std::vector<std::string> command{"tshark", "-r", path, "-Y", "can or canfd", "-T", "fields"};
  for (const char* field :
       {"frame.time_epoch", "can.id", "can.flags.xtd", "can.flags.rtr", "can.flags.err", "can.len",
        "canfd.flags.brs", "canfd.flags.esi", "data.data", "can.err.buserror"}) {
    command.insert(command.end(), {"-e", field});
  }
  const RunResult result = run(command, kLimit);
  EXPECT_EQ(result.status, 0) << result.err;
  std::vector<std::string> frames;
  std::istringstream lines(result.out);
  for (std::string line; std::getline(lines, line);) {
    const auto cell = cells(line);
    std::string data = cell[8];
    for (char& c : data) c = static_cast<char>(std::toupper(static_cast<unsigned char>(c)));
    char id[16];
    const bool fd = !cell[6].empty();
    if (cell[4] == "1") {  // error frames: the class, not the data, which tshark takes apart
      frames.push_back(cell[0] + " error " + (cell[9] == "1" ? "80" : "?"));
      continue;
    }
    std::snprintf(id, sizeof id, cell[2] == "1" ? "%08lX" : "%03lX", std::stoul(cell[1]));
    std::string text = cell[0] + ' ' + id;
    if (cell[3] == "1") {
      text += "#R" + (cell[5] == "0" ? "" : cell[5]);
    } else if (fd) {
      text += "##" + std::to_string(std::stoi(cell[6]) + 2 * std::stoi(cell[7])) + data;
    } else {
      text += '#' + data;
    }
    frames.push_back(text);
  }
  return frames;
}

// The same words from our reader.
std::vector<std::string> in_those_words(const ReadLog& log) {
  std::vector<std::string> frames;
  for (const std::string& line : log.frames) {
    std::istringstream words(line);
    std::string stamp, name, text;
    words >> stamp >> name >> text;
    frames.push_back(text.starts_with("2000008") ? stamp + " error 80" : stamp + ' ' + text);
  }
  return frames;
}

TEST(Capture, EveryKindOfFrameInBothByteOrders) {
  for (const bool big : {false, true}) {
    SCOPED_TRACE(big);
    const LogFile file(every_kind(big));
    const ReadLog log = read_log(file.path());
    EXPECT_EQ(log.frames, kEveryKind);
    EXPECT_EQ(log.stats.lines_bad, 0U);
    EXPECT_EQ(by_tshark(file.path()), in_those_words(log));
  }
}

TEST(Capture, SectionsOfDifferentOrderFollowEachOther) {
  const LogFile file(every_kind(true) + every_kind(false));
  const ReadLog log = read_log(file.path());
  EXPECT_EQ(log.frames.size(), 2 * kEveryKind.size());
  EXPECT_EQ(log.stats.lines_bad, 0U);
  EXPECT_EQ(by_tshark(file.path()), in_those_words(log));
}

// Files that another program wrote, from frames in text.
TEST(Capture, FilesOfOtherMake) {
  const LogFile dump(
      "0000 00 00 01 23 08 00 00 00 11 22 33 44 55 66 77 88\n"
      "0000 98 ff ee 00 03 00 00 00 aa bb cc 00 00 00 00 00\n"
      "0000 40 00 07 ff 00 00 00 00 00 00 00 00 00 00 00 00\n");
  const LogFile made("");
  ASSERT_EQ(run({"text2pcap", "-q", "-F", "pcapng", "-l", "227", dump.path(), made.path()}, kLimit)
                .status,
            0);
  for (const std::string kind : {"pcapng", "pcap", "nsecpcap"}) {
    SCOPED_TRACE(kind);
    const LogFile file("");
    ASSERT_EQ(run({"editcap", "-F", kind, made.path(), file.path()}, kLimit).status, 0);
    const ReadLog log = read_log(file.path());
    ASSERT_EQ(log.frames.size(), 3U);
    EXPECT_EQ(log.stats.lines_bad, 0U);
    const std::string named = kind == "pcapng" ? " Fake_IF__text2pcap " : " 0 ";
    EXPECT_NE(log.frames[0].find(named + "123#1122334455667788"), std::string::npos)
        << log.frames[0];
    EXPECT_NE(log.frames[1].find(named + "18FFEE00#AABBCC"), std::string::npos) << log.frames[1];
    EXPECT_NE(log.frames[2].find(named + "7FF#R"), std::string::npos) << log.frames[2];
    EXPECT_EQ(by_tshark(file.path()), in_those_words(log));
  }
}

std::string old_header(bool big, std::uint64_t magic, unsigned link_type) {
  return Bytes(big).u32(magic).u16(2).u16(4).u32(0).u32(0).u32(65535).u32(link_type).str();
}

std::string old_packet(bool big, unsigned part, const std::string& bytes) {
  return Bytes(big).u32(1700000000).u32(part).u32(bytes.size()).u32(bytes.size()).text(bytes).str();
}

TEST(Capture, OldFormatInBothOrdersAndUnitsOfTime) {
  for (const bool big : {false, true}) {
    for (const bool nano : {false, true}) {
      SCOPED_TRACE(std::to_string(big) + std::to_string(nano));
      const LogFile file(
          old_header(big, nano ? 0xA1B23C4D : 0xA1B2C3D4, 113) +
          old_packet(big, 123456, cooked(12, frame(0x123, "abc", 0, 16, big))) +
          old_packet(big, 123457, cooked(0x0800, std::string(500, 'x'))) +
          old_packet(big, 123458, cooked(13, frame(0x321, counting(64), 4, 72, big))));
      const ReadLog log = read_log(file.path());
      ASSERT_EQ(log.frames.size(), 2U);
      EXPECT_EQ(log.frames[0],
                nano ? "1700000000.000123456 0 123#616263" : "1700000000.123456000 0 123#616263");
      EXPECT_EQ(log.stats.lines_bad, 0U);
      EXPECT_EQ(by_tshark(file.path()), in_those_words(log));
    }
  }
}

struct Trouble {
  std::string content;
  std::string place, reason;  // of the first bad record
  std::size_t frames;         // that are read all the same
};

TEST(Capture, WhatIsWrongIsToldWithItsPlace) {
  const std::string start = section(false) + interface(false, 227);
  const std::string good = packet(false, 0, kTime_us, frame(0x123, "abc"));
  const std::string at = "byte " + std::to_string(start.size() + good.size());
  const auto damaged = [&](std::size_t place, unsigned value) {
    std::string text = start + good + good + good;
    text[start.size() + good.size() + place] = static_cast<char>(value);
    return text;
  };
  const std::vector<Trouble> troubles{
      {(start + good + good).substr(0, start.size() + 2 * good.size() - 3), at,
       "a block of 48 bytes is cut off by the end of the file", 1},
      {start + good + good.substr(0, 7), at, "a block's header is cut off by the end of the file",
       1},
      {damaged(4, 49), at, "a block of 49 bytes, expected a multiple of 4 from 12 on", 1},
      {damaged(4, 8), at, "a block of 8 bytes, expected a multiple of 4 from 12 on", 1},
      {damaged(7, 0xFF), at, "a block of 4278190128 bytes is cut off by the end of the file", 1},
      {damaged(44, 47), at, "a block of 48 bytes that ends with the length 47", 1},
      {damaged(8, 3), at, "a packet of interface 3, of 1 that the section names", 2},
      {damaged(20, 200), at, "a packet of 200 bytes in a block that has 16", 2},
      {damaged(32, 65), at, "data length above 64, or above 8 without CAN FD", 2},
      {damaged(30, 0xFF), at, "identifier above 0x7FF without the mark of an extended one", 2},
      {start + good + block(false, 3, Bytes().u32(16).text(frame(0x123, ""))) + good, at,
       "a packet without a time stamp (simple packet block)", 2},
      {section(false).replace(12, 1, "\x02"), "byte 0", "a section of another version", 0},
      {section(false).replace(8, 1, "\x02"), "byte 0", "a section without its mark", 0},
      {old_header(false, 0xA1B2C3D4, 1), "byte 0", "a capture of link type 1, expected", 0},
      {old_header(false, 0xA1B2C3D4, 227).substr(0, 20), "byte 0", "the file's header is cut", 0},
      {old_header(false, 0xA1B2C3D4, 227) +
           Bytes().u32(1).u32(1).u32(0xFFFFFFF0).u32(16).zeros(40).str(),
       "byte 24", "a packet of 4294967280 bytes, expected at most 262144", 0}};
  for (const Trouble& trouble : troubles) {
    SCOPED_TRACE(trouble.reason);
    const LogFile file(trouble.content);
    const ReadLog log = read_log(file.path());
    EXPECT_EQ(log.frames.size(), trouble.frames);
    ASSERT_EQ(log.stats.lines_bad, 1U);
    EXPECT_EQ(log.stats.first_bad[0].place(), trouble.place);
    EXPECT_TRUE(log.stats.first_bad[0].reason.starts_with(trouble.reason))
        << log.stats.first_bad[0].reason;
  }
}

TEST(Capture, FrameCutByTheCapturesLimit) {
  const LogFile file(section(false) + interface(false, 227) +
                     packet(false, 0, kTime_us, frame(0x123, counting(8)).substr(0, 12)));
  const ReadLog log = read_log(file.path());
  EXPECT_TRUE(log.frames.empty());
  ASSERT_EQ(log.stats.lines_bad, 1U);
  EXPECT_EQ(log.stats.first_bad[0].reason,
            "the capture holds fewer data bytes than the frame's length says");
}

TEST(Capture, TimeBeyondTheRange) {
  for (const std::string& unit : {std::string("\x00", 1), std::string("\x80", 1)}) {
    const LogFile file(section(false) + interface(false, 227, option(false, 9, unit)) +
                       packet(false, 0, std::uint64_t{1} << 62U, frame(0x123, "")));
    const ReadLog log = read_log(file.path());
    EXPECT_TRUE(log.frames.empty());
    ASSERT_EQ(log.stats.lines_bad, 1U);
    EXPECT_EQ(log.stats.first_bad[0].reason, "time stamp beyond the range");
  }
}

}  // namespace
}  // namespace beltgrip::test
