// Every output option of every command: an output that is an input is refused, under any name; what
// somebody may have edited is replaced only with --force; results are replaced, at the end and as a
// whole.
#include <gtest/gtest.h>
#include <sys/stat.h>

#include <algorithm>
#include <cctype>
#include <filesystem>
#include <iterator>
#include <set>
#include <sstream>

#include "daemon/io/history_db.h"
#include "tests/support/program.h"

namespace beltgrip::test {
namespace {

namespace fs = std::filesystem;

// What is not a name of a file that is written.
// Inputs; and what status_test looks at, with a server.
const std::set<std::string> kNoOutputs{"--config", "--model",   "--held-out",  "--truth",
                                       "--dbc",    "--history", "--prometheus"};
constexpr const char* kMark = "not to be lost\n";

struct Output {
  std::string command, option;
  bool kept;                           // replaced only with --force
  std::vector<std::string> arguments;  // names in the workplace as "@name"
  std::vector<std::string> inputs;     // of these
  std::string file;                    // in the folder that the option names; empty: it is one
  std::string title() const { return command + " " + option; }
};
void PrintTo(const Output& output, std::ostream* out) { *out << output.title() << output.file; }

const std::vector<std::string> kReplay{"replay", "@trace.log", "--config", "@beltgrip.toml"};
const std::vector<std::string> kReplayed{"trace.log", "beltgrip.toml", "vehicle.dbc"};
const std::vector<std::string> kDiagnose{"diagnose",   "@run.csv",  "--config", "@beltgrip.toml",
                                         "--held-out", "@held.csv", "--model",  "@model.toml"};
const std::vector<std::string> kDiagnosed{"run.csv", "beltgrip.toml", "held.csv", "model.toml"};
const std::vector<std::string> kSimulate{"simulate", "--scenario", "@scene.toml",
                                         "--start",  "80",         "--duration",
                                         "0.5",      "--model",    "@model.toml"};
const std::vector<std::string> kSimulated{"scene.toml", "model.toml"};
const std::vector<std::string> kDecode{"dbc", "decode", "--dbc", "@vehicle.dbc", "@trace.log"};

const std::vector<Output> kOutputs{
    {"report",
     "--out",
     false,
     {"report", "@trace.log", "--config", "@beltgrip.toml"},
     kReplayed,
     ""},
    {"init", "--out", true, {"init", "@vehicle.dbc"}, {"vehicle.dbc"}, ""},
    {"calibrate",
     "--out",
     true,
     {"calibrate", "@trace.log", "--config", "@beltgrip.toml"},
     kReplayed,
     ""},
    {"calibrate",
     "--json",
     false,
     {"calibrate", "@trace.log", "--config", "@beltgrip.toml"},
     kReplayed,
     ""},
    {"replay", "--json", false, kReplay, kReplayed, ""},
    {"replay", "--trace", false, kReplay, kReplayed, ""},
    {"replay", "--signals-out", false, kReplay, kReplayed, ""},
    {"replay", "--log-out", false, kReplay, kReplayed, ""},
    {"diagnose", "--json", false, kDiagnose, kDiagnosed, ""},
    {"diagnose", "--report", false, kDiagnose, kDiagnosed, ""},
    {"diagnose", "--model-out", true, kDiagnose, kDiagnosed, ""},
    {"diagnose", "--next-out", false, kDiagnose, kDiagnosed, ""},
    {"simulate", "--json", false, kSimulate, kSimulated, ""},
    {"simulate", "--log-out", false, kSimulate, kSimulated, ""},
    {"simulate", "--out-dir", true, kSimulate, kSimulated, "trace.log"},
    {"simulate", "--out-dir", true, kSimulate, kSimulated, "vehicle.dbc"},
    {"simulate", "--out-dir", true, kSimulate, kSimulated, "beltgrip.toml"},
    {"simulate", "--out-dir", true, kSimulate, kSimulated, "truth.json"},
    {"history", "--json", false, {"history", "@history.db"}, {"history.db"}, ""},
    {"history", "--csv", false, {"history", "@history.db"}, {"history.db"}, ""},
    {"dbc show", "--json", false, {"dbc", "show", "@vehicle.dbc"}, {"vehicle.dbc"}, ""},
    {"dbc decode", "--json", false, kDecode, {"vehicle.dbc", "trace.log"}, ""},
    {"dbc decode", "--csv", false, kDecode, {"vehicle.dbc", "trace.log"}, ""},
    {"dbc decode", "--text", false, kDecode, {"vehicle.dbc", "trace.log"}, ""},
};

// Twenty seconds at the overdrive end stop.
std::string steady_run(double speed_rad_s) {
  std::ostringstream out;
  out << "t[s],primary_speed[rad/s],secondary_speed[rad/s],secondary_pressure[Pa],"
         "primary_torque[Nm]\n";
  for (int i = 0; i < 400; ++i) {
    out << 0.05 * i << ',' << speed_rad_s + 0.01 * (i % 3) << ',' << 2.24 * speed_rad_s
        << ",300000," << 50.0 + 0.1 * (i % 5) << '\n';
  }
  return out.str();
}

class OutputFiles : public testing::TestWithParam<Output> {
 protected:
  static void SetUpTestSuite() {
    source_ = new Workplace();
    const Workplace& in = *source_;
    const RunResult made =
        beltgrip({"simulate", "--start", "88", "--duration", "1", "--out-dir", in.path("")});
    ASSERT_EQ(made.status, 0) << made.err;
    in.write("run.csv", steady_run(105.0));
    in.write("held.csv", steady_run(106.0));
    in.write("scene.toml", "name = \"scene\"\n");
    in.write("model.toml", "[variator]\n");
    daemon::HistoryRow row;
    ASSERT_TRUE(daemon::HistoryDb::open(in.path("history.db")).db->append(row));
  }
  static void TearDownTestSuite() { delete source_; }

