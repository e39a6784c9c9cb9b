// What help says: every value has a name, every command an example, and the examples that need no
// bus and no daemon run as they stand, one after the other.
#include <gtest/gtest.h>

#include <algorithm>
#include <sstream>
#include <string>
#include <vector>

#include "tests/support/program.h"

namespace beltgrip::test {
namespace {

using Command = std::vector<std::string>;

std::string help_of(Command command) {
  command.emplace_back("--help");
  const RunResult result = beltgrip(command);
  EXPECT_EQ(result.status, 0) << result.err;
  return result.out;
}

// The indented lines below a headline.
std::vector<std::string> section(const std::string& help, const std::string& headline) {
  std::vector<std::string> found;
  std::istringstream in(help);
  bool inside = false;
  for (std::string line; std::getline(in, line);) {
    if (inside && line.starts_with("  ")) found.push_back(line.substr(2));
    inside = line == headline || (inside && line.starts_with("  "));
  }
  return found;
}

// Every command that has no commands below it.
void add_leaves(const Command& above, std::vector<Command>& leaves) {
  for (const std::string& line : section(help_of(above), "Subcommands:")) {
    if (line.starts_with(' ')) continue;  // the second line of a help
    Command command = above;
    command.push_back(line.substr(0, line.find(' ')));
    const std::size_t before = leaves.size();
    add_leaves(command, leaves);
    if (leaves.size() == before) leaves.push_back(command);
  }
}

std::vector<Command> leaves() {
  std::vector<Command> found;
  add_leaves({}, found);
  return found;
}

TEST(Help, EveryValueHasANameAndEveryCommandAnExample) {
  const std::vector<Command> commands = leaves();
  ASSERT_GT(commands.size(), 15U);
  for (const Command& command : commands) {
    const std::string help = help_of(command);
    std::string text = "beltgrip";
    for (const std::string& word : command) text += " " + word;
    EXPECT_EQ(help.find("TEXT"), std::string::npos) << help;
    const std::vector<std::string> examples = section(help, "Examples:");
    EXPECT_FALSE(examples.empty()) << help;
    for (const std::string& example : examples) {
      EXPECT_NE(example.find(text), std::string::npos) << example;
    }
  }
}

TEST(Help, IsASubcommandToo) {
  EXPECT_EQ(beltgrip({"help", "help"}).out, beltgrip({"--help"}).out);
  EXPECT_EQ(beltgrip({"help"}).out, beltgrip({"--help"}).out);
  EXPECT_EQ(beltgrip({"help", "dbc", "show"}).out, beltgrip({"dbc", "show", "--help"}).out);
  const RunResult unknown = beltgrip({"help", "reply"});
  EXPECT_EQ(unknown.status, 64);
  EXPECT_EQ(unknown.err, "beltgrip: unknown subcommand 'reply' (see beltgrip --help)\n");
  EXPECT_EQ(beltgrip({"dbc", "decode"}).err,
            "beltgrip: --dbc is required (see beltgrip dbc decode --help)\n");
  EXPECT_EQ(beltgrip({"-V"}).out, beltgrip({"--version"}).out);
  EXPECT_EQ(beltgrip({"dbc", "show", "-V"}).out, beltgrip({"--version"}).out);
}

// The drive of the first is what the others read.
TEST(Help, ExamplesRun) {
  std::vector<std::string> examples;
  for (const Command& command : leaves()) {
    for (const std::string& example : section(help_of(command), "Examples:")) {
      const bool makes = example.ends_with("--out-dir drive");
      if (makes) examples.insert(examples.begin(), example);
      if (!makes && example.find("drive/") != std::string::npos) examples.push_back(example);
    }
  }
  ASSERT_GT(examples.size(), 8U);
  const Workplace place;
  const std::string program = program_path();
  const std::string folder = program.substr(0, program.rfind('/'));
  for (const std::string& example : examples) {
    const RunResult result =
        run({"/bin/sh", "-c",
             "cd '" + place.path("") + "' && PATH='" + folder + "':$PATH && " + example},
            Milliseconds(120'000));
    EXPECT_EQ(result.status, 0) << example << "\n" << result.err;
  }
}

}  // namespace
}  // namespace beltgrip::test
