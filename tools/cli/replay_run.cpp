#include "tools/cli/replay_run.h"

#include <cmath>
#include <filesystem>
#include <memory>
#include <optional>
#include <span>

#include "can_dbc/log/can_log.h"
#include "can_dbc/log/candump_writer.h"
#include "can_dbc/text/format.h"
#include "daemon/core/config/load/signal_catalogue.h"
#include "daemon/core/loop/loop.h"
#include "daemon/core/observe/reasons_now.h"
#include "daemon/core/publish/names.h"
#include "daemon/core/publish/own_frames.h"
#include "daemon/io/carried_keeper.h"
#include "daemon/io/reloader.h"
#include "tools/cli/failure.h"
#include "tools/cli/log_trouble.h"
#include "tools/cli/recorded_log.h"
#include "tools/cli/signals_out.h"
#include "tools/ports/log_timeline.h"
#include "tools/ports/record_port.h"
#include "tools/ports/replay_port.h"
#include "tools/table/table_log.h"
#include "tools/text/joined.h"
#include "tools/text/json_writer.h"
#include "tools/text/seconds.h"
#include "tools/text/snake_case.h"

namespace beltgrip::cli {

namespace {

constexpr std::size_t kBadLinesShown = 3;
constexpr double kShownInhibit_s = 0.05;

// Collects the results and writes the trace as samples come.
class Sink final : public daemon::SampleSink {
 public:
  Sink(ReplayResult& result, const daemon::Pipeline& pipeline, const daemon::Config& config,
       const ReplayOutputs& outputs)
      : result_(result),
        pipeline_(pipeline),
        config_(config),
        trace_(outputs.trace),
        signals_(outputs.signals),
        also_(outputs.also),
        on_result_(outputs.on_result),
        period_s_(1.0 / config.estimator.sample_rate_hz),
        watch_(config.control == daemon::Control::kCommand) {
    for (int phase = 0; phase < 4; ++phase) {
      phases_[phase] = daemon::phase_name(static_cast<estimator::Phase>(phase));
    }
    if (trace_ != nullptr) {
      std::fputs(
          "t_s,mu_star,sigma_star_percent,slip_variance,friction_slope,phase,clamp_force_N,"
          "torque_p_Nm,macro_slip_stop,mu_max_expected,mu_max_low,mu_max_high\n",
          trace_);
    }
  }

  void on_report(const daemon::SampleReport& report) noexcept override {
    if (report.new_result) {
      result_.experiments.push_back(report.result);
      result_.lost.push_back(lost_now());
      if (on_result_) on_result_(result_);
    }
    if (const daemon::CarriedWindow* window = watch_.step(report)) {
      result_.carried_windows.push_back(*window);
    }
    count_inhibits(report, 1);
    if (also_ != nullptr) also_->on_report(report);
    if (signals_ != nullptr) {
      signal_values(report, pipeline_, config_, values_);
      signals_->row(report.t.ns(), values_);
    }
    if (trace_ == nullptr || !report.in_experiment || !report.curve.usable) return;
    const estimator::CurveEstimate& curve = report.curve;
    row_ = text::seconds_text(report.t.ns());
    for (const double value :
         {curve.mu_star, curve.sigma_star_percent, curve.slip_variance, curve.friction_slope}) {
      append(value);
    }
    row_ += ',';
    row_ += phases_[static_cast<std::size_t>(curve.phase)];
    append(curve.clamp_force_N);
    append(curve.torque_p_Nm);
    row_ += report.macro_slip_stop ? ",1" : ",0";
    for (const double value : {curve.mu_max_expected, curve.mu_max_low, curve.mu_max_high}) {
      if (curve.mu_max_expected > 0.0) {
        append(value);
      } else {
        row_ += ',';
      }
    }
    row_ += '\n';
    std::fwrite(row_.data(), 1, row_.size(), trace_);
  }

  void on_silence(const daemon::SampleReport& last, std::int64_t samples) noexcept override {
    count_inhibits(last, samples);
    if (also_ != nullptr) also_->on_silence(last, samples);
  }

