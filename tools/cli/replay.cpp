// beltgrip replay: the daemon's pipeline over logs, as fast as the machine can.
#include <sys/resource.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cstdio>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "tools/cli/bus.h"
#include "tools/cli/command.h"
#include "tools/cli/configuration.h"
#include "tools/cli/log_configuration.h"
#include "tools/cli/log_trouble.h"
#include "tools/cli/output_file.h"
#include "tools/cli/progress.h"
#include "tools/cli/replay_run.h"
#include "tools/cli/resumed_lines.h"
#include "tools/cli/signals_out.h"
#include "tools/cli/stop_signals.h"
#include "tools/text/terminal.h"

namespace beltgrip::cli {

namespace {

struct ReplayOptions {
  std::vector<std::string> logs;
  std::string config;
  std::string method;
  std::string interface;
  double rate_Hz = 0.0;
  bool join = false;
  bool as_recorded = false;
  bool decide_anew = false;
  unsigned jobs = 0;
  std::string json;
  bool resume = false;
  bool quiet = false;
  std::string trace;
  std::string signals;
  std::string log_out;
  std::string bus;
  std::optional<double> speed;

  AsRecorded whether_as_recorded() const {
    if (decide_anew) return AsRecorded::kNever;
    return as_recorded ? AsRecorded::kAlways : AsRecorded::kWherePresent;
  }
};

struct Task {
  std::vector<std::string> paths;
  std::optional<ReplayResult> result;
  std::optional<Failure> failure;
};

void run_task(Task& task, const ReplayOptions& options, const daemon::Config& config,
              const ReplayOutputs& outputs) {
  try {
    task.result =
        replay(task.paths, options.interface, config, outputs, options.whether_as_recorded());
    task.result->stopped = stop_asked();
  } catch (const Failure& failure) {
    task.failure = failure;
  } catch (const std::exception& error) {
    task.failure = Failure{kInternal, task.paths.front() + ": " + error.what()};
  }
}

// Runs the tasks on some threads, reports each in its turn as soon as it is done. Those that a stop
// finds unfinished are not reported.
template <typename Report>
void run_all(std::vector<Task>& tasks, unsigned jobs, const auto& work, const Report& report) {
  std::atomic<std::size_t> next = 0;
  std::mutex mutex;
  std::vector<bool> done(tasks.size(), false);
  std::size_t reported = 0;
  const auto worker = [&] {
    for (std::size_t i = next++; i < tasks.size(); i = next++) {
      work(tasks[i]);
      if (stop_asked() && tasks.size() > 1) return;
      const std::lock_guard lock(mutex);
      done[i] = true;
      for (; reported < tasks.size() && done[reported]; ++reported) {
        report(tasks[reported]);
        tasks[reported] = {};
      }
    }
  };
  std::vector<std::jthread> threads;
  for (unsigned i = 1; i < std::min<std::size_t>(jobs, tasks.size()); ++i) {
    threads.emplace_back(worker);
  }
  worker();
}

// Tells results: those of a single run as they fall, of others when they are done.
class Teller {
 public:
  Teller(std::FILE* json, bool in_words) : json_(json), in_words_(in_words) {}

  void tell(const ReplayResult& result) {
    if (told_ == result.experiments.size()) return;
    if (json_ != nullptr) put(json_, experiment_lines(result, told_));
    if (in_words_) {
      text::print(stdout, experiment_text(result, told_));
      std::fflush(stdout);
    }
    told_ = result.experiments.size();
  }
  void end(const ReplayResult& result) {
    const bool none = result.experiments.empty();
    tell(result);
    if (json_ != nullptr) put(json_, summary_line(result));
    if (in_words_) {
      text::print(stdout, (none ? experiment_text(result) : "") + end_text(result));
    } else if (none) {
      text::complain(result.log + ": " + no_experiment(result));
    }
    told_ = 0;
  }

 private:
  static void put(std::FILE* out, const std::string& lines) {
    std::fwrite(lines.data(), 1, lines.size(), out);
    std::fflush(out);
  }

  std::FILE* json_;
  bool in_words_;
  std::size_t told_ = 0;
};

// Tells of a single run how far it has come.
class ProgressSink final : public daemon::SampleSink {
 public:
  explicit ProgressSink(RunProgress& progress) : progress_(progress) {}
  void on_report(const daemon::SampleReport& report) noexcept override { progress_.at(report.t); }

