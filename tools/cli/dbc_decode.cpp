#include "tools/cli/dbc_decode.h"

#include <poll.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cinttypes>
#include <cmath>
#include <cstdio>
#include <memory>
#include <optional>
#include <set>
#include <string_view>

#include "can_dbc/dbc/bring_near.h"
#include "can_dbc/dbc/message_index.h"
#include "can_dbc/log/can_log.h"
#include "can_dbc/text/printable.h"
#include "tools/cli/dbc_file.h"
#include "tools/cli/decoded_frame.h"
#include "tools/cli/failure.h"
#include "tools/cli/log_trouble.h"
#include "tools/cli/output_file.h"
#include "tools/cli/stop_signals.h"
#include "tools/text/short_number.h"
#include "tools/text/terminal.h"

namespace beltgrip::cli {

namespace {

// The names that were asked for, and which of them were found.
class Names {
 public:
  explicit Names(const std::vector<std::string>& names) : names_(names) {}
  bool all() const { return names_.empty(); }
  bool has(const std::string& name) {
    if (std::find(names_.begin(), names_.end(), name) == names_.end()) return false;
    found_.insert(name);
    return true;
  }
  void demand_all_found(const char* option, const char* what) const {
    for (const std::string& name : names_) {
      if (found_.count(name) == 0) {
        throw Failure{kUsage, std::string("dbc decode: ") + option + ' ' + name + ": no " + what +
                                  " of that name in the DBC (beltgrip dbc show lists them)"};
      }
    }
  }

 private:
  std::vector<std::string> names_;
  std::set<std::string> found_;
};

// The DBC files, and what of them is wanted.
class Decoder {
 public:
  explicit Decoder(const DecodeOptions& options) {
    const std::vector<std::string>& paths = options.dbc_paths;
    for (const std::string& path : paths) {
      results_.push_back(std::make_unique<can::DbcParseResult>(read_dbc(path)));
      const can::DbcParseResult& result = *results_.back();
      mention_problems(path, result.problems);
      if (result.database.messages.empty()) fail_without_message(path);
      databases_.push_back(&result.database);
    }
    index_ = can::MessageIndex(databases_);
    mention_conflicts(paths);
    choose(options);
  }

  // The messages of which something is wanted.
  const std::vector<const ChosenMessage*>& chosen() const { return chosen_; }

  // Before it is looked up.
  void expect(const can::CanFrame& frame) const { index_.bring_near(frame.id); }
  // nullptr: no DBC names the frame.
  const ChosenMessage* message_of(const can::CanFrame& frame) const {
    if (frame.remote || frame.error) return nullptr;
    const can::MessageIndex::Entry* entry = index_.lookup(frame.id);
    return entry == nullptr ? nullptr : &messages_[entry->database][entry->message];
  }
  // False: nothing of it is wanted.
  bool decode(const can::CanFrame& frame, const ChosenMessage& message) {
    if (!message.definition) return false;
    message.codec.decode(frame.payload(), values_);
    for (const std::size_t unwanted : message.unwanted) values_.drop(unwanted);
    if (message.names_repeat) keep_first_of_each_name(message);
    return true;
  }
  const can::DecodedMessage& values() const { return values_; }

 private:
  const can::MessageDef& message_at(can::MessageIndex::Entry entry) const {
    return databases_[entry.database]->messages[entry.message];
  }

  void mention_conflicts(const std::vector<std::string>& paths) const {
    constexpr std::size_t kConflictsShown = 10;
    const auto& conflicts = index_.conflicts();
    for (std::size_t i = 0; i < std::min(conflicts.size(), kConflictsShown); ++i) {
      const can::MessageIndex::Conflict& conflict = conflicts[i];
      text::print(stderr, paths[conflict.ignored.database] + ": message " +
                              message_at(conflict.ignored).name + " has the identifier of " +
                              message_at(conflict.used).name + " in " +
                              paths[conflict.used.database] + ", which is used\n");
    }
    if (conflicts.size() > kConflictsShown) {
      std::fprintf(stderr, "and %zu more messages with an identifier used before\n",
                   conflicts.size() - kConflictsShown);
    }
  }

  void choose(const DecodeOptions& options) {
    Names messages(options.messages);
    Names signals(options.signals);
    std::size_t longest = 0;
    std::size_t number = 0;
    for (const can::Database* database : databases_) {
      messages_.emplace_back(database->messages.size());
      for (std::size_t m = 0; m < database->messages.size(); ++m) {
        const can::MessageDef& definition = database->messages[m];
        if (!messages.all() && !messages.has(definition.name)) continue;
        ChosenMessage message = prepare(definition, signals);
        if (std::count(message.wanted.begin(), message.wanted.end(), true) == 0 && !signals.all()) {
          continue;
        }
        message.number = number++;
        longest = std::max(longest, definition.signals.size());
        messages_.back()[m] = std::move(message);
      }
    }
    messages.demand_all_found("--messages", "message");
    signals.demand_all_found("--signals", "signal");
    std::uint32_t column = 0;
    for (std::vector<ChosenMessage>& database : messages_) {
      for (ChosenMessage& message : database) {
        if (!message.definition) continue;
        for (const bool wanted : message.wanted) {
          message.columns.push_back(column);
          column += wanted ? 1U : 0U;
        }
        chosen_.push_back(&message);
      }
    }
    values_ = can::DecodedMessage(longest);
  }

