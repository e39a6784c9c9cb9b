// Each line of a document's code that calls beltgrip or beltgripd is run, in the order in which it
// stands there, beside the files that it names: a drive of a simulated car and its DBC. There is no
// CAN interface.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>
#include <string_view>
#include <vector>

#include "tests/support/program.h"

namespace beltgrip::test {
namespace {

namespace fs = std::filesystem;
constexpr Milliseconds kLimit{120'000};

// How a line ends that does not end with 0. The first that it holds counts.
struct Ending {
  std::string_view part;
  int status;
  const char* why;
};
constexpr int kNotRun = -2;
constexpr std::array kEndings{
    Ending{"--follow", kNotRun, "it goes on for ever"},
    Ending{"run-demo", kNotRun, "34 s in real time: program_test"},
    Ending{"/var/lib", kNotRun, "it shows what this machine has"},
    Ending{"beltgrip history --config", 66, "no daemon has kept one"},
    Ending{"beltgrip history --", 0, "from logs"},
    Ending{"beltgrip history car17", 0, "from logs"},
    Ending{"beltgrip history fleet", 0, "from logs"},
    Ending{"beltgrip history", kNotRun, "it shows what this machine has"},
    Ending{"beltgripd --config", 69, "no CAN interface"},
    Ending{"monitor can0", 69, "no CAN interface"},
    Ending{"status can0", 69, "no daemon"},
    Ending{"beltgrip status", kNotRun, "it shows what this machine has"},
    Ending{"beltgrip can ", 69, "no CAN interface"},
    Ending{"--live", 69, "no CAN interface"},
    Ending{"--bus vcan0", 69, "no CAN interface"},
    Ending{"scan.csv", 66, "somebody else's recording: table_cli_test has one like it"},
    Ending{"diagnose --config", 66, "no tables: it would take minutes"},
    Ending{"diagnose run", 66, "the same"},
    Ending{"simulate --model model.toml", 66, "what diagnose would have written"},
};

// Lines of code blocks that call one of the programs or make a file, without their remarks.
std::vector<std::string> command_lines(const std::string& text) {
  std::vector<std::string> found;
  bool code = false;
  for (std::size_t from = 0, to; (to = text.find('\n', from)) != std::string::npos; from = to + 1) {
    std::string line = text.substr(from, to - from);
    if (line.starts_with("```")) code = !code;
    if (line.starts_with("  ")) line.erase(0, 2);  // the examples of a help
    const bool ours = line.starts_with("build/bin/beltgrip") || line.starts_with("beltgrip ") ||
                      line.starts_with("echo ");
    if (!code || !ours || line.find('$') != std::string::npos) continue;
    line.erase(std::min(line.find(" # "), line.size()));
    line.erase(line.find_last_not_of(' ') + 1);
    found.push_back(std::move(line));
  }
  return found;
}

std::string read_file(const fs::path& path) {
  std::ifstream in(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), {}};
}

class CommandLines : public testing::TestWithParam<const char*> {
 protected:
  void SetUp() override {
    ASSERT_EQ(
        beltgrip({"simulate", "--scenario", "demo", "--out-dir", place_.path("drive")}).status, 0);
    for (const char* folder : {"logs", "car17", "build/bin"}) {
      fs::create_directories(place_.path(folder));
    }
    for (const char* log :
         {"drive.log", "logs/a.log", "logs/b.log", "logs/a.log.zst", "car17/a.log.zst"}) {
      fs::copy_file(place_.path("drive/trace.log"), place_.path(log));
    }
    fs::copy_file(place_.path("drive/vehicle.dbc"), place_.path("vehicle.dbc"));
    for (const char* config : {"beltgrip.toml", "mycar.toml"}) {
      fs::copy_file(place_.path("drive/beltgrip.toml"), place_.path(config));
    }
    for (const char* program : {"beltgrip", "beltgripd"}) {
      fs::create_symlink(program_path(program), place_.path(std::string("build/bin/") + program));
    }
  }
  RunResult run_line(std::string line) {
    // A machine may have such an interface.
    for (std::size_t at = 0; (at = line.find(" can0", at)) != std::string::npos; at += 7) {
      line.insert(at + 1, "no");
    }
    for (std::size_t at = 0; (at = line.find(" vcan0", at)) != std::string::npos; at += 8) {
      line.insert(at + 1, "no");
    }
    return run({"bash", "-c", "cd " + place_.path("") + " && PATH=$PWD/build/bin:$PATH && " + line},
               kLimit);
  }
  // What another line has made is not replaced.
  void make_room(const std::string& line) {
    for (const std::string_view option : {"--out ", "--out-dir ", "--model-out "}) {
      const std::size_t at = line.find(option);
      if (at == std::string::npos) continue;
      const std::size_t from = at + option.size();
      fs::remove_all(place_.path(line.substr(from, line.find(' ', from) - from)));
    }
  }
  Workplace place_;
};

TEST_P(CommandLines, DoWhatTheDocumentSays) {
  const std::vector<std::string> lines =
      command_lines(read_file(fs::path(BELTGRIP_SOURCE_DIR) / GetParam()));
  EXPECT_FALSE(lines.empty());
  for (const std::string& line : lines) {
    const auto* ending = std::find_if(kEndings.begin(), kEndings.end(), [&](const Ending& each) {
      return line.find(each.part) != std::string::npos;
    });
    const int expected = ending == kEndings.end() ? 0 : ending->status;
    if (expected == kNotRun) continue;
    make_room(line);
    const RunResult result = run_line(line);
    EXPECT_EQ(result.status, expected) << line << "\n" << result.err;
  }
}

INSTANTIATE_TEST_SUITE_P(, CommandLines,
                         testing::Values("README.md", "tools/OWN_CAR.md", "tools/COMMANDS.md",
                                         "tools/DIAGNOSE.md", "tools/FLEET.md",
                                         "systemd/SERVICE.md"));

// Every other document has none.
TEST(CommandLinesOf, NoFurtherDocument) {
  std::vector<std::string> with;
  const fs::path root(BELTGRIP_SOURCE_DIR);
  for (auto each = fs::recursive_directory_iterator(root); each != fs::end(each); ++each) {
    const std::string path = fs::relative(each->path(), root).string();
    if (each->is_directory() && (path.starts_with("build") || path.starts_with("."))) {
      each.disable_recursion_pending();
    }
    if (each->path().extension() != ".md") continue;
    if (!command_lines(read_file(each->path())).empty()) with.push_back(path);
  }
  std::sort(with.begin(), with.end());
  EXPECT_EQ(with,
            (std::vector<std::string>{"README.md", "systemd/SERVICE.md", "tools/COMMANDS.md",
                                      "tools/DIAGNOSE.md", "tools/FLEET.md", "tools/OWN_CAR.md"}));
}

TEST(CommandLinesOf, ADocumentStandInItsCode) {
  EXPECT_EQ(command_lines(
                "beltgrip x\n```sh\nbeltgrip a  # b\nls\nbuild/bin/beltgripd\nbeltgrip $c\n```\n"
                "beltgrip y\n"),
            (std::vector<std::string>{"beltgrip a", "build/bin/beltgripd"}));
}

}  // namespace
}  // namespace beltgrip::test