 private:
  RunProgress& progress_;
};

void print_speed(std::uint64_t frames, std::chrono::steady_clock::time_point begin) {
  const double wall_s =
      std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  const auto seconds = [](const timeval& time) {
    return static_cast<double>(time.tv_sec) + static_cast<double>(time.tv_usec) * 1e-6;
  };
  std::fprintf(stderr,
               "beltgrip: %llu frames in %.3f s, %.2f million frames/s; processor %.3f s, peak "
               "memory %.1f MB\n",
               static_cast<unsigned long long>(frames), wall_s,
               static_cast<double>(frames) / wall_s * 1e-6,
               seconds(usage.ru_utime) + seconds(usage.ru_stime),
               static_cast<double>(usage.ru_maxrss) / 1024.0);
}

// The logs as one timeline onto a bus in real time; BeltGrip's own frames stay out.
void play_logs(const ReplayOptions& options) {
  end_streams_when_stopped(options.logs);
  if (!options.json.empty() || !options.trace.empty() || !options.signals.empty() ||
      !options.log_out.empty()) {
    throw Failure{kUsage,
                  "replay: --bus plays the log; it gives no --json, --trace, --signals-out, "
                  "--log-out"};
  }
  if (options.logs.size() > 1 && !options.join) {
    throw Failure{kUsage, "replay: --bus takes one log, or several with --join"};
  }
  daemon::FrameIdentifiers own;
  if (!options.config.empty()) own = load_configuration(options.config, "").identifiers;
  const auto timeline = open_timeline(options.logs, options.interface, own);
  const auto port = open_bus(options.bus, {}, stop_descriptor());
  play(*port, options.bus, options.speed.value_or(1.0),
       [&](can::StampedFrame& frame) { return timeline->next(frame); });
  if (timeline->counters().frames == 0) {
    throw Failure{kBadInput, options.logs.front() + ": no readable frame"};
  }
  std::fprintf(stderr, "beltgrip: %llu frames played\n",
               static_cast<unsigned long long>(timeline->counters().frames));
}

void check_as_recorded(const ReplayOptions& options, const daemon::Config& config) {
  if (options.as_recorded && options.decide_anew) {
    throw Failure{kUsage, "replay: --as-recorded and --decide-anew exclude each other"};
  }
  if (!options.as_recorded) return;
  if (config.control != daemon::Control::kCommand) {
    throw Failure{kUsage,
                  "replay: --as-recorded follows clamp requests, expected experiment.control = "
                  "\"command\" in " +
                      options.config};
  }
  for (const std::string& log : options.logs) {
    if (log == "-") throw Failure{kUsage, "replay: --as-recorded reads a log twice, not '-'"};
  }
}

// By the end of the file's name. A measurement has its counts in front: it needs a file.
std::unique_ptr<signals::SignalWriter> signal_writer(const std::string& path, OutputFile& file,
                                                     const daemon::Config& config) {
  if (!path.ends_with(".mf4")) return signals::make_csv_writer(file.get(), signal_columns(config));
  if (std::fseek(file.get(), 0, SEEK_SET) != 0) {
    throw Failure{kCannotCreate, path + ": .mf4 cannot be written into a pipe, expected a file"};
  }
  return signals::make_mf4_writer(file.get(), signal_columns(config));
}

bool goes_log_by_log(const ReplayOptions& options) {
  return options.logs.size() > 1 && !options.join;
}

int outputs_on_stdout(const ReplayOptions& options) {
  return (options.json == "-") + (options.trace == "-") + (options.signals == "-") +
         (options.log_out == "-");
}

void check_together(const ReplayOptions& options) {
  if (options.speed) throw Failure{kUsage, "replay: --speed needs --bus"};
  if (options.config.empty()) throw Failure{kUsage, "replay: --config is required"};
  if (goes_log_by_log(options) &&
      (!options.trace.empty() || !options.signals.empty() || !options.log_out.empty())) {
    throw Failure{kUsage,
                  "replay: --trace, --signals-out and --log-out take one log, or several with "
                  "--join"};
  }
  if (outputs_on_stdout(options) > 1) {
    throw Failure{kUsage,
                  "replay: only one of --json, --trace, --signals-out, --log-out can be standard "
                  "output"};
  }
  if (options.resume && (options.json.empty() || options.join)) {
    throw Failure{kUsage, "replay: --resume goes log by log, expected --json FILE and no --join"};
  }
}

// All logs in one, or each that an earlier run has not done.
std::vector<Task> tasks_of(const ReplayOptions& options, const ResumedLines* resumed) {
  std::vector<Task> tasks;
  if (!goes_log_by_log(options) && resumed == nullptr) {
    tasks.push_back({options.logs, {}, {}});
    return tasks;
  }
  for (const std::string& log : options.logs) {
    if (resumed == nullptr || !resumed->has(log)) tasks.push_back({{log}, {}, {}});
  }
  if (resumed != nullptr && resumed->count() > 0) {
    std::fprintf(stderr, "beltgrip: %zu of %zu logs are done\n", options.logs.size() - tasks.size(),
                 options.logs.size());
  }
  return tasks;
}

// The files asked for beside the results.
class Files {
 public:
  Files(const ReplayOptions& options, const Inputs& inputs, const daemon::Config& config) {
    if (!options.trace.empty()) trace_.emplace(options.trace, inputs);
    if (!options.signals.empty()) {
      signals_.emplace(options.signals, inputs);
      signal_writer_ = signal_writer(options.signals, *signals_, config);
    }
    if (!options.log_out.empty()) log_out_.emplace(options.log_out, inputs);
  }
  ReplayOutputs outputs() {
    ReplayOutputs out;
    if (trace_) out.trace = trace_->get();
    out.signals = signal_writer_.get();
    if (log_out_) out.log_out = log_out_->get();
    return out;
  }
  void close() {
    if (trace_) trace_->close();
    if (signal_writer_) signal_writer_->finish();
    if (signals_) signals_->close();
    if (log_out_) log_out_->close();
  }

