#include "can_dbc/log/can_log.h"
#include "can_dbc/log/candump_writer.h"

#include <gtest/gtest.h>

#include <unistd.h>
#include <zlib.h>
#include <zstd.h>

#include <fstream>
#include <iterator>
#include <random>

#include "can_dbc/log/format.h"
#include "can_dbc/log/text.h"
#include "tests/can_dbc/log/both_ways.h"

namespace beltgrip::can {
namespace {

class TemporaryFile {
 public:
  explicit TemporaryFile(std::string_view content) {
    path_ = ::testing::TempDir() + "beltgrip_log_XXXXXX";
    const int descriptor = mkstemp(path_.data());
    EXPECT_GE(descriptor, 0);
    EXPECT_EQ(::write(descriptor, content.data(), content.size()),
              static_cast<ssize_t>(content.size()));
    ::close(descriptor);
  }
  ~TemporaryFile() { ::unlink(path_.c_str()); }
  TemporaryFile(const TemporaryFile&) = delete;
  TemporaryFile& operator=(const TemporaryFile&) = delete;
  const std::string& path() const { return path_; }

 private:
  std::string path_;
};

struct Frame {
  std::int64_t t_ns;
  std::string interface;
  CanFrame frame;
  std::string text() const { return interface + ' ' + frame_text(frame); }
};

struct Log {
  std::vector<Frame> frames;
  LogStats stats;
};

Log read(std::string_view content) {
  const TemporaryFile file(content);
  const auto reader = LogReader::open(file.path());
  Log log;
  LogRecord record;
  while (reader->next(record)) {
    log.frames.push_back({record.t_ns, std::string(record.interface), record.frame});
  }
  log.stats = reader->stats();
  EXPECT_EQ(log.stats.frames, log.frames.size());
  return log;
}

std::string rewritten(const Log& log) {
  char* text = nullptr;
  std::size_t size = 0;
  std::FILE* out = open_memstream(&text, &size);
  CandumpWriter writer(out);
  for (const Frame& frame : log.frames) writer.write(frame.t_ns, frame.interface, frame.frame);
  std::fclose(out);
  const std::string result(text, size);
  std::free(text);
  return result;
}

// --- candump, compact ----------------------------------------------------------------------------

TEST(CandumpLog, CompactFormatReadsAndWritesBackTheSameBytes) {
  const std::string log =
      "(1700000000.000000) vcan0 123#0011\n"
      "(1700000000.000100) can1 1FFFFFFF#DEADBEEF00112233\n"
      "(1700000000.000100) vcan0 00000123#\n"
      "(1700000000.123456789) vcan0 7FF#R8\n"
      "(1700000001.000000) vcan0 001#R\n"
      "(1700000001.500000) vcan0 00000123##10011\n"
      "(1700000001.600000) vcan0 123##3" +
      std::string(128, 'A') +
      "\n"
      "(1700000001.700000) vcan0 123##0\n"
      "(1700000002.000000) vcan0 20000004#0004000000000000\n";
  const Log read_log = read(log);
  EXPECT_EQ(rewritten(read_log), log);
  ASSERT_EQ(read_log.frames.size(), 9U);
  EXPECT_EQ(read_log.stats.lines_bad, 0U);
  EXPECT_EQ(read_log.frames[0].t_ns, 1'700'000'000'000'000'000);
  EXPECT_EQ(read_log.frames[1].frame.id, (CanId{0x1FFFFFFF, true}));
  EXPECT_EQ(read_log.frames[2].frame.id, (CanId{0x123, true}));
  EXPECT_EQ(read_log.frames[3].t_ns % 1'000'000'000, 123'456'789);
  EXPECT_TRUE(read_log.frames[3].frame.remote);
  EXPECT_EQ(read_log.frames[3].frame.length, 8);
  EXPECT_TRUE(read_log.frames[5].frame.fd);
  EXPECT_TRUE(read_log.frames[5].frame.bit_rate_switch);
  EXPECT_FALSE(read_log.frames[5].frame.error_state_indicator);
  EXPECT_EQ(read_log.frames[6].frame.length, 64);
  EXPECT_TRUE(read_log.frames[8].frame.error);
  EXPECT_EQ(read_log.frames[8].frame.id, (CanId{0x4, false}));
}

// The usual line is read in a shorter way, but not where the log may end within it.
TEST(CandumpLog, UsualLinesAreReadToTheLastDigit) {
  const std::string comment = "# " + std::string(100, '-') + "\n";
  const std::string log =
      "(1700000000.123456) vcan0 123#0011223344556677\n"
      "(0.000001) c 7fF#aB\n"
      "(9223372034.999999999) can1 1fFfFfFf#\n"
      "(12345678.100000) abcdefg 00000000#0123456789aBcDeF\n"
      "(123456789.000000) can0 000#010203040506\n";
  const Log read_log = read(log + comment);
  EXPECT_EQ(read_log.stats.lines, 6U);
  EXPECT_EQ(read_log.stats.lines_bad, 0U);
  ASSERT_EQ(read_log.frames.size(), 5U);
  const std::int64_t stamps_ns[] = {1'700'000'000'123'456'000, 1'000, 9'223'372'034'999'999'999,
                                    12'345'678'100'000'000, 123'456'789'000'000'000};
  const char* texts[] = {"vcan0 123#0011223344556677", "c 7FF#AB", "can1 1FFFFFFF#",
                         "abcdefg 00000000#0123456789ABCDEF", "can0 000#010203040506"};
  for (std::size_t i = 0; i < 5; ++i) {
    EXPECT_EQ(read_log.frames[i].t_ns, stamps_ns[i]);
    EXPECT_EQ(read_log.frames[i].text(), texts[i]);
    const CanFrame& frame = read_log.frames[i].frame;
    for (std::size_t k = frame.length; k < kMaxPayload; ++k) EXPECT_EQ(frame.data[k], 0);
  }
}

// A line that begins with a blank is not a usual one and says the same. One character of each usual
// line is another, one is missing, or one is there twice.
TEST(CandumpLog, WhatIsNearlyAUsualLineIsReadAlikeBothWays) {
  const std::string usual[] = {"(1700000000.123456) vcan0 123#0011223344556677",
                               "(0.000001) c 7FF#AB", "(1700000001.123456789) can1 1FFFFFFF#DEAD",
                               "(12345678.100000) abcdefg 00000123#0123456789ABCDEF",
                               "(123456789.000000) can0 000#"};
  const std::string characters = std::string("0189afAFgG(). #R@`:/_\t\r\x1B\x7F\xE9-") + '\0';
  std::string log, shifted;
  const auto add = [&](const std::string& line) {
    log += line + '\n';
    shifted += ' ' + line + '\n';
  };
  for (const std::string& line : usual) {
    for (std::size_t at = 0; at <= line.size(); ++at) {
      for (const char c : characters) add(line.substr(0, at) + c + line.substr(at));
      if (at == line.size()) break;
      for (const char c : characters) add(line.substr(0, at) + c + line.substr(at + 1));
      add(line.substr(0, at) + line.substr(at + 1));
    }
    for (int i = 0; i < 3000; ++i) add(line);  // that it is taken for a candump log
  }
  const Log quick = read(log);
  const Log slow = read(shifted);
  EXPECT_EQ(quick.stats.lines, slow.stats.lines);
  EXPECT_EQ(quick.stats.lines_bad, slow.stats.lines_bad);
  ASSERT_EQ(quick.frames.size(), slow.frames.size());
  EXPECT_GT(quick.frames.size(), 15'000U);
  for (std::size_t i = 0; i < quick.frames.size(); ++i) {
    ASSERT_EQ(quick.frames[i].t_ns, slow.frames[i].t_ns) << i;
    ASSERT_EQ(quick.frames[i].text(), slow.frames[i].text()) << i;
    ASSERT_EQ(quick.frames[i].frame, slow.frames[i].frame) << i;
  }
}

TEST(CandumpLog, TakesWhatLogsInTheFieldHave) {
  const Log log = read(
      "(000.000000) can0 123#00.11.22\r\n"  // CRLF, dots
      "\r\n"
      "(000.010000) can0 1a5#aabb R\r\n"  // lower case, direction
      "# a comment\n"
      "(000.005000) can1 123#11\n"                // time going back, another interface
      "   (0.02)   can0   123#11   \n"            // blanks, two digits
      "(0.030000) can0 123#1122334455667788_B\n"  // raw length code
      "(0.040000) can0 123#0011");                // no line break at the end
  EXPECT_EQ(log.stats.lines_bad, 0U);
  ASSERT_EQ(log.frames.size(), 6U);
  EXPECT_EQ(log.frames[0].text(), "can0 123#001122");
  EXPECT_EQ(log.frames[1].text(), "can0 1A5#AABB");
  EXPECT_EQ(log.frames[2].t_ns, 5'000'000);
  EXPECT_EQ(log.frames[3].t_ns, 20'000'000);
  EXPECT_EQ(log.frames[4].frame.length, 8);
}

TEST(CandumpLog, CountsBrokenLinesWithNumberAndReason) {
  const Log log = read(
      "(1.0) can0 123#00\n"
      "(1.1 can0 123#00\n"
      "(1.x) can0 123#00\n"
      "(1.2) can0 12G#00\n"
      "(1.3) can0 FFF#00\n"
      "(1.4) can0 123#000\n"
      "(1.5) can0 123#0011223344556677889\n"
      "(1.6) can0 123#001122334455667788\n"
      "(1.7) can0 123##\n"
      "(1.8) can0 123#XY\n"
      "(1.9) can0\n"
      "hello world\n"
      "can0 123#00\n"
      "(99999999999999.0) can0 123#00\n"
      "(2.0) can0 123#00\n");
  EXPECT_EQ(log.frames.size(), 2U);
  EXPECT_EQ(log.stats.lines, 15U);
  EXPECT_EQ(log.stats.lines_bad, 13U);
  ASSERT_EQ(log.stats.first_bad.size(), 10U);
  EXPECT_EQ(log.stats.first_bad[0].line, 2U);
  EXPECT_EQ(log.stats.first_bad[0].reason, "time stamp without \")\"");
  EXPECT_EQ(log.stats.first_bad[4].line, 6U);
  EXPECT_EQ(log.stats.first_bad[4].reason, "odd number of data digits");
}

// The grammar is that of can-utils, above parse_canframe() in its lib.h.
TEST(CandumpLog, WhatCandumpDoesNotWriteIsNoFrame) {
  const char* const wrong[] = {"12#11",
                               "1#11",
                               "12345#11",
                               "0012#11",
                               "0000123#11",
                               "123456789#11",
                               "#11",
                               "123#11_22_zz",
                               "123#11_",
                               "123#11_9",
                               "123#1122334455667788_8",
                               "123#1122334455667788_BB",
                               "123##11122334455667788_B",
                               "123#11 garbage here",
                               "123#11 X",
                               "123#11 R R",
                               "123#11 RT",
                               "123#R garbage",
                               "123#R9",
                               "123#R4_B",
                               "123#R44",
                               "123#Rx",
                               "123#R8_8",
                               "123#R_B"};
  std::string lines = "(1.0) can0 123#00\n";
  for (const char* frame : wrong) lines += "(1.0) can0 " + std::string(frame) + "\n";
  const Log log = read(lines);
  EXPECT_EQ(log.frames.size(), 1U);
  for (std::size_t i = 1; i < log.frames.size(); ++i) ADD_FAILURE() << log.frames[i].text();
  EXPECT_EQ(log.stats.lines_bad, std::size(wrong));
  EXPECT_EQ(log.stats.first_bad.at(0).reason,
            "unreadable identifier; expected 3 or 8 hexadecimal digits");
  const Log right = read(
      "(1.0) can0 123#R8_C\n"
      "(1.0) can0 12345678#R4 T\n"
      "(1.0) can0 123#r0 R\n"
      "(1.0) can0 123#11.22 T\n"
      "(1.0) can0 123##0.11.22\n"
      "(1.0) can0 123##011 R\n"
      "(1.0) can0 123# R\n"
      "(1.0) can0 123#11.22.33.44.55.66.77.88_f T\n");
  EXPECT_EQ(right.stats.lines_bad, 0U);
  ASSERT_EQ(right.frames.size(), 8U);
  EXPECT_EQ(right.frames[0].text(), "can0 123#R8");
  EXPECT_EQ(right.frames[1].text(), "can0 12345678#R4");
  EXPECT_EQ(right.frames[3].text(), "can0 123#1122");
  EXPECT_EQ(right.frames[4].text(), "can0 123##01122");
  EXPECT_EQ(right.frames[7].text(), "can0 123#1122334455667788");
}

// --- candump, console ----------------------------------------------------------------------------

TEST(CandumpLog, ConsoleFormatWithAbsoluteTimes) {
  const Log log = read(
      " (1700000000.000000)  vcan0  123   [2]  00 11\n"
      " (1700000000.100000)  vcan0  1FFFFFFF   [8]  01 02 03 04 05 06 07 08\n"
      " (1700000000.200000)  vcan0  123  [12]  00 01 02 03 04 05 06 07 08 09 0A 0B\n"
      " (1700000000.200001)  vcan0  123  [02]  00 01\n"
      " (1700000000.300000)  vcan0  456   [8]  remote request\n"
      " (1700000000.300000)  vcan0  456   [0]  remote request\n"
      " (1700000000.350000)  vcan0  TX B E  456  [01]  AA\n"
      " (1700000000.360000)  vcan0  RX - -  456   [1]  AA   '.'\n"
      " (1700000000.400000)  vcan0  20000004   [8]  00 04 00 00 00 00 00 00   ERRORFRAME\n"
      "\tcontroller-problem{rx-overflow}\n"
      "\terror-counter-tx-rx{{0}{0}}\n"
      " (1700000000.500000)  vcan0  124   [0]\n");
  EXPECT_EQ(log.stats.lines_bad, 0U);
  ASSERT_EQ(log.frames.size(), 10U);
  EXPECT_EQ(log.frames[0].text(), "vcan0 123#0011");
  EXPECT_EQ(log.frames[1].text(), "vcan0 1FFFFFFF#0102030405060708");
  EXPECT_EQ(log.frames[2].text(), "vcan0 123##0000102030405060708090A0B");
  EXPECT_EQ(log.frames[3].text(), "vcan0 123##00001");
  EXPECT_EQ(log.frames[4].text(), "vcan0 456#R8");
  EXPECT_EQ(log.frames[5].text(), "vcan0 456#R");
  EXPECT_EQ(log.frames[6].text(), "vcan0 456##3AA");
  EXPECT_EQ(log.frames[7].text(), "vcan0 456#AA");
  EXPECT_EQ(log.frames[8].text(), "vcan0 20000004#0004000000000000");
  EXPECT_EQ(log.frames[9].text(), "vcan0 124#");
}

TEST(CandumpLog, ConsoleFormatWithDates) {
  const Log log = read(
      " (2023-11-14 22:13:20.000001)  vcan0  123   [1]  00\n"
      " (2024-02-29 00:00:00.500000)  vcan0  123   [1]  00\n");
  ASSERT_EQ(log.frames.size(), 2U);
  EXPECT_EQ(log.frames[0].t_ns, 1'700'000'000'000'001'000);
  EXPECT_EQ(log.frames[1].t_ns, 1'709'164'800'500'000'000);
}

TEST(CandumpLog, ConsoleFormatWithZeroBasedTimesAndWithDifferences) {
  const Log zero = read(
      " (000.000000)  vcan0  123   [1]  00\n"
      " (000.010000)  vcan0  123   [1]  00\n"
      " (000.020500)  vcan0  123   [1]  00\n");
  ASSERT_EQ(zero.frames.size(), 3U);
  EXPECT_EQ(zero.frames[2].t_ns, 20'500'000);
  const Log delta = read(
      " (000.000000)  vcan0  123   [1]  00\n"
      " (000.010000)  vcan0  123   [1]  00\n"
      " (000.009900)  vcan0  123   [1]  00\n"
      " (000.010100)  vcan0  123   [1]  00\n");
  ASSERT_EQ(delta.frames.size(), 4U);
  EXPECT_EQ(delta.frames[3].t_ns, 30'000'000);
  // Zero-based, every second frame a little before the one above it.
  std::string swapped = " (000.000000)  vcan0  123   [1]  00\n";
  for (int i = 1; i < 200; ++i) {
    char line[64];
    std::snprintf(line, sizeof line, " (000.%06d)  vcan%d  123   [1]  00\n",
                  i * 1000 + (i % 2) * 1500, i % 2);
    swapped += line;
  }
  const Log out_of_order = read(swapped);
  ASSERT_EQ(out_of_order.frames.size(), 200U);
  EXPECT_EQ(out_of_order.frames[199].t_ns, 200'500'000);
}

TEST(CandumpLog, ConsoleFormatWithoutTimesHasNoFrame) {
  const Log log = read(
      "  vcan0  123   [2]  00 11\n"
      "  vcan0  123   [2]  00 11\n");
  EXPECT_TRUE(log.frames.empty());
  EXPECT_EQ(log.stats.lines_bad, 2U);
  EXPECT_EQ(log.stats.first_bad[0].reason, "no time stamp");
}

TEST(CandumpLog, ConsoleFormatWithRawLengthCodes) {
  const Log log = read(" (1.000000)  can0  123  {B}  11 22 33 44 55 66 77 88\n");
  ASSERT_EQ(log.frames.size(), 1U);
  EXPECT_EQ(log.frames[0].text(), "can0 123#1122334455667788");
}

TEST(CandumpLog, ConsoleColoursAreLookedThrough) {
  const Log log = read("\x1B[31m (1.000000)  vcan0  \x1B[0m123   [2]  00 11\x1B[0m\n");
  ASSERT_EQ(log.frames.size(), 1U);
  EXPECT_EQ(log.frames[0].text(), "vcan0 123#0011");
}

// --- .asc ----------------------------------------------------------------------------------------

TEST(AscLog, HexadecimalAbsolute) {
  const Log log = read(
      "date Sam Sep 30 15:06:13.191 2017\n"
      "base hex  timestamps absolute\n"
      "internal events logged\n"
      "// version 9.0.0\n"
      "Begin Triggerblock Sam Sep 30 15:06:13.191 2017\n"
      "   0.000000 Start of measurement\n"
      "   0.015991 CAN 1 Status:chip status error active\n"
      "   1.015991 1  Statistic: D 0 R 0 XD 0 XR 0 E 0 O 0 B 0.00%\n"
      "   2.501000 1 ErrorFrame\n"
      "   2.510001 2 100 Tx r\n"
      "   2.584921 4 300 Rx r 8 Length = 1704000 BitCount = 145 ID = 88888888x\n"
      "   3.098426 1  18EBFF00x       Rx d 8 01 A0 0F A6 60 3B D1 40    Length = 273910\n"
      "   3.297743 1  J1939TP FEE3p        6    0  0   -   Rx   d 23 A0 0F\n"
      "  17.876708 1  6F9             Rx   d 8 05 0C 00 00 00 00 00 00  Length = 240015\n"
      "End TriggerBlock\n");
  EXPECT_EQ(log.stats.lines_bad, 0U);
  ASSERT_EQ(log.frames.size(), 5U);
  EXPECT_TRUE(log.frames[0].frame.error);
  EXPECT_EQ(log.frames[1].text(), "2 100#R");
  EXPECT_EQ(log.frames[2].text(), "4 300#R8");
  EXPECT_EQ(log.frames[3].text(), "1 18EBFF00#01A00FA6603BD140");
  EXPECT_EQ(log.frames[4].t_ns, 17'876'708'000);
}

TEST(AscLog, DecimalRelativeAndNames) {
  const Log log = read(
      "date Mit Jul 5 10:00:00 vorm. 2023\n"
      "base dec  timestamps relative\n"
      "no internal events logged\n"
      "   0.000000 Start of measurement\n"
      "   0.500000 1  291             Rx   d 3 16 255 0\n"
      "   0.250000 CAN 1 Status:chip status error active\n"
      "   0.250000 2  EngineData      Rx   d 1 7  Length = 0 BitCount = 0 ID = 419327232x\n");
  EXPECT_EQ(log.stats.lines_bad, 0U);
  ASSERT_EQ(log.frames.size(), 2U);
  EXPECT_EQ(log.frames[0].text(), "1 123#10FF00");
  EXPECT_EQ(log.frames[0].t_ns, 500'000'000);
  EXPECT_EQ(log.frames[1].t_ns, 1'000'000'000);
  EXPECT_EQ(log.frames[1].text(), "2 18FE6D00#07");
}

TEST(AscLog, RelativeTimesThatAddUpBeyondTheRangeAreBadLines) {
  const Log log = read(
      "base dec  timestamps relative\n"
      "   5555555555 1  291             Rx   d 1 16\n"
      "   5555555555 1  291             Rx   d 1 17\n"
      "   0.5        1  291             Rx   d 1 18\n");
  EXPECT_EQ(log.stats.lines_bad, 1U);
  ASSERT_EQ(log.frames.size(), 2U);
  EXPECT_EQ(log.frames[1].text(), "1 123#12");
  EXPECT_EQ(log.frames[1].t_ns, 5'555'555'555'500'000'000);
}

TEST(AscLog, TheHeaderIsReadInAnyCase) {
  const Log log = read(
      "Base Dec  Timestamps Relative\n"
      "   0.5 1  291             Rx   d 1 16\n"
      "   0.5 1  291             Rx   d 1 17\n");
  ASSERT_EQ(log.frames.size(), 2U);
  EXPECT_EQ(log.frames[1].text(), "1 123#11");
  EXPECT_EQ(log.frames[1].t_ns, 1'000'000'000);
}

TEST(AscLog, CanFd) {
  const Log log = read(
      "base hex  timestamps absolute\n"
      "  30.005021 CANFD   1 Rx        300                                   1 0 8  8 11 c2 03 04 "
      "05 06 07 08   102203  133   303000 e0006659\n"
      "  30.005071 CANFD   3 Tx        30a  Generic_Name_12                  0 1 9 12 01 02 03 04 "
      "05 06 07 08 09 0a 0b 0c  102203  133   303000 e0006659\n"
      "  30.300981 CANFD   3 Tx     50005x                                0 0 5 0 140000 73 "
      "200050\n"
      "  30.806898 CANFD   5 Tx ErrorFrame Not Acknowledge error, dominant error flag fffe c7\n"
      "  31.000000 CANFD   4 Rx        4EE   1 0 2 2 01 02  102203  133 0 46500250\n"
      "  31.100000 CANFD   4 Rx        4EE   0 0 2 2 01 02  102203  133 200040 46500250\n");
  EXPECT_EQ(log.stats.lines_bad, 0U);
  ASSERT_EQ(log.frames.size(), 6U);
  EXPECT_EQ(log.frames[4].text(), "4 4EE##10102");
  EXPECT_EQ(log.frames[5].text(), "4 4EE#0102");
  EXPECT_EQ(log.frames[0].text(), "1 300##111C2030405060708");
  EXPECT_EQ(log.frames[1].text(), "3 30A##20102030405060708090A0B0C");
  EXPECT_EQ(log.frames[2].text(), "3 00050005#R5");
  EXPECT_TRUE(log.frames[3].frame.error);
}

// Found by fuzzing: flags that say remote behind data bytes.
TEST(AscLog, RemoteFrameOnACanFdChannelHasNoData) {
  const Log log = read(
      "base hex  timestamps absolute\n"
      "  31.1 CANFD   4 Rx        4EE   0 0 2 2 01 02  102203  133 10 46500250\n");
  ASSERT_EQ(log.frames.size(), 1U);
  CanFrame wanted;
  wanted.id.value = 0x4EE;
  wanted.remote = true;
  wanted.length = 2;
  EXPECT_EQ(log.frames[0].frame, wanted);
}

TEST(AscLog, ErrorFramesOnACanFdChannel) {
  const Log log = read(
      "base hex  timestamps absolute\n"
      "   0.100000 CANFD   1 Rx ErrorFrame Not Acknowledge error\n"
      "   0.200000 CANFD   2 ErrorFrame Rx   Not Acknowledge error\n");
  EXPECT_EQ(log.stats.lines_bad, 0U);
  ASSERT_EQ(log.frames.size(), 2U);
  EXPECT_TRUE(log.frames[0].frame.error);
  EXPECT_TRUE(log.frames[1].frame.error);
}

TEST(AscLog, BrokenLinesAreCounted) {
  const Log log = read(
      "base hex  timestamps absolute\n"
      "   1.000000 1  64              Rx   d 4 64 00\n"
      "   2.000000 1  64              Rx   q 4 64 00 00 00\n"
      "   3.000000 1  fff             Rx   d 1 64\n"
      "   x.000000 1  64              Rx   d 1 64\n"
      "   4.000000 1  64              Rx   d 1 64\n");
  EXPECT_EQ(log.frames.size(), 1U);
  EXPECT_EQ(log.stats.lines_bad, 4U);
}

// --- .trc ----------------------------------------------------------------------------------------

TEST(TrcLog, Versions1) {
  const Log v10 = read(
      ";##########\n"
      ";   Start time: 12.06.2003 14:02:04.321.0\n"
      "     1)      1841  0001  8  00 11 22 33 44 55 66 77\n"
      "     2)      1842  00000123  2  AA BB\n"
      "     3)      1843  0123  4  RTR\n"
      "     4)     17540  FFFFFFFF  4  00 00 00 08 -- -- -- -- BUSHEAVY\n");
  EXPECT_EQ(v10.stats.lines_bad, 0U);
  ASSERT_EQ(v10.frames.size(), 3U);
  EXPECT_EQ(v10.frames[0].t_ns, 1'841'000'000);
  EXPECT_EQ(v10.frames[0].text(), "1 001#0011223344556677");
  EXPECT_EQ(v10.frames[1].text(), "1 00000123#AABB");
  EXPECT_EQ(v10.frames[2].text(), "1 123#R4");
  const Log v11 = read(
      ";$FILEVERSION=1.1\n"
      "     1)      1059.9  Rx     0300  2  00 01\n"
      "     2)      1060.9  Warng  FFFFFFFF  4  00 00 00 08  BUSLIGHT\n"
      "     3)      1061.9  Error  0300  2  00 01\n"
      "     4)      1062.9  Tx     09F11201  1  FF\n");
  EXPECT_EQ(v11.stats.lines_bad, 0U);
  ASSERT_EQ(v11.frames.size(), 3U);
  EXPECT_EQ(v11.frames[0].t_ns, 1'059'900'000);
  EXPECT_TRUE(v11.frames[1].frame.error);
  EXPECT_EQ(v11.frames[2].text(), "1 09F11201#FF");
  const Log v12 = read(
      ";$FILEVERSION=1.2\n"
      "     1)      1059.900 2  Rx     0300  2  00 01\n");
  ASSERT_EQ(v12.frames.size(), 1U);
  EXPECT_EQ(v12.frames[0].text(), "2 300#0001");
  const Log v13 = read(
      ";$FILEVERSION=1.3\n"
      "     1)      1059.900 2  Rx     0300 -  2  00 01\n");
  ASSERT_EQ(v13.frames.size(), 1U);
  EXPECT_EQ(v13.frames[0].text(), "2 300#0001");
}

TEST(TrcLog, Versions2) {
  const Log v20 = read(
      ";$FILEVERSION=2.0\n"
      ";$COLUMNS=N,O,T,I,d,l,D\n"
      "      1      1059.900 DT     0300 Rx 2  00 01\n"
      "      2      1283.231 FB     0700 Rx 12 00 01 02 03 04 05 06 07 08 09 0A 0B\n"
      "      3      1298.945 BI     0701 Rx 1  00\n"
      "      4      1323.201 ER          Rx 5  04 00 02 00 00\n"
      "      4      1324.000 ST          Rx    00 00 00 08\n"
      "      5      1334.222 RR     0100 Rx 3\n");
  EXPECT_EQ(v20.stats.lines_bad, 0U);
  ASSERT_EQ(v20.frames.size(), 5U);
  EXPECT_EQ(v20.frames[0].text(), "1 300#0001");
  EXPECT_EQ(v20.frames[1].text(), "1 700##1000102030405060708090A0B");
  EXPECT_EQ(v20.frames[2].text(), "1 701##300");
  EXPECT_TRUE(v20.frames[3].frame.error);
  EXPECT_EQ(v20.frames[4].text(), "1 100#R3");
  const Log v21 = read(
      ";$FILEVERSION=2.1\n"
      ";$COLUMNS=N,O,T,B,I,d,R,L,D\n"
      "      1     17535.400 DT 1  00000100 Tx -  8    00 00 00 00 00 00 00 01\n"
      "      2     17540.300 ST 1         - Rx -  4    00 00 00 08\n"
      "      3     17600.000 FD 2      0100 Rx -  9    00 01 02 03 04 05 06 07 08 09 0A 0B\n"
      "     12     48937.600 RR 1      0704 Rx -  1\n");
  EXPECT_EQ(v21.stats.lines_bad, 0U);
  ASSERT_EQ(v21.frames.size(), 3U);
  EXPECT_EQ(v21.frames[0].text(), "1 00000100#0000000000000001");
  EXPECT_EQ(v21.frames[1].text(), "2 100##0000102030405060708090A0B");
  EXPECT_EQ(v21.frames[2].text(), "1 704#R1");
}

TEST(TrcLog, ARemoteRequestInCanFdDoesNotExist) {
  const Log log = read(
      ";$FILEVERSION=2.0\n"
      ";$COLUMNS=N,O,T,I,d,l,D\n"
      "      1      1059.900 FD     0300 Rx 2  RTR\n"
      "      2      1060.900 DT     0300 Rx 2  RTR\n");
  EXPECT_EQ(log.stats.lines_bad, 1U);
  ASSERT_EQ(log.frames.size(), 1U);
  EXPECT_EQ(log.frames[0].text(), "1 300#R2");
}

// --- .csv ----------------------------------------------------------------------------------------

TEST(CsvLog, SavvyCan) {
  const Log log = read(
      "Time Stamp,ID,Extended,Dir,Bus,LEN,D1,D2,D3,D4,D5,D6,D7,D8\n"
      "166064000,0000021A,false,Rx,0,8,FE,36,12,FE,69,05,07,AD,\n"
      "166064100,18FEEE00,true,Rx,1,2,01,0A,,,,,,,\n");
  EXPECT_EQ(log.stats.lines_bad, 0U);
  ASSERT_EQ(log.frames.size(), 2U);
  EXPECT_EQ(log.frames[0].t_ns, 166'064'000'000);
  EXPECT_EQ(log.frames[0].text(), "0 21A#FE3612FE690507AD");
  EXPECT_EQ(log.frames[1].text(), "1 18FEEE00#010A");
}

// The columns of bytes that a frame has not may be left out.
TEST(CsvLog, ARowWithoutOneOfItsCellsIsNoFrame) {
  const Log log = read(
      "Time Stamp,ID,Extended,Dir,Bus,LEN,D1,D2,D3,D4,D5,D6,D7,D8\n"
      "13348,00000130,false,Rx,0,2,48,08,\n"
      "13349,00000130,Rx,0,8,02,08,C0,0D,C6,08,2B,20,\n"
      "13350,00000130,Rx,0,8,07,08,C0,0D,C6,08,2B,20,\n"
      "13351,00000130,xx,Rx,0,2,48,08,\n"
      "13352,00000130,false,Rx,0,3E,48,08,\n"
      "13353,00000130,false,Rx,0\n"
      "13354,00000130,false,Rx,0,8,01,02,03,04,05,06,07,08,09\n"
      "13355,00000130,,Rx,0,1,48\n");
  EXPECT_EQ(log.stats.lines_bad, 6U);
  ASSERT_EQ(log.frames.size(), 2U);
  EXPECT_EQ(log.frames[0].text(), "0 130#4808");
  EXPECT_EQ(log.frames[1].text(), "0 130#48");
  EXPECT_EQ(log.stats.first_bad.at(0).reason,
            "unreadable kind of identifier; expected true or false");
  EXPECT_EQ(log.stats.first_bad.at(3).reason, "unreadable length");
  EXPECT_EQ(log.stats.first_bad.at(5).reason,
            "more cells than the header has; expected decimal points");
  const Log kinds = read(
      "time,id,ide,comment,data\n"
      "0.1,0x12,EXT,,11\n"
      "0.2,0x12,Std,,12\n"
      "0.3,0x12,STD,13\n");
  EXPECT_EQ(kinds.stats.lines_bad, 1U);
  ASSERT_EQ(kinds.frames.size(), 2U);
  EXPECT_EQ(kinds.frames[0].text(), "1 00000012#11");
  EXPECT_EQ(kinds.frames[1].text(), "1 012#12");
}

TEST(CsvLog, PythonCanWithBase64) {
  const Log log = read(
      "timestamp,arbitration_id,extended,remote,error,dlc,data\n"
      "1483389946.197,0xdadada,1,0,0,6,WzQyLCA5\n"
      "1483389946.298,0x123,0,1,0,4,\n"
      "1483389946.399,0x123,0,0,0,3,YWJj\n");
  EXPECT_EQ(log.stats.lines_bad, 0U);
  ASSERT_EQ(log.frames.size(), 3U);
  EXPECT_EQ(log.frames[0].text(), "1 00DADADA#5B34322C2039");
  EXPECT_EQ(log.frames[1].text(), "1 123#R4");
  EXPECT_EQ(log.frames[2].text(), "1 123#616263");
  EXPECT_EQ(log.frames[2].t_ns, 1'483'389'946'399'000'000);
}

TEST(CsvLog, OtherHeaders) {
  const Log semicolons = read(
      "TimestampEpoch;BusChannel;ID;IDE;DLC;DataLength;Dir;EDL;BRS;DataBytes\n"
      "1606811541.850000;1;0CF004FE;1;8;8;0;0;0;FFFFFF6813FFFFFF\n"
      "1606811541.850100;2;7E8;0;9;12;0;1;1;000102030405060708090A0B\n");
  EXPECT_EQ(semicolons.stats.lines_bad, 0U);
  ASSERT_EQ(semicolons.frames.size(), 2U);
  EXPECT_EQ(semicolons.frames[0].text(), "1 0CF004FE#FFFFFF6813FFFFFF");
  EXPECT_EQ(semicolons.frames[1].text(), "2 7E8##1000102030405060708090A0B");
  const Log decimals = read(
      "time,can_id,data\n"
      "0.5,291,\"01 02\"\n"
      "2020-09-12 10:20:30.250,2047,ff\n");
  EXPECT_EQ(decimals.stats.lines_bad, 0U);
  ASSERT_EQ(decimals.frames.size(), 2U);
  EXPECT_EQ(decimals.frames[0].text(), "1 123#0102");
  EXPECT_EQ(decimals.frames[0].t_ns, 500'000'000);
  const Log cabana = read(
      "time,addr,bus,data\n"
      "1.25,0x1d2,0,0x0011\n");
  ASSERT_EQ(cabana.frames.size(), 1U);
  EXPECT_EQ(cabana.frames[0].text(), "0 1D2#0011");
}

TEST(CsvLog, TimesOfDayDecimalBytesAndCommasInQuotes) {
  const Log clock = read("Time,ID,Data\n10:20:30.5,0x123,00\n10:20:31:2500,0x123,01\n");
  ASSERT_EQ(clock.frames.size(), 2U);
  EXPECT_EQ(clock.frames[0].t_ns, 37'230'500'000'000);
  EXPECT_EQ(clock.frames[1].t_ns, 37'231'250'000'000);
  const Log decimals = read("time,id,d0,d1\n0.1,0x10,255,16\n0.2,0x10,7,1\n");
  ASSERT_EQ(decimals.frames.size(), 2U);
  EXPECT_EQ(decimals.frames[0].text(), "1 010#FF10");
  const Log quoted = read("\"Time\",\"ID\",\"Data\"\n\"0.5\",\"0x123\",\"11,22\"\n");
  ASSERT_EQ(quoted.frames.size(), 1U);
  EXPECT_EQ(quoted.frames[0].text(), "1 123#1122");
}

TEST(CsvLog, HeaderBehindAPreamble) {
  const Log log = read(
      "Export of a measurement\n\n"
      "Line,Abs Time(Sec),Er,Tx,Network,Arb ID,Remote,Xtd,B1,B2,B3\n"
      "1,0.1,F,F,HS CAN,18FEF100,F,T,11,22,\n");
  EXPECT_EQ(log.stats.lines_bad, 1U);
  ASSERT_EQ(log.frames.size(), 1U);
  EXPECT_EQ(log.frames[0].text(), "HS CAN 18FEF100#1122");
}

TEST(CsvLog, ThePayloadWinsOverColumnsOfItsBytes) {
  const Log log = read(
      "time,id,d0,d1,data\n"
      "0.5,0x123,AA,BB,11\n");
  EXPECT_EQ(log.stats.lines_bad, 0U);
  ASSERT_EQ(log.frames.size(), 1U);
  EXPECT_EQ(log.frames[0].text(), "1 123#11");
  EXPECT_EQ(log.frames[0].frame.data[1], 0) << "bytes behind the payload are zero";
}

TEST(CsvLog, BrokenRowsAreCounted) {
  const Log log = read(
      "time,id,dlc,data\n"
      "0.1,123,2,0011\n"
      "x,123,2,0011\n"
      "0.2,99999999999,2,0011\n"
      "0.3,123,2,00\n"
      "0.4\n"
      "0.5,123,2,00112\n");
  EXPECT_EQ(log.frames.size(), 1U);
  EXPECT_EQ(log.stats.lines_bad, 5U);
}

// --- the quick ways against the plain ones -------------------------------------------------------

// Changed here and there.
std::string changed(std::string text, std::string_view pool, std::mt19937& random) {
  const auto below = [&](std::size_t end) { return static_cast<std::size_t>(random()) % end; };
  for (std::size_t changes = below(3); changes > 0 && !text.empty(); --changes) {
    const std::size_t at = below(text.size());
    const std::size_t kind = below(3);
    if (kind == 0) text[at] = pool[below(pool.size())];
    if (kind == 1) text.insert(at, 1, pool[below(pool.size())]);
    if (kind == 2) text.erase(at, 1);
  }
  return text;
}

TEST(LogText, NumbersAndTimesAreReadAlikeBothWays) {
  std::mt19937 random(5);
  const std::vector<std::string> words{
      "8",        "1FFFFFFF",          "00a0", "4294967295", "123456789",     "1234567890",
      "12.34567", "1700000000.123456", "-0.5", "0,25",       "99999999999.9", "1.123456789"};
  for (int round = 0; round < 100'000; ++round) {
    const std::string word = changed(words[random() % words.size()], "0123456789aF.-, x", random);
    ASSERT_EQ(log_text::hexadecimal(word), log_text::whole_number(word, 16)) << word;
    ASSERT_EQ(log_text::decimal(word), log_text::whole_number(word, 10)) << word;
    for (const std::int64_t unit_ns : {1'000'000'000, 1'000'000, 1'000, 1, 60}) {
      ASSERT_EQ(log_text::time_ns(word, unit_ns), log_text::any_time_ns(word, unit_ns))
          << word << ' ' << unit_ns;
    }
  }
}

// With two blanks for each the bytes are taken word by word.
TEST(LogText, BytesAreReadAlikeBothWays) {
  std::mt19937 random(6);
  const std::string asc = "base hex  timestamps absolute\n";
  const std::string trc = ";$FILEVERSION=2.1\n;$COLUMNS=N,O,T,B,I,d,R,L,D\n";
  const std::string asc_line =
      "   1.234567 1  123             Rx   d 8 64 00 0A ff 77 12 34 56 x = 1";
  const std::string trc_line = "  2     1064.160 DT 1     0123 Rx -  8    64 00 0A FF 77 12 34 56 ";
  for (int round = 0; round < 20'000; ++round) {
    for (const bool is_asc : {true, false}) {
      const std::string& head = is_asc ? asc : trc;
      std::string line = changed(is_asc ? asc_line : trc_line, "0123456789aFRT x-", random);
      const Log once = read(head + line + '\n');
      std::string wide;
      for (const char c : line) wide += c == ' ' ? "  " : std::string(1, c);
      const Log twice = read(head + wide + '\n');
      ASSERT_EQ(rewritten(once), rewritten(twice)) << line;
      ASSERT_EQ(once.stats.lines_bad, twice.stats.lines_bad) << line;
    }
  }
}

// Lines as the formats' tools write them, read by the short way whole and changed by both alike.
std::string changed_lines(const std::vector<std::string>& lines, std::mt19937& random) {
  constexpr int kRounds = 20'000;
  const std::string pool = std::string("0189afFxgRTdr.:,-; \t\r\x7F\xE9") + '\0';
  std::string log;
  for (int round = 0; round < kRounds; ++round) {
    for (const std::string& line : lines) log += changed(line, pool, random) + '\n';
  }
  return log;
}

TEST(AscLog, UsualLinesAreReadAlikeBothWays) {
  std::mt19937 random(7);
  const std::vector<std::string> lines{
      "   1.234567 1  123             Rx   d 8 64 00 0A ff 77 12 34 56  Length = 228000 ID = 291",
      "  17.1 12 18EBFF00x Tx d 3 01 A0 0F", "0.000001234 1  7ff  Rx  d 0  Length = 0\r",
      "12345678.123456 99999999 1FFFFFFFx Rx d 1 00",
      "  1.5 1  0  Rx  d 8  01 02 03 04 05 06 07 08 09"};
  for (const char* head : {"base hex  timestamps absolute", "base hex  timestamps relative",
                           "base dec  timestamps absolute"}) {
    const auto quick = make_asc_parser();
    const auto plain = make_asc_parser();
    LogRecord record;
    for (const auto* parser : {&quick, &plain}) (*parser)->parse(head, record);
    const test::BothWays read = test::read_both_ways(*quick, *plain, changed_lines(lines, random));
    EXPECT_TRUE(read.alike) << head << '\n' << read.different;
    const bool is_hexadecimal = std::string_view(head).starts_with("base hex");
    EXPECT_EQ(read.quick_frames > 10'000, is_hexadecimal) << read.quick_frames;
  }
}

TEST(TrcLog, UsualLinesAreReadAlikeBothWays) {
  struct Version {
    std::string head;
    std::vector<std::string> lines;
  };
  const Version versions[] = {
      {";$FILEVERSION=1.0",
       {"     1)      1841  0001  8  00 11 22 33 44 55 66 77", "2) 1842 00000123 2 AA BB",
        "  3)  1843  0123  0  RTR", "4) 1844 0123 8 01 02 03 04 05 06 07 08 09"}},
      {";$FILEVERSION=1.1",
       {"     1)      1059.9  Rx     0300  2  00 01", "     4)      1062.9  Tx     09F11201  0  "}},
      {";$FILEVERSION=1.3", {"     1)      1059.900 2  Rx     0300 -  2  00 01 \r"}},
      {";$COLUMNS=N,O,T,I,d,l,D", {"      1      1059.900 DT     0300 Rx 2  00 01"}},
      {";$COLUMNS=N,O,T,B,I,d,R,L,D",
       {"      2      1064.160 DT 1      0123 Rx -  8    64 00 0A FF 77 12 34 56 ",
        "1234567 12345678.123456 DT 12345678 1FFFFFFF Tx - 7 00 11 22 33 44 55 66"}},
      {";$COLUMNS=l,I,N,N,N,N,N,N,N,N,N,N",
       {"8 0001 1 2 3 4 5 6 7 8 9 0 01 02 03 04 05 06 07 08"}}};
  std::mt19937 random(8);
  for (const Version& version : versions) {
    const auto quick = make_trc_parser();
    const auto plain = make_trc_parser();
    LogRecord record;
    for (const auto* parser : {&quick, &plain}) (*parser)->parse(version.head, record);
    const test::BothWays read =
        test::read_both_ways(*quick, *plain, changed_lines(version.lines, random));
    EXPECT_TRUE(read.alike) << version.head << '\n' << read.different;
    EXPECT_GT(read.quick_frames, 5'000U) << version.head;
  }
}

// --- any format ----------------------------------------------------------------------------------

std::string gzipped(const std::string& text) {
  z_stream stream{};
  EXPECT_EQ(deflateInit2(&stream, 6, Z_DEFLATED, 15 + 16, 8, Z_DEFAULT_STRATEGY), Z_OK);
  std::string out(text.size() + 1000, '\0');
  stream.next_in = reinterpret_cast<Bytef*>(const_cast<char*>(text.data()));
  stream.avail_in = static_cast<uInt>(text.size());
  stream.next_out = reinterpret_cast<Bytef*>(out.data());
  stream.avail_out = static_cast<uInt>(out.size());
  EXPECT_EQ(deflate(&stream, Z_FINISH), Z_STREAM_END);
  out.resize(stream.total_out);
  deflateEnd(&stream);
  return out;
}

std::string many_lines(int count) {
  std::string text;
  for (int i = 0; i < count; ++i) {
    text += "(" + std::to_string(i) + ".000000) can0 123#" + (i % 2 == 0 ? "00" : "11") + "\n";
  }
  return text;
}

TEST(AnyLog, UnpacksGzipAndZstdByContent) {
  const std::string text = many_lines(100'000);  // more than the buffers hold
  const Log gzip = read(gzipped(text) + gzipped("(100000.0) can0 123#\n"));  // two members
  EXPECT_EQ(gzip.frames.size(), 100'001U);
  EXPECT_EQ(gzip.stats.lines_bad, 0U);
  std::string packed(ZSTD_compressBound(text.size()), '\0');
  packed.resize(ZSTD_compress(packed.data(), packed.size(), text.data(), text.size(), 3));
  const Log zstd = read(packed);
  EXPECT_EQ(zstd.frames.size(), 100'000U);
  EXPECT_EQ(zstd.stats.lines_bad, 0U);
}

TEST(AnyLog, AFrameIsOfOneKind) {
  // An error frame that is remote; CAN FD that is remote, as candump prints them.
  const Log log = read(
      "(1.0) can0 20000004#R8\n"
      "(2.0) can0 20000004#0000000000000000\n"
      " (003.000000)  can0  123  [12]  remote request\n"
      "(4.0) can0 123#R8\n");
  EXPECT_EQ(log.stats.lines_bad, 2U);
  ASSERT_EQ(log.frames.size(), 2U);
  EXPECT_TRUE(log.frames[0].frame.error);
  EXPECT_TRUE(log.frames[1].frame.remote);
}

std::string utf16(std::string_view ascii, bool little) {
  std::string out = little ? "\xFF\xFE" : "\xFE\xFF";
  for (const char c : ascii) out += little ? std::string{c, '\0'} : std::string{'\0', c};
  return out;
}

TEST(AnyLog, ReadsUtf16WithItsMark) {
  const std::string text = many_lines(20'000);
  for (const bool little : {true, false}) {
    const Log log = read(utf16(text, little));
    EXPECT_EQ(log.stats.lines_bad, 0U);
    ASSERT_EQ(log.frames.size(), 20'000U);
    EXPECT_EQ(log.frames[19'999].text(), "can0 123#11");
  }
  // A character of two units counts as one bad letter of its line, wherever a block ends.
  const std::string clef("\x34\xD8\x1E\xDD", 4);
  const Log log = read(utf16("(1.0) can0 123#00\n", true) + clef + std::string("\n\0", 2) +
                       utf16("(2.0) can0 123#00\n", true).substr(2));
  EXPECT_EQ(log.frames.size(), 2U);
  EXPECT_EQ(log.stats.lines_bad, 1U);
  const Log cut = read(utf16("(1.0) can0 123#00\n", true) + "(");
  EXPECT_EQ(cut.frames.size(), 1U);
  ASSERT_EQ(cut.stats.lines_bad, 1U);
  EXPECT_EQ(cut.stats.first_bad[0].reason, "UTF-16 text ends within a character");
  EXPECT_TRUE(read("\xFF\xFE").frames.empty());
}

TEST(AnyLog, ReportsPackedDataThatEndEarlyOrAreDamaged) {
  const std::string text = many_lines(100'000);
  std::string cut = gzipped(text);
  cut.resize(cut.size() / 2);
  const Log half = read(cut);
  EXPECT_GT(half.frames.size(), 1000U);
  EXPECT_GE(half.stats.lines_bad, 1U);
  EXPECT_EQ(half.stats.first_bad.back().reason, "gzip data ends before its end");
  std::string damaged = gzipped(text);
  for (std::size_t i = 2000; i < 2100; ++i) damaged[i] = 'x';
  EXPECT_GE(read(damaged).stats.lines_bad, 1U);
  std::string packed(ZSTD_compressBound(text.size()), '\0');
  packed.resize(ZSTD_compress(packed.data(), packed.size(), text.data(), text.size(), 3));
  packed.resize(packed.size() / 2);
  const Log half_zstd = read(packed);
  EXPECT_EQ(half_zstd.stats.first_bad.back().reason, "zstd data ends before its end");
}

// The line in which packed data break off has lost its end: its frame would be a shorter one.
TEST(AnyLog, TheLineInWhichPackedDataBreakOffIsNoFrame) {
  const std::string text = many_lines(100'000);
  const std::string whole = gzipped(text);
  for (std::size_t bytes = whole.size() / 2; bytes < whole.size() / 2 + 64; ++bytes) {
    const Log log = read(whole.substr(0, bytes));
    ASSERT_EQ(log.stats.lines_bad, 1U);
    EXPECT_EQ(log.stats.first_bad[0].line, log.frames.size() + 1);
    EXPECT_EQ(log.frames.back().frame.length, log.frames.front().frame.length);
  }
}

// Lines that end with CR alone look like one line; its first frame must not stand for all.
TEST(AnyLog, ACarriageReturnInsideALineIsReported) {
  const Log log = read("(1.0) can0 123#00\r(2.0) can0 123#01\r\n(3.0) can0 123#02\r\r\n");
  ASSERT_EQ(log.frames.size(), 1U);
  EXPECT_EQ(log.frames[0].text(), "can0 123#02");
  ASSERT_EQ(log.stats.lines_bad, 1U);
  EXPECT_EQ(log.stats.first_bad[0].line, 1U);
}

TEST(AnyLog, WhatFollowsGzipDataIsSaidUnlessItIsPadding) {
  const std::string packed = gzipped("(1.0) can0 123#00\n");
  const Log padded = read(packed + std::string(512, '\0') + packed);
  EXPECT_EQ(padded.frames.size(), 2U);
  EXPECT_EQ(padded.stats.lines_bad, 0U);
  const Log more = read(packed + "(2.0) can0 123#00\n");
  EXPECT_EQ(more.frames.size(), 1U);
  ASSERT_EQ(more.stats.lines_bad, 1U);
  EXPECT_EQ(more.stats.first_bad[0].reason, "gzip data with something else behind them");
}

TEST(AnyLog, LinesWithoutEndAreCountedOnceAndMemoryStaysFlat) {
  const Log log = read("(1.0) can0 123#00\n" + std::string(5'000'000, 'x') +
                       "\n(2.0) can0 123#00\n" + std::string(3'000'000, '('));
  EXPECT_EQ(log.frames.size(), 2U);
  EXPECT_EQ(log.stats.lines_bad, 2U);
  EXPECT_EQ(log.stats.lines, 4U);
}

TEST(AnyLog, EmptyAndForeignFilesHaveNoFrame) {
  EXPECT_EQ(read("").stats.lines, 0U);
  EXPECT_TRUE(read("\n\n\n").frames.empty());
  EXPECT_TRUE(read("# nothing but a comment\n").frames.empty());
  EXPECT_EQ(read("[bus]\ninterface = \"vcan0\"\n").frames.size(), 0U);
  const Log packed = read("BZh91AY&SY");
  EXPECT_TRUE(packed.frames.empty());
  ASSERT_EQ(packed.stats.lines_bad, 1U);
  EXPECT_NE(packed.stats.first_bad[0].reason.find("bzip2"), std::string::npos);
}

TEST(AnyLog, ByteOrderMarkIsSkipped) {
  EXPECT_EQ(read("\xEF\xBB\xBF(1.0) can0 123#00\n").frames.size(), 1U);
}

TEST(AnyLog, MissingFilesAndDirectoriesAreNamed) {
  try {
    LogReader::open("/nonexistent/a.log");
    FAIL();
  } catch (const LogOpenError& error) {
    EXPECT_EQ(error.text, "/nonexistent/a.log: No such file or directory");
  }
  try {
    LogReader::open("/tmp");
    FAIL();
  } catch (const LogOpenError& error) {
    EXPECT_EQ(error.text, "/tmp: is a directory, expected a log");
  }
}

}  // namespace
}  // namespace beltgrip::can
