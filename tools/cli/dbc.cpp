#include "tools/cli/dbc.h"

#include <cinttypes>
#include <cstdio>
#include <memory>
#include <string>

#include "can_dbc/text/number_text.h"
#include "can_dbc/text/printable.h"
#include "tools/cli/dbc_decode.h"
#include "tools/cli/dbc_encode.h"
#include "tools/cli/dbc_file.h"
#include "tools/cli/dbc_json.h"
#include "tools/cli/failure.h"
#include "tools/cli/log_trouble.h"
#include "tools/cli/output_file.h"
#include "tools/text/terminal.h"

namespace beltgrip::cli {

namespace {

// --- check ---------------------------------------------------------------------------------------

void check(const std::string& path, bool strict) {
  const can::DbcParseResult result = read_dbc(path);
  for (const can::Problem& problem : result.problems) {
    std::printf("%s:%" PRIu32 ":%" PRIu32 ": %s: %s [%s]\n", can::printable(path).c_str(),
                problem.line, problem.column,
                problem.severity == can::Severity::kError ? "error" : "warning",
                can::printable(problem.text).c_str(), problem.code.c_str());
  }
  const ProblemCount found = count(result.problems);
  if (result.database.messages.empty()) fail_without_message(path);
  const std::string summary = path + ": " + text_of(found);
  if (found.errors > 0 || (strict && found.warnings > 0)) throw Failure{kBadInput, summary};
  std::size_t signals = 0;
  for (const can::MessageDef& message : result.database.messages) signals += message.signals.size();
  const std::string read = counted(result.database.messages.size(), "message") + ", " +
                           counted(signals, "signal") + " read";
  const std::string outcome = found.warnings == 0 ? path + ": no problems" : summary;
  text::print(stderr, can::printable(outcome) + "; " + read + "\n");
}

// --- show ----------------------------------------------------------------------------------------

std::string id_text(can::CanId id) {
  char text[16];
  std::snprintf(text, sizeof text, id.extended ? "0x%08" PRIX32 "x" : "0x%03" PRIX32, id.value);
  return text;
}

std::string type_text(can::ValueType type) {
  switch (type) {
    case can::ValueType::kUnsigned:
      return "unsigned";
    case can::ValueType::kSigned:
      return "signed";
    default:
      return "float";
  }
}

// ", selected by Page = 1, 3-5"
std::string selection_text(const can::MuxRule& rule) {
  std::string text = ", selected by " + rule.selector;
  const char* before = " = ";
  for (const auto& [first, last] : rule.ranges) {
    text += before + std::to_string(first);
    if (last != first) text += '-' + std::to_string(last);
    before = ", ";
  }
  return text;
}

void print_signal(const can::SignalDef& signal) {
  std::printf("  %s: bit %" PRIu32 ", %" PRIu32 " bits, %s endian, %s, factor %s, offset %s",
              can::printable(signal.name).c_str(), signal.start_bit, signal.length,
              signal.byte_order == can::ByteOrder::kLittle ? "little" : "big",
              type_text(signal.type).c_str(), number_text(signal.scale).c_str(),
              number_text(signal.offset).c_str());
  if (!signal.unit.empty()) std::printf(" %s", can::printable(signal.unit).c_str());
  if (signal.usage->minimum < signal.usage->maximum) {
    std::printf(", from %s to %s", number_text(signal.usage->minimum).c_str(),
                number_text(signal.usage->maximum).c_str());
  }
  if (signal.is_multiplexer) std::printf(", multiplexer");
  if (signal.multiplexed_by)
    text::print(stdout, can::printable(selection_text(*signal.multiplexed_by)));
  std::printf("\n");
  for (const auto& [key, label] : signal.values) {
    std::printf("      %s = %s\n", can::value_key_text(signal, key).c_str(),
                can::printable(label).c_str());
  }
  if (!signal.comment.empty())
    std::printf("      \"%s\"\n", can::printable(signal.comment).c_str());
}

void print_readably(const can::Database& database) {
  for (const can::MessageDef& message : database.messages) {
    std::printf("%s %s, %" PRIu32 " bytes%s", id_text(message.id).c_str(),
                can::printable(message.name).c_str(), message.length, message.fd ? ", CAN FD" : "");
    if (message.j1939) std::printf(", J1939");
    if (message.cycle_ms) std::printf(", every %g ms", *message.cycle_ms);
    std::printf("\n");
    if (!message.comment.empty())
      std::printf("  \"%s\"\n", can::printable(message.comment).c_str());
    for (const can::SignalDef& signal : message.signals) print_signal(signal);
  }
}

void show(const std::string& path, const std::string& json_path) {
  const can::DbcParseResult result = read_dbc(path);
  mention_problems(path, result.problems);
  const bool nothing = result.database.messages.empty();
  if (nothing && json_path != "-") fail_without_message(path);  // what is in the file stays
  if (json_path.empty()) {
    print_readably(result.database);
  } else {
    OutputFile out(json_path, {path});
    out.write(database_json(result.database));
    out.write("\n");
    out.close();
  }
  if (nothing) fail_without_message(path);
}

void add_decode(command_line::Command dbc) {
  const auto options = std::make_shared<DecodeOptions>();
  const command_line::Command command =
      dbc.add_subcommand("decode", "print the signals of a log's frames");
  command.add_option("--dbc", options->dbc_paths, "DBC file; several may be given")
      .type_name("FILE")
      .required()
      .allow_extra_args(false);
  command.add_option("LOG", options->log_paths, kLogKinds).type_name("");
  command
      .add_option("--text", options->text_path,
                  "write one line a frame to this file, - for standard output (the default)")
      .type_name("FILE");
  command
      .add_option("--csv", options->csv_path,
                  "write a table to this file, - for standard output: one column a signal")
      .type_name("FILE");
  command
      .add_option("--json", options->json_path,
                  "write one JSON line a frame to this file, - for standard output")
      .type_name("FILE");
  command.add_flag("--raw", options->raw, "add the raw values; in CSV: instead of the physical");
  command
      .add_option("--messages", options->messages,
                  "only messages of these names: a,b; may be repeated")
      .type_name("NAMES")
      .allow_extra_args(false)
      .delimiter(',');
  command
      .add_option("--signals", options->signals,
                  "only these signals, each Name or Message.Name: a,b; may be repeated")
      .type_name("NAMES")
      .allow_extra_args(false)
      .delimiter(',');
  command.add_option("--from", options->from_s, "begin so many seconds after the first frame")
      .type_name("SECONDS");
  command.add_option("--to", options->to_s, "end so many seconds after the first frame")
      .type_name("SECONDS");
  command.example("beltgrip dbc decode drive/trace.log --dbc drive/vehicle.dbc --csv signals.csv");
  command.example("candump -L can0 | beltgrip dbc decode - --dbc mycar.dbc");
  command.callback([options] { decode(*options); });
}

void add_encode(command_line::Command dbc) {
  const auto options = std::make_shared<EncodeOptions>();
  const command_line::Command command =
      dbc.add_subcommand("encode", "print the frame that carries these values, for cansend");
  command
      .add_option("--dbc", options->dbc_paths,
                  "DBC file; several may be given, the first with the message counts")
      .type_name("FILE")
      .required()
      .allow_extra_args(false);
  command.add_option("MESSAGE", options->message, "name of the message").type_name("").required();
  command
      .add_option("SIGNAL=VALUE", options->values,
                  "physical value, or text of the value table; signals that are left out have "
                  "their start value, or 0 on the bus")
      .type_name("");
  command.example(
      "beltgrip dbc encode --dbc drive/vehicle.dbc ECU_Engine EngineSpeed=1200 EngineTorque=-31.5");
  command.callback([options] { encode(*options); });
}

}  // namespace

void add_dbc(command_line::Command app) {
  const command_line::Command dbc =
      app.add_subcommand("dbc", "show, decode and encode with, or check a DBC file");
  dbc.require_subcommand();

  struct Options {
    std::string path;
    std::string show_json_path;
    bool strict = false;
  };
  const auto options = std::make_shared<Options>();

  const command_line::Command show_command =
      dbc.add_subcommand("show", "print what a DBC file says");
  show_command.add_option("FILE", options->path, "DBC file").type_name("").required();
  show_command
      .add_option("--json", options->show_json_path,
                  "write JSON to this file, - for standard output")
      .type_name("FILE");
  show_command.example("beltgrip dbc show drive/vehicle.dbc");
  show_command.callback([options] { show(options->path, options->show_json_path); });

  add_decode(dbc);
  add_encode(dbc);

  const command_line::Command check_command =
      dbc.add_subcommand("check", "list every problem of a DBC file");
  check_command.add_option("FILE", options->path, "DBC file").type_name("").required();
  check_command.add_flag("--strict", options->strict, "refuse warnings too");
  check_command.example("beltgrip dbc check drive/vehicle.dbc --strict");
  check_command.callback([options] { check(options->path, options->strict); });
}

}  // namespace beltgrip::cli
