#include "daemon/command_line/command_line.h"

#include <CLI/CLI.hpp>
#include <cmath>
#include <cstdint>
#include <optional>
#include <type_traits>
#include <utility>

namespace beltgrip::command_line {

namespace {
constexpr const char* kVersionFlag = "-V,--version";

void set_version_below(CLI::App& app, const std::string& text) {
  for (CLI::App* command : app.get_subcommands(nullptr)) {
    if (command->get_group().empty()) continue;
    command->set_version_flag(kVersionFlag, text);
    set_version_below(*command, text);
  }
}

}  // namespace

Option Option::required() const { return Option(option_->required()); }

Option Option::type_name(const std::string& name) const { return Option(option_->type_name(name)); }

Option Option::capture_default_str() const { return Option(option_->capture_default_str()); }

Option Option::allow_extra_args(bool allowed) const {
  return Option(option_->allow_extra_args(allowed));
}

Option Option::delimiter(char between) const { return Option(option_->delimiter(between)); }

Option Option::envname(const std::string& name) const { return Option(option_->envname(name)); }

template <typename T>
Option Option::range(T smallest, T largest) const {
  return Option(option_->check(CLI::Range(smallest, largest)));
}

Option Option::one_of(const std::vector<std::string>& values) const {
  return Option(option_->check(CLI::IsMember(values)));
}

template <typename T>
Option Command::add_option(const std::string& name, T& value, const std::string& help) const {
  CLI::Option* const option = app_->add_option(name, value, help);
  // No range holds against NaN, which is neither below nor above it.
  if constexpr (std::is_same_v<T, double> || std::is_same_v<T, std::optional<double>>) {
    option->check([](const std::string& text) {
      double number = 0.0;
      const bool finite = CLI::detail::lexical_cast(text, number) && std::isfinite(number);
      return finite ? std::string() : "found " + text + ", expected a finite number";
    });
  }
  return Option(option);
}

Option Command::add_flag(const std::string& name, bool& value, const std::string& help) const {
  return Option(app_->add_flag(name, value, help));
}

Command Command::add_subcommand(const std::string& name, const std::string& help) const {
  return Command(app_->add_subcommand(name, help));
}

Command Command::add_hidden_subcommand(const std::string& name) const {
  CLI::App* command = app_->add_subcommand(name)->group("");
  command->allow_extras();
  command->set_help_flag();
  return Command(command);
}

void Command::require_subcommand() const { app_->require_subcommand(1); }

void Command::set_version(const std::string& text) const {
  app_->set_version_flag(kVersionFlag, text);
}

void Command::example(const std::string& line) const {
  const std::string before = app_->get_footer();
  app_->footer((before.empty() ? "Examples:" : before) + "\n  " + line);
}

void Command::callback(std::function<void()> function) const {
  app_->callback(std::move(function));
}

Program::Program(const std::string& help)
    : Command(nullptr), owned_(std::make_unique<CLI::App>(help)) {
  app_ = owned_.get();
}

Program::~Program() = default;

void Program::set_name(const std::string& name) { owned_->name(name); }

void Program::set_column_width(std::size_t width) { owned_->get_formatter()->column_width(width); }

void Program::set_version_of_subcommands(const std::string& text) {
  set_version_below(*owned_, text);
}

bool Program::has_subcommand(const std::string& name) const {
  for (const CLI::App* command : owned_->get_subcommands(nullptr)) {
    if (command->get_name() == name) return true;
  }
  return false;
}

Parsed Program::parse(int argc, char** argv) {
  try {
    owned_->parse(argc, argv);
  } catch (const CLI::Success& success) {  // --help, --version
    owned_->exit(success);
    return Parsed::kShown;
  } catch (const CLI::ParseError& error) {
    error_ = error.what();
    return Parsed::kWrong;
  }
  return Parsed::kGoOn;
}

std::vector<std::string> Program::chosen() const {
  std::vector<std::string> names;
  const CLI::App* command = owned_.get();
  while (!command->get_subcommands().empty()) {
    command = command->get_subcommands().front();
    names.push_back(command->get_name());
  }
  return names;
}

template Option Option::range(int, int) const;
template Option Option::range(unsigned, unsigned) const;
template Option Option::range(std::uint64_t, std::uint64_t) const;
template Option Option::range(double, double) const;

#define BELTGRIP_OPTION_TYPE(...)                                                                 \
  template Option Command::add_option(const std::string&, __VA_ARGS__& value, const std::string&) \
      const
BELTGRIP_OPTION_TYPE(std::string);
BELTGRIP_OPTION_TYPE(std::vector<std::string>);
BELTGRIP_OPTION_TYPE(int);
BELTGRIP_OPTION_TYPE(unsigned);
BELTGRIP_OPTION_TYPE(std::uint64_t);
BELTGRIP_OPTION_TYPE(double);
BELTGRIP_OPTION_TYPE(std::optional<int>);
BELTGRIP_OPTION_TYPE(std::optional<unsigned>);
BELTGRIP_OPTION_TYPE(std::optional<double>);
#undef BELTGRIP_OPTION_TYPE

}  // namespace beltgrip::command_line
