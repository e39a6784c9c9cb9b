// The program beltgrip: registers the subcommands, runs one, turns every failure into one line on
// standard error and a sysexits code.
#include <algorithm>
#include <cstdio>
#include <exception>
#include <string>
#include <string_view>
#include <vector>

#include "tools/cli/can.h"
#include "tools/cli/command.h"
#include "tools/cli/dbc.h"
#include "tools/cli/diagnose.h"
#include "tools/cli/status.h"
#include "tools/cli/stop_signals.h"
#include "tools/text/terminal.h"

namespace beltgrip::cli {
namespace {

// One line for each line of the text; none when everything has been said.
int fail(const std::string& text, int exit_code) {
  std::fflush(stdout);
  for (std::size_t begin = 0; begin < text.size();) {
    const std::size_t end = std::min(text.find('\n', begin), text.size());
    text::complain(text.substr(begin, end - begin));
    begin = end + 1;
  }
  return exit_code;
}

std::string one_line(std::string text) {
  for (char& c : text) {
    if (c == '\n' || c == '\r') c = ' ';
  }
  return text;
}

// The first argument, where it is neither an option nor a subcommand.
std::string unknown_subcommand(const command_line::Program& app, int argc, char** argv) {
  if (argc < 2 || argv[1][0] == '-' || app.has_subcommand(argv[1])) return {};
  return argv[1];
}

// "beltgrip help dbc show" is "beltgrip dbc show --help", and "beltgrip help" is "beltgrip --help".
std::vector<char*> without_help_word(int argc, char** argv) {
  static char help[] = "--help";
  std::vector<char*> words(argv, argv + argc);
  const auto is_help = [](const char* word) { return std::string_view(word) == "help"; };
  if (argc > 1 && is_help(argv[1])) {
    while (words.size() > 1 && is_help(words[1])) words.erase(words.begin() + 1);  // "help help"
    words.push_back(help);
  }
  return words;
}

int run(std::vector<char*> words) {
  const int argc = static_cast<int>(words.size());
  char** argv = words.data();
  command_line::Program app{
      "BeltGrip: measures the belt-pulley friction of a metal pushbelt CVT over CAN."};
  app.set_name("beltgrip");
  app.set_version("beltgrip " BELTGRIP_VERSION);
  app.require_subcommand();
  app.set_column_width(34);
  add_run_demo(app);
  add_init(app);
  add_can(app);
  add_status(app);
  add_history(app);
  add_check(app);
  add_calibrate(app);
  add_replay(app);
  add_simulate(app);
  add_monitor(app);
  add_dbc(app);
  add_diagnose(app);
  add_report(app);
  app.set_version_of_subcommands("beltgrip " BELTGRIP_VERSION);
  if (const std::string name = unknown_subcommand(app, argc, argv); !name.empty()) {
    return fail("unknown subcommand '" + name + "' (see beltgrip --help)", kUsage);
  }
  try {
    switch (app.parse(argc, argv)) {
      case command_line::Parsed::kGoOn:
      case command_line::Parsed::kShown:
        break;
      case command_line::Parsed::kWrong: {
        std::string hint = "beltgrip";
        for (const std::string& name : app.chosen()) hint += " " + name;
        return fail(one_line(app.error()) + " (see " + hint + " --help)", kUsage);
      }
    }
  } catch (const Failure& failure) {
    return fail(failure.text, failure.exit_code);
  }
  if (std::fflush(stdout) != 0 || std::ferror(stdout) != 0) {
    return fail("standard output: cannot write", kCannotWrite);
  }
  return kDone;
}

}  // namespace
}  // namespace beltgrip::cli

int main(int argc, char** argv) {
  beltgrip::cli::take_stop_signals();
  try {
    const int exit_code = beltgrip::cli::run(beltgrip::cli::without_help_word(argc, argv));
    beltgrip::cli::end_if_cut();
    return exit_code;
  } catch (const std::exception& error) {
    beltgrip::text::complain(std::string("internal error: ") + error.what());
    return beltgrip::kInternal;
  }
}
