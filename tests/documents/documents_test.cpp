// Documents whose content stands in a table of the code: frames, configuration, commands, effects.
// They are generated, and compared here; BELTGRIP_WRITE_DOCUMENTS=1 writes them instead.
#include <gtest/gtest.h>

#include <cstdlib>
#include <fstream>
#include <functional>
#include <iterator>
#include <sstream>
#include <vector>

#include "can_dbc/dbc/parser.h"
#include "daemon/core/config/options/config_model.h"
#include "daemon/core/publish/own_frames.h"
#include "daemon/core/reasons/reasons.h"
#include "estimator/physics/machine_effects.h"
#include "tests/support/program.h"

namespace beltgrip::test {
namespace {

constexpr Milliseconds kLimit{10'000};
constexpr std::string_view kGenerated =
    "\nGenerated from the code, compared by `build/tests/documents_test`; "
    "`BELTGRIP_WRITE_DOCUMENTS=1` before it writes it anew.\n";

std::string read_file(const std::string& path) {
  std::ifstream in(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), {}};
}

// In a cell of a table.
std::string cell(std::string_view text) {
  std::string out;
  for (const char c : text) {
    if (c == '|') out += '\\';
    out += c == '\n' ? ' ' : c;
  }
  return out;
}

std::string number(double value) {
  std::ostringstream text;
  text.precision(12);
  text << value;
  return text.str();
}

std::string values_of(const can::SignalDef& signal) {
  std::string text;
  for (const auto& [raw, name] : signal.values) {
    text += (text.empty() ? "" : ", ") + can::value_key_text(signal, raw) + " " + name;
  }
  return text;
}

std::string frames() {
  const can::DbcParseResult parsed = can::parse_dbc(std::string(daemon::beltgrip_dbc_text()));
  std::ostringstream out;
  out << "# The frames of BeltGrip\n"
      << can::Text(parsed.database.comment)
      << " The file is `can_dbc/beltgrip.dbc`; what a receiver of clamp "
      << "requests keeps to is `daemon/CLAMP_CONTRACT.md`.\n"
      << kGenerated;
  for (const can::MessageDef& message : parsed.database.messages) {
    out << "\n## " << message.name << ", 0x" << std::hex << std::uppercase << message.id.value
        << std::dec << "\n"
        << can::Text(message.comment)
        << "\n\n| signal | bit, length | factor | range | unit | meaning |\n"
        << "|---|---|---|---|---|---|\n";
    for (const can::SignalDef& each : message.signals) {
      const std::string values = values_of(each);
      out << "| " << each.name << " | " << each.start_bit << ", " << each.length << " | "
          << number(each.scale) << " | " << number(each.usage->minimum) << " to "
          << number(each.usage->maximum) << " | " << can::Text(each.unit) << " | "
          << cell(each.comment) << (each.comment.empty() || values.empty() ? "" : " ")
          << cell(values) << " |\n";
    }
  }
  return out.str();
}

void add_model(std::ostream& out) {
  out << "\n## The model file\n"
      << "`beltgrip diagnose --model-out` writes it, `model` in `[estimator]` names it. "
         "`[variator]` "
      << "has the keys of the section above. `[effects.NAME]` has those of `tools/DIAGNOSE.md`. "
      << "What is left out stays as it is.\n\n"
      << "| section | key | unit | meaning |\n|---|---|---|---|\n";
  for (const auto& options : {daemon::friction_options(), daemon::driveline_options()}) {
    for (const daemon::OptionRow& option : options) {
      out << "| `[" << option.section << "]` | `" << option.key << "` | " << option.unit << " | "
          << cell(option.help) << " |\n";
    }
  }
}

// The commented default file, section by section.
std::string configuration() {
  const RunResult printed =
      run({program_path("beltgripd"), "--print-default-config"}, kLimit, "/dev/null");
  std::istringstream in(printed.out);
  std::ostringstream out;
  out << "# The configuration\n"
      << "Every key of `beltgripd.toml` with its default, unit and range, section by section. What "
      << "is left out has its default; a key that is not here is refused. `systemd/beltgripd.toml` "
      << "is the same as a file to fill in, `beltgrip init` writes one for your car, "
      << "`include = [\"calibrated.toml\"]` at the top takes what `beltgrip calibrate` found, "
      << "`include = [\"conf.d/*.toml\"]` every file of a folder, by name.\n"
      << kGenerated;
  std::string line;
  bool open = false;
  while (std::getline(in, line)) {
    if (line.starts_with("[")) {
      out << (open ? "```\n" : "") << "\n## " << line.substr(1, line.size() - 2) << "\n```toml\n";
      open = true;
    }
    if (open) out << line << "\n";
  }
  out << "```\n";
  add_model(out);
  return out.str();
}

constexpr std::string_view kCommandsBegin = "\n## Every command\n";

// The command's help, and that of the commands below it, whose names stand behind "Subcommands:".
void add_command(const std::vector<std::string>& command, std::ostream& out) {
  std::vector<std::string> arguments = command;
  arguments.push_back("--help");
  const std::string help = beltgrip(arguments).out;
  if (!command.empty()) {
    out << "\n### beltgrip";
    for (const std::string& word : command) out << ' ' << word;
    out << "\n```\n" << help.substr(0, help.find_last_not_of('\n') + 1) << "\n```\n";
  }
  std::istringstream in(help);
  std::string line;
  bool listed = false;
  while (std::getline(in, line)) {
    if (line.starts_with("Subcommands:")) {
      listed = true;
    } else if (listed && line.starts_with("  ") && line.size() > 2 && line[2] != ' ') {
      std::vector<std::string> below = command;
      below.push_back(line.substr(2, line.find(' ', 2) - 2));
      add_command(below, out);
    }
  }
}

std::string commands() {
  const std::string path = BELTGRIP_SOURCE_DIR "/tools/COMMANDS.md";
  std::string text = read_file(path);
  const std::size_t begin = text.find(kCommandsBegin);
  std::ostringstream out;
  out << text.substr(0, begin) << kCommandsBegin << kGenerated;
  add_command({}, out);
  return out.str();
}

constexpr std::string_view kEffectsBegin = "\n## Every effect\n";

std::string effects() {
  const std::string text = read_file(BELTGRIP_SOURCE_DIR "/tools/DIAGNOSE.md");
  std::ostringstream out;
  out << text.substr(0, text.find(kEffectsBegin)) << kEffectsBegin
      << "In a model file or a scenario: `[effects.NAME]`, `parameter = value`; zero, or left out, "
         "is "
         "off. The sizes of `friction_shape` are relative to the nominal curve.\n"
      << kGenerated
      << "\n| effect | parameter | unit | equation | usual size | fitted from | to |\n"
      << "|---|---|---|---|---|---|---|\n";
  for (const estimator::EffectRow& row : estimator::effect_rows()) {
    out << "| `" << row.id << "` | `" << row.parameter << "` | " << row.unit << " | "
        << cell(row.equation);
    for (const estimator::EffectRole& each : row.roles) {
      out << (&each == &row.roles.front() ? "; `role`: " : ", ") << each.role;
    }
    if (row.typical == 0.0) {
      out << " | | | |\n";
    } else {
      out << " | " << number(row.typical) << " | " << number(row.low) << " | " << number(row.high)
          << " |\n";
    }
  }
  return out.str();
}

// The rows between the head of a table and the line behind it.
std::string with_rows(const std::string& text, const std::string& head, const std::string& rows) {
  const std::string line = "|---|---|---|\n";
  const std::size_t begin = text.find(line, text.find(head)) + line.size();
  std::size_t end = begin;
  while (text.compare(end, 1, "|") == 0) end = text.find('\n', end) + 1;
  return text.substr(0, begin) + rows + text.substr(end);
}

std::string reason_row(std::string_view name, const daemon::Words& words) {
  return "| " + std::string(name) + " | " + cell(words.means) + " | " + cell(words.remedy) + " |\n";
}

std::string no_result() {
  std::string inhibits, faults, stops;
  for (std::size_t i = 0; i < estimator::kStopReasonCount; ++i) {
    const auto reason = static_cast<estimator::StopReason>(i);
    stops += reason_row(daemon::stop_reason_name(reason), daemon::words_of(reason));
    const daemon::Words with_bound = daemon::words_of(reason, true);
    if (with_bound.remedy != daemon::words_of(reason).remedy) {
      stops += reason_row(std::string(daemon::stop_reason_name(reason)) + ", with a lower bound",
                          with_bound);
    }
  }
  for (const auto& each : daemon::kInhibits) {
    inhibits += reason_row(each.name, daemon::words_of(each.value));
  }
  for (const auto& each : daemon::kFaults) {
    faults += reason_row(each.name, daemon::words_of(each.value));
  }
  const std::string text = read_file(BELTGRIP_SOURCE_DIR "/tools/NO_RESULT.md");
  return with_rows(with_rows(with_rows(text, "| name | what is missing", inhibits),
                             "| fault | what it means", faults),
                   "| StopReason | what happened", stops);
}

struct Document {
  std::string path;
  std::function<std::string()> text;
};

void PrintTo(const Document& document, std::ostream* out) { *out << document.path; }

class Documents : public testing::TestWithParam<Document> {};

TEST_P(Documents, SayWhatTheCodeSays) {
  const std::string path = BELTGRIP_SOURCE_DIR "/" + GetParam().path;
  const std::string text = GetParam().text();
  ASSERT_GT(lines(text), 40) << text;
  if (std::getenv("BELTGRIP_WRITE_DOCUMENTS") != nullptr) std::ofstream(path) << text;
  EXPECT_EQ(read_file(path), text) << "BELTGRIP_WRITE_DOCUMENTS=1 build/tests/documents_test";
}

INSTANTIATE_TEST_SUITE_P(All, Documents,
                         testing::Values(Document{"can_dbc/FRAMES.md", frames},
                                         Document{"systemd/CONFIGURATION.md", configuration},
                                         Document{"tools/COMMANDS.md", commands},
                                         Document{"tools/NO_RESULT.md", no_result},
                                         Document{"tools/DIAGNOSE.md", effects}));

}  // namespace
}  // namespace beltgrip::test
