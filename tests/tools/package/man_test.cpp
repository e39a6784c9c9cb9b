// The manual pages as the build makes them, against what the programs say.
#include <gtest/gtest.h>

#include <algorithm>
#include <regex>
#include <set>
#include <sstream>
#include <string>

#include "tests/support/program.h"

namespace beltgrip::test {
namespace {

constexpr Milliseconds kLimit{30'000};

std::string page(const std::string& name) {
  const RunResult result =
      run({"/bin/sh", "-c",
           "cd '" BELTGRIP_SOURCE_DIR "' && awk -f tools/package/man_options.awk tools/package/" +
               name},
          kLimit);
  EXPECT_EQ(result.status, 0) << result.err;
  return result.out;
}

// "--json", "-V", ... of a text; in a page with their dashes escaped.
std::set<std::string> options_of(std::string text) {
  text = std::regex_replace(text, std::regex("\\\\-"), "-");
  std::set<std::string> options;
  const std::regex option("(^|[\\s,])(--?[A-Za-z][A-Za-z-]*)");
  for (std::sregex_iterator it(text.begin(), text.end(), option), end; it != end; ++it) {
    options.insert((*it)[2]);
  }
  return options;
}

// The commands' sections, by name.
std::map<std::string, std::string> sections(const std::string& page) {
  std::map<std::string, std::string> sections;
  std::istringstream lines(page);
  std::string name;
  for (std::string line; std::getline(lines, line);) {
    if (line.starts_with(".S")) name = line.starts_with(".SS ") ? line.substr(4) : "";
    if (!name.empty()) sections[std::regex_replace(name, std::regex("\\\\-"), "-")] += line + '\n';
  }
  return sections;
}

TEST(ManualPage, TellsEveryOptionOfEveryCommand) {
  const auto told = sections(page("beltgrip.1"));
  EXPECT_GE(told.size(), 18U);
  std::size_t options = 0;
  for (const auto& [name, text] : told) {
    SCOPED_TRACE(name);
    std::istringstream words(name);
    std::vector<std::string> arguments;
    for (std::string word; words >> word;) arguments.push_back(word);
    arguments.erase(arguments.begin());  // "beltgrip"
    arguments.push_back("--help");
    const RunResult help = beltgrip(arguments);
    ASSERT_EQ(help.status, 0) << help.err;
    EXPECT_EQ(options_of(text), options_of(help.out));
    options += options_of(help.out).size();
  }
  EXPECT_GT(options, 100U);
}

TEST(ManualPage, HasEveryCommandThatHelpLists) {
  const auto told = sections(page("beltgrip.1"));
  std::istringstream lines(beltgrip({"--help"}).out);
  bool inside = false;
  std::size_t commands = 0;
  for (std::string line; std::getline(lines, line);) {
    if (inside && line.starts_with("  ")) {
      std::istringstream words(line);
      std::string name;
      words >> name;
      if (name == "help") continue;
      const auto found = std::find_if(told.begin(), told.end(), [&](const auto& section) {
        return (section.first + ' ').starts_with("beltgrip " + name + ' ');
      });
      EXPECT_NE(found, told.end()) << name;
      ++commands;
    }
    inside = line == "Subcommands:" || (inside && line.starts_with("  "));
  }
  EXPECT_GE(commands, 12U);
}

TEST(ManualPage, OfTheDaemonTellsItsOptions) {
  const std::set<std::string> told = options_of(page("beltgripd.8"));
  const RunResult help = run({program_path("beltgripd"), "--help"}, kLimit);
  ASSERT_EQ(help.status, 0);
  for (const std::string& option : options_of(help.out)) {
    if (option.size() == 2) continue;  // a short form
    EXPECT_TRUE(told.count(option) > 0) << option;
  }
}

TEST(ManualPage, OfTheConfigurationHasEveryKey) {
  std::string told = page("beltgrip.toml.5");
  const RunResult keys = run({program_path("beltgripd"), "--print-default-config"}, kLimit);
  ASSERT_EQ(keys.status, 0);
  told = std::regex_replace(told, std::regex("\\\\-"), "-");
  told = std::regex_replace(told, std::regex("\\\\e"), "\\");
  EXPECT_NE(told.find(keys.out), std::string::npos);
  EXPECT_GT(lines(keys.out), 200);
}

}  // namespace
}  // namespace beltgrip::test
