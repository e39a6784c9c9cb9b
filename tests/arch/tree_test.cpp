// The tree keeps its rules; and every rule is seen to fail on a planted violation.
#include <gtest/gtest.h>

#include <algorithm>
#include <ostream>

#include "tests/arch/tree_check.h"

namespace beltgrip::test {
namespace {

std::string lines(const std::vector<std::string>& found) {
  std::string text;
  for (const std::string& each : found) text += each + "\n";
  return text;
}

TEST(Tree, KeepsItsRules) {
  const std::vector<SourceFile> files = read_tree(BELTGRIP_SOURCE_DIR);
  ASSERT_GT(files.size(), 50U);  // the tree was found
  EXPECT_EQ(lines(check_tree(files)), "");
}

// Room for what everybody needs; the rest stands in its room.
constexpr std::size_t kReadmeMax = 7168;

TEST(Tree, TheReadmeIsShortAndEveryDocumentThatItNamesIsThere) {
  const std::vector<SourceFile> files = read_tree(BELTGRIP_SOURCE_DIR);
  const auto has = [&](std::string_view path) {
    return std::any_of(files.begin(), files.end(),
                       [&](const SourceFile& each) { return each.path == path; });
  };
  const auto readme = std::find_if(files.begin(), files.end(),
                                   [](const SourceFile& each) { return each.path == "README.md"; });
  ASSERT_NE(readme, files.end());
  EXPECT_LE(readme->text.size(), kReadmeMax);
  const std::vector<std::string> named = documents_named_in(readme->text);
  EXPECT_GE(named.size(), 10U);
  for (const std::string& path : named) EXPECT_TRUE(has(path)) << path;
}

TEST(Tree, EveryRoomSaysWhatItIsFor) {
  int rooms = 0;
  for (const SourceFile& file : read_tree(BELTGRIP_SOURCE_DIR)) {
    if (!file.path.ends_with("/CMakeLists.txt")) continue;
    ++rooms;
    EXPECT_TRUE(file.text.starts_with("# ")) << file.path;
  }
  EXPECT_GT(rooms, 60);
}

TEST(DocumentsNamedIn, FindsThemInBackticks) {
  EXPECT_EQ(documents_named_in("see `a/B.md`, `x.toml` and `tools/packages.txt`; B.md"),
            (std::vector<std::string>{"a/B.md", "tools/packages.txt"}));
}

struct Planted {
  std::string path;
  std::string text;
};

void PrintTo(const Planted& planted, std::ostream* out) {
  *out << planted.path << ": " << planted.text;
}

class Violation : public testing::TestWithParam<Planted> {};

TEST_P(Violation, IsFoundWithItsLine) {
  const auto found = check_tree({{GetParam().path, "\n" + GetParam().text + "\n"}});
  ASSERT_EQ(found.size(), 1U) << lines(found);
  EXPECT_TRUE(found[0].starts_with(GetParam().path + ":2: ")) << found[0];
}

INSTANTIATE_TEST_SUITE_P(
    Includes, Violation,
    testing::Values(Planted{"can_dbc/a.cpp", "#include \"estimator/physics/parameters.h\""},
                    Planted{"estimator/a.cpp", "#include \"can_dbc/frame/can_frame.h\""},
                    Planted{"estimator/a.h", "#  include <daemon/core/base/port.h>"},
                    Planted{"daemon/core/a.cpp", "#include \"daemon/io/socket_port.h\""},
                    Planted{"daemon/core/guard/tx_gate.cpp",
                            "#include \"estimator/physics/parameters.h\""},
                    Planted{"daemon/main.cpp", "#include \"tools/cli/command.h\""},
                    Planted{"tools/sim/a.cpp", "#include \"estimator/paper/paper_estimator.h\""},
                    Planted{"tools/cli/a.cpp", "#include \"tests/support/process.h\""},
                    Planted{"can_dbc/a.cpp", "#include <sys/socket.h>"},
                    Planted{"estimator/a.cpp", "#include <unistd.h>"},
                    Planted{"daemon/core/a.cpp", "#include <linux/can.h>"},
                    Planted{"daemon/core/a.cpp", "#include <spdlog/spdlog.h>"},
                    Planted{"daemon/core/a.cpp", "#include <chrono>"}));

INSTANTIATE_TEST_SUITE_P(
    Calls, Violation,
    testing::Values(Planted{"estimator/a.cpp", "auto t = std::time(nullptr);"},
                    Planted{"daemon/core/a.cpp", "clock_gettime(CLOCK_MONOTONIC, &t);"},
                    Planted{"tools/cli/a.cpp", "double v = std::stod(text);"},
                    Planted{"daemon/io/a.cpp", "port.send(frame);"},
                    Planted{"daemon/io/a.cpp", "port->send(frame);"},
                    Planted{"daemon/io/a.cpp", "n = sendmmsg(fd, m, 1, 0);"},
                    Planted{"daemon/io/a.cpp", "if (::write(fd, &frame, n) != n) return;"},
                    Planted{"estimator/a.cpp", "auto* p = new Sample;"},
                    Planted{"estimator/a.cpp", "samples.push_back(s);"},
                    Planted{"daemon/core/loop/pipeline.cpp", "std::function<void()> f;"},
                    Planted{"daemon/core/loop/loop.cpp", "throw 1;"},
                    Planted{"daemon/core/publish/a.h", "void collect(const SampleReport& report);"},
                    Planted{"daemon/core/experiment/a.cpp",
                            "#include \"daemon/core/loop/pipeline.h\""},
                    Planted{"daemon/core/loop/pipeline.cpp",
                            "now.clamp.secondary_force_N = report.request_force_N;"}));

INSTANTIATE_TEST_SUITE_P(Usings, Violation,
                         testing::Values(Planted{"can_dbc/a.cpp", "using beltgrip::Used;"},
                                         Planted{"tools/cli/a.cpp", "  using a::B; int c::B = 0;"},
                                         Planted{"tools/cli/a.cpp", "namespace fs = std::fs;"}));

// In pieces, so that they are not found in this file.
INSTANTIATE_TEST_SUITE_P(Texts, Violation,
                         testing::Values(Planted{"README.md", std::string("see http://deb") +
                                                                  ".debian.org/debian"},
                                         Planted{"tools/x", std::string("registry") + ".npmjs.org"},
                                         Planted{"systemd/x", std::string("cd /") + "work/main"}));

INSTANTIATE_TEST_SUITE_P(
    Installed, Violation,
    testing::Values(Planted{"tests/loop/a.cpp", "#if __has_include(<valgrind/callgrind.h>)"},
                    Planted{"tests/can_dbc/CMakeLists.txt", "find_package(benchmark QUIET)"},
                    Planted{"daemon/io/CMakeLists.txt", "pkg_check_modules(ZSTD libzstd)"}));

TEST(Tree, HasNoOtherFoldersAtTheTop) {
  EXPECT_EQ(check_tree({{"other/a.cpp", ""}, {".ci/run", ""}, {"notes.md", ""}}),
            (std::vector<std::string>{"other/a.cpp: not at the top of this tree",
                                      "notes.md: not at the top of this tree"}));
}

class Harmless : public testing::TestWithParam<Planted> {};

TEST_P(Harmless, IsNotTaken) {
  EXPECT_EQ(lines(check_tree({{GetParam().path, GetParam().text}})), "");
}

INSTANTIATE_TEST_SUITE_P(
    All, Harmless,
    testing::Values(Planted{"estimator/a.cpp", "// a new sample, push_back no longer"},
                    Planted{"estimator/a.cpp", "/* throw\n new */ int a;"},
                    Planted{"estimator/a.cpp", "const char* a = \"new \\\" throw\";"},
                    Planted{"estimator/a.cpp", "const char* a = R\"(new \" throw)\";"},
                    Planted{"estimator/a.cpp", "int renewed = 1'000'000; int n = renewed;"},
                    Planted{"estimator/a.cpp", "char c = '\"'; int n = 0; char d = '\"';"},
                    Planted{"daemon/core/config/load/load_config.cpp", "roles.push_back(role);"},
                    Planted{"can_dbc/a.cpp", "void Writer::write(int a) {}"},
                    Planted{"daemon/io/socket_port.cpp", "#include <sys/socket.h>"},
                    Planted{"tools/sim/a.cpp",
                            "#include \"estimator/physics/variator_geometry.h\""},
                    Planted{"tools/cli/a.cpp", "using a::B;\nB b;"},
                    Planted{"tools/cli/a.cpp", "namespace fs = std::fs;\nfs::path p;"},
                    Planted{"tools/cli/a.cpp", "using namespace a::b;\nusing enum a::E;"},
                    Planted{"README.md", "the framework/work of vcan"}));

TEST(Blank, KeepsLinesAndCode) {
  EXPECT_EQ(blank_comments_and_strings("a // b\nc /* d\ne */ f \"g\" 'h'\n"),
            "a     \nc     \n     f \" \" ' '\n");
}

}  // namespace
}  // namespace beltgrip::test
