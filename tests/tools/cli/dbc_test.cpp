// beltgrip dbc show, decode and check: their output word by word, and input that is wrong.
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>
#include <sstream>

#include "tests/support/program.h"

namespace beltgrip::test {
namespace {

using nlohmann::json;

constexpr const char* kDbc = R"(VERSION "1"
BS_: BU_: A
BO_ 291 Engine: 8 A
 SG_ Speed : 0|16@1+ (0.1,-3) [0|8031] "rpm" A
 SG_ Gear : 23|4@0- (1,0) [-8|7] "" A
 SG_ Late : 56|8@1+ (1,0) [0|255] "" A
 SG_ Long : 0|64@1+ (1,0) [0|0] "" A
BO_ 292 Muxed: 8 A
 SG_ Page M : 0|8@1+ (1,0) [0|0] "" A
 SG_ First m1 : 8|8@1+ (1,0) [0|0] "" A
 SG_ Second m2 : 8|8@1+ (1,0) [0|0] "" A
 SG_ Float m3 : 32|32@1- (1,0) [0|0] "" A
BO_ 2566844926 Ccvs: 8 A
 SG_ Vehicle : 8|16@1+ (0.00390625,0) [0|251] "km/h" A
SIG_VALTYPE_ 292 Float : 1;
VAL_ 291 Gear -1 "reverse" 1 "first" ;
BA_DEF_ BO_ "GenMsgCycleTime" INT 0 1000;
BA_DEF_ BO_ "GenMsgSendType" ENUM "cyclic","event";
BA_ "GenMsgCycleTime" BO_ 291 10;
BA_ "GenMsgSendType" BO_ 291 1;
CM_ SG_ 291 Speed "of the \"engine\"";
)";

class Dbc : public testing::Test {
 protected:
  void SetUp() override { place_.write("a.dbc", kDbc); }
  std::string path(const std::string& name) const { return place_.path(name); }
  RunResult decode(const std::string& log, std::vector<std::string> more = {}) const {
    place_.write("a.log", log);
    std::vector<std::string> arguments{"dbc",         "decode", "--dbc", path("a.dbc"),
                                       path("a.log"), "--json", "-"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return beltgrip(arguments);
  }
  Workplace place_;
};

TEST_F(Dbc, DecodeWritesOneLineAFrame) {
  const RunResult result = decode(
      "(1700000000.123456) can0 123#E803F00000000005\n"
      "(1700000000.5) can1 123#0A00\n"
      "(1700000001.123456789) can0 124#0107\n");
  EXPECT_EQ(result.status, 0) << result.err;
  EXPECT_EQ(result.out, R"({"t_s":1700000000.123456,"iface":"can0","id":291,"extended":false,)"
                        R"("message":"Engine","signals":{"Speed":97,"Gear":-1,"Late":5,)"
                        R"("Long":360287970205369344},"labels":{"Gear":"reverse"}})"
                        "\n"
                        R"({"t_s":1700000000.5,"iface":"can1","id":291,"extended":false,)"
                        R"("message":"Engine","signals":{"Speed":-2},"labels":{}})"
                        "\n"
                        R"({"t_s":1700000001.123456789,"iface":"can0","id":292,"extended":false,)"
                        R"("message":"Muxed","signals":{"Page":1,"First":7},"labels":{}})"
                        "\n");
}

TEST_F(Dbc, DecodeGivesUtf8WhateverTheInterfaceIsCalled) {
  const RunResult result = decode("(1.0) can\xB0 123#0A00\n(2.0) can\xC2\xB0 123#0A00\n");
  std::istringstream stream(result.out);
  for (std::string line; std::getline(stream, line);) {
    EXPECT_EQ(json::parse(line)["iface"], "can\xC2\xB0");
  }
  EXPECT_EQ(lines(result.out), 2);
}

TEST_F(Dbc, ShowLosesNoNumberOfAnAttribute) {
  place_.write("b.dbc", R"(BS_: BU_: A
BO_ 1 M: 8 A
BA_DEF_ BO_ "Whole" INT 0 0;
BA_DEF_ BO_ "Negative" INT 0 0;
BA_DEF_ BO_ "Half" FLOAT 0 0;
BA_DEF_ BO_ "Huge" FLOAT 0 0;
BA_DEF_ BO_ "Text" HEX 0 0;
BA_ "Whole" BO_ 1 18446744073709551615;
BA_ "Negative" BO_ 1 -9223372036854775807;
BA_ "Half" BO_ 1 5e-1;
BA_ "Huge" BO_ 1 1e999;
BA_ "Text" BO_ 1 "nan";
)");
  const RunResult result = beltgrip({"dbc", "show", path("b.dbc"), "--json", "-"});
  const json attributes = json::parse(result.out)["messages"][0]["attributes"];
  EXPECT_EQ(attributes["Whole"], 18446744073709551615U);
  EXPECT_EQ(attributes["Negative"], -9223372036854775807);
  EXPECT_EQ(attributes["Half"], 0.5);
  EXPECT_EQ(attributes["Huge"], "1e999");
  EXPECT_EQ(attributes["Text"], "nan");
}

TEST_F(Dbc, DecodeWithRawValues) {
  const RunResult result = decode(
      "(1.0) can0 123#FFFFFFFFFFFFFFFF\n"
      "(2.0) can0 124#0300000000000040\n"
      "(3.0) can0 124#030000000000C07F\n",
      {"--raw"});
  std::istringstream stream(result.out);
  std::string line;
  std::getline(stream, line);
  json frame = json::parse(line);
  EXPECT_EQ(frame["raw"]["Long"], "18446744073709551615");
  EXPECT_EQ(frame["raw"]["Gear"], "-1");
  EXPECT_EQ(frame["signals"]["Speed"], 65535 * 0.1 - 3);
  std::getline(stream, line);
  frame = json::parse(line);
  EXPECT_EQ(frame["signals"]["Float"], 2.0);
  EXPECT_EQ(frame["raw"]["Float"], "2");
  EXPECT_FALSE(frame["signals"].contains("First"));
  std::getline(stream, line);
  frame = json::parse(line);
  EXPECT_TRUE(frame["signals"]["Float"].is_null());
  EXPECT_EQ(frame["raw"]["Float"], "nan");
}

TEST_F(Dbc, DecodeMatchesParameterGroupsAndCountsTheRest) {
  const RunResult result = decode(
      "(1.0) can0 0CFEF117#0000010000000000\n"
      "(1.1) can0 0CFEF217#00\n"
      "(1.2) can0 7FF#00\n"
      "(1.3) can0 123#R8\n"
      "(1.4) can0 20000004#0004000000000000\n"
      "not a frame\n");
  EXPECT_EQ(result.status, 0);
  const json frame = json::parse(result.out);
  EXPECT_EQ(frame["message"], "Ccvs");
  EXPECT_EQ(frame["id"], 0x0CFEF117);
  EXPECT_EQ(frame["extended"], true);
  EXPECT_NE(result.err.find(":6: not a frame"), std::string::npos) << result.err;
  EXPECT_NE(result.err.find("5 frames, 1 decoded, 4 that no DBC names, 1 bad lines"),
            std::string::npos)
      << result.err;
}

TEST_F(Dbc, DecodeWithTwoFilesUsesTheFirstAndSaysSo) {
  place_.write(
      "b.dbc",
      "BS_: BU_: A\nBO_ 291 Other: 8 A\nBO_ 512 More: 8 A\n SG_ s : 0|8@1+ (1,0) [0|1] \"\" A\n");
  const RunResult result =
      decode("(1.0) can0 123#00\n(2.0) can0 200#07\n", {"--dbc", path("b.dbc")});
  EXPECT_EQ(result.status, 0);
  EXPECT_NE(result.out.find("\"message\":\"Engine\""), std::string::npos);
  EXPECT_NE(result.out.find("\"message\":\"More\",\"signals\":{\"s\":7}"), std::string::npos);
  EXPECT_NE(
      result.err.find("b.dbc: message Other has the identifier of Engine in " + path("a.dbc")),
      std::string::npos)
      << result.err;
}

TEST_F(Dbc, DecodeReadsStandardInputAndWritesAFile) {
  place_.write("in.log", "(1.0) can0 123#0A00\n");
  const RunResult result = beltgrip(
      {"dbc", "decode", "--dbc", path("a.dbc"), "-", "--json", path("out.jsonl")}, path("in.log"));
  EXPECT_EQ(result.status, 0) << result.err;
  EXPECT_EQ(result.out, "");
  EXPECT_EQ(json::parse(place_.read("out.jsonl"))["signals"]["Speed"], -2);
}

TEST_F(Dbc, DecodeRefusesWhatCannotBeUsedAtAll) {
  EXPECT_EQ(decode("").status, 65);
  EXPECT_EQ(decode("hello\n").status, 65);
  const RunResult no_times = decode("  can0  123   [2]  00 11\n  can0  123   [2]  00 11\n");
  EXPECT_EQ(no_times.status, 65);
  EXPECT_NE(no_times.err.find("no time stamp"), std::string::npos) << no_times.err;
  EXPECT_EQ(decode("(1.0) can0 123#00\n", {"--dbc", path("missing.dbc")}).status, 66);
  place_.write("empty.dbc", "VERSION \"\"\n");
  const RunResult empty = decode("(1.0) can0 123#00\n", {"--dbc", path("empty.dbc")});
  EXPECT_EQ(empty.status, 65);
  EXPECT_NE(empty.err.find("empty.dbc: no readable message"), std::string::npos) << empty.err;
  EXPECT_EQ(beltgrip({"dbc", "decode", "--dbc", path("a.dbc"), path("missing.log")}).status, 66);
  EXPECT_EQ(beltgrip({"dbc", "decode", path("a.log")}).status, 64);
  EXPECT_EQ(beltgrip({"dbc"}).status, 64);
  place_.write("one.log", "(1.0) can0 123#00\n");
  EXPECT_EQ(beltgrip({"dbc", "decode", "--dbc", path("a.dbc"), path("one.log"), "--json",
                      "/nonexistent/out"})
                .status,
            73);
}

TEST_F(Dbc, ShowNamesTheFieldsOfTheInterface) {
  const RunResult result = beltgrip({"dbc", "show", path("a.dbc"), "--json", "-"});
  EXPECT_EQ(result.status, 0) << result.err;
  const json all = json::parse(result.out);
  ASSERT_EQ(all["messages"].size(), 3U);
  const json& message = all["messages"][0];
  EXPECT_EQ(message["name"], "Engine");
  EXPECT_EQ(message["id"], 291);
  EXPECT_EQ(message["extended"], false);
  EXPECT_EQ(message["length"], 8);
  EXPECT_EQ(message["fd"], false);
  EXPECT_EQ(message["cycle_ms"], 10);
  EXPECT_EQ(message["comment"], "");
  EXPECT_EQ(message["attributes"], (json{{"GenMsgCycleTime", 10}, {"GenMsgSendType", "event"}}));
  const json& speed = message["signals"][0];
  EXPECT_EQ(speed["name"], "Speed");
  EXPECT_EQ(speed["start_bit"], 0);
  EXPECT_EQ(speed["length"], 16);
  EXPECT_EQ(speed["byte_order"], "little");
  EXPECT_EQ(speed["signed"], false);
  EXPECT_EQ(speed["float"], false);
  EXPECT_EQ(speed["scale"], 0.1);
  EXPECT_EQ(speed["offset"], -3);
  EXPECT_EQ(speed["min"], 0);
  EXPECT_EQ(speed["max"], 8031);
  EXPECT_EQ(speed["unit"], "rpm");
  EXPECT_EQ(speed["comment"], "of the \"engine\"");
  EXPECT_EQ(speed["is_multiplexer"], false);
  EXPECT_TRUE(speed["multiplexed_by"].is_null());
  EXPECT_EQ(message["signals"][1]["byte_order"], "big");
  EXPECT_EQ(message["signals"][1]["signed"], true);
  EXPECT_EQ(message["signals"][1]["values"], (json{{"-1", "reverse"}, {"1", "first"}}));
  const json& muxed = all["messages"][1]["signals"];
  EXPECT_EQ(muxed[0]["is_multiplexer"], true);
  EXPECT_EQ(muxed[2]["multiplexed_by"], json::parse(R"({"Page": [[2, 2]]})"));
  EXPECT_EQ(muxed[3]["float"], true);
  EXPECT_TRUE(all["messages"][1]["cycle_ms"].is_null());
  EXPECT_EQ(all["messages"][2]["id"], 0x18FEF1FE);
  EXPECT_EQ(all["messages"][2]["extended"], true);
}

TEST_F(Dbc, DecodeTakesSeveralLogsOfAnyFormat) {
  place_.write("b.asc", "base hex  timestamps absolute\n   0.500000 1  123 Rx d 2 0A 00\n");
  place_.write("c.trc", ";$FILEVERSION=1.1\n     1)      1059.9  Rx         0123  2  14 00\n");
  place_.write("d.csv", "Time,ID,Data\n0.5,0x123,1E00\n");
  const RunResult all =
      decode("(1.0) can0 123#0000\n", {path("b.asc"), path("c.trc"), path("d.csv")});
  EXPECT_EQ(all.status, 0) << all.err;
  std::vector<double> speeds;
  std::istringstream stream(all.out);
  for (std::string line; std::getline(stream, line);) {
    speeds.push_back(json::parse(line)["signals"]["Speed"]);
  }
  EXPECT_EQ(speeds, (std::vector<double>{-3.0, 10 * 0.1 - 3, 20 * 0.1 - 3, 30 * 0.1 - 3}));
  // One that cannot be used does not hide the others.
  const RunResult missing = decode("(1.0) can0 123#0000\n", {path("none.log"), path("b.asc")});
  EXPECT_EQ(missing.status, 66);
  EXPECT_EQ(lines(missing.out), 2);
}

TEST_F(Dbc, DecodeIsTextForPeople) {
  place_.write("a.log",
               "(1.5) can0 123#E803F00000000005\n"
               "(2.25) can1 124#03000000CDCCCC3D\n"  // 0.1 as a float
               "(3.0) can0 18FEF1FE#FF0080FFFFFFFFFF\n");
  const std::vector<std::string> decode{"dbc", "decode", "--dbc", path("a.dbc"), path("a.log")};
  const RunResult result = beltgrip(decode);
  EXPECT_EQ(result.status, 0) << result.err;
  EXPECT_EQ(result.out,
            "1.5 can0 0x123 Engine: Speed 97 rpm, Gear -1 (reverse), Late 5, "
            "Long 360287970205369344\n"
            "2.25 can1 0x124 Muxed: Page 3, Float 0.10000000149\n"
            "3.0 can0 0x18FEF1FE Ccvs: Vehicle 128 km/h\n");
  std::vector<std::string> to_file = decode;
  to_file.insert(to_file.end(), {"--text", path("out.txt")});
  EXPECT_EQ(beltgrip(to_file).status, 0);
  EXPECT_EQ(place_.read("out.txt"), result.out);
}

TEST_F(Dbc, DecodeIsATableForPrograms) {
  place_.write("a.log",
               "(1.5) can0 123#0A00\n"
               "(2.0) can0 124#030000000000C0FF\n"  // a nan with a sign
               "(2.5) can0 124#030000000000807F\n"  // inf
               "(3.0) can0 124#03000000000080FF\n"  // -inf
               "(3.5) can0 124#0207\n"
               "(4.0) can0 124#020007\n");
  const RunResult result =
      beltgrip({"dbc", "decode", "--dbc", path("a.dbc"), path("a.log"), "--csv", "-", "--signals",
                "Speed", "--signals", "Muxed.Second,Float"});
  EXPECT_EQ(result.status, 0) << result.err;
  EXPECT_EQ(result.out,
            "t_s,iface,Engine.Speed,Muxed.Second,Muxed.Float\n"
            "1.5,can0,-2,,\n"
            "2.0,can0,,,nan\n"
            "2.5,can0,,,inf\n"
            "3.0,can0,,,-inf\n"
            "3.5,can0,,7,\n"
            "4.0,can0,,0,\n");
}

TEST_F(Dbc, DecodeTakesWhatIsAskedFor) {
  const std::string log =
      "(10.0) can0 123#0A00\n(10.5) can0 124#0107\n(11.0) can0 124#0207\n(12.0) can0 123#0B00\n";
  const auto times = [&](std::vector<std::string> more) {
    std::string found;
    const RunResult result = decode(log, std::move(more));
    EXPECT_EQ(result.status, 0) << result.err;
    std::istringstream stream(result.out);
    for (std::string line; std::getline(stream, line);) {
      found += json::parse(line)["t_s"].dump() + ' ';
    }
    return found;
  };
  EXPECT_EQ(times({}), "10.0 10.5 11.0 12.0 ");
  EXPECT_EQ(times({"--messages", "Muxed"}), "10.5 11.0 ");
  EXPECT_EQ(times({"--messages", "Muxed", "--messages", "Engine"}), "10.0 10.5 11.0 12.0 ");
  EXPECT_EQ(times({"--messages", "Muxed,Engine"}), "10.0 10.5 11.0 12.0 ");
  EXPECT_EQ(times({"--signals", "Speed"}), "10.0 12.0 ");
  // Both ends of the time count, from the first frame of the log.
  EXPECT_EQ(times({"--from", "0.5"}), "10.5 11.0 12.0 ");
  EXPECT_EQ(times({"--from", "0.5", "--to", "1"}), "10.5 11.0 ");
  EXPECT_EQ(times({"--to", "0"}), "10.0 ");
  const RunResult one = decode("(1.0) can0 124#0107\n", {"--signals", "First"});
  EXPECT_EQ(json::parse(one.out)["signals"], (json{{"First", 7}}))
      << "the selector is not asked for";
}

TEST_F(Dbc, DecodeSaysWhatItCannotGive) {
  const std::string log = "(1.0) can0 123#0A00\n";
  for (const auto& [more, text] : std::vector<std::pair<std::vector<std::string>, std::string>>{
           {{"--signals", "Spede"}, "--signals Spede: no signal of that name"},
           {{"--signals", "Muxed.Speed"}, "--signals Muxed.Speed: no signal of that name"},
           {{"--signals", "Speed,Spede"}, "--signals Spede: no signal of that name"},
           {{"--messages", "Motor"}, "--messages Motor: no message of that name"},
           {{"--csv", "-"}, "expected one of --text, --csv, --json"}}) {
    const RunResult result = decode(log, more);
    EXPECT_EQ(result.status, 64) << result.err;
    EXPECT_NE(result.err.find(text), std::string::npos) << result.err;
    EXPECT_EQ(lines(result.err), 2) << "one of the DBC's own: " << result.err;
  }
  const RunResult backward = decode(log, {"--from", "3", "--to", "2"});
  EXPECT_EQ(backward.status, 64);
  EXPECT_NE(backward.err.find("found a --to before --from"), std::string::npos) << backward.err;
  // Nothing decoded is no result.
  for (const auto& [nothing, more] : std::vector<std::pair<std::string, std::vector<std::string>>>{
           {"(1.0) can0 456#0A00\n", {}}, {log, {"--messages", "Muxed"}}, {log, {"--from", "1"}}}) {
    const RunResult result = decode(nothing, more);
    EXPECT_EQ(result.status, 65) << result.err;
    EXPECT_NE(result.err.find("none of its 1 frames"), std::string::npos) << result.err;
    EXPECT_EQ(result.out, "");
  }
}

// Bytes by hand: Speed is raw (97 + 3) / 0.1 = 1000 = 0x03E8, low byte first; Gear -1 is the high
// nibble of byte 2; 87.65 km/h are raw 22438.4, so 22438 = 0x57A6.
TEST_F(Dbc, EncodeGivesTheFrameOfCansend) {
  const auto encode = [this](std::vector<std::string> what) {
    std::vector<std::string> arguments{"dbc", "encode", "--dbc", path("a.dbc")};
    arguments.insert(arguments.end(), what.begin(), what.end());
    return beltgrip(arguments);
  };
  for (const auto& [what, frame] : std::vector<std::pair<std::vector<std::string>, std::string>>{
           {{"Engine", "Speed=97", "Gear=reverse"}, "123#E803F00000000000"},
           {{"Engine", "Gear=-1", "Late=0xFF"}, ""},
           {{"Engine"}, "123#0000000000000000"},
           {{"Muxed", "Page=2", "Second=7"}, "124#0207000000000000"},
           {{"Muxed", "Float=1.5", "Page=3"}, "124#030000000000C03F"},
           {{"Muxed", "Float=nan", "Page=3"}, "124#030000000000C07F"},
           {{"Muxed", "Float=-inf", "Page=3"}, "124#03000000000080FF"},
           {{"Ccvs", "Vehicle=87.65"}, "18FEF1FE#00A6570000000000"},
           {{"Muxed", "First=7", "Page=2"}, "First: not in a frame with this value of Page"},
           {{"Engine", "Speed=7000"},
            "Speed: found 7000, which its 16 bits cannot carry; the "
            "nearest is 6550.5"},
           {{"Engine", "Speed=fast"}, "Speed: found \"fast\", expected a number"},
           {{"Engine", "Speed=nan"}, "Speed: found \"nan\", expected a number"},
           {{"Engine", "Speed=1", "Long=0"}, "Speed: shares bits with another signal"},
           {{"Engine", "Speed=1", "Speed=1"}, "Speed: given twice"},
           {{"Engine", "Spede=1"}, "Spede: no signal of Engine, which has Speed, Gear, Late, Long"},
           {{"Engine", "Speed"}, "Speed: expected SIGNAL=VALUE"},
           {{"Motor"}, "Motor: no message of that name"}}) {
    const RunResult result = encode(what);
    const bool right = frame.find('#') != std::string::npos;
    EXPECT_EQ(result.status, right ? 0 : 64) << frame << result.err;
    EXPECT_EQ(result.out, right ? frame + "\n" : "");
    if (!right) {
      EXPECT_NE(result.err.find(frame), std::string::npos) << result.err;
    }
  }
  // What is not given has the start value that the file states.
  place_.write("start.dbc",
               "BS_: BU_: A\nBO_ 293 Lamp: 1 A\n SG_ On : 0|1@1+ (1,0) [0|1] \"\" A\n"
               " SG_ Level : 1|7@1+ (2,10) [0|0] \"%\" A\n"
               "BA_DEF_ SG_ \"GenSigStartValue\" FLOAT 0 100;\n"
               "BA_DEF_DEF_ \"GenSigStartValue\" 0;\n"
               "BA_ \"GenSigStartValue\" SG_ 293 Level 5;\n");
  const RunResult started = beltgrip({"dbc", "encode", "--dbc", path("start.dbc"), "Lamp", "On=1"});
  EXPECT_EQ(started.out, "125#0B\n") << started.err;
}

TEST_F(Dbc, ATableTooWideIsRefused) {
  std::string wide = "BS_: BU_: A\n";
  for (int message = 0; message < 40; ++message) {
    wide += "BO_ " + std::to_string(message + 1) + " M" + std::to_string(message) + ": 8 A\n";
    for (int signal = 0; signal < 64; ++signal) {
      wide += " SG_ S" + std::to_string(signal) + " : " + std::to_string(signal) +
              "|1@1+ (1,0) [0|0] \"\" A\n";
    }
  }
  place_.write("wide.dbc", wide);
  place_.write("a.log", "(1.0) can0 001#FF\n");
  const RunResult refused =
      beltgrip({"dbc", "decode", "--dbc", path("wide.dbc"), path("a.log"), "--csv", "-"});
  EXPECT_EQ(refused.status, 64);
  EXPECT_NE(refused.err.find("2560 columns, expected at most 2000"), std::string::npos)
      << refused.err;
  const RunResult chosen = beltgrip({"dbc", "decode", "--dbc", path("wide.dbc"), path("a.log"),
                                     "--csv", "-", "--messages", "M0"});
  EXPECT_EQ(chosen.status, 0) << chosen.err;
}

TEST_F(Dbc, ShowForReadersPrintsEveryMessageAndSignal) {
  const RunResult result = beltgrip({"dbc", "show", path("a.dbc")});
  EXPECT_EQ(result.status, 0);
  EXPECT_NE(result.out.find("0x123 Engine, 8 bytes, every 10 ms\n"), std::string::npos);
  EXPECT_NE(result.out.find("  First: bit 8, 8 bits, little endian, unsigned, factor 1, offset 0, "
                            "selected by Page = 1\n"),
            std::string::npos)
      << result.out;
  EXPECT_NE(result.out.find("big endian, signed, factor 1, offset 0, from -8 to 7\n"
                            "      -1 = reverse\n      1 = first\n"),
            std::string::npos)
      << result.out;
  EXPECT_NE(result.out.find("\n      \"of the \"engine\"\"\n"), std::string::npos);
  EXPECT_EQ(lines(result.out), 3 + 9 + 2 + 1);
}

TEST_F(Dbc, CheckPrintsEachProblemWithItsPlace) {
  EXPECT_EQ(beltgrip({"dbc", "check", path("a.dbc")}).status, 0);
  EXPECT_EQ(
      beltgrip({"dbc", "check", path("a.dbc")}).out,
      path("a.dbc") + ":7:6: warning: signal \"Long\" shares bits with \"Speed\" [overlap]\n");
  place_.write("odd.dbc",
               "BS_: BU_: A\nBO_ 2048 M: 1 A\n SG_ s : 0|9@1+ (1,0) [0|1] \"\" A\n SG_ t 0|8@1+\n");
  const RunResult odd = beltgrip({"dbc", "check", path("odd.dbc")});
  EXPECT_EQ(odd.status, 65);
  std::istringstream stream(odd.out);
  std::vector<std::string> found;
  for (std::string line; std::getline(stream, line);) {
    EXPECT_TRUE(line.starts_with(path("odd.dbc") + ":")) << line;
    found.push_back(line.substr(path("odd.dbc").size()));
  }
  ASSERT_EQ(found.size(), 3U);
  EXPECT_TRUE(found[0].starts_with(":2:5: warning: ")) << found[0];
  EXPECT_TRUE(found[1].starts_with(":3:6: warning: ")) << found[1];
  EXPECT_TRUE(found[2].starts_with(":4:9: error: ")) << found[2];
}

TEST_F(Dbc, CheckStrictRefusesWarnings) {
  place_.write("odd.dbc", "BS_: BU_: A\nBO_ 2048 M: 1 A\n");
  EXPECT_EQ(beltgrip({"dbc", "check", path("odd.dbc")}).status, 0);
  EXPECT_EQ(beltgrip({"dbc", "check", path("odd.dbc"), "--strict"}).status, 65);
  place_.write("good.dbc", "BS_: BU_: A\nBO_ 1 M: 1 A\n");
  const RunResult good = beltgrip({"dbc", "check", "--strict", path("good.dbc")});
  EXPECT_EQ(good.status, 0);
  EXPECT_EQ(good.out, "");
  EXPECT_EQ(good.err, path("good.dbc") + ": no problems; 1 message, 0 signals read\n");
  EXPECT_EQ(beltgrip({"dbc", "check", path("missing.dbc")}).status, 66);
  EXPECT_EQ(beltgrip({"dbc", "check", path("")}).status, 66);  // a directory
  place_.write("none.dbc", "VERSION \"\"\n");
  EXPECT_EQ(beltgrip({"dbc", "check", path("none.dbc")}).status, 65);
  EXPECT_EQ(beltgrip({"dbc", "show", path("none.dbc"), "--json", "-"}).status, 65);
}

}  // namespace
}  // namespace beltgrip::test
