#include "tools/cli/dbc.h"

#include <poll.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <charconv>
#include <cinttypes>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "can_dbc/dbc/message_codec.h"
#include "can_dbc/dbc/message_index.h"
#include "can_dbc/dbc/parser.h"
#include "can_dbc/log/can_log.h"
#include "can_dbc/text/printable.h"
#include "tools/cli/dbc_json.h"
#include "tools/cli/exit_codes.h"
#include "tools/cli/output_file.h"
#include "tools/cli/stop_signals.h"
#include "tools/text/json_writer.h"
#include "tools/text/terminal.h"

namespace beltgrip::cli {

namespace {

std::string read_file(const std::string& path) {
  const std::unique_ptr<std::FILE, int (*)(std::FILE*)> file(std::fopen(path.c_str(), "rb"),
                                                             &std::fclose);
  const auto fail = [&] { throw Failure{kNoInput, path + ": " + std::strerror(errno)}; };
  if (!file) fail();
  constexpr std::size_t kLargest = std::size_t{256} * 1024 * 1024;
  std::string text;
  std::array<char, 65536> block;
  std::size_t count = 0;
  while ((count = std::fread(block.data(), 1, block.size(), file.get())) > 0) {
    text.append(block.data(), count);
    if (text.size() > kLargest) {
      throw Failure{kBadInput, path + ": larger than 256 MiB, expected a DBC file"};
    }
  }
  if (std::ferror(file.get()) != 0) fail();
  return text;
}

[[noreturn]] void fail_without_message(const std::string& path) {
  throw Failure{kBadInput, path + ": no readable message (BO_) in it, expected a DBC file"};
}

// Warnings and errors, counted.
struct Tally {
  std::size_t warnings = 0;
  std::size_t errors = 0;
};

Tally tally(const std::vector<can::Problem>& problems) {
  Tally count;
  for (const can::Problem& problem : problems) {
    ++(problem.severity == can::Severity::kError ? count.errors : count.warnings);
  }
  return count;
}

std::string counted(std::size_t count, const char* what) {
  return std::to_string(count) + ' ' + what + (count == 1 ? "" : "s");
}

std::string text_of(const Tally& count) {
  return counted(count.errors, "error") + ", " + counted(count.warnings, "warning");
}

// One line on standard error if there is anything to know about the file.
void mention_problems(const std::string& path, const std::vector<can::Problem>& problems) {
  const Tally count = tally(problems);
  if (count.warnings + count.errors == 0) return;
  print(stderr,
        can::printable(path) + ": " + text_of(count) + " (beltgrip dbc check lists them)\n");
}

// --- check ---------------------------------------------------------------------------------------

void check(const std::string& path, bool strict) {
  const can::DbcParseResult result = can::parse_dbc(read_file(path));
  for (const can::Problem& problem : result.problems) {
    std::printf("%s:%" PRIu32 ":%" PRIu32 ": %s: %s [%s]\n", can::printable(path).c_str(),
                problem.line, problem.column,
                problem.severity == can::Severity::kError ? "error" : "warning",
                can::printable(problem.text).c_str(), problem.code.c_str());
  }
  const Tally count = tally(result.problems);
  if (result.database.messages.empty()) fail_without_message(path);
  const std::string summary = path + ": " + text_of(count);
  if (count.errors > 0 || (strict && count.warnings > 0)) throw Failure{kBadInput, summary};
  std::size_t signals = 0;
  for (const can::MessageDef& message : result.database.messages) signals += message.signals.size();
  const std::string read = counted(result.database.messages.size(), "message") + ", " +
                           counted(signals, "signal") + " read";
  const std::string found = count.warnings == 0 ? path + ": no problems" : summary;
  print(stderr, can::printable(found) + "; " + read + "\n");
}

// --- show ----------------------------------------------------------------------------------------

std::string id_text(can::CanId id) {
  char text[16];
  std::snprintf(text, sizeof text, id.extended ? "0x%08" PRIX32 "x" : "0x%03" PRIX32, id.value);
  return text;
}

std::string number_text(double value) {
  std::array<char, 32> text;
  return {text.data(), std::to_chars(text.data(), text.data() + text.size(), value).ptr};
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
  if (signal.minimum < signal.maximum) {
    std::printf(", from %s to %s", number_text(signal.minimum).c_str(),
                number_text(signal.maximum).c_str());
  }
  if (signal.is_multiplexer) std::printf(", multiplexer");
  if (signal.multiplexed_by) print(stdout, can::printable(selection_text(*signal.multiplexed_by)));
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
  const can::DbcParseResult result = can::parse_dbc(read_file(path));
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

// --- decode --------------------------------------------------------------------------------------

// One message ready to be written: its codec and its JSON text that never changes.
struct DecodedMessage {
  const can::MessageDef* definition = nullptr;
  can::MessageCodec codec;
  std::string head;               // ,"id":291,"extended":false,"message":"X","signals":{
  std::vector<std::string> keys;  // "name": of each signal
  bool names_repeat = false;
};

DecodedMessage prepare(const can::MessageDef& definition) {
  DecodedMessage message;
  message.definition = &definition;
  message.codec = can::MessageCodec(definition);
  std::set<std::string_view> names;
  for (const can::SignalDef& signal : definition.signals) {
    message.names_repeat |= !names.insert(signal.name).second;
    JsonWriter key;
    message.keys.push_back(key.value(signal.name).text() + ':');
  }
  JsonWriter name;
  message.head = R"(,"extended":)" + std::string(definition.id.extended ? "true" : "false") +
                 R"(,"message":)" + name.value(definition.name).text() + R"(,"signals":{)";
  return message;
}

void append_number(std::string& line, auto value) {
  std::array<char, 32> text;
  line.append(text.data(), std::to_chars(text.data(), text.data() + text.size(), value).ptr);
}

// Seconds with every digit that the log has, and no more zeros than needed.
void append_seconds(std::string& line, std::int64_t t_ns) {
  constexpr std::uint64_t kSecond_ns = 1'000'000'000;
  if (t_ns < 0) line += '-';
  const auto magnitude =
      t_ns < 0 ? ~static_cast<std::uint64_t>(t_ns) + 1 : static_cast<std::uint64_t>(t_ns);
  append_number(line, magnitude / kSecond_ns);
  std::uint64_t fraction = magnitude % kSecond_ns;
  line += '.';
  for (std::uint64_t unit = kSecond_ns / 10; unit > 0; unit /= 10) {
    line += static_cast<char>('0' + fraction / unit);
    fraction %= unit;
    if (fraction == 0) break;
  }
}

class Decoder {
 public:
  Decoder(const std::vector<std::string>& paths, bool with_raw) : with_raw_(with_raw) {
    for (const std::string& path : paths) {
      results_.push_back(std::make_unique<can::DbcParseResult>(can::parse_dbc(read_file(path))));
      const can::DbcParseResult& result = *results_.back();
      mention_problems(path, result.problems);
      if (result.database.messages.empty()) fail_without_message(path);
      databases_.push_back(&result.database);
    }
    index_ = can::MessageIndex(databases_);
    constexpr std::size_t kConflictsShown = 10;
    const auto& conflicts = index_.conflicts();
    for (std::size_t i = 0; i < std::min(conflicts.size(), kConflictsShown); ++i) {
      const can::MessageIndex::Conflict& conflict = conflicts[i];
      print(stderr, paths[conflict.ignored.database] + ": message " +
                        message_at(conflict.ignored).name + " has the identifier of " +
                        message_at(conflict.used).name + " in " + paths[conflict.used.database] +
                        ", which is used\n");
    }
    if (conflicts.size() > kConflictsShown) {
      std::fprintf(stderr, "and %zu more messages with an identifier used before\n",
                   conflicts.size() - kConflictsShown);
    }
    std::size_t longest = 0;
    for (const can::Database* database : databases_) {
      messages_.emplace_back();
      for (const can::MessageDef& message : database->messages) {
        messages_.back().push_back(prepare(message));
        longest = std::max(longest, message.signals.size());
      }
    }
    values_.resize(longest);
  }

  // Appends one line; false if no DBC names the frame.
  bool append(const can::LogRecord& record, std::string& out) {
    const can::CanFrame& frame = record.frame;
    if (frame.remote || frame.error) return false;
    const can::MessageIndex::Place* place = index_.lookup(frame.id);
    if (place == nullptr) return false;
    const DecodedMessage& message = messages_[place->database][place->message];
    message.codec.decode(frame.payload(), values_);
    if (message.names_repeat) keep_first_of_each_name(message);

    out += R"({"t_s":)";
    append_seconds(out, record.t_ns);
    out += R"(,"iface":)";
    append_interface(record.interface, out);
    out += R"(,"id":)";
    append_number(out, frame.id.value);
    out += message.head;
    const std::size_t count = message.codec.signal_count();
    for_each_present(message, out, [&](std::size_t i) {
      const double value = values_[i].physical;
      if (std::isfinite(value)) {
        append_number(out, value);
      } else {
        out += "null";
      }
    });
    out += R"(},"labels":{)";
    bool first = true;
    for (std::size_t i = 0; i < count; ++i) {
      const std::string* label = label_of(message, i);
      if (label == nullptr) continue;
      if (!first) out += ',';
      first = false;
      out += message.keys[i];
      JsonWriter text;
      out += text.value(*label).text();
    }
    if (with_raw_) {
      out += R"(},"raw":{)";
      for_each_present(message, out, [&](std::size_t i) {
        out += '"';
        out += message.codec.signal(i).raw_text(values_[i].raw);
        out += '"';
      });
    }
    out += "}}\n";
    return true;
  }

 private:
  const can::MessageDef& message_at(can::MessageIndex::Place place) const {
    return databases_[place.database]->messages[place.message];
  }

  template <typename Write>
  void for_each_present(const DecodedMessage& message, std::string& out, Write write) {
    bool first = true;
    for (std::size_t i = 0; i < message.codec.signal_count(); ++i) {
      if (!values_[i].present) continue;
      if (!first) out += ',';
      first = false;
      out += message.keys[i];
      write(i);
    }
  }

  // A JSON object has each name once.
  void keep_first_of_each_name(const DecodedMessage& message) {
    std::set<std::string_view> seen;
    for (std::size_t i = 0; i < message.codec.signal_count(); ++i) {
      if (!values_[i].present) continue;
      values_[i].present = seen.insert(message.definition->signals[i].name).second;
    }
  }

  const std::string* label_of(const DecodedMessage& message, std::size_t i) const {
    const can::ValueTable& values = message.definition->signals[i].values;
    if (!values_[i].present || values.empty()) return nullptr;
    auto key = static_cast<std::int64_t>(values_[i].raw);
    const can::SignalCodec& codec = message.codec.signal(i);
    if (codec.is_float()) {
      const double value = codec.value_of(values_[i].raw);
      constexpr double kExactWhole = 9007199254740992.0;  // 2^53
      if (!(std::fabs(value) <= kExactWhole) || value != std::trunc(value)) return nullptr;
      key = static_cast<std::int64_t>(value);
    }
    const auto found = values.find(key);
    return found == values.end() ? nullptr : &found->second;
  }

  void append_interface(std::string_view interface, std::string& out) {
    if (interface != interface_) {
      interface_ = interface;
      JsonWriter text;
      interface_json_ = text.value(interface_).text();
    }
    out += interface_json_;
  }

  bool with_raw_;
  std::vector<std::unique_ptr<can::DbcParseResult>> results_;
  std::vector<const can::Database*> databases_;
  can::MessageIndex index_;
  std::vector<std::vector<DecodedMessage>> messages_;  // beside the databases' messages
  std::vector<can::DecodedSignal> values_;
  std::string interface_;
  std::string interface_json_ = R"("")";
};

// More stands ready on standard input, or it is at its end. Where nothing does, the lines written
// so far must not wait for what may come much later.
bool input_waits() {
  pollfd input{STDIN_FILENO, POLLIN, 0};
  return ::poll(&input, 1, 0) > 0;
}

void decode_log(Decoder& decoder, const std::string& log_path, OutputFile& out) {
  std::unique_ptr<can::LogReader> log;
  try {
    log = can::LogReader::open(log_path);
  } catch (const can::LogOpenError& error) {
    throw Failure{kNoInput, error.text};
  }
  can::LogRecord record;
  std::string lines;
  std::uint64_t decoded = 0;
  constexpr std::size_t kBlock = std::size_t{64} * 1024;
  const bool live = log_path == "-";
  while (log->next(record)) {
    if (decoder.append(record, lines)) ++decoded;
    const bool hand_on = live && !input_waits();
    if (lines.size() < kBlock && !hand_on) continue;
    out.write(lines);
    if (hand_on) out.flush();
    lines.clear();
  }
  out.write(lines);

  const can::LogStats& stats = log->stats();
  for (const can::BadLine& bad : stats.first_bad) {
    print(stderr, log_path + ":" + std::to_string(bad.line) + ": " + bad.reason + "\n");
  }
  std::fprintf(stderr,
               "%s: %" PRIu64 " frames, %" PRIu64 " decoded, %" PRIu64
               " that no DBC names, %" PRIu64 " bad lines\n",
               can::printable(log_path).c_str(), stats.frames, decoded, stats.frames - decoded,
               stats.lines_bad);
  if (stats.frames == 0) {
    throw Failure{kBadInput, log_path + ": no readable frame in it, expected a CAN log"};
  }
}

// One log after the other; one that cannot be used does not hide the rest.
void decode(const std::vector<std::string>& dbc_paths, const std::vector<std::string>& log_paths,
            bool with_raw, const std::string& json_path) {
  end_streams_when_stopped(log_paths);
  Decoder decoder(dbc_paths, with_raw);
  Inputs inputs(dbc_paths);
  inputs.add(log_paths);
  OutputFile out(json_path, inputs);
  std::optional<Failure> failure;
  bool any = false;
  for (const std::string& log_path : log_paths) {
    try {
      decode_log(decoder, log_path, out);
      any = true;
    } catch (const Failure& found) {
      if (found.exit_code != kNoInput && found.exit_code != kBadInput) throw;
      if (failure) print(stderr, found.text + "\n");
      if (!failure) failure = found;
    }
  }
  if (any || json_path == "-") out.close();
  if (failure) throw *failure;
}

}  // namespace

void add_dbc(command_line::Command app) {
  const command_line::Command dbc =
      app.add_subcommand("dbc", "show, decode with, or check a DBC file");
  dbc.require_subcommand();

  struct Options {
    std::vector<std::string> dbc_paths;
    std::string path;
    std::vector<std::string> log_paths{"-"};
    std::string show_json_path;
    std::string decode_json_path = "-";
    bool raw = false;
    bool strict = false;
  };
  const auto options = std::make_shared<Options>();

  const command_line::Command show_command =
      dbc.add_subcommand("show", "print what a DBC file says");
  show_command.add_option("FILE", options->path, "DBC file").required();
  show_command.add_option("--json", options->show_json_path,
                          "write JSON to this file, - for standard output");
  show_command.callback([options] { show(options->path, options->show_json_path); });

  const command_line::Command decode_command =
      dbc.add_subcommand("decode", "print the signals of a log's frames, one JSON line a frame");
  decode_command.add_option("--dbc", options->dbc_paths, "DBC file; several may be given")
      .required()
      .allow_extra_args(false);
  decode_command.add_option(
      "LOG", options->log_paths,
      "candump, .asc, .trc or .csv logs, plain, .gz or .zst; - is standard input");
  decode_command.add_flag("--raw", options->raw, "add the raw values");
  decode_command.add_option("--json", options->decode_json_path,
                            "write to this file instead of standard output (-)");
  decode_command.callback([options] {
    decode(options->dbc_paths, options->log_paths, options->raw, options->decode_json_path);
  });

  const command_line::Command check_command =
      dbc.add_subcommand("check", "list every problem of a DBC file");
  check_command.add_option("FILE", options->path, "DBC file").required();
  check_command.add_flag("--strict", options->strict, "refuse warnings too");
  check_command.callback([options] { check(options->path, options->strict); });
}

}  // namespace beltgrip::cli