  OutputFiles() {
    const Output& output = GetParam();
    for (const std::string& each : output.inputs) place.write(each, source_->read(each));
    fs::create_directory(place.path("out"));
    // What its scenario makes of the files beside the one that is looked at.
    target = output.file.empty() ? place.path("result") : place.path("out/" + output.file);
  }

  RunResult run_to(const std::string& path, bool force = false) const {
    const Output& output = GetParam();
    std::vector<std::string> arguments;
    for (const std::string& each : output.arguments) {
      arguments.push_back(each.starts_with("@") ? place.path(each.substr(1)) : each);
    }
    arguments.insert(arguments.end(), {output.option, path});
    if (force) arguments.emplace_back("--force");
    return beltgrip(arguments);
  }
  RunResult run(bool force = false) const {
    return run_to(GetParam().file.empty() ? target : place.path("out"), force);
  }
  std::string text(const std::string& path) const {
    return place.read(fs::relative(path, place.path("")).string());
  }
  // Nothing of a run stays beside its outputs.
  void expect_no_parts() const {
    for (const auto& each : fs::recursive_directory_iterator(place.path(""))) {
      EXPECT_FALSE(each.path().filename().string().starts_with(".beltgrip")) << each.path();
    }
  }
  void expect_input_refused(const std::string& input, const std::string& as) const {
    const RunResult result = run();
    EXPECT_EQ(result.status, 64) << as << ": " << result.err;
    EXPECT_NE(result.err.find("an output that is an input"), std::string::npos) << result.err;
    EXPECT_EQ(lines(result.err), 1) << result.err;
    EXPECT_EQ(place.read(input), source_->read(input)) << as;
    fs::remove(target);
  }

