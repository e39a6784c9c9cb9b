// Options, flags and subcommands of a program. What reads them is CLI11, whose headers cost ten
// seconds in every file that includes them; so only command_line.cpp does. The values here are
// handles: what they name lives as long as the Program.
#pragma once

#include <functional>
#include <memory>
#include <string>
#include <vector>

namespace CLI {
class App;
class Option;
}  // namespace CLI

namespace beltgrip::command_line {

class Option {
 public:
  explicit Option(CLI::Option* option) : option_(option) {}
  Option required() const;
  Option type_name(const std::string& name) const;
  // Help shows the value that the variable has now.
  Option capture_default_str() const;
  // False: each value wants the option's name before it.
  Option allow_extra_args(bool allowed) const;
  // One word may hold several values with this between them.
  Option delimiter(char between) const;
  // The environment variable that is read where the option is not given.
  Option envname(const std::string& name) const;
  // T: int, unsigned or double, which help names.
  template <typename T>
  Option range(T smallest, T largest) const;
  Option one_of(const std::vector<std::string>& values) const;

 private:
  CLI::Option* option_;
};

class Command {
 public:
  explicit Command(CLI::App* app) : app_(app) {}
  // The types are listed at the end of command_line.cpp.
  template <typename T>
  Option add_option(const std::string& name, T& value, const std::string& help = {}) const;
  Option add_flag(const std::string& name, bool& value, const std::string& help = {}) const;
  Command add_subcommand(const std::string& name, const std::string& help) const;
  // Known, but not shown in help; takes any arguments.
  Command add_hidden_subcommand(const std::string& name) const;
  // A command line that help shows below the options, in the order of the calls.
  void example(const std::string& line) const;
  // Exactly one subcommand must be given.
  void require_subcommand() const;
  void set_version(const std::string& text) const;
  // Called by parse() when the command is given.
  void callback(std::function<void()> function) const;

 protected:
  CLI::App* app_;
};

enum class Parsed { kGoOn, kShown, kWrong };

class Program : public Command {
 public:
  explicit Program(const std::string& help);
  ~Program();
  Program(const Program&) = delete;
  Program& operator=(const Program&) = delete;

  void set_name(const std::string& name);
  void set_column_width(std::size_t width);
  // Every subcommand that help shows answers --version too.
  void set_version_of_subcommands(const std::string& text);
  bool has_subcommand(const std::string& name) const;

  // kShown: help or version stands on standard output. kWrong: error() says why, chosen() by which
  // subcommand it was reached. What a callback throws comes through.
  Parsed parse(int argc, char** argv);
  const std::string& error() const { return error_; }
  std::vector<std::string> chosen() const;

 private:
  std::unique_ptr<CLI::App> owned_;
  std::string error_;
};

}  // namespace beltgrip::command_line