 private:
  void count_inhibits(const daemon::SampleReport& report, std::int64_t samples) noexcept {
    if (report.in_experiment) return;
    const bool by_feet = is_by_feet(report.inhibits);
    if (!by_feet) result_.beyond.take(report.beyond);
    for (std::size_t i = 0; i < daemon::kInhibitCount; ++i) {
      if ((report.inhibits >> i & 1) == 0) continue;
      // The figure is that of without a foot on a pedal, where there is such a time, and taken
      // again as the time doubles: of most of it, not of how it began.
      double& held_s = by_feet ? by_feet_s_[i] : result_.inhibited_s[i];
      double& figure_s = by_feet ? figure_by_feet_s_[i] : figure_s_[i];
      held_s += static_cast<double>(samples) * period_s_;
      if (held_s < std::max(kShownInhibit_s, 2.0 * figure_s)) continue;
      if (by_feet && figure_s_[i] > 0.0) continue;
      figure_s = held_s;
      result_.inhibit_figures[i] = daemon::figure_of(static_cast<daemon::Inhibit>(i), config_,
                                                     report, daemon::signals_of(pipeline_));
    }
  }

  // Where the inputs forbid an experiment nothing else is looked at: the pedals are asked here.
  bool is_by_feet(std::uint32_t inhibits) const noexcept {
    if ((inhibits & kFeet) != 0) return true;
    if ((inhibits & daemon::inhibit_bit(daemon::Inhibit::kInputs)) == 0) return false;
    const auto pressed = [&](daemon::Role role, double most) {
      const daemon::SignalObservation signal = pipeline_.signal(role);
      return signal.seen && signal.value > most;
    };
    const bool coast = config_.trigger == daemon::Trigger::kCoastDown;
    return (coast && pressed(daemon::Role::kAcceleratorPedal, daemon::Arming::kPedalReleased)) ||
           pressed(daemon::Role::kBrakePressed, 0.5);
  }

  std::string lost_now() const {
    std::string roles;
    for (std::size_t i = 0; i < daemon::kRoleCount; ++i) {
      const auto role = static_cast<daemon::Role>(i);
      const estimator::ReadingVerdict verdict = pipeline_.signal(role).status.verdict;
      if (verdict != estimator::ReadingVerdict::kStale &&
          verdict != estimator::ReadingVerdict::kFrozen) {
        continue;
      }
      roles += (roles.empty() ? "" : ", ") + std::string(daemon::role_name(role));
    }
    return roles;
  }

  // A value that is no number leaves its cell empty.
  void append(double value) {
    row_ += ',';
    if (!std::isfinite(value)) return;
    char buffer[32];
    row_.append(buffer, std::to_chars(buffer, buffer + sizeof buffer, value).ptr);
  }

  static constexpr std::uint32_t kFeet =
      daemon::inhibit_bit(daemon::Inhibit::kPedal) | daemon::inhibit_bit(daemon::Inhibit::kBrake);