  static Workplace* source_;
  Workplace place;
  std::string target;
};
Workplace* OutputFiles::source_ = nullptr;

TEST_P(OutputFiles, AnInputIsRefusedUnderAnyName) {
  for (const std::string& input : GetParam().inputs) {
    const std::string path = place.path(input);
    fs::create_symlink(path, target);
    expect_input_refused(input, input + " through a symbolic link");
    fs::create_symlink(input, place.path("link"));
    fs::create_symlink(place.path("link"), target);
    expect_input_refused(input, input + " through two");
    fs::remove(place.path("link"));
    fs::create_hard_link(path, target);
    expect_input_refused(input, input + " through a hard link");
    if (GetParam().file.empty()) {
      const RunResult result = run_to(path);
      EXPECT_EQ(result.status, 64) << input << ": " << result.err;
      EXPECT_EQ(place.read(input), source_->read(input)) << input;
      EXPECT_EQ(run_to(path, GetParam().kept).status, 64) << "also by force";
      EXPECT_EQ(place.read(input), source_->read(input)) << input;
    }
  }
  expect_no_parts();
}

// What a list of recordings may follow, and that is no recording itself.
const std::set<std::string> kResults{"report --out",    "calibrate --json",  "replay --json",
                                     "diagnose --json", "diagnose --report", "diagnose --next-out",
                                     "history --json"};
std::vector<Output> results() {
  std::vector<Output> out;
  std::copy_if(kOutputs.begin(), kOutputs.end(), std::back_inserter(out),
               [](const Output& each) { return kResults.contains(each.title()); });
  return out;
}
class Results : public OutputFiles {};

// What `--json run*.csv` comes to in a shell: the first recording is the file of the result.
TEST_P(Results, NoRecordingIsReplaced) {
  place.write("other.csv", kMark);
  const RunResult result = run_to(place.path("other.csv"));
  EXPECT_EQ(result.status, 64) << result.err;
  EXPECT_NE(result.err.find("other.csv: found a recording"), std::string::npos) << result.err;
  EXPECT_EQ(lines(result.err), 1) << result.err;
  EXPECT_EQ(place.read("other.csv"), kMark);
  expect_no_parts();
}

TEST_P(OutputFiles, AFileThatExistsIsReplacedWhereItMayBe) {
  place.write(fs::relative(target, place.path("")).string(), kMark);
  ASSERT_EQ(chmod(target.c_str(), 0640), 0);
  RunResult result = run();
  if (GetParam().kept) {
    EXPECT_EQ(result.status, 73) << result.err;
    EXPECT_NE(result.err.find("--force"), std::string::npos) << result.err;
    EXPECT_EQ(text(target), kMark);
    result = run(true);
  }
  EXPECT_EQ(result.status, 0) << result.err;
  EXPECT_NE(text(target), kMark);
  struct stat found {};
  ASSERT_EQ(stat(target.c_str(), &found), 0);
  EXPECT_EQ(found.st_mode & 0777, 0640U);
  expect_no_parts();
}

// A link stays one: what it names is written.
TEST_P(OutputFiles, ALinkIsFollowed) {
  fs::create_directory(place.path("elsewhere"));
  fs::create_symlink("../elsewhere/file", target.substr(0, target.rfind('/')) + "/second");
  fs::create_symlink(GetParam().file.empty() ? "elsewhere/file" : "second", target);
  const RunResult result = run();
  EXPECT_EQ(result.status, 0) << result.err;
  EXPECT_TRUE(fs::is_symlink(target));
  EXPECT_TRUE(fs::is_regular_file(place.path("elsewhere/file")));
  expect_no_parts();
}

// A run that fails leaves what was there.
TEST_P(OutputFiles, AFailureLeavesTheFormerFile) {
  place.write(fs::relative(target, place.path("")).string(), kMark);
  place.write(GetParam().inputs.front(), "");
  const RunResult result = run(GetParam().kept);
  EXPECT_NE(result.status, -1);
  if (result.status != 0) {
    EXPECT_EQ(text(target), kMark) << result.err;
  }
  expect_no_parts();
}

std::string name_of(const testing::TestParamInfo<Output>& info) {
  std::string name;
  for (const char c : info.param.title() + info.param.file) {
    if (std::isalnum(static_cast<unsigned char>(c)) != 0) name += c;
  }
  return name;
}
INSTANTIATE_TEST_SUITE_P(, OutputFiles, testing::ValuesIn(kOutputs), name_of);
INSTANTIATE_TEST_SUITE_P(, Results, testing::ValuesIn(results()), name_of);

// The table above is whole: each option of the program that takes a file or folder is known.
TEST(OutputTable, HasEveryOption) {
  std::set<std::string> known;
  for (const Output& each : kOutputs) known.insert(each.title());
  const auto look = [&](const std::string& command, std::vector<std::string> arguments) {
    arguments.emplace_back("--help");
    std::istringstream help(beltgrip(arguments).out);
    for (std::string line; std::getline(help, line);) {
      const std::size_t begin = line.find("--"), end = line.find(' ', begin);
      if (line.rfind("  --", 0) != 0) continue;
      const std::string_view value = std::string_view(line).substr(end + 1);
      if (!value.starts_with("FILE") && !value.starts_with("FOLDER")) continue;
      const std::string option = line.substr(begin, end - begin);
      if (kNoOutputs.contains(option)) continue;
      EXPECT_TRUE(known.erase(command + " " + option) == 1) << command << " " << option;
    }
  };
  for (const char* name : {"run-demo", "init", "calibrate", "replay", "report", "simulate",
                           "monitor", "diagnose", "history", "status"}) {
    look(name, {name});
  }
  for (const char* name : {"show", "decode", "encode", "check"})
    look(std::string("dbc ") + name, {"dbc", name});
  for (const char* name : {"up", "down", "status"}) look(std::string("can ") + name, {"can", name});
  EXPECT_TRUE(known.empty()) << *known.begin();
}

class OutputPairs : public testing::Test {
 protected:
  OutputPairs() {
    EXPECT_EQ(
        beltgrip({"simulate", "--start", "88", "--duration", "1", "--out-dir", place.path("")})
            .status,
        0);
  }
  Workplace place;
};

TEST_F(OutputPairs, TwoOutputsAreTwoFiles) {
  const RunResult result = beltgrip(
      {"replay", place.path("trace.log"), "--config", place.path("beltgrip.toml"), "--json",
       place.path("x"), "--trace",
       place.path("../") + fs::path(place.path("")).parent_path().filename().string() + "/x"});
  EXPECT_EQ(result.status, 64) << result.err;
  EXPECT_FALSE(fs::exists(place.path("x")));
}

TEST_F(OutputPairs, AnInputOnAStandardStreamIsOne) {
  const std::string log = place.read("trace.log");
  const RunResult result = beltgrip({"replay", "-", "--config", place.path("beltgrip.toml"),
                                     "--log-out", place.path("trace.log")},
                                    place.path("trace.log"));
  EXPECT_EQ(result.status, 64) << result.err;
  EXPECT_EQ(place.read("trace.log"), log);
  // beltgrip ... --log-out - >>trace.log
  const RunResult appended =
      test::run({"sh", "-c", "\"$0\" replay \"$1\" --config \"$2\" --log-out - >>\"$1\"",
                 program_path(), place.path("trace.log"), place.path("beltgrip.toml")},
                Milliseconds{60000});
  EXPECT_EQ(appended.status, 64) << appended.err;
  EXPECT_EQ(place.read("trace.log"), log);
}

TEST_F(OutputPairs, DevicesAndPipesAreWrittenAsTheyAre) {
  for (const char* path : {"/dev/null", "/dev/stdout"}) {
    const RunResult result = beltgrip({"dbc", "show", place.path("vehicle.dbc"), "--json", path});
    EXPECT_EQ(result.status, 0) << result.err;
  }
  const std::string full =
      beltgrip({"dbc", "show", place.path("vehicle.dbc"), "--json", "/dev/full"}).err;
  EXPECT_NE(full.find("cannot be written"), std::string::npos) << full;
  for (const char* shown : {"help", "help replay", "--version", "replay --help"}) {
    const RunResult result =
        test::run({"sh", "-c", std::string("\"$0\" ") + shown + " >/dev/full", program_path()},
                  Milliseconds{60000});
    EXPECT_EQ(result.status, 74) << shown;
    EXPECT_EQ(lines(result.err), 1) << result.err;
  }
  const RunResult piped =
      test::run({"sh", "-c",
                 "mkfifo \"$2/p\" && (cat \"$2/p\" & \"$0\" dbc show \"$1\" --json \"$2/p\"; wait)",
                 program_path(), place.path("vehicle.dbc"), place.path("")},
                Milliseconds{60000});
  EXPECT_EQ(piped.status, 0) << piped.err;
  EXPECT_NE(piped.out.find("\"messages\":"), std::string::npos);
  EXPECT_TRUE(fs::is_fifo(place.path("p")));
}

}  // namespace
}  // namespace beltgrip::test
