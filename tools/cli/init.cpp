// beltgrip init: a first configuration from DBC files, with every guess marked as one.
#include <filesystem>
#include <fstream>
#include <memory>
#include <sstream>
#include <string>
#include <vector>

#include "can_dbc/dbc_parser.h"
#include "daemon/core/config.h"
#include "tools/cli/command.h"
#include "tools/cli/output_file.h"
#include "tools/cli/role_guess.h"

namespace beltgrip::cli {

namespace {

constexpr std::size_t kAlternativesShown = 3;

struct Options {
  std::vector<std::string> dbc;
  std::string interface = "can0";
  std::string out = "-";
};

can::Database read_database(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  std::ostringstream text;
  if (!file || !(text << file.rdbuf())) throw Failure{kNoInput, path + ": cannot be read"};
  can::DbcParseResult result = can::parse_dbc(text.str());
  if (result.database.messages.empty()) {
    throw Failure{kBadInput, path + ": no readable message"};
  }
  return std::move(result.database);
}

// As the configuration will see it: relative to its own place.
std::string path_text(const std::string& dbc, const std::string& out) {
  if (out == "-" || std::filesystem::path(dbc).is_absolute()) return dbc;
  std::error_code error;
  const auto relative =
      std::filesystem::relative(dbc, std::filesystem::absolute(out).parent_path(), error);
  return (error || relative.empty() ? std::filesystem::path(dbc) : relative).generic_string();
}

std::string quoted(const std::string& text) {
  std::string result = "\"";
  for (const char c : text) {
    if (c == '"' || c == '\\') result += '\\';
    result += c;
  }
  return result + "\"";
}

std::string signal_text(const RoleCandidate& candidate) {
  return quoted(candidate.message->name + "." + candidate.signal->name);
}

std::string unit_remark(const RoleCandidate& candidate) {
  return candidate.signal->unit.empty() ? "no unit" : candidate.signal->unit;
}

void append_role(std::string& text, daemon::Role role, bool required,
                 const std::vector<can::Database>& databases) {
  std::string name(daemon::role_name(role));
  name.resize(std::max<std::size_t>(name.size(), 18), ' ');
  const std::vector<RoleCandidate> candidates = guess_role(role, databases);
  if (candidates.empty()) {
    if (required) text += "# " + name + " = \"Message.Signal\"   # NOT FOUND: enter it by hand\n";
    return;
  }
  const RoleCandidate& best = candidates.front();
  if (best.has_unit) {
    text += name + " = " + signal_text(best) + "   # guessed";
    if (!best.signal->unit.empty()) text += ", " + best.signal->unit;
    text += "\n";
  } else {
    text += "# " + name + " = { signal = " + signal_text(best) +
            ", unit = \"...\" }   # guessed; the DBC gives no unit: enter it\n";
  }
  for (std::size_t i = 1; i < candidates.size() && i <= kAlternativesShown; ++i) {
    text += "#   or " + signal_text(candidates[i]) + ", " + unit_remark(candidates[i]) + "\n";
  }
}

void run(const Options& options) {
  std::vector<can::Database> databases;
  databases.reserve(options.dbc.size());
  for (const std::string& path : options.dbc) databases.push_back(read_database(path));

  std::string text =
      "# Proposed by beltgrip init. Roles were guessed from the names and units in the DBC files:\n"
      "# check each line before use.\n\n[bus]\ninterface = " +
      quoted(options.interface) + "\ndbc       = [";
  for (std::size_t i = 0; i < options.dbc.size(); ++i) {
    text += (i > 0 ? ", " : "") + quoted(path_text(options.dbc[i], options.out));
  }
  text += "]\n\n[signals]\n";
  using daemon::Role;
  for (const Role role : {Role::kPrimarySpeed, Role::kSecondarySpeed, Role::kSecondaryPressure}) {
    append_role(text, role, true, databases);
  }
  const bool measured = !guess_role(Role::kPrimaryTorque, databases).empty();
  append_role(text, Role::kEngineTorque, !measured, databases);
  if (measured) append_role(text, Role::kPrimaryTorque, true, databases);
  text += "# optional\n";
  for (std::size_t i = 0; i < daemon::kRoleCount; ++i) {
    const auto role = static_cast<Role>(i);
    if (role > Role::kPrimaryTorque) append_role(text, role, false, databases);
  }
  text +=
      "\n# A signal that no frame broadcasts may come from diagnostics (UDS "
      "ReadDataByIdentifier):\n"
      "# secondary_pressure = { uds = { request = 0x7E1, response = 0x7E9, did = 0x1101, start = "
      "7,\n"
      "#   length = 16, byte_order = \"big\", scale = 1.0, offset = 0.0 }, unit = \"kPa\", "
      "period_ms "
      "= 50 }\n"
      "# It is taken from the answers that another tester asks for; [bus] diagnostics = \"poll\" "
      "asks itself.\n"
      "# On a second interface: [bus.diag] with interface = \"can1\", and bus = \"diag\" in the "
      "role.\n";
  text +=
      "\n# [variator], [sensors], [estimator], [experiment]: every key has a default; see the\n"
      "# documented default file. Piston area, spring and end-stop ratios are the vehicle's own.\n";
  OutputFile file(options.out);
  file.write(text);
  file.close();
}

}  // namespace

void add_init(CLI::App& app) {
  CLI::App* command = app.add_subcommand("init", "Propose a configuration for DBC files");
  auto options = std::make_shared<Options>();
  command->add_option("dbc", options->dbc, "The vehicle's DBC files")->required();
  command->add_option("--interface", options->interface, "CAN interface to enter")
      ->capture_default_str();
  command->add_option("--out", options->out, "File to write, '-': standard output")
      ->capture_default_str();
  command->callback([options] { run(*options); });
}

}  // namespace beltgrip::cli