  ReplayResult& result_;
  const daemon::Pipeline& pipeline_;
  const daemon::Config& config_;
  std::FILE* trace_;
  signals::SignalWriter* signals_;
  std::vector<double> values_;                             // of one sample
  std::array<double, daemon::kInhibitCount> by_feet_s_{};  // as ReplayResult.inhibited_s
  std::array<double, daemon::kInhibitCount> figure_s_{}, figure_by_feet_s_{};  // at the last figure
  daemon::SampleSink* also_;
  std::function<void(const ReplayResult&)> on_result_;
  double period_s_;
  daemon::CarriedWatch watch_;
  std::string phases_[4];
  std::string row_;
};

void describe_troubles(const can::LogStats& stats, const ports::TimelineCounters& counters,
                       ReplayResult& result) {
  for (std::size_t i = 0; i < stats.first_bad.size() && i < kBadLinesShown; ++i) {
    result.warnings.push_back(bad_line_text(result.log, stats.first_bad[i]));
  }
  if (stats.lines_bad > kBadLinesShown) {
    result.warnings.push_back(result.log + ": " + unreadable_text(stats) + " in all");
  }
  if (counters.frames_bad > 0) {
    result.warnings.push_back(result.log + ": " + left_out_text(counters.frames_bad));
  }
  if (counters.clock_steps > 0) {
    result.warnings.push_back(result.log + ": the clock of the log was set " +
                              std::to_string(counters.clock_steps) +
                              " times; later times are shifted");
  }
}

Failure no_frames(const ReplayResult& result, const can::LogStats& stats,
                  const std::string& interface) {
  if (stats.frames > 0 && !interface.empty()) {
    return {kBadInput, result.log + ": no frame of interface " + interface + " among " +
                           std::to_string(stats.frames)};
  }
  return {kBadInput, no_frame_text(result.log, stats)};
}

}  // namespace

std::string outcome_text(daemon::Outcome outcome) {
  return text::snake_case(daemon::outcome_name(outcome));
}
std::string reason_text(estimator::StopReason reason) {
  return text::snake_case(daemon::stop_reason_name(reason));
}

namespace {

using Open = std::function<std::unique_ptr<can::LogReader>(const std::string& path)>;

std::unique_ptr<ports::LogTimeline> open_logs(const std::vector<std::string>& paths,
                                              const Open& open, ports::FrameSelection selection) {
  std::vector<std::unique_ptr<can::LogReader>> readers;
  for (const std::string& path : paths) {
    try {
      readers.push_back(open(path));
    } catch (const can::LogOpenError& error) {
      throw Failure{kNoInput, error.text};
    }
  }
  return std::make_unique<ports::LogTimeline>(std::move(readers), std::move(selection));
}

}  // namespace

std::unique_ptr<ports::LogTimeline> open_timeline(
    const std::vector<std::string>& paths, const std::string& interface,
    const std::optional<daemon::FrameIdentifiers>& own, const std::string& further_interface,
    std::vector<daemon::WantedFrames> wanted) {
  ports::FrameSelection selection;
  selection.interface = interface;
  selection.further_interface = further_interface;
  selection.wanted = std::move(wanted);
  for (std::size_t i = 0; own && i < daemon::kOwnMessageCount; ++i) {
    selection.ignored.push_back(
        {daemon::own_identifier(*own, static_cast<daemon::OwnMessage>(i)), false});
  }
  return open_logs(
      paths, [](const std::string& path) { return can::LogReader::open(path); },
      std::move(selection));
}

std::unique_ptr<ports::LogTimeline> open_timeline(const std::vector<std::string>& paths,
                                                  const std::string& interface,
                                                  const daemon::Config& config,
                                                  std::vector<daemon::WantedFrames> wanted) {
  if (!config.table) {
    return open_timeline(paths, interface, config.identifiers, further_interface(config),
                         std::move(wanted));
  }
  ports::FrameSelection selection;
  selection.interface = interface;
  selection.wanted = std::move(wanted);
  return open_logs(
      paths,
      [&config](const std::string& path) {
        return table::open(path, config.table->columns, config.table->rate_Hz);
      },
      std::move(selection));
}

std::string further_interface(const daemon::Config& config) {
  return config.further_bus ? config.further_bus->interface : "";
}

namespace {

// Why no value of a role came.
std::string why_unseen(const daemon::Pipeline& pipeline, const daemon::Config& config,
                       daemon::Role role) {
  std::string no_value = "no frame brought a value of it that is in the DBC's range";
  const auto bound = std::find_if(config.roles.begin(), config.roles.end(),
                                  [role](const auto& each) { return each.role == role; });
  if (bound == config.roles.end() || bound->uds) return no_value;
  const daemon::RoleBinding& binding = *bound;
  const daemon::FramesCame came = pipeline.frames_came(role);
  if (config.table) {
    return came == daemon::FramesCame::kTaken
               ? no_value
               : "no cell of its column \"" + binding.message_name + "\" is a value";
  }
  const std::string frame = binding.message_name + " (" + daemon::id_text(binding.id) + ")";
  switch (came) {
    case daemon::FramesCame::kNone:
      return "no frame of " + frame + " came" +
             (binding.bus == 0 ? "" : " on " + further_interface(config));
    case daemon::FramesCame::kOfOtherKind:
      return "every frame of " + frame + " has another length or kind than the DBC's " +
             std::to_string(binding.message_length) + " bytes, " +
             (binding.message_fd ? "CAN FD" : "classic");
    case daemon::FramesCame::kRefused:
      return "every frame of " + frame + " is refused, its counter or CRC is wrong";
    case daemon::FramesCame::kTaken:
      break;
  }
  return no_value;
}

// What keeps the inputs at the end of a log from being a sample; empty if nothing does.
std::string why_unusable(const daemon::Pipeline& pipeline, const daemon::Config& config) {
  using daemon::Role;
  const Role torque =
      config.estimator.torque_is_engine ? Role::kEngineTorque : Role::kPrimaryTorque;
  for (const Role role :
       {Role::kPrimarySpeed, Role::kSecondarySpeed, Role::kSecondaryPressure, torque}) {
    const std::string name(daemon::role_name(role));
    const daemon::SignalObservation seen = pipeline.signal(role);
    if (!seen.seen) return name + ": " + why_unseen(pipeline, config, role);
    if (role == Role::kPrimarySpeed && seen.value <= 0.0) {
      return name + format(" is not above zero (last %.3g rad/s); is its sign wrong?", seen.value);
    }
  }
  return "";
}

void run_pipeline(daemon::Port& port, daemon::Pipeline& pipeline, const daemon::Config& config,
                  estimator::StopReason end, ReplayResult& result, const ReplayOutputs& outputs) {
  result.assumed = config.assumed;
  Sink sink(result, pipeline, config, outputs);
  daemon::run_loop(port, pipeline, config.estimator.sample_rate_hz, end, &sink);
  result.frames_decoded = pipeline.counters().frames_decoded;
  result.frames_bad = pipeline.counters().frames_bad;
  result.unusable = why_unusable(pipeline, config);
  daemon::CarriedRecord record(config);
  for (const daemon::CarriedWindow& window : result.carried_windows) {
    record.take(window, daemon::seconds(window.end.since_origin()));
  }
  result.carried = record.bounds();
}

// What the flight recorder wrote; 0: a log. It is read twice, which a pipe cannot be.
int record_version(const std::string& path) {
  std::error_code none;
  if (!std::filesystem::is_regular_file(path, none)) return 0;
  try {
    const std::optional<int> version = ports::RecordPort::version_of(path);
    constexpr int kNewest = ports::RecordPort::kVersion;
    if (version && (*version < 1 || *version > kNewest)) {
      throw Failure{kBadInput, path + ": found a flight record of version " +
                                   std::to_string(*version) + ", expected 1 to " +
                                   std::to_string(kNewest)};
    }
    return version.value_or(0);
  } catch (const can::LogOpenError& error) {
    throw Failure{kNoInput, error.text};
  }
}

// What the flight recorder kept, decided again as the daemon did.
ReplayResult replay_record(const std::string& path, const daemon::Config& config,
                           const ports::ReplayPort::Receiver& receiver,
                           const ReplayOutputs& outputs) {
  ReplayResult result;
  result.log = path;
  daemon::Pipeline pipeline(config);
  ports::RecordPort port(path, receiver, [&](const ports::RecordedKnowledge& known) {
    estimator::LearnedFriction learned;
    for (std::size_t i = 0; i < learned.groups.size(); ++i) {
      learned.groups[i].known = known.groups[i].mu_max > 0.0;
      learned.groups[i].mu_max = known.groups[i].mu_max;
      learned.groups[i].ci95_low = known.groups[i].low;
      learned.groups[i].repeatability_percent = known.groups[i].scatter_percent;
    }
    using estimator::BeltMemory;
    if (known.memory.size() == BeltMemory::kNumbers) {
      const std::span<const double, BeltMemory::kNumbers> numbers(known.memory);
      learned.memory = BeltMemory::of_numbers(numbers);
    }
    learned.doubtful = known.doubtful;
    learned.unwritten = known.unwritten;
    pipeline.learn(learned);
  });
  run_pipeline(port, pipeline, config,
               port.ends_with_the_daemon() ? estimator::StopReason::kShutdown
                                           : estimator::StopReason::kTraceEnd,
               result, outputs);
  result.frames = port.stats().frames;
  result.lines_bad = port.stats().lines_bad;
  result.duration_ns = port.duration().ns();
  describe_troubles(port.stats(), {}, result);
  return result;
}

std::string followed_text(const RecordedLog& recorded) {
  const std::string count = std::to_string(recorded.requests.size());
  return "as recorded: experiments follow the " + count + " clamp requests of the log, " +
         std::to_string(recorded.cut) + " more lack their beginning (--decide-anew follows none)";
}

// What to follow; nothing: the pipeline decides itself when to ask.
std::optional<daemon::RecordedRequests> to_follow(const std::vector<std::string>& paths,
                                                  const std::string& interface,
                                                  const daemon::Config& config,
                                                  AsRecorded as_recorded, ReplayResult& result) {
  if (config.control != daemon::Control::kCommand || as_recorded == AsRecorded::kNever) return {};
  std::optional<RecordedLog> recorded = recorded_requests(paths, interface, config);
  if (!recorded && as_recorded == AsRecorded::kAlways) recorded.emplace();
  if (!recorded) return {};
  result.requests_followed = recorded->requests;
  result.notes.push_back(result.log + ": " + followed_text(*recorded));
  return daemon::RecordedRequests(std::move(recorded->requests));
}

}  // namespace

void run_daemon(daemon::Port& port, const daemon::Config& config, ReplayResult& result,
                const ReplayOutputs& outputs) {
  daemon::Pipeline pipeline(config);
  run_pipeline(port, pipeline, config, estimator::StopReason::kTraceEnd, result, outputs);
}

ReplayResult replay(const std::vector<std::string>& paths, const std::string& interface,
                    const daemon::Config& config, const ReplayOutputs& outputs,
                    AsRecorded as_recorded) {
  ReplayResult result;
  result.log = text::joined(paths, "+");
  const std::string further = further_interface(config);
  ports::ReplayPort::Receiver receiver;
  std::unique_ptr<can::CandumpWriter> writer;
  if (outputs.log_out != nullptr) {
    writer = std::make_unique<can::CandumpWriter>(outputs.log_out);
    receiver = [&](daemon::MonoTime t, const can::CanFrame& frame, std::uint8_t bus) {
      writer->write(t.ns(), bus == 0 ? config.interface : further, frame);
    };
  }
  const int version = paths.size() == 1 && interface.empty() ? record_version(paths[0]) : 0;
  if (version > 0) {
    result = replay_record(paths[0], config, receiver, outputs);
    if (version < ports::RecordPort::kVersion) {
      result.warnings.push_back(result.log + ": a flight record of version " +
                                std::to_string(version) + ": of what the history had learned it " +
                                (version == 1 ? "has mu_max alone" : "lacks the newest results") +
                                ", forces may differ from the daemon's");
    }
    return result;
  }
  const auto timeline = open_timeline(paths, interface, config, daemon::wanted_frames(config));
  if (outputs.on_log) outputs.on_log(*timeline);
  ports::ReplayPort port(*timeline, std::move(receiver));
  const can::LogStats head = timeline->stats();
  if (head.frames == 0 || port.empty()) throw no_frames(result, head, interface);

  if (auto recorded = to_follow(paths, interface, config, as_recorded, result)) {
    daemon::Pipeline pipeline(config, *std::move(recorded));
    run_pipeline(port, pipeline, config, estimator::StopReason::kTraceEnd, result, outputs);
  } else {
    run_daemon(port, config, result, outputs);
  }

  const can::LogStats stats = timeline->stats();
  const ports::TimelineCounters& counters = timeline->counters();
  result.frames = stats.frames;
  result.frames_bad += counters.frames_bad;
  result.lines_bad = stats.lines_bad;
  result.duration_ns = counters.last_ns - counters.first_ns;
  describe_troubles(stats, counters, result);
  return result;
}

namespace {

// A shaft that is read as standing still, or as turning the other way, is no slip.
constexpr double kSlipMost_percent = 100.0;

}  // namespace

namespace {

void interval(text::JsonWriter& json, bool known, double low, double high) {
  if (known) {
    json.begin_array().value(low).value(high).end_array();
  } else {
    json.null();
  }
}

// The readings that are not what they should be.
void doubted(text::JsonWriter& json, const estimator::ReadingStatuses& readings) {
  json.key("doubted").begin_array();
  for (std::size_t i = 0; i < readings.size(); ++i) {
    if (!estimator::is_doubtful(readings[i].verdict)) continue;
    json.begin_object()
        .field("channel", estimator::kChannels[i])
        .field("verdict", estimator::verdict_text(readings[i].verdict))
        .key("since_s")
        .raw(text::seconds_text(readings[i].since_ns))
        .end_object();
  }
  json.end_array();
}

}  // namespace

std::string experiment_lines(const ReplayResult& result, std::size_t from) {
  std::string lines;
  text::JsonWriter json;
  for (std::size_t i = from; i < result.experiments.size(); ++i) {
    const daemon::ExperimentResult& e = result.experiments[i];
    const bool completed = e.outcome == daemon::Outcome::kCompleted;
    const bool slips = e.stopped && e.sigma_stop_percent < kSlipMost_percent;
    json.begin_object()
        .field("type", "experiment")
        .field("log", result.log)
        .key("start_s")
        .raw(text::seconds_text(e.start.ns()))
        .key("stop_s")
        .raw(e.stopped ? text::seconds_text(e.end.ns()) : "null")
        .field("outcome", outcome_text(e.outcome))
        .field("stop_reason", reason_text(e.stop_reason))
        .field("mu_max", completed ? e.peak.mu_max : text::kJsonNull)
        .field("mu_max_std", completed ? e.peak.mu_max_std : text::kJsonNull)
        .key("mu_max_ci95");
    interval(json, completed, e.peak.ci95_low, e.peak.ci95_high);
    json.key("mu_max_ci95_noise");
    interval(json, completed, e.peak.noise_low, e.peak.noise_high);
    json.key("assumed").begin_array();
    for (const std::string& key : result.assumed) json.value(key);
    json.end_array();
    json.field("reason", why(e, result.lost[i])).field("remedy", remedy_of(e));
    json.field("mu_max_lower_bound", has_bound(e) ? e.peak.mu_max : text::kJsonNull)
        .field("sigma_stop_percent", slips ? e.sigma_stop_percent : text::kJsonNull)
        .field("contradictory", e.peak.contradictory)
        .field("impossible", e.peak.impossible)
        .field("sigma_peak_percent", completed ? e.peak.sigma_peak_percent : text::kJsonNull)
        .field("samples", e.samples);
    doubted(json, e.peak.readings);
    json.field("direction", text::snake_case(daemon::direction_name(e.direction)))
        .field("ratio", text::snake_case(daemon::end_stop_name(e.end_stop)))
        .end_object();
    lines += json.take() + "\n";
  }
  return lines;
}

namespace {

// Of an inhibit, as it first held; of what lay beyond a box, the furthest.
std::string figure_shown(const ReplayResult& result, std::size_t inhibit) {
  const bool beyond = static_cast<daemon::Inhibit>(inhibit) == daemon::Inhibit::kModel;
  return beyond && result.beyond ? daemon::beyond_text(result.beyond)
                                 : result.inhibit_figures[inhibit];
}

}  // namespace

std::string summary_line(const ReplayResult& result) {
  text::JsonWriter json;
  json.begin_object()
      .field("type", "summary")
      .field("log", result.log)
      .field("frames", result.frames)
      .field("frames_decoded", result.frames_decoded)
      .field("frames_bad", result.frames_bad)
      .field("lines_bad", result.lines_bad)
      .key("duration_s")
      .raw(text::seconds_text(result.duration_ns))
      .field("stopped", result.stopped)
      .key("requests_followed");
  if (result.requests_followed) {
    json.value(result.requests_followed->size());
  } else {
    json.null();
  }
  json.key("inhibits").begin_array();
  for (std::size_t i = 0; i < daemon::kInhibitCount; ++i) {
    if (result.inhibited_s[i] < kShownInhibit_s) continue;
    const daemon::Reason reason =
        daemon::reason_of(static_cast<daemon::Inhibit>(i), figure_shown(result, i));
    json.begin_object()
        .field("name", reason.name)
        .field("seconds", result.inhibited_s[i])
        .field("means", reason.means)
        .field("figure", reason.figure)
        .field("remedy", reason.remedy)
        .end_object();
  }
  json.end_array();
  json.key("carried").raw(daemon::carried_json_text(result.carried));
  json.end_object();
  return json.take() + "\n";
}

namespace {

// What the belt carried without slip, a line for each direction and end stop.
std::string carried_lines(const ReplayResult& result) {
  std::string text;
  for (std::size_t group = 0; group < result.carried.size(); ++group) {
    const daemon::CarriedBound& bound = result.carried[group];
    if (bound.known()) {
      text += "  " + daemon::group_text(group) + format(", at %.1f s: ", bound.time_s) +
              daemon::carried_text(bound) + "\n";
    } else if (bound.refused_mu_star > 0.0) {
      text += "  " + daemon::group_text(group) + ": " + daemon::refused_text(bound) + "\n";
    }
  }
  return text;
}

// What kept experiments from beginning, and how long; empty: nothing for long.
std::string inhibits_text(const ReplayResult& result) {
  std::string why;
  for (std::size_t i = 0; i < daemon::kInhibitCount; ++i) {
    if (result.inhibited_s[i] < kShownInhibit_s) continue;
    why += (why.empty() ? "" : ", ") + std::string(daemon::kInhibits[i].name) +
           format(" %.1f s", result.inhibited_s[i]);
  }
  return why;
}

// Of each of them what it means, its figure when it first held, and what to do.
std::string inhibit_words(const ReplayResult& result) {
  std::string text;
  for (std::size_t i = 0; i < daemon::kInhibitCount; ++i) {
    if (result.inhibited_s[i] < kShownInhibit_s) continue;
    const auto inhibit = static_cast<daemon::Inhibit>(i);
    text += "    " + reason_text(reason_of(inhibit, figure_shown(result, i))) + "\n";
  }
  return text;
}

}  // namespace

std::string no_experiment(const ReplayResult& result) {
  std::string why = result.unusable;
  const std::string inhibits = inhibits_text(result);
  if (why.empty() && !inhibits.empty()) why = "with no pedal pressed, kept away by " + inhibits;
  if (why.empty() && result.frames_bad > result.frames_decoded) {
    why = "counter or CRC is wrong in " + std::to_string(result.frames_bad) + " of " +
          std::to_string(result.frames_bad + result.frames_decoded) +
          " frames of its messages: a log of two interfaces (--interface takes one)? `beltgrip "
          "check` tells them apart";
  }
  if (why.empty()) why = "the trigger's conditions never held for long enough";
  return "no experiment: " + why;
}

std::string experiment_text(const ReplayResult& result, std::size_t from) {
  std::string out = from == 0 ? result.log + "\n" : "";
  for (std::size_t i = from; i < result.experiments.size(); ++i) {
    const daemon::ExperimentResult& e = result.experiments[i];
    out += "  " + outcome_text(e.outcome) + ", " +
           text::snake_case(daemon::direction_name(e.direction)) + ", " +
           text::snake_case(daemon::end_stop_name(e.end_stop)) + ": ";
    const double end_s = static_cast<double>(e.end.ns()) * 1e-9;
    const double length_s = static_cast<double>((e.end - e.start).ns()) * 1e-9;
    out += e.stopped ? format("stopped at %.3f s", end_s) : format("ended at %.3f s", end_s);
    out += format(" (%s) after %.1f s", reason_text(e.stop_reason).c_str(), length_s);
    if (e.stopped) out += format(", at %.2f %% slip", e.sigma_stop_percent);
    const std::string cause = has_bound(e) ? why(e) : daemon::cause_text(e.stop_reason, e.cause);
    if (!cause.empty()) out += ": " + cause;
    out += "\n";
    if (e.outcome == daemon::Outcome::kCompleted) {
      out += format("  mu_max %.4f, std %.4f, 95 %% %.4f .. %.4f, peak at %.2f %% slip\n",
                    e.peak.mu_max, e.peak.mu_max_std, e.peak.ci95_low, e.peak.ci95_high,
                    e.peak.sigma_peak_percent);
    } else {
      const std::string remedy(remedy_of(e));
      out += has_bound(e) ? format("  mu_max is at least %.4f", e.peak.mu_max)
                          : "  no value: " + why_no_value(e, result.lost[i]);
      out += (remedy.empty() ? "" : "; to do: " + remedy) + "\n";
    }
  }
  return out;
}

std::string end_text(const ReplayResult& result) {
  std::string out;
  const std::string why = inhibits_text(result);
  if (result.experiments.empty()) {
    out += "  " + no_experiment(result) + "\n";
  } else if (!why.empty()) {
    out += "  neither pedal pressed, and no experiment for: " + why + "\n";
  }
  out += inhibit_words(result);
  out += carried_lines(result);
  if (!result.assumed.empty()) {
    out += "  assumed, as the configuration leaves them out: ";
    for (const std::string& key : result.assumed) {
      out += (&key == &result.assumed.front() ? "" : ", ") + key;
    }
    out += "\n";
  }
  out += format("  %llu frames in %.1f s, %llu decoded, %llu bad; %llu bad lines\n",
                static_cast<unsigned long long>(result.frames),
                static_cast<double>(result.duration_ns) * 1e-9,
                static_cast<unsigned long long>(result.frames_decoded),
                static_cast<unsigned long long>(result.frames_bad),
                static_cast<unsigned long long>(result.lines_bad));
  return out;
}

}  // namespace beltgrip::cli
