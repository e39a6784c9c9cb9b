// One replay: the daemon's pipeline over a timeline of logs, and what came out of it as JSON lines
// and as text. Tools only.
#pragma once

#include <array>
#include <cstdint>
#include <cstdio>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "daemon/core/base/port.h"
#include "daemon/core/config/options/config.h"
#include "daemon/core/experiment/arming.h"
#include "daemon/core/experiment/recorded_requests.h"
#include "daemon/core/loop/loop.h"
#include "daemon/core/loop/pipeline.h"
#include "daemon/core/observe/carried_record.h"
#include "tools/ports/log_timeline.h"
#include "tools/signals/signal_writer.h"

namespace beltgrip::cli {

struct ReplayResult {
  std::string log;  // its name: the path, joined ones with "+"
  std::vector<daemon::ExperimentResult> experiments;
  std::vector<std::string> lost;     // with each: the roles that were lost as it ended; empty: none
  std::vector<std::string> assumed;  // keys that nobody stated and a result rests on
  std::vector<std::string> warnings;  // one line each
  std::vector<std::string> notes;     // the same, of what is as it should be
  std::uint64_t frames = 0;           // in the log
  std::uint64_t frames_decoded = 0;
  std::uint64_t frames_bad = 0;
  std::uint64_t lines_bad = 0;
  std::int64_t duration_ns = 0;
  // Clamp requests of the log that were followed; none: it was decided anew when to ask.
  std::optional<std::vector<daemon::RecordedRequest>> requests_followed;
  std::string unusable;      // what was wrong with the inputs in the end; empty: nothing
  bool stopped = false;      // by a signal, before its end
  daemon::BeyondBox beyond;  // while no experiment ran and the driver's feet did not forbid one
  // What was carried without slip.
  std::vector<daemon::CarriedWindow> carried_windows;
  daemon::CarriedBounds carried{};
  // How long each daemon::Inhibit kept an experiment from beginning while the driver's feet did
  // not, triggers "coast_down" and "steady".
  std::array<double, daemon::kInhibitCount> inhibited_s{};
  std::array<std::string, daemon::kInhibitCount> inhibit_figures;  // of most of it
};

struct ReplayOutputs {
  std::FILE* trace = nullptr;                          // CSV, one row a sample of an experiment
  signals::SignalWriter* signals = nullptr;            // every sample
  std::FILE* log_out = nullptr;                        // candump, what the daemon would have sent
  daemon::SampleSink* also = nullptr;                  // sees every report, after the results
  std::function<void(const ReplayResult&)> on_result;  // at each, then the last
  std::function<void(const ports::LogTimeline&)> on_log;  // before its first sample
};

// The logs as one timeline, without BeltGrip's own frames where `own` is given; those of an
// interface named as the further bus's are of that bus, all others of the first. wanted:
// FrameSelection. Throws Failure 66.
std::unique_ptr<ports::LogTimeline> open_timeline(
    const std::vector<std::string>& paths, const std::string& interface,
    const std::optional<daemon::FrameIdentifiers>& own, const std::string& further_interface = "",
    std::vector<daemon::WantedFrames> wanted = {});
// What the configuration reads: BeltGrip's own frames are no input, the further bus is one, and a
// table of signals is read as its columns say.
std::unique_ptr<ports::LogTimeline> open_timeline(const std::vector<std::string>& paths,
                                                  const std::string& interface,
                                                  const daemon::Config& config,
                                                  std::vector<daemon::WantedFrames> wanted = {});
// Empty where the configuration has one bus.
std::string further_interface(const daemon::Config& config);

// With control "command": whether it follows the clamp requests that the logs have.
enum class AsRecorded : std::uint8_t { kWherePresent, kAlways, kNever };

// Throws Failure: 66 a log is missing, 65 it has no readable frame.
ReplayResult replay(const std::vector<std::string>& paths, const std::string& interface,
                    const daemon::Config& config, const ReplayOutputs& outputs,
                    AsRecorded as_recorded = AsRecorded::kWherePresent);

// The daemon's loop on this port until it closes; the results go into `result`.
void run_daemon(daemon::Port& port, const daemon::Config& config, ReplayResult& result,
                const ReplayOutputs& outputs = {});

// The experiments from one on, a JSON line each; and the line of the summary.
std::string experiment_lines(const ReplayResult& result, std::size_t from = 0);
std::string summary_line(const ReplayResult& result);
// Why there was none.
std::string no_experiment(const ReplayResult& result);
// In words: the experiments from one on, with the log's name before the first; and what follows
// the last.
std::string experiment_text(const ReplayResult& result, std::size_t from = 0);
std::string end_text(const ReplayResult& result);

std::string outcome_text(daemon::Outcome outcome);
std::string reason_text(estimator::StopReason reason);

}  // namespace beltgrip::cli
