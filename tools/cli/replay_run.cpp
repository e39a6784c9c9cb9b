#include "tools/cli/replay_run.h"

#include <cmath>
#include <memory>

#include "can_dbc/can_log.h"
#include "daemon/core/loop.h"
#include "daemon/core/own_frames.h"
#include "tools/cli/exit_codes.h"
#include "tools/cli/json_writer.h"
#include "tools/sim/log_timeline.h"
#include "tools/sim/record_port.h"
#include "tools/sim/replay_port.h"

namespace beltgrip::cli {

namespace {

constexpr std::size_t kBadLinesShown = 3;
constexpr double kShownInhibit_s = 0.05;

std::string outcome_text(daemon::Outcome outcome) {
  return snake_case(own_label("BeltGripStatus", "Outcome", static_cast<int>(outcome)));
}
std::string reason_text(estimator::StopReason reason) {
  return snake_case(own_label("BeltGripStatus", "StopReason", static_cast<int>(reason)));
}
const char* direction_text(estimator::Direction direction) {
  return direction == estimator::Direction::kDrive ? "drive" : "overrun";
}
const char* ratio_text(estimator::EndStop end_stop) {
  return end_stop == estimator::EndStop::kLow ? "low" : "overdrive";
}

// Collects the results and writes the trace as samples come.
class Sink final : public daemon::SampleSink {
 public:
  Sink(ReplayResult& result, const daemon::Pipeline& pipeline, const daemon::Config& config,
       std::FILE* trace)
      : result_(result),
        pipeline_(pipeline),
        trace_(trace),
        period_s_(1.0 / config.estimator.sample_rate_hz) {
    for (int phase = 0; phase < 4; ++phase) {
      phases_[phase] = own_label("BeltGripSlip", "Phase", phase);
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
    }
    if (!report.in_experiment && (report.inhibits & kFeet) == 0) {
      for (std::size_t i = 0; i < daemon::kInhibitCount; ++i) {
        if ((report.inhibits >> i & 1) != 0) result_.inhibited_s[i] += period_s_;
      }
    }
    if (trace_ == nullptr || !report.in_experiment || !report.curve.usable) return;
    const estimator::CurveEstimate& curve = report.curve;
    row_ = seconds_text(report.t);
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

 private:
  std::string lost_now() const {
    std::string roles;
    for (std::size_t i = 0; i < daemon::kRoleCount; ++i) {
      const auto role = static_cast<daemon::Role>(i);
      const daemon::SignalQuality quality = pipeline_.signal(role).quality;
      if (quality != daemon::SignalQuality::kStale && quality != daemon::SignalQuality::kFrozen) {
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

  static constexpr std::uint32_t kFeet = daemon::inhibit_bit(daemon::Inhibit::kPedal) |
                                         daemon::inhibit_bit(daemon::Inhibit::kBrake) |
                                         daemon::inhibit_bit(daemon::Inhibit::kInputs);

  ReplayResult& result_;
  const daemon::Pipeline& pipeline_;
  std::FILE* trace_;
  double period_s_;
  std::string phases_[4];
  std::string row_;
};

std::string joined(const std::vector<std::string>& paths) {
  std::string name;
  for (const std::string& path : paths) name += (name.empty() ? "" : "+") + path;
  return name;
}

void describe_troubles(const can::LogStats& stats, const sim::TimelineCounters& counters,
                       ReplayResult& result) {
  for (std::size_t i = 0; i < stats.first_bad.size() && i < kBadLinesShown; ++i) {
    result.warnings.push_back(result.log + ":" + std::to_string(stats.first_bad[i].line) + ": " +
                              stats.first_bad[i].reason);
  }
  if (stats.lines_bad > kBadLinesShown) {
    result.warnings.push_back(result.log + ": " + std::to_string(stats.lines_bad) +
                              " unreadable lines in all");
  }
  if (counters.frames_bad > 0) {
    result.warnings.push_back(result.log + ": " + std::to_string(counters.frames_bad) +
                              " frames left out, their time stamps are far from their neighbours'");
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
  std::string text =
      result.log + ": no readable frame in " + std::to_string(stats.lines) + " lines";
  if (!stats.first_bad.empty()) {
    text += ", line " + std::to_string(stats.first_bad[0].line) + ": " + stats.first_bad[0].reason;
  }
  return {kBadInput, text};
}

std::string format(const char* pattern, auto... arguments) {
  char buffer[256];
  std::snprintf(buffer, sizeof buffer, pattern, arguments...);
  return buffer;
}

}  // namespace

std::string own_label(const char* message, const char* signal, std::int64_t raw) {
  const auto* definition = daemon::own_database().find_message(message);
  return definition->find_signal(signal)->values.at(raw);
}

std::string snake_case(const std::string& label) {
  std::string result;
  for (const char c : label) {
    const bool upper = c >= 'A' && c <= 'Z';
    if (upper && !result.empty()) result += '_';
    result += upper ? static_cast<char>(c - 'A' + 'a') : c;
  }
  return result;
}

std::string seconds_text(std::int64_t t_ns) {
  std::string digits = std::to_string(t_ns < 0 ? -t_ns : t_ns);
  if (digits.size() < 10) digits.insert(0, 10 - digits.size(), '0');
  digits.insert(digits.size() - 9, ".");
  while (digits.back() == '0') digits.pop_back();
  if (digits.back() == '.') digits.pop_back();
  return (t_ns < 0 ? "-" : "") + digits;
}

std::unique_ptr<sim::LogTimeline> open_timeline(const std::vector<std::string>& paths,
                                                const std::string& interface,
                                                const daemon::FrameIdentifiers& own,
                                                const std::string& further_interface) {
  std::vector<std::unique_ptr<can::LogReader>> readers;
  for (const std::string& path : paths) {
    try {
      readers.push_back(can::LogReader::open(path));
    } catch (const can::LogOpenError& error) {
      throw Failure{kNoInput, error.text};
    }
  }
  sim::FrameSelection selection;
  selection.interface = interface;
  selection.further_interface = further_interface;
  for (std::size_t i = 0; i < daemon::kOwnMessageCount; ++i) {
    selection.ignored.push_back(
        {daemon::own_identifier(own, static_cast<daemon::OwnMessage>(i)), false});
  }
  return std::make_unique<sim::LogTimeline>(std::move(readers), std::move(selection));
}

std::string further_interface(const daemon::Config& config) {
  return config.further_bus ? config.further_bus->interface : "";
}

namespace {

// What keeps the inputs at the end of a log from being a sample; empty if nothing does.
std::string why_unusable(const daemon::Pipeline& pipeline, const daemon::Config& config) {
  using daemon::Role;
  const Role torque =
      config.estimator.torque_is_engine ? Role::kEngineTorque : Role::kPrimaryTorque;
  for (const Role role :
       {Role::kPrimarySpeed, Role::kSecondarySpeed, Role::kSecondaryPressure, torque}) {
    const std::string name(daemon::role_name(role));
    const daemon::SignalObservation seen = pipeline.signal(role);
    if (!seen.seen) return name + ": no frame brought a value of it that is in the DBC's range";
    if (role == Role::kPrimarySpeed && seen.value <= 0.0) {
      return name + format(" is not above zero (last %.3g rad/s); is its sign wrong?", seen.value);
    }
  }
  return "";
}

void run_pipeline(daemon::Port& port, daemon::Pipeline& pipeline, const daemon::Config& config,
                  estimator::StopReason end, ReplayResult& result, std::FILE* trace) {
  Sink sink(result, pipeline, config, trace);
  daemon::run_loop(port, pipeline, config.estimator.sample_rate_hz, end, &sink);
  result.frames_decoded = pipeline.counters().frames_decoded;
  result.frames_bad = pipeline.counters().frames_bad;
  result.unusable = why_unusable(pipeline, config);
}

bool is_record(const std::string& path) {
  if (path == "-") return false;
  try {
    return sim::RecordPort::is_record(path);
  } catch (const can::LogOpenError& error) {
    throw Failure{kNoInput, error.text};
  }
}

// What the flight recorder kept, decided again as the daemon did.
ReplayResult replay_record(const std::string& path, const daemon::Config& config,
                           const sim::ReplayPort::Receiver& receiver, std::FILE* trace) {
  ReplayResult result;
  result.log = path;
  daemon::Pipeline pipeline(config);
  sim::RecordPort port(path, receiver, [&](const sim::RecordedKnowledge& known) {
    estimator::LearnedFriction learned;
    for (std::size_t i = 0; i < learned.groups.size(); ++i) {
      learned.groups[i].known = known.mu_max[i] > 0.0;
      learned.groups[i].mu_max = known.mu_max[i];
    }
    learned.doubtful = known.doubtful;
    learned.unwritten = known.unwritten;
    pipeline.learn(learned);
  });
  run_pipeline(port, pipeline, config,
               port.ends_with_the_daemon() ? estimator::StopReason::kShutdown
                                           : estimator::StopReason::kTraceEnd,
               result, trace);
  result.frames = port.stats().frames;
  result.lines_bad = port.stats().lines_bad;
  result.duration_ns = port.duration();
  describe_troubles(port.stats(), {}, result);
  return result;
}

}  // namespace

void run_daemon(daemon::Port& port, const daemon::Config& config, ReplayResult& result,
                std::FILE* trace) {
  daemon::Pipeline pipeline(config);
  run_pipeline(port, pipeline, config, estimator::StopReason::kTraceEnd, result, trace);
}

ReplayResult replay(const std::vector<std::string>& paths, const std::string& interface,
                    const daemon::Config& config, const ReplayOutputs& outputs) {
  ReplayResult result;
  result.log = joined(paths);
  const std::string further = further_interface(config);
  sim::ReplayPort::Receiver receiver;
  std::unique_ptr<can::CandumpWriter> writer;
  if (outputs.log_out != nullptr) {
    writer = std::make_unique<can::CandumpWriter>(outputs.log_out);
    receiver = [&](daemon::MonoTime t, const can::CanFrame& frame, std::uint8_t bus) {
      writer->write(t, bus == 0 ? config.interface : further, frame);
    };
  }
  if (paths.size() == 1 && interface.empty() && is_record(paths[0])) {
    return replay_record(paths[0], config, receiver, outputs.trace);
  }
  const auto timeline = open_timeline(paths, interface, config.identifiers, further);
  sim::ReplayPort port(*timeline, std::move(receiver));
  const can::LogStats head = timeline->stats();
  if (head.frames == 0 || port.empty()) throw no_frames(result, head, interface);

  run_daemon(port, config, result, outputs.trace);

  const can::LogStats stats = timeline->stats();
  const sim::TimelineCounters& counters = timeline->counters();
  result.frames = stats.frames;
  result.frames_bad += counters.frames_bad;
  result.lines_bad = stats.lines_bad;
  result.duration_ns = counters.last_ns - counters.first_ns;
  describe_troubles(stats, counters, result);
  return result;
}

namespace {

bool has_bound(const daemon::ExperimentResult& e) {
  return e.outcome == daemon::Outcome::kInconclusive &&
         e.peak.kind == estimator::PeakKind::kLowerBound && e.peak.mu_max > 0.0;
}

// A shaft that is read as standing still, or as turning the other way, is no slip.
constexpr double kSlipMost_percent = 100.0;

}  // namespace

std::string experiment_lines(const ReplayResult& result) {
  std::string lines;
  JsonWriter json;
  for (const daemon::ExperimentResult& e : result.experiments) {
    const bool completed = e.outcome == daemon::Outcome::kCompleted;
    const bool slips = e.stopped && e.sigma_stop_percent < kSlipMost_percent;
    json.begin_object()
        .field("type", "experiment")
        .field("log", result.log)
        .key("start_s")
        .raw(seconds_text(e.start))
        .key("stop_s")
        .raw(e.stopped ? seconds_text(e.end) : "null")
        .field("outcome", outcome_text(e.outcome))
        .field("stop_reason", reason_text(e.stop_reason))
        .field("mu_max", completed ? e.peak.mu_max : kJsonNull)
        .field("mu_max_std", completed ? e.peak.mu_max_std : kJsonNull)
        .key("mu_max_ci95");
    if (completed) {
      json.begin_array().value(e.peak.ci95_low).value(e.peak.ci95_high).end_array();
    } else {
      json.null();
    }
    json.field("mu_max_lower_bound", has_bound(e) ? e.peak.mu_max : kJsonNull)
        .field("sigma_stop_percent", slips ? e.sigma_stop_percent : kJsonNull)
        .field("contradictory", e.peak.contradictory)
        .field("impossible", e.peak.impossible)
        .field("sigma_peak_percent", completed ? e.peak.sigma_peak_percent : kJsonNull)
        .field("samples", e.samples)
        .field("direction", direction_text(e.direction))
        .field("ratio", ratio_text(e.end_stop))
        .end_object();
    lines += json.take() + "\n";
  }
  return lines;
}

// Where nothing is known of mu_max.
std::string why_no_value(const daemon::ExperimentResult& e, const std::string& lost) {
  if (e.peak.contradictory) return "its points lie on no one friction curve";
  if (e.peak.impossible) {
    return "no belt has the friction that was read; is pressure, torque or their unit wrong?";
  }
  switch (e.stop_reason) {
    case estimator::StopReason::kRatio:
      return "speeds and torque do not fit the ratio at the end stop; is a speed or the sign of "
             "the torque wrong, or the ratio off its stop?";
    case estimator::StopReason::kInputs:
      if (e.outcome == daemon::Outcome::kAborted && !lost.empty()) return lost + " was lost";
      return "an input was lost, stood still, or read what cannot be";
    case estimator::StopReason::kTorque:
      return "the torque went to zero or changed its sign";
    default:
      return e.outcome == daemon::Outcome::kAborted
                 ? "the experiment was broken off"
                 : "too short, or too little torque or clamp force, or an input that stood still";
  }
}

std::string summary_line(const ReplayResult& result) {
  JsonWriter json;
  json.begin_object()
      .field("type", "summary")
      .field("log", result.log)
      .field("frames", result.frames)
      .field("frames_decoded", result.frames_decoded)
      .field("frames_bad", result.frames_bad)
      .field("lines_bad", result.lines_bad)
      .key("duration_s")
      .raw(seconds_text(result.duration_ns))
      .end_object();
  return json.take() + "\n";
}

namespace {

// What kept experiments from beginning, and how long; empty: nothing for long.
std::string inhibits_text(const ReplayResult& result) {
  std::string why;
  for (std::size_t i = 0; i < daemon::kInhibitCount; ++i) {
    if (result.inhibited_s[i] < kShownInhibit_s) continue;
    why += (why.empty() ? "" : ", ") + std::string(daemon::kInhibitNames[i]) +
           format(" %.1f s", result.inhibited_s[i]);
  }
  return why;
}

}  // namespace

std::string no_experiment(const ReplayResult& result) {
  std::string why = result.unusable;
  const std::string inhibits = inhibits_text(result);
  if (why.empty() && !inhibits.empty()) why = "with no pedal pressed, kept away by " + inhibits;
  if (why.empty()) why = "the trigger's conditions never held for long enough";
  return "no experiment: " + why;
}

std::string text(const ReplayResult& result) {
  std::string out = result.log + "\n";
  for (std::size_t i = 0; i < result.experiments.size(); ++i) {
    const daemon::ExperimentResult& e = result.experiments[i];
    out += "  " + outcome_text(e.outcome) + ", " + direction_text(e.direction) + ", " +
           ratio_text(e.end_stop) + ": ";
    const double end_s = static_cast<double>(e.end) * 1e-9;
    const double length_s = static_cast<double>(e.end - e.start) * 1e-9;
    out += e.stopped ? format("stopped at %.3f s", end_s) : format("ended at %.3f s", end_s);
    out += format(" (%s) after %.1f s", reason_text(e.stop_reason).c_str(), length_s);
    if (e.stopped) out += format(", at %.2f %% slip", e.sigma_stop_percent);
    out += "\n";
    if (e.outcome == daemon::Outcome::kCompleted) {
      out += format("  mu_max %.4f, std %.4f, 95 %% %.4f .. %.4f, peak at %.2f %% slip\n",
                    e.peak.mu_max, e.peak.mu_max_std, e.peak.ci95_low, e.peak.ci95_high,
                    e.peak.sigma_peak_percent);
    } else if (has_bound(e)) {
      out += format("  mu_max is at least %.4f\n", e.peak.mu_max);
    } else {
      out += "  no value: " + why_no_value(e, result.lost[i]) + "\n";
    }
  }
  const std::string why = inhibits_text(result);
  if (result.experiments.empty()) {
    out += "  " + no_experiment(result) + "\n";
  } else if (!why.empty()) {
    out += "  neither pedal pressed, and no experiment for: " + why + "\n";
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