  static ChosenMessage prepare(const can::MessageDef& definition, Names& signals) {
    ChosenMessage message;
    message.definition = &definition;
    message.codec = can::MessageCodec(definition);
    std::set<std::string_view> names;
    for (const can::SignalDef& signal : definition.signals) {
      message.names_repeat |= !names.insert(signal.name).second;
      // Both, so that each counts as found.
      const bool by_name = signals.has(signal.name);
      const bool by_place = signals.has(definition.name + '.' + signal.name);
      const bool wanted = signals.all() || by_name || by_place;
      if (!wanted) message.unwanted.push_back(message.wanted.size());
      message.wanted.push_back(wanted);
      const bool is_float = message.codec.signal(message.decimals.size()).is_float();
      message.decimals.push_back(
          is_float ? text::kNoDecimals
                   : std::max(text::decimals_of(signal.scale), text::decimals_of(signal.offset)));
    }
    return message;
  }

  // A JSON object has each name once.
  void keep_first_of_each_name(const ChosenMessage& message) {
    std::set<std::string_view> before;
    for (std::size_t i = 0; i < message.wanted.size(); ++i) {
      if (!values_.has(i)) continue;
      if (!before.insert(message.definition->signals[i].name).second) values_.drop(i);
    }
  }

  std::vector<std::unique_ptr<can::DbcParseResult>> results_;
  std::vector<const can::Database*> databases_;
  can::MessageIndex index_;
  std::vector<std::vector<ChosenMessage>> messages_;  // beside the databases' messages
  std::vector<const ChosenMessage*> chosen_;
  can::DecodedMessage values_;
};

// Instants of one log that are wanted, in seconds after its first frame.
class Window {
 public:
  Window(double from_s, double to_s) : from_s_(from_s), to_s_(to_s) {}
  bool has(std::int64_t t_ns) {
    if (std::isinf(from_s_) && std::isinf(to_s_)) return true;  // stamps that go back, too
    if (!has_begun_) begin_ns_ = t_ns;
    has_begun_ = true;
    std::int64_t after_ns = 0;
    if (__builtin_sub_overflow(t_ns, begin_ns_, &after_ns)) return false;
    const double after_s = static_cast<double>(after_ns) * 1e-9;
    return after_s >= from_s_ && after_s <= to_s_;
  }

 private:
  double from_s_;  // -inf and inf: all
  double to_s_;
  std::int64_t begin_ns_ = 0;
  bool has_begun_ = false;
};

// More stands ready on standard input, or it is at its end. Where nothing does, the lines written
// so far must not wait for what may come much later.
bool input_waits() {
  pollfd input{STDIN_FILENO, POLLIN, 0};
  return ::poll(&input, 1, 0) > 0;
}

std::unique_ptr<can::LogReader> open_log(const std::string& path) {
  try {
    return can::LogReader::open(path);
  } catch (const can::LogOpenError& error) {
    throw Failure{kNoInput, error.text};
  }
}

// The next frames of a log. What one of them needs is brought near in steps, each some frames
// before the next, so that none of them waits for the memory that the step before has asked for.
class FramesAhead {
 public:
  // step: frames between one step and the next; 0: each frame is handed on before the next is read.
  FramesAhead(can::LogReader& log, Window window, const Decoder& decoder, const FrameWriter& writer,
              std::size_t step)
      : log_(log), window_(window), decoder_(decoder), writer_(writer), step_(step) {}

  struct Frame {
    can::LogRecord record;
    std::string interface;  // that of the record is the log's until the next one is read
    bool in_time = false;
    const ChosenMessage* message = nullptr;  // of one in time
  };

  // nullptr at the end.
  const Frame* next() {
    while (taken_ == due(kSteps)) {
      if (over_) return nullptr;
      read();
      for (; found_ < due(1); ++found_) {
        Frame& frame = at(found_);
        frame.message = frame.in_time ? decoder_.message_of(frame.record.frame) : nullptr;
        if (frame.message != nullptr) can::bring_near(frame.message, ChosenMessage::kNear);
      }
      for (; expected_ < due(2); ++expected_) {
        const ChosenMessage* const message = at(expected_).message;
        if (message == nullptr) continue;
        message->codec.bring_near();
        writer_.expect(*message);
      }
      for (; near_ < due(3); ++near_) {
        if (const ChosenMessage* message = at(near_).message) writer_.expect_soon(*message);
      }
    }
    return &at(taken_++);
  }

  static constexpr std::size_t kStep = 4;  // chosen by trying: 2 to 8 take the same time

