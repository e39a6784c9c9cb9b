// beltgrip init: a first configuration from DBC files, with every guess marked as one.
#include <algorithm>
#include <array>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "can_dbc/dbc/parser.h"
#include "can_dbc/text/printable.h"
#include "daemon/core/config/options/config.h"
#include "daemon/core/config/options/config_bus.h"
#include "daemon/core/config/options/config_options.h"
#include "tools/cli/command.h"
#include "tools/cli/dbc_file.h"
#include "tools/cli/output_file.h"
#include "tools/cli/role_evidence.h"
#include "tools/cli/role_guess.h"
#include "tools/text/terminal.h"

namespace beltgrip::cli {

namespace {

constexpr std::size_t kAlternativesShown = 2;

struct InitOptions {
  std::vector<std::string> dbc;
  std::vector<std::string> log;
  std::string interface = "can0";
  std::string out = "-";
  bool force = false;
};

can::Database read_database(const std::string& path) {
  can::DbcParseResult result = read_dbc(path);
  if (result.database.messages.empty()) fail_without_message(path);
  return std::move(result.database);
}

// As whoever reads the configuration judges it.
void check_interface(const std::string& name) {
  daemon::Config config;
  config.interface = name;
  std::vector<daemon::ConfigError> errors;
  daemon::ConfigErrors collected("--interface", errors);
  daemon::check_bus(config, {}, collected);
  if (errors.empty()) return;
  const std::string& text = errors.front().text;
  throw Failure{kUsage, "init: --interface: " + text.substr(text.find("found "))};
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
    const auto byte = static_cast<unsigned char>(c);
    if (c == '"' || c == '\\') result += '\\';
    if (byte >= ' ' && byte != 0x7F) {
      result += c;
    } else {  // no line end ends a text of TOML
      constexpr char kHex[] = "0123456789abcdef";
      result += std::string("\\u00") + kHex[byte >> 4] + kHex[byte & 15];
    }
  }
  return result + "\"";
}

std::string signal_text(const RoleCandidate& candidate) {
  return quoted(candidate.message->name + "." + candidate.signal->name);
}

std::string trimmed(std::string name) {
  name.erase(name.find_last_not_of(' ') + 1);
  return name;
}

std::string unit_remark(const RoleCandidate& candidate) {
  return candidate.signal->unit.empty() ? "no unit" : can::printable(candidate.signal->unit);
}

// "Open", "Slipping", ...: for a person to choose from.
std::string labels_text(const can::SignalDef& signal) {
  constexpr std::size_t kLabelsShown = 8;
  std::string text;
  std::size_t shown = 0;
  for (const auto& [value, label] : signal.values) {
    if (shown++ == kLabelsShown) return text + ", ...";
    text += (text.empty() ? "" : ", ") + std::to_string(value) + " " +
            can::printable(quoted(std::string(label)));
  }
  return text;
}

// Where a role that nobody names can be found.
struct Where {
  daemon::Role role;
  const char* text;
};
constexpr std::array kWhere{
    Where{daemon::Role::kPrimarySpeed,
          "the transmission's message of speeds: input, turbine or primary pulley"},
    Where{daemon::Role::kSecondarySpeed,
          "the transmission's message of speeds: output or secondary pulley"},
    Where{daemon::Role::kSecondaryPressure,
          "the transmission's messages; else by diagnostics, as below"},
    Where{daemon::Role::kEngineTorque,
          "the engine's message of torques: the actual, not the wanted"},
    Where{daemon::Role::kPrimaryTorque, "a torque sensor on the primary shaft"},
    Where{daemon::Role::kOilTemperature, "the transmission's messages; else by diagnostics"},
    Where{daemon::Role::kVehicleSpeed,
          "the brake controller's or the instrument cluster's message"},
    Where{daemon::Role::kAcceleratorPedal,
          "the engine's message of the pedal, not of the throttle"},
    Where{daemon::Role::kBrakePressed, "the brake controller's or the body's message"},
    Where{daemon::Role::kLockupClosed, "the transmission's message of the converter clutch"},
    Where{daemon::Role::kExperimentPermitted,
          "the transmission controller sends it for BeltGrip: daemon/CLAMP_CONTRACT.md"},
};
const char* where_of(daemon::Role role) {
  const auto found = std::find_if(kWhere.begin(), kWhere.end(),
                                  [role](const Where& each) { return each.role == role; });
  return found == kWhere.end() ? "" : found->text;
}

// What control "command" asks for beside the required ones.
bool command_needs(daemon::Role role) {
  using daemon::Role;
  return role == Role::kExperimentPermitted || role == Role::kAcceleratorPedal ||
         role == Role::kBrakePressed || role == Role::kLockupClosed ||
         role == Role::kOilTemperature || role == Role::kVehicleSpeed;
}

// The proposal as it grows, and what it rests on.
struct Proposal {
  const std::vector<can::Database>& databases;
  const EvidenceOf* evidence = nullptr;  // of logs, where some were given
  std::string text;
  std::string missing;  // required roles without a line
};

std::string evidence_text(const Proposal& proposal, daemon::Role role,
                          const RoleCandidate& candidate) {
  if (proposal.evidence == nullptr) return {};
  return ", " +
         can::printable(judge(role, candidate, proposal.evidence->at(candidate.signal)).text);
}

// A flag is never taken on trust: what speaks for it stands beside it.
std::string flag_line(const Proposal& proposal, const std::string& name, daemon::Role role,
                      const RoleCandidate& best) {
  const TrueWhen guessed = guess_true_when(role, *best.signal);
  const std::string labels = labels_text(*best.signal);
  const std::string bits = std::to_string(best.signal->length) + " bit";
  const std::string seen = bits + (labels.empty() ? "" : ", " + labels) +
                           evidence_text(proposal, role, best) + ": uncomment where that is right";
  if (!guessed.needed)
    return "# " + name + " = " + signal_text(best) + "   # guessed, " + seen + "\n";
  const std::string when = !guessed.label.empty()            ? quoted(guessed.label)
                           : best.signal->values.contains(1) ? "1"
                                                             : "\"...\"";
  return "# " + name + " = { signal = " + signal_text(best) + ", true_when = " + when +
         " }   # guessed, " + seen + "\n";
}

// Never a line that only lacks its "#": its name leaves open what it is.
void append_in_part(Proposal& proposal, daemon::Role role) {
  std::vector<RoleCandidate> candidates = guess_in_part(role, proposal.databases);
  if (proposal.evidence != nullptr) order_by(*proposal.evidence, role, candidates);
  for (std::size_t i = 0; i < candidates.size() && i <= kAlternativesShown; ++i) {
    const RoleCandidate& each = candidates[i];
    proposal.text += "#   perhaps " + signal_text(each) + ", " + unit_remark(each) +
                     evidence_text(proposal, role, each) + "\n";
  }
}

void append_role(Proposal& proposal, daemon::Role role, bool required) {
  std::string name(daemon::role_name(role));
  name.resize(std::max<std::size_t>(name.size(), 18), ' ');
  std::vector<RoleCandidate> candidates = guess_role(role, proposal.databases);
  if (proposal.evidence != nullptr) order_by(*proposal.evidence, role, candidates);
  std::string& text = proposal.text;
  const bool needed = required || command_needs(role);
  if (candidates.empty()) {
    if (needed) {
      text += "# " + name + " = \"Message.Signal\"   # NOT FOUND" +
              (required ? "" : ", control = \"command\" needs it") +
              ": enter it by hand\n#   found: " + where_of(role) + "\n";
      append_in_part(proposal, role);
    }
    if (required) proposal.missing += (proposal.missing.empty() ? "" : ", ") + trimmed(name);
    return;
  }
  const RoleCandidate& best = candidates.front();
  const bool lives =
      proposal.evidence == nullptr || judge(role, best, proposal.evidence->at(best.signal)).lives;
  const bool is_flag = daemon::role_dimension(role) == can::Dimension::kNone;
  const bool active = !is_flag && best.has_unit && lives;
  const std::string evidence = evidence_text(proposal, role, best);
  if (is_flag) {
    text += flag_line(proposal, name, role, best);
  } else if (active || best.has_unit) {
    text += (active ? "" : "# ") + name + " = " + signal_text(best) + "   # guessed, " +
            unit_remark(best) + evidence + "\n";
  } else {
    text += "# " + name + " = { signal = " + signal_text(best) +
            ", unit = \"...\" }   # guessed; the DBC gives no unit: enter it" + evidence + "\n";
  }
  if (required && !active) {
    proposal.missing += (proposal.missing.empty() ? "" : ", ") + trimmed(name);
  }
  for (std::size_t i = 1; i < candidates.size() && i <= kAlternativesShown; ++i) {
    text += "#   or " + signal_text(candidates[i]) + ", " + unit_remark(candidates[i]) +
            evidence_text(proposal, role, candidates[i]) + "\n";
  }
}

// Every key that is assumed as long as it is left out, with what is assumed and where its number is
// found. Only to fill in: a number that nobody knows is better left out than guessed.
void append_assumed(std::string& text, daemon::Role torque) {
  using daemon::Role;
  text +=
      "\n# The variator's own numbers. Each that stays a comment is assumed, within the range "
      "given:\n"
      "# mu_max is then as wide as that. Enter what is known, and uncomment the section's name.\n"
      "# [variator]\n"
      "# ratio_low =   # default 0.405\n"
      "#   found: beltgrip calibrate, of a drive from standstill\n"
      "# ratio_overdrive =   # default 2.25\n"
      "#   found: beltgrip calibrate, of a drive at steady speed\n";
  for (const daemon::Option& option : daemon::option_table()) {
    for (const estimator::Assumption& each : estimator::assumptions()) {
      if (option.section != "variator" || option.key != each.key) continue;
      const bool is_inertia = each.key == "primary_inertia_kg_m2";
      if (is_inertia && torque == Role::kPrimaryTorque) continue;
      text += "# " + std::string(each.key) + " =   # assumed " + daemon::assumption_text(option) +
              "\n#   found: " + std::string(each.where) + "\n";
    }
  }
  text +=
      "\n# Accuracy of the sensors, 1 sigma of an error that stays; 0 is exact. As assumed where "
      "left "
      "out:\n# [sensors]\n";
  for (const Role role :
       {Role::kPrimarySpeed, Role::kSecondarySpeed, Role::kSecondaryPressure, torque}) {
    const auto sensor = daemon::sensor_of(role);
    if (!sensor) continue;
    const estimator::TypicalAccuracy& typical = estimator::typical_accuracy(*sensor);
    char numbers[96];
    std::snprintf(numbers, sizeof numbers, " = %g, gain = %g }", typical.accuracy.bias,
                  typical.accuracy.gain);
    text += "# " + std::string(daemon::role_name(role)) + " = { " +
            std::string(daemon::bias_key(daemon::role_dimension(role))) + numbers +
            "\n#   found: " + std::string(typical.where) + "\n";
  }
}

void run_init(const InitOptions& options) {
  check_interface(options.interface);
  Inputs inputs(options.dbc);
  inputs.add(options.log);
  OutputFile file(options.out, inputs, unless_forced(options.force));
  std::vector<can::Database> databases;
  databases.reserve(options.dbc.size());
  for (const std::string& path : options.dbc) databases.push_back(read_database(path));

  std::vector<RoleCandidate> candidates;
  for (std::size_t i = 0; i < daemon::kRoleCount; ++i) {
    const auto each = guess_role(static_cast<daemon::Role>(i), databases);
    candidates.insert(candidates.end(), each.begin(), each.end());
    const auto in_part = guess_in_part(static_cast<daemon::Role>(i), databases);
    candidates.insert(candidates.end(), in_part.begin(), in_part.end());
  }
  EvidenceOf evidence;
  Proposal proposal{.databases = databases, .evidence = nullptr, .text = "", .missing = ""};
  if (!options.log.empty()) {
    evidence = read_evidence(options.log, candidates);
    proposal.evidence = &evidence;
  }
  std::string& text = proposal.text;
  text =
      "# Proposed by beltgrip init. Roles were guessed from the names, comments and units in the "
      "DBC "
      "files" +
      std::string(options.log.empty() ? "" : ", and the values in the logs") +
      ":\n# check each line before use; beltgrip check does it with a log.\n\n[bus]\ninterface = " +
      quoted(options.interface) + "\ndbc       = [";
  for (std::size_t i = 0; i < options.dbc.size(); ++i) {
    text += (i > 0 ? ", " : "") + quoted(path_text(options.dbc[i], options.out));
  }
  text += "]\n\n[signals]\n";
  using daemon::Role;
  for (const Role role : {Role::kPrimarySpeed, Role::kSecondarySpeed, Role::kSecondaryPressure}) {
    append_role(proposal, role, true);
  }
  const bool measured = !guess_role(Role::kPrimaryTorque, databases).empty();
  append_role(proposal, Role::kEngineTorque, !measured);
  if (measured) append_role(proposal, Role::kPrimaryTorque, true);
  text += "# optional; yes/no signals stay comments until somebody has looked at them\n";
  for (std::size_t i = 0; i < daemon::kRoleCount; ++i) {
    const auto role = static_cast<Role>(i);
    if (role > Role::kPrimaryTorque) append_role(proposal, role, false);
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
  append_assumed(text, measured ? Role::kPrimaryTorque : Role::kEngineTorque);
  text +=
      "\n# [estimator], [experiment] and the end-stop ratios of [variator] have defaults;\n"
      "# beltgripd --print-default-config shows every key. beltgrip calibrate finds the ratios.\n";
  file.write(options.out == "-" ? can::printable_lines(text) : text);
  file.close();
  if (proposal.missing.empty()) {
    if (options.out == "-") return;
    text::print(stdout, options.out +
                            ": every role that is needed has a line; look at each, then " +
                            "beltgrip check LOG --config " + options.out + "\n");
    return;
  }
  throw Failure{kBadInput, options.dbc.front() + (options.dbc.size() > 1 ? ", ..." : "") +
                               ": found no signal for " + proposal.missing +
                               "; expected one for each, to be entered in " +
                               (options.out == "-" ? "the proposal" : options.out)};
}

}  // namespace

void add_init(command_line::Command app) {
  const command_line::Command command =
      app.add_subcommand("init", "Propose a configuration for DBC files");
  auto options = std::make_shared<InitOptions>();
  command.add_option("DBC", options->dbc, "The vehicle's DBC files").type_name("").required();
  command
      .add_option(
          "--log", options->log,
          "Logs of the car: a signal that is not there, stands still or cannot be gives way")
      .type_name("LOG");
  command.add_option("--interface", options->interface, "CAN interface to enter")
      .type_name("INTERFACE")
      .capture_default_str();
  command.add_option("--out", options->out, "File to write, '-': standard output")
      .type_name("FILE")
      .capture_default_str();
  command.add_flag("--force", options->force, "Replace a file that exists");
  command.example("beltgrip init drive/vehicle.dbc --out mycar.toml");
  command.example("beltgrip init drive/vehicle.dbc --log drive/trace.log");
  command.callback([options] { run_init(*options); });
}

}  // namespace beltgrip::cli