 private:
  std::optional<OutputFile> trace_, signals_, log_out_;
  std::unique_ptr<signals::SignalWriter> signal_writer_;
};

// Takes the tasks as they end, in the order of their logs.
class Ends {
 public:
  Ends(const ReplayOptions& options, std::size_t tasks, Progress& progress, Teller& teller,
       ResumedLines* resumed)
      : options_(options), tasks_(tasks), progress_(progress), teller_(teller), resumed_(resumed) {}

  void take(const Task& task) {
    progress_.clear();
    if (++done_ < tasks_) {
      progress_.tell(static_cast<double>(done_), "of " + std::to_string(tasks_) + " logs", "logs/s",
                     static_cast<double>(done_) / static_cast<double>(tasks_));
    }
    if (task.failure) {
      text::complain(task.failure->text);
      if (exit_code_ == kDone) exit_code_ = task.failure->exit_code;
    }
    if (task.result) take(*task.result);
  }
  // Nothing was read: what earlier runs left stays.
  void finish() {
    progress_.clear();
    if (done_ < tasks_) {
      text::complain("stopped: " + std::to_string(done_) + " of " + std::to_string(tasks_) +
                     " logs are done");
    }
    if (!any_ && tasks_ > 0) throw Failure{exit_code_, ""};
  }
  std::uint64_t frames() const { return frames_; }
  int exit_code() const { return exit_code_; }

 private:
  void take(const ReplayResult& result) {
    if (!options_.quiet) {
      for (const std::string& note : result.notes) text::complain(note);
    }
    for (const std::string& warning : result.warnings) text::warn(warning);
    any_ = true;
    frames_ += result.frames;
    if (resumed_ != nullptr && !result.stopped &&
        !resumed_->append(experiment_lines(result) + summary_line(result))) {
      text::complain(options_.json + ": cannot write");
      exit_code_ = kCannotWrite;
    }
    teller_.end(result);
  }