 private:
  static constexpr std::size_t kSteps = 4;

  // Frames that a number of steps lies behind.
  std::size_t due(std::size_t steps) const {
    return over_ ? read_ : read_ - std::min(read_, steps * step_);
  }
  Frame& at(std::size_t frame) { return frames_[frame % frames_.size()]; }

  void read() {
    Frame& frame = at(read_);
    over_ = !log_.next(frame.record);
    if (over_) return;
    frame.in_time = window_.has(frame.record.t_ns);
    if (frame.interface != frame.record.interface) frame.interface = frame.record.interface;
    frame.record.interface = frame.interface;
    decoder_.expect(frame.record.frame);
    ++read_;
  }

  can::LogReader& log_;
  Window window_;
  const Decoder& decoder_;
  const FrameWriter& writer_;
  std::size_t step_;
  bool over_ = false;
  std::array<Frame, 2 * kSteps * kStep> frames_;
  std::size_t read_ = 0, found_ = 0, expected_ = 0, near_ = 0, taken_ = 0;
};

void decode_log(Decoder& decoder, const DecodeOptions& options, const std::string& log_path,
                FrameWriter& writer, OutputFile& out) {
  const std::unique_ptr<can::LogReader> log = open_log(log_path);
  std::string lines;
  std::uint64_t decoded = 0;
  std::uint64_t in_time = 0;
  constexpr std::size_t kBlock = std::size_t{64} * 1024;
  const bool live = log_path == "-";
  FramesAhead frames(*log, Window(options.from_s, options.to_s), decoder, writer,
                     live ? 0 : FramesAhead::kStep);
  while (const FramesAhead::Frame* frame = frames.next()) {
    if (frame->in_time) ++in_time;
    if (frame->message != nullptr && decoder.decode(frame->record.frame, *frame->message)) {
      writer.append({frame->record, *frame->message, decoder.values()}, lines);
      ++decoded;
    }
    const bool hand_on = live && !input_waits();
    if (lines.size() < kBlock && !hand_on) continue;
    out.write(lines);
    if (hand_on) out.flush();
    lines.clear();
  }
  out.write(lines);

  const can::LogStats& stats = log->stats();
  for (const can::BadLine& bad : stats.first_bad) {
    text::print(stderr, bad_line_text(log_path, bad) + "\n");
  }
  const bool all = options.messages.empty() && options.signals.empty();
  std::fprintf(stderr,
               "%s: %" PRIu64 " frames, %" PRIu64 " decoded, %" PRIu64 " %s, %" PRIu64
               " bad lines\n",
               can::printable(log_path).c_str(), stats.frames, decoded, in_time - decoded,
               all ? "that no DBC names" : "not asked for or that no DBC names", stats.lines_bad);
  if (stats.frames == 0) {
    throw Failure{kBadInput, no_frame_text(log_path, stats)};
  }
  if (decoded == 0) {
    throw Failure{kBadInput,
                  log_path + ": none of its " + std::to_string(stats.frames) +
                      " frames is one that was asked for, expected a log of the bus that the DBC "
                      "describes"};
  }
}

struct Output {
  std::string path;
  std::unique_ptr<FrameWriter> writer;
};

Output output_of(const DecodeOptions& options, const Decoder& decoder) {
  const int asked = static_cast<int>(!options.text_path.empty()) +
                    static_cast<int>(!options.csv_path.empty()) +
                    static_cast<int>(!options.json_path.empty());
  if (asked > 1) {
    throw Failure{kUsage,
                  "dbc decode: more than one output, expected one of --text, --csv, --json"};
  }
  if (!options.json_path.empty()) return {options.json_path, json_writer(options.raw)};
  if (!options.csv_path.empty()) {
    return {options.csv_path, csv_writer(decoder.chosen(), options.raw)};
  }
  return {options.text_path.empty() ? "-" : options.text_path, text_writer(options.raw)};
}

}  // namespace

// One log after the other; one that cannot be used does not hide the rest.
void decode(const DecodeOptions& options) {
  if (options.from_s > options.to_s) {
    throw Failure{kUsage, "dbc decode: found a --to before --from, expected it behind"};
  }
  end_logs_when_stopped(options.log_paths);
  Decoder decoder(options);
  const Output output = output_of(options, decoder);
  Inputs inputs(options.dbc_paths);
  inputs.add(options.log_paths);
  OutputFile out(output.path, inputs);
  out.write(output.writer->head());
  std::optional<Failure> failure;
  bool any = false;
  for (const std::string& log_path : options.log_paths) {
    if (any && stop_asked()) break;
    try {
      decode_log(decoder, options, log_path, *output.writer, out);
      any = true;
    } catch (const Failure& found) {
      if (found.exit_code != kNoInput && found.exit_code != kBadInput) throw;
      if (failure) text::print(stderr, found.text + "\n");
      if (!failure) failure = found;
    }
  }
  if (any || output.path == "-") out.close();
  if (failure) throw *failure;
}

}  // namespace beltgrip::cli
