// Files and peers that mean no good: keys without end, clocks that were set, silences of hours,
// pipes that nobody writes to, text that steers a terminal. The programs as users call them.
#include <fcntl.h>
#include <gtest/gtest.h>
#include <sqlite3.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <unistd.h>
#include <zlib.h>

#include <array>
#include <charconv>
#include <chrono>
#include <csignal>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <sstream>
#include <thread>

#include "daemon/io/history_db.h"
#include "tests/daemon/test_vehicle.h"
#include "tests/support/program.h"

namespace beltgrip::test {
namespace {

namespace fs = std::filesystem;
constexpr Milliseconds kHostileLimit{60000};

std::string repeated(const std::string& text, int count) {
  std::string out;
  for (int i = 0; i < count; ++i) out += text;
  return out;
}

class Hostile : public testing::Test {
 protected:
  Hostile() {
    place.write("vehicle.dbc", kVehicleDbc);
    place.write("beltgrip.toml", kVehicleToml);
    place.write("table.csv", "t[s],primary_speed[rad/s]\n0,100\n");
  }
  std::string config() const { return place.path("beltgrip.toml"); }
  Workplace place;
};

// --- TOML -----------------------------------------------------------------------------------

class DeepToml : public Hostile, public testing::WithParamInterface<std::string> {};

TEST_P(DeepToml, IsOneLineAndStatus78) {
  place.write("deep.toml", GetParam());
  const std::string deep = place.path("deep.toml");
  const std::vector<std::vector<std::string>> commands{
      {program_path("beltgripd"), "--config", deep},
      {program_path(), "replay", "-", "--config", deep},
      {program_path(), "calibrate", "-", "--config", deep},
      {program_path(), "diagnose", place.path("table.csv"), "--config", config(), "--model", deep},
      {program_path(), "simulate", "--scenario", deep},
      {program_path(), "simulate", "--model", deep},
      {program_path(), "simulate", "--scenario", "demo", "--model", deep}};
  for (const auto& command : commands) {
    const RunResult result = run(command, kHostileLimit);
    EXPECT_EQ(result.status, 78) << command[1] << ": " << result.err;
    EXPECT_NE(result.err.find("deep.toml:2: "), std::string::npos) << result.err;
    EXPECT_LE(lines(result.err), 2) << result.err;
  }
  const std::string key = repeated("a.", 30000) + "a=1";
  EXPECT_EQ(beltgrip({"simulate", "--set", key}).status, 78);
}

INSTANTIATE_TEST_SUITE_P(
    , DeepToml,
    testing::Values("\na" + repeated(".a", 30000) + " = 1\n",
                    "\n[" + repeated("a.", 30000) + "a]\n",
                    "\na = " + repeated("[", 3000) + repeated("]", 3000) + "\n",
                    "\na = " + repeated("{a.b=", 3000) + "1" + repeated("}", 3000) + "\n",
                    "\nx = [\"\"\"a\"\"\"\", {a" + repeated(".a", 30000) + " = 1}]\n",
                    "\na = '''b''''.c'''\n" + std::string("a") + repeated(" . a", 30000) +
                        " = 1\n"));

// What the library's own headers take for a failed assertion of theirs.
class UnfinishedToml : public Hostile, public testing::WithParamInterface<std::string> {};

TEST_P(UnfinishedToml, IsOneLineAndStatus78) {
  place.write("typed.toml", GetParam());
  const std::string typed = place.path("typed.toml");
  const std::vector<std::vector<std::string>> commands{
      {program_path("beltgripd"), "--check", "--config", typed},
      {program_path(), "replay", "-", "--config", typed},
      {program_path(), "diagnose", place.path("table.csv"), "--config", config(), "--model", typed},
      {program_path(), "simulate", "--scenario", typed},
      {program_path(), "simulate", "--scenario", "demo", "--model", typed}};
  for (const auto& command : commands) {
    const RunResult result = run(command, kHostileLimit);
    EXPECT_EQ(result.status, 78) << command[1] << ": " << result.err;
    EXPECT_NE(result.err.find("typed.toml:1: "), std::string::npos) << result.err;
    EXPECT_EQ(lines(result.err), 1) << result.err;
  }
}

INSTANTIATE_TEST_SUITE_P(, UnfinishedToml,
                         testing::Values("[\n", "[ \n", "[[\n", "[[[\n", "[.a]\n", "[[[a]]]\n",
                                         "[[#\n", "[#\n", "a = {.b = 1}\n", ".a = 1\n"));

TEST_F(Hostile, ADeepFileDoesNotEndARunningDaemon) {
  Process process({program_path("beltgripd"), "--config", config(), "--log-level", "debug"});
  ASSERT_TRUE(process.wait_for_error(" samples, ", kHostileLimit)) << process.err();
  place.write("beltgrip.toml", "a" + repeated(".a", 30000) + " = 1\n");
  process.signal(SIGHUP);
  EXPECT_TRUE(process.wait_for_error("reload refused", kHostileLimit)) << process.err();
  process.signal(SIGTERM);
  EXPECT_EQ(process.wait(kHostileLimit), 0) << process.err();
}

// Nobody will ever write to it, and the helper thread has more to do than to wait.
TEST_F(Hostile, AReloadOutOfAPipeIsRefusedAndTheDaemonGoesOn) {
  Process process({program_path("beltgripd"), "--config", config(), "--log-level", "debug"});
  ASSERT_TRUE(process.wait_for_error(" samples, ", kHostileLimit)) << process.err();
  fs::remove(config());
  ASSERT_EQ(mkfifo(config().c_str(), 0600), 0);
  process.signal(SIGHUP);
  EXPECT_TRUE(process.wait_for_error("reload refused, the old configuration stays: " + config() +
                                         ": found no readable file (it is no regular file)",
                                     Milliseconds{500}))
      << process.err();
  fs::remove(config());
  place.write("beltgrip.toml", kVehicleToml);
  process.signal(SIGHUP);
  EXPECT_TRUE(process.wait_for_error("is in force", kHostileLimit)) << process.err();
  process.signal(SIGTERM);
  EXPECT_EQ(process.wait(kHostileLimit), 0) << process.err();
}

// What stands in quotes and comments has no depth.
TEST_F(Hostile, DotsAndBracketsInTextAreNone) {
  const std::string many = repeated(".[{", 100);
  place.write("beltgrip.toml", "# " + many + "\n" + std::string(kVehicleToml) +
                                   "[daemon]\nstate_dir = \"\"\"\n" + many + "\\\"\"\"\" # " +
                                   many + "\n");
  const RunResult result = beltgrip({"replay", "-", "--config", config()});
  EXPECT_EQ(result.err.find("levels"), std::string::npos) << result.err;
  EXPECT_EQ(result.status, 65) << result.err;  // no frame
}

// --- clocks ---------------------------------------------------------------------------------

// What a program with sanitizers costs more: 14 times was measured for `diagnose`.
#if defined(__has_feature)
#if __has_feature(address_sanitizer) || __has_feature(thread_sanitizer)
constexpr int kSanitized = 20;
#else
constexpr int kSanitized = 1;
#endif
#else
constexpr int kSanitized = 1;
#endif

// With so many seconds of the processor at most, as a program without sanitizers takes them.
RunResult limited(int processor_s, std::vector<std::string> arguments) {
  arguments.insert(
      arguments.begin(),
      {"sh", "-c", "ulimit -t " + std::to_string(processor_s * kSanitized) + "; exec \"$0\" \"$@\"",
       program_path()});
  return run(arguments, Milliseconds{240000});
}

class Silence : public testing::Test {
 protected:
  Silence() {
    EXPECT_EQ(beltgrip({"simulate", "--start", "80", "--out-dir", place.path("")}).status, 0);
  }
  // Its first lines, `gap_s` after every `block` of them.
  std::string with_gaps(int count, int block, double gap_s) const {
    std::istringstream in(place.read("trace.log"));
    std::string out;
    int i = 0;
    for (std::string line; i < count && std::getline(in, line); ++i) {
      const std::size_t end = line.find(')');
      double t_s = 0.0;
      std::from_chars(line.data() + 1, line.data() + end, t_s);
      char stamp[48];
      std::snprintf(stamp, sizeof stamp, "(%.6f", t_s + gap_s * (i / block));
      out += stamp + line.substr(end) + "\n";
    }
    return out;
  }
  RunResult replay(std::vector<std::string> more, int processor_s) const {
    more.insert(more.begin(),
                {"replay", place.path("gaps.log"), "--config", place.path("beltgrip.toml")});
    return limited(processor_s, more);
  }
  Workplace place;
};

TEST_F(Silence, CostsTheSameHoweverLongItIs) {
  for (const int block : {1, 40}) {
    place.write("gaps.log", with_gaps(4300, block, 3600.0));
    const RunResult result = replay({"--json", place.path("out.json")}, 8);
    EXPECT_EQ(result.status, 0) << result.err;
    EXPECT_EQ(lines(place.read("out.json")), block == 1 ? 1 : 2);
  }
}

// Nor do the tools that look at the whole log.
TEST_F(Silence, CostsCalibrateAndDiagnoseNothingEither) {
  for (const int block : {1, 40}) {
    place.write("gaps.log", with_gaps(4300, block, 3600.0));
    for (const char* command : {"calibrate", "diagnose", "report"}) {
      std::vector<std::string> arguments{command, place.path("gaps.log"), "--config",
                                         place.path("beltgrip.toml")};
      if (command == std::string("report")) {
        arguments.insert(arguments.end(), {"--out", place.path("report.html")});
      }
      const RunResult result = limited(8, arguments);
      EXPECT_TRUE(result.status == 0 || result.status == 65) << command << result.err;
    }
  }
}

// With --log-out every frame is wanted that the daemon would have sent, also in the silence.
TEST_F(Silence, LeavesEverythingElseAsItIs) {
  place.write("gaps.log", with_gaps(9001, 3000, 300.0));
  const RunResult left_out =
      replay({"--json", place.path("a.json"), "--trace", place.path("a.csv")}, 60);
  const RunResult played = replay({"--json", place.path("b.json"), "--trace", place.path("b.csv"),
                                   "--log-out", place.path("b.log")},
                                  60);
  EXPECT_EQ(left_out.status, 0) << left_out.err;
  EXPECT_EQ(played.status, 0) << played.err;
  EXPECT_EQ(left_out.out, played.out);
  EXPECT_EQ(place.read("a.json"), place.read("b.json"));
  EXPECT_EQ(place.read("a.csv"), place.read("b.csv"));
  // 600 s and 10 frames of estimate and slip in each.
  EXPECT_GT(lines(place.read("b.log")), 12000);
}

// --- signals and pipes ----------------------------------------------------------------------

class Stop : public Hostile {
 protected:
  // The program has opened the pipe, and nobody will ever write to it or read from it.
  void expect_ends(std::vector<std::string> arguments, int pipe_mode = O_WRONLY) {
    const std::string pipe = place.path("pipe");
    fs::remove(pipe);
    ASSERT_EQ(mkfifo(pipe.c_str(), 0600), 0);
    arguments.insert(arguments.begin(), program_path());
    Process process(arguments);
    const int fd = open(pipe.c_str(), pipe_mode);  // returns once the program has opened it
    ASSERT_GE(fd, 0);
    expect_ends(process, arguments[1] + " " + arguments[2]);
    close(fd);
    for (const auto& each : fs::directory_iterator(place.path(""))) {
      EXPECT_FALSE(each.path().filename().string().starts_with(".beltgrip")) << each.path();
    }
  }
  static void expect_ends(Process& process, const std::string& name) {
    const auto begin = std::chrono::steady_clock::now();
    process.signal(SIGTERM);
    const auto status = process.wait(Milliseconds{10000});
    const double s =
        std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
    EXPECT_TRUE(status.has_value()) << name;
    EXPECT_LT(s, 0.5) << name;
  }
  std::string pipe() const { return place.path("pipe"); }
};

TEST_F(Stop, EndsEveryToolThatWaitsForItsInput) {
  const std::string dbc = place.path("vehicle.dbc");
  const std::string out = place.path("out");
  expect_ends({"replay", pipe(), "--config", config(), "--json", out});
  expect_ends({"calibrate", pipe(), "--config", config(), "--out", out});
  expect_ends({"diagnose", pipe(), "--config", config(), "--json", out});
  expect_ends({"dbc", "show", pipe(), "--json", out});
  expect_ends({"dbc", "check", pipe()});
  expect_ends({"dbc", "decode", pipe(), "--dbc", dbc, "--json", out});
  expect_ends({"init", pipe(), "--out", out});
  expect_ends({"simulate", "--scenario", pipe(), "--json", out});
  expect_ends({"replay", pipe(), "--bus", "inproc:x"});
}

// A log through a pipe ends by Ctrl-C: what came before is used, and every output is in its place.
TEST_F(Stop, KeepsWhatCameThroughAPipe) {
  std::string log;
  for (int i = 0; i < 20000; ++i) {
    char line[64];
    std::snprintf(line, sizeof line, "(%d.%06d) can0 103#0000\n", 1 + i / 100, i % 100 * 10000);
    log += line;
  }
  const std::string dbc = place.path("vehicle.dbc");
  const std::vector<std::vector<std::string>> commands{
      {"dbc", "decode", pipe(), "--dbc", dbc, "--json", place.path("out.json")},
      {"replay", pipe(), "--config", config(), "--json", place.path("out.json"), "--trace",
       place.path("out.csv"), "--log-out", place.path("out.log")},
      {"report", pipe(), "--config", config(), "--out", place.path("out.html")},
      {"check", pipe(), "--config", config(), "--json", place.path("out.json")}};
  for (const auto& command : commands) {
    for (const int number : {SIGINT, SIGTERM}) {
      for (const char* name : {"pipe", "out.json", "out.csv", "out.log", "out.html"}) {
        fs::remove(place.path(name));
      }
      ASSERT_EQ(mkfifo(pipe().c_str(), 0600), 0);
      std::vector<std::string> arguments = command;
      arguments.insert(arguments.begin(), program_path());
      Process process(arguments);
      const int fd = open(pipe().c_str(), O_WRONLY);
      ASSERT_GE(fd, 0);
      // A pipe holds 64 KiB: once all is written, most of it was read.
      ASSERT_EQ(write(fd, log.data(), log.size()), static_cast<ssize_t>(log.size()));
      process.signal(number);
      EXPECT_EQ(process.wait(Milliseconds{10000}), 0) << command[0] << process.err();
      close(fd);
      for (std::size_t i = 0; i + 1 < command.size(); ++i) {
        const std::string& file = command[i + 1];
        if (command[i] == "--config" || command[i] == "--dbc" || !command[i].starts_with("--")) {
          continue;
        }
        EXPECT_TRUE(fs::exists(file)) << command[0] << " " << file << process.err();
      }
      if (fs::exists(place.path("out.json"))) {
        std::istringstream in(place.read("out.json"));
        int count = 0;
        for (std::string line; std::getline(in, line); ++count) {
          ASSERT_TRUE(nlohmann::json::accept(line)) << line;
        }
        EXPECT_GE(count, command[0] == "dbc" ? 15000 : 1);
      }
    }
  }
}

// What an empty line takes in it is one bit: much to read, and read in small pieces.
std::string packed_empty_lines(std::size_t count) {
  const std::string text(count, '\n');
  std::string packed(count / 4 + 1000, '\0');
  z_stream stream{};
  constexpr int kGzip = 15 + 16, kMemory = 8;
  EXPECT_EQ(deflateInit2(&stream, 1, Z_DEFLATED, kGzip, kMemory, Z_HUFFMAN_ONLY), Z_OK);
  stream.next_in = reinterpret_cast<Bytef*>(const_cast<char*>(text.data()));
  stream.avail_in = static_cast<uInt>(text.size());
  stream.next_out = reinterpret_cast<Bytef*>(packed.data());
  stream.avail_out = static_cast<uInt>(packed.size());
  EXPECT_EQ(deflate(&stream, Z_FINISH), Z_STREAM_END);
  packed.resize(stream.total_out);
  deflateEnd(&stream);
  return packed;
}

// Ctrl-C within a log that is a file, after its first experiment: what came before it is used,
// whole, and the end is that by the signal. A log that had not ended is none of those that are
// done.
TEST_F(Stop, ByCtrlCKeepsWhatAFileGaveUntilThen) {
  ASSERT_EQ(beltgrip({"simulate", "--scenario", "demo", "--out-dir", place.path("drive")}).status,
            0);
  const std::string trace = place.read("drive/trace.log");
  const std::string whole = place.path("drive/trace.log"), long_log = place.path("long.log.gz");
  gzFile gz = gzopen(long_log.c_str(), "wb");
  ASSERT_EQ(gzwrite(gz, trace.data(), static_cast<unsigned>(trace.size())),
            static_cast<int>(trace.size()));
  ASSERT_EQ(gzclose(gz), Z_OK);
  std::ofstream tail(long_log, std::ios::app | std::ios::binary);
  const std::string lines_of_nothing = packed_empty_lines(std::size_t{1} << 24U);
  for (int i = 0; i < 12; ++i) tail << lines_of_nothing;
  tail.close();
  const auto cut = [&](std::vector<std::string> arguments) {
    arguments.insert(arguments.begin(),
                     {program_path(), "replay", "--config", place.path("drive/beltgrip.toml")});
    arguments.insert(arguments.end(), {"--json", place.path("out.json")});
    Process process(arguments);
    EXPECT_TRUE(process.wait_for_output("completed, overrun", kHostileLimit)) << process.err();
    process.signal(SIGINT);
    EXPECT_EQ(process.wait(kHostileLimit), 128 + SIGINT) << process.err();
    EXPECT_NE(process.err().find("stopped: what was read until then is used"), std::string::npos);
    return process.err();
  };
  const std::string said = cut({long_log, "--signals-out", place.path("signals.csv")});
  EXPECT_NE(said.find("ended by a signal, what may have followed is not read"), std::string::npos);
  EXPECT_TRUE(place.read("signals.csv").ends_with('\n'));
  const std::string results = place.read("out.json");
  EXPECT_GE(lines(results), 2);  // an experiment and the summary
  const std::size_t last = results.rfind('\n', results.size() - 2) + 1;
  EXPECT_TRUE(results.substr(last).starts_with("{\"type\":\"summary\"")) << results;
  EXPECT_NE(cut({whole, long_log, "--jobs", "1"}).find("stopped: 1 of 2 logs are done"),
            std::string::npos);
  EXPECT_EQ(lines(place.read("out.json")), 3);
  EXPECT_EQ(place.read("out.json").find("long.log"), std::string::npos);

  // The same of a check, which judges what it has read, and of a history, which keeps whole logs.
  const auto cut_soon = [&](std::vector<std::string> arguments) {
    arguments.insert(arguments.begin(), program_path());
    arguments.insert(arguments.end(), {"--config", place.path("drive/beltgrip.toml")});
    Process process(arguments);
    EXPECT_FALSE(process.wait(Milliseconds(1000)).has_value()) << process.err();
    process.signal(SIGINT);
    EXPECT_EQ(process.wait(kHostileLimit), 128 + SIGINT) << process.err();
    EXPECT_NE(process.err().find("stopped: what was read until then is used"), std::string::npos)
        << process.err();
    return process.out();
  };
  EXPECT_NE(cut_soon({"check", long_log, "--json", place.path("check.json")}).find("Ready to"),
            std::string::npos);
  EXPECT_TRUE(nlohmann::json::accept(place.read("check.json")));
  EXPECT_NE(cut_soon({"history", place.path("belt"), "--from", whole, long_log}).find("mu_max 0.1"),
            std::string::npos);
}

// A drive in virtual time: what was driven until then is whole and can be replayed.
TEST_F(Stop, ByCtrlCKeepsTheDriveUntilThen) {
  const std::string folder = place.path("cut");
  Process process({program_path(), "simulate", "--scenario", "coast-overdrive", "--set",
                   "run.duration_s=100000", "--out-dir", folder});
  EXPECT_FALSE(process.wait(Milliseconds(1000)).has_value()) << process.err();
  process.signal(SIGINT);
  EXPECT_EQ(process.wait(kHostileLimit), 128 + SIGINT) << process.err();
  EXPECT_NE(process.err().find("stopped: the drive ends there"), std::string::npos)
      << process.err();
  const RunResult checked =
      beltgrip({"check", folder + "/trace.log", "--config", folder + "/beltgrip.toml"});
  EXPECT_EQ(checked.status, 0) << checked.err;
  EXPECT_TRUE(fs::exists(folder + "/truth.json"));
}

// SIGTERM leaves nothing of a log that is a file: what an earlier run left stays.
TEST_F(Stop, KeepsTheEarlierResultOfAFile) {
  std::string log;
  for (int i = 0; i < 2000; ++i) {
    log += "(" + std::to_string(1 + 3600 * i) + ".0) can0 103#0000\n";
  }
  place.write("trace.log", log);
  place.write("out.json", "earlier\n");
  ASSERT_EQ(mkfifo(pipe().c_str(), 0600), 0);
  Process process({program_path(), "replay", place.path("trace.log"), "--config", config(),
                   "--json", place.path("out.json"), "--log-out", pipe()});
  const int fd = open(pipe().c_str(), O_RDONLY);  // returns once both outputs are open
  ASSERT_GE(fd, 0);
  expect_ends(process, "replay FILE");
  EXPECT_EQ(process.wait(Milliseconds{0}), 128 + SIGTERM);
  EXPECT_EQ(place.read("out.json"), "earlier\n");
  close(fd);
  for (const auto& each : fs::directory_iterator(place.path(""))) {
    EXPECT_FALSE(each.path().filename().string().starts_with(".beltgrip")) << each.path();
  }
}

TEST_F(Stop, EndsEveryToolWhoseOutputNobodyTakes) {
  expect_ends({"simulate", "--scenario", "city", "--log-out", pipe()}, O_RDONLY);
  expect_ends({"simulate", "--set", "run.cycles=1000", "--log-out", pipe()}, O_RDONLY);
}

TEST_F(Stop, EndsWhatRunsInRealTime) {
  Process demo({program_path(), "run-demo"});
  ASSERT_TRUE(demo.wait_for_output("idle", kHostileLimit)) << demo.out();
  expect_ends(demo, "run-demo");
  // Nobody else can be on it.
  const RunResult monitor = beltgrip({"monitor", "inproc:x"});
  EXPECT_EQ(monitor.status, 69) << monitor.err;
  EXPECT_EQ(lines(monitor.err), 1) << monitor.err;
  place.write("trace.log", "(1.000000) can0 100#0011223344556677\n(90000.0) can0 100#00\n");
  const std::string pipe = place.path("pipe");
  ASSERT_EQ(mkfifo(pipe.c_str(), 0600), 0);
  Process player(
      {program_path(), "replay", place.path("trace.log"), "--bus", "inproc:x", "--config", pipe});
  place.write("pipe", kVehicleToml);  // it reads its configuration, then plays
  expect_ends(player, "replay --bus");
}

TEST_F(Hostile, AHistoryThatIsAPipeIsNone) {
  const std::string pipe = place.path("history.db");
  ASSERT_EQ(mkfifo(pipe.c_str(), 0600), 0);
  for (const std::string& name : {pipe, place.path("")}) {
    const RunResult result = run({program_path(), "history", name}, Milliseconds{10000});
    EXPECT_EQ(result.status, 66) << result.err;
    EXPECT_NE(result.err.find("no regular file"), std::string::npos) << result.err;
  }
}

// --- a daemon that is none ------------------------------------------------------------------

class Answer : public Hostile, public testing::WithParamInterface<std::string> {};

TEST_P(Answer, ThatIsNotTheDaemonsIsStatus65) {
  const std::string path = place.path("status.sock");
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  path.copy(address.sun_path, sizeof address.sun_path - 1);
  const int server = socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0);
  ASSERT_EQ(bind(server, reinterpret_cast<const sockaddr*>(&address), sizeof address), 0);
  ASSERT_EQ(listen(server, 1), 0);
  {
    const std::jthread answers([&] {
      const int client = accept(server, nullptr, nullptr);
      static_cast<void>(!write(client, GetParam().data(), GetParam().size()));
      close(client);
    });
    const RunResult result = run({program_path(), "status", "--socket", path}, kHostileLimit);
    EXPECT_EQ(result.status, 65) << result.err;
    EXPECT_EQ(lines(result.err), 1) << result.err;
    EXPECT_EQ(result.err.find('\x1b'), std::string::npos) << result.err;
  }
  close(server);
}
INSTANTIATE_TEST_SUITE_P(, Answer,
                         testing::Values("{}", "[]", "null", "{\"interface\":1}", "{", "\x1b[31m",
                                         "{\"interface\":\"a\",\"control\":\"b\"}",
                                         repeated("[", 100000) + repeated("]", 100000)));

// --- a history that nobody has written ------------------------------------------------------

// The row as the file has it, up to the checksum.
std::uint32_t checksum_of(sqlite3_stmt* row) {
  std::string bytes;
  for (int i = 0; i + 1 < sqlite3_column_count(row); ++i) {
    std::array<char, 32> digits;
    const auto add = [&](auto value) {
      bytes.append(digits.data(),
                   std::to_chars(digits.data(), digits.data() + digits.size(), value).ptr);
    };
    const int type = sqlite3_column_type(row, i);
    if (type == SQLITE_INTEGER) add(sqlite3_column_int64(row, i));
    if (type == SQLITE_FLOAT) add(sqlite3_column_double(row, i));
    if (type == SQLITE_TEXT) bytes += reinterpret_cast<const char*>(sqlite3_column_text(row, i));
    bytes += '|';
  }
  return static_cast<std::uint32_t>(
      crc32(0, reinterpret_cast<const Bytef*>(bytes.data()), static_cast<uInt>(bytes.size())));
}

TEST_F(Hostile, AHistoryRowWithARightChecksumAndMadValuesIsDamaged) {
  const std::vector<std::string> mad{"mu_max = 0.9",
                                     "mu_max = 1e300",
                                     "mu_max_std = -1.0",
                                     "mu_max = NULL",
                                     "ci95_low = 0.2",
                                     "ci95_high = 1e300",
                                     "sensor_std = 1e300",
                                     "oil_degC = 1e300",
                                     "oil_degC = -1e300",
                                     "omega_p_rad_s = 1e300",
                                     "omega_s_rad_s = 9e99",
                                     "torque_Nm = 1e300",
                                     "clamp_force_N = 1e300",
                                     "time_s = 1e300",
                                     "duration_s = 1e300",
                                     "duration_s = -1.0",
                                     "samples = -1",
                                     "notes = -1",
                                     "sigma_stop_percent = 1e300",
                                     "sigma_peak_percent = -1e300",
                                     "fingerprint = char(27) || '[31m'",
                                     "direction = 'Sideways'",
                                     "kind = 'Truth'",
                                     "time_s = 9e999"};
  for (const std::string& each : mad) {
    fs::remove(place.path("history.db"));
    {
      const auto opened = daemon::HistoryDb::open(place.path("history.db"));
      std::string why;
      for (int i = 0; i < 3; ++i) {
        daemon::HistoryRow row;
        row.time_s = 1.7e9 + i;
        row.fingerprint = "00000000deadbeef";
        row.result.end = daemon::MonoTime{12'500 * daemon::kMillisecond};
        row.result.outcome = daemon::Outcome::kCompleted;
        row.result.peak = {estimator::PeakKind::kValue, 0.1, 3e-4, 0.099, 0.101, 2.5, 900};
        row.result.oil_degC = 80.0;
        ASSERT_TRUE(opened.db->append(row));
      }
    }
    sqlite3* db = nullptr;
    ASSERT_EQ(sqlite3_open(place.path("history.db").c_str(), &db), SQLITE_OK);
    const auto execute = [&](const std::string& sql) {
      EXPECT_EQ(sqlite3_exec(db, sql.c_str(), nullptr, nullptr, nullptr), SQLITE_OK) << sql;
    };
    execute("UPDATE experiment SET " + each + " WHERE id = 2");
    sqlite3_stmt* row = nullptr;
    sqlite3_prepare_v2(db, "SELECT * FROM experiment WHERE id = 2", -1, &row, nullptr);
    ASSERT_EQ(sqlite3_step(row), SQLITE_ROW);
    const std::uint32_t right = checksum_of(row);
    sqlite3_finalize(row);
    execute("UPDATE experiment SET checksum = " + std::to_string(right) + " WHERE id = 2");
    execute("PRAGMA wal_checkpoint(TRUNCATE)");
    sqlite3_close(db);
    const RunResult result = beltgrip({"history", place.path("history.db"), "--json", "-"});
    EXPECT_EQ(result.status, 0) << each << result.err;
    EXPECT_NE(result.out.find("\"experiments\":2,\"damaged\":1,"), std::string::npos)
        << each << "\n"
        << result.out;
  }
}

// --- terminals ------------------------------------------------------------------------------

bool steers(const std::string& text) {
  for (std::size_t i = 0; i < text.size(); ++i) {
    const auto byte = static_cast<unsigned char>(text[i]);
    const auto next = static_cast<unsigned char>(i + 1 < text.size() ? text[i + 1] : 0);
    if ((byte < 0x20 && byte != '\n') || byte == 0x7F) return true;
    if (byte == 0xC2 && next >= 0x80 && next < 0xA0) return true;
    // alone: no lead byte before it
    if (byte == 0x9B && (i == 0 || static_cast<unsigned char>(text[i - 1]) < 0x80)) return true;
  }
  return false;
}

TEST_F(Hostile, NoTextOfOthersSteersTheTerminal) {
  const std::string evil =
      "\x1b]0;x\x07\x1b[31m\xc2\x9b"
      "2J\x7f";
  const std::string raw =
      "\x9b"
      "31m";
  std::string dbc = kVehicleDbc;
  const std::size_t unit = dbc.find("\"rpm\"");
  ASSERT_NE(unit, std::string::npos);
  std::string with_unit = dbc;
  with_unit.replace(unit, 5, "\"" + evil + "\"");
  with_unit += "CM_ \"" + evil + "\";\nCM_ BO_ 256 \"" + evil + raw + "\";\nFOO " + evil + "\n";
  const std::string name = "a" + evil + ".x";
  for (const char* each : {"evil.dbc", "vehicle.dbc"}) place.write(each, with_unit);
  place.write(name, evil + "\n");
  fs::copy(place.path("evil.dbc"), place.path(name + ".dbc"));
  place.write("key.toml", "\"" + std::string("\\u001b[31m") +
                              "\" = 1\n\"a\\u009b\" = 2\n[bus]\n\"b\\u001b\"=1\n");
  place.write("wrong.toml", evil + " = 1\n");
  place.write("truth.json", "{\"a\":\"" + evil + "\"}");
  place.write("odd.csv", "t[s]," + evil + "\n0,1\n1,2\n" + evil + "\n");
  const std::string bad = place.path(name);
  const std::vector<std::vector<std::string>> commands{
      {"dbc", "show", place.path("evil.dbc")},
      {"dbc", "show", place.path("evil.dbc"), "--json", "-"},
      {"dbc", "check", place.path("evil.dbc")},
      {"dbc", "check", place.path(name + ".dbc")},
      {"dbc", "show", bad},
      {"dbc", "decode", "--dbc", place.path("evil.dbc"), bad},
      {"dbc", "decode", "--dbc", bad, bad},
      {"init", place.path("evil.dbc")},
      {"init", place.path(name + ".dbc")},
      {"init", bad},
      {"replay", bad, "--config", config()},
      {"replay", bad, "--config", bad},
      {"replay", bad, "--config", place.path("key.toml")},
      {"replay", bad, "--config", place.path("wrong.toml")},
      {"replay", bad, "--bus", evil},
      {"calibrate", bad, "--config", config()},
      {"diagnose", place.path("odd.csv"), "--config", config()},
      {"diagnose", bad, "--config", config()},
      {"diagnose", place.path("odd.csv"), "--config", config(), "--model", place.path("key.toml")},
      {"simulate", "--scenario", bad},
      {"simulate", "--set", evil + "=1"},
      {"simulate", "--model", place.path("key.toml")},
      {"history", bad},
      {"monitor", evil},
      {"monitor", "vcan0", "--truth", place.path("truth.json")},
      {"status", evil},
      {"status", "--socket", bad},
      {"can", "status", evil},
      {evil},
      {"replay", "--" + evil},
  };
  for (const auto& command : commands) {
    const RunResult result = beltgrip(command);
    EXPECT_FALSE(steers(result.out)) << command[0] << " " << command.size() << "\n"
                                     << testing::PrintToString(result.out);
    EXPECT_FALSE(steers(result.err)) << command[0] << " " << command.size() << "\n"
                                     << testing::PrintToString(result.err);
  }
  for (const std::string& each :
       {place.path("key.toml"), place.path("wrong.toml"), bad, config()}) {
    const RunResult result = run({program_path("beltgripd"), "--config", each}, kHostileLimit);
    EXPECT_NE(result.status, 0);
    EXPECT_FALSE(steers(result.err)) << testing::PrintToString(result.err);
  }
  EXPECT_FALSE(steers(run({program_path("beltgripd"), "--" + evil}, kHostileLimit).err));
}

}  // namespace
}  // namespace beltgrip::test