  const ReplayOptions& options_;
  std::size_t tasks_, done_ = 0;
  Progress& progress_;
  Teller& teller_;
  ResumedLines* resumed_;
  std::uint64_t frames_ = 0;
  int exit_code_ = kDone;
  bool any_ = false;
};

void run_replay(const ReplayOptions& options) {
  if (!options.bus.empty()) return play_logs(options);
  end_logs_when_stopped(options.logs);
  check_together(options);
  const daemon::Config config =
      load_configuration_for(options.logs, options.rate_Hz, options.config, options.method);
  require_columns(config, options.logs.front());
  check_as_recorded(options, config);
  Inputs inputs(options.logs);
  inputs.add(config.files);
  std::optional<OutputFile> json;
  std::optional<ResumedLines> resumed;
  if (options.resume) {
    resumed.emplace(options.json, inputs);
  } else if (!options.json.empty()) {
    json.emplace(options.json, inputs, Existing::kReplaceResult);
  }
  ResumedLines* const earlier = resumed ? &*resumed : nullptr;
  std::vector<Task> tasks = tasks_of(options, earlier);
  Files files(options, inputs, config);

  Teller teller(json ? json->get() : nullptr, outputs_on_stdout(options) == 0);
  Progress progress(!options.quiet);
  RunProgress run_progress(progress);
  ProgressSink progress_sink(run_progress);
  ReplayOutputs outputs = files.outputs();
  if (tasks.size() == 1) {
    outputs.also = &progress_sink;
    outputs.on_log = [&](const ports::LogTimeline& timeline) { run_progress.reads(timeline); };
    outputs.on_result = [&](const ReplayResult& result) {
      progress.clear();
      teller.tell(result);
    };
  }
  const auto begin = std::chrono::steady_clock::now();
  const unsigned jobs = options.jobs > 0 ? options.jobs : std::thread::hardware_concurrency();
  Ends ends(options, tasks.size(), progress, teller, earlier);
  run_all(
      tasks, std::max(jobs, 1u), [&](Task& task) { run_task(task, options, config, outputs); },
      [&](Task& task) { ends.take(task); });
  ends.finish();
  if (json) json->close();
  files.close();
  if (ends.frames() > 0 && !options.quiet) print_speed(ends.frames(), begin);
  if (ends.exit_code() != kDone) throw Failure{ends.exit_code(), ""};
}

}  // namespace

void add_replay(command_line::Command app) {
  const command_line::Command command =
      app.add_subcommand("replay", "Run the daemon's pipeline over logs, the stamps are the clock");
  auto options = std::make_shared<ReplayOptions>();
  command.add_option("LOG", options->logs, std::string(kLogKinds) + "; or tables of signals (.csv)")
      .type_name("")
      .required();
  command
      .add_option("--config", options->config, "BeltGrip's configuration; required without --bus")
      .type_name("FILE");
  command.add_option("--method", options->method, "Instead of the configuration's")
      .type_name("METHOD")
      .one_of({"robust", "paper"});
  command.add_option("--interface", options->interface, "Frames of this interface only")
      .type_name("INTERFACE");
  add_rate_option(command, options->rate_Hz);
  command.add_flag("--as-recorded", options->as_recorded,
                   "Follow the log's clamp requests (default where it has BeltGripClamp frames)");
  command.add_flag("--decide-anew", options->decide_anew,
                   "Do not: decide as a daemon of now would when to ask");
  command.add_flag("--join", options->join, "The logs are one timeline, not separate runs");
  command.add_option("--jobs", options->jobs, "Logs at the same time (default: all processors)")
      .range(1, 1024);
  command.add_option("--json", options->json, "Results as JSON lines, '-': standard output")
      .type_name("FILE");
  command.add_flag("--resume", options->resume,
                   "Go on in the file of --json: logs that stand in it are left out");
  command.add_option("--trace", options->trace, "Every sample of the experiments as CSV")
      .type_name("FILE");
  command
      .add_option("--signals-out", options->signals,
                  "Inputs and estimate at every sample: .mf4 (MDF 4.1), any other name CSV")
      .type_name("FILE");
  command
      .add_option("--log-out", options->log_out,
                  "What the daemon would have put on the bus, as a candump log")
      .type_name("FILE");
  command.add_flag("--quiet", options->quiet, "Neither progress nor speed on standard error");
  command.add_option("--bus", options->bus, "Play the log onto this bus in real time instead")
      .type_name("BUS");
  command.add_option("--speed", options->speed, "Times real time, with --bus (default: 1)")
      .range(1e-3, 1e3);
  command.example(
      "beltgrip replay drive/trace.log --config drive/beltgrip.toml --json results.json");
  command.example("beltgrip replay logs/*.log.zst --config mycar.toml --json fleet.jsonl --resume");
  command.example("candump -L can0 | beltgrip replay - --config mycar.toml");
  command.callback([options] { run_replay(*options); });
}

}  // namespace beltgrip::cli
