// beltgrip check: is a configuration fit for a car? What a log or a bus shows of every role, what
// belongs together, which experiments the driving allows, and what is missing.
#include <algorithm>
#include <array>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <limits>
#include <memory>
#include <optional>
#include <sstream>
#include <string>
#include <vector>

#include "can_dbc/dbc/parser.h"
#include "daemon/core/loop/loop.h"
#include "tools/calibrate/calibrate.h"
#include "tools/check/bus_view.h"
#include "tools/check/judge_constants.h"
#include "tools/check/listening_port.h"
#include "tools/check/report.h"
#include "tools/check/role_watch.h"
#include "tools/check/verdict.h"
#include "tools/cli/bus.h"
#include "tools/cli/command.h"
#include "tools/cli/log_configuration.h"
#include "tools/cli/log_table.h"
#include "tools/cli/log_trouble.h"
#include "tools/cli/output_file.h"
#include "tools/cli/progress.h"
#include "tools/cli/replay_run.h"
#include "tools/cli/role_guess.h"
#include "tools/cli/stop_signals.h"
#include "tools/ports/replay_port.h"
#include "tools/text/terminal.h"

namespace beltgrip::cli {

namespace {

struct CheckOptions {
  std::vector<std::string> logs;
  std::string config;
  std::string json;
  double live_s = 0.0;
  double rate_Hz = 0.0;
  bool quiet = false;
};

std::vector<can::Database> databases_of(const daemon::Config& config) {
  std::vector<can::Database> databases;
  for (const std::string& path : config.files) {
    if (!path.ends_with(".dbc")) continue;
    std::ifstream file(path, std::ios::binary);
    std::ostringstream text;
    text << file.rdbuf();
    databases.push_back(can::parse_dbc(text.str()).database);
  }
  return databases;
}

// Units as the DBC files say them; the configuration keeps its own alone.
check::DbcUnits dbc_units(const daemon::Config& config,
                          const std::vector<can::Database>& databases) {
  check::DbcUnits units;
  for (const can::Database& database : databases) {
    for (const can::MessageDef& message : database.messages) {
      for (const daemon::RoleBinding& role : config.roles) {
        if (role.uds || role.id != message.id) continue;
        const can::SignalDef* signal = message.find_signal(role.signal_name);
        if (signal != nullptr) units.emplace(role.role, signal->unit);
      }
    }
  }
  return units;
}

// One shaft, or one torque, where a lock-up is closed: a name of the one for the other is no
// mistake.
bool may_stand_in(daemon::Role a, daemon::Role b) {
  using daemon::Role;
  const auto either = [a, b](Role x, Role y) { return (a == x && b == y) || (a == y && b == x); };
  return either(Role::kPrimarySpeed, Role::kEngineSpeed) ||
         either(Role::kPrimaryTorque, Role::kEngineTorque) ||
         either(Role::kExperimentActive, Role::kExperimentPermitted);
}

// Signals that by their names have another role: "init" would take them for that one, and not for
// the one that they have.
void judge_names(const daemon::Config& config, const std::vector<can::Database>& databases,
                 std::vector<check::Findings>& findings) {
  std::array<std::vector<RoleCandidate>, daemon::kRoleCount> candidates;
  for (std::size_t i = 0; i < daemon::kRoleCount; ++i) {
    candidates[i] = guess_role(static_cast<daemon::Role>(i), databases);
  }
  for (std::size_t i = 0; i < config.roles.size(); ++i) {
    const daemon::RoleBinding& role = config.roles[i];
    const auto is_called = [&](std::size_t other) {
      return std::any_of(
          candidates[other].begin(), candidates[other].end(), [&role](const RoleCandidate& each) {
            return each.message->id == role.id && each.signal->name == role.signal_name;
          });
    };
    if (role.uds || is_called(static_cast<std::size_t>(role.role))) continue;
    for (std::size_t other = 0; other < daemon::kRoleCount; ++other) {
      const auto its = static_cast<daemon::Role>(other);
      if (daemon::role_dimension(its) != daemon::role_dimension(role.role)) continue;
      if (may_stand_in(its, role.role) || !is_called(other)) continue;
      findings[i].push_back({check::Weight::kDoubt, "by its name " + role.signal_name + " is " +
                                                        std::string(daemon::role_name(its)) +
                                                        ", not " +
                                                        std::string(daemon::role_name(role.role))});
      break;
    }
  }
}

// The same inputs, with nothing asked of anybody. Where the car's conditions begin an experiment,
// none begins: what one would need is judged by the view, all along the drive.
daemon::Config listening(daemon::Config config) {
  config.control = daemon::Control::kObserve;
  config.diagnostics = daemon::Diagnostics::kListen;
  config.experiment.primary_speed_min_rad_s = std::numeric_limits<double>::infinity();
  return config;
}

struct DriveView {
  check::Thinned<check::Window> windows;
  check::Prospects prospects;
};

// The view, and how far it has come.
class ProgressView final : public daemon::SampleSink {
 public:
  ProgressView(daemon::SampleSink& view, RunProgress* progress)
      : view_(view), progress_(progress) {}
  void on_report(const daemon::SampleReport& report) noexcept override {
    view_.on_report(report);
    if (progress_ != nullptr) progress_->at(report.t);
  }

 private:
  daemon::SampleSink& view_;
  RunProgress* progress_;
};

void observe(daemon::Port& port, const daemon::Config& config, check::RoleWatch& watch,
             std::optional<daemon::Duration> length, RunProgress* progress, DriveView& seen) {
  watch.begin_log();
  check::ListeningPort listening_port(port, watch, length);
  const daemon::Config quiet = listening(config);
  daemon::Pipeline pipeline(quiet);
  check::BusView view(config, watch, pipeline, seen.windows, seen.prospects);
  ProgressView progress_view(view, progress);
  daemon::run_loop(listening_port, pipeline, quiet.estimator.sample_rate_hz,
                   estimator::StopReason::kTraceEnd, &progress_view);
  watch.end_log();
}

void observe_log(const std::string& path, const daemon::Config& config, check::RoleWatch& watch,
                 Progress& progress, RunProgress& run_progress, DriveView& seen) {
  const auto timeline = open_timeline({path}, "", config);
  ports::ReplayPort port(*timeline, {});
  if (port.empty()) {
    throw Failure{kBadInput, no_frame_text(path, timeline->stats())};
  }
  run_progress.reads(*timeline);
  observe(port, config, watch, {}, &run_progress, seen);
  const can::LogStats stats = timeline->stats();
  const std::uint64_t left_out = timeline->counters().frames_bad;
  if (stats.lines_bad > 0 || left_out > 0) progress.clear();
  if (stats.lines_bad > 0) text::warn(path + ": " + unreadable_with_first(stats));
  if (left_out > 0) text::warn(path + ": " + left_out_text(left_out));
}

// The constants as these drives show them, where the signals are right and the logs can be read
// once more: into memory, so not of very long ones.
check::Findings constants(const std::vector<std::string>& logs, const daemon::Config& config,
                          const check::RoleWatch& watch, const check::Verdict& verdict) {
  constexpr std::uint64_t kFramesMost = 5'000'000;
  const auto is_file = [](const std::string& log) {
    std::error_code none;
    return std::filesystem::is_regular_file(log, none);
  };
  if (verdict.ready == check::Ready::kNone || watch.frames() > kFramesMost || logs.empty()) {
    return {};
  }
  if (!std::all_of(logs.begin(), logs.end(), is_file) || stop_asked()) return {};
  std::vector<diagnose::SignalTable> tables;
  tables.reserve(logs.size());
  for (const std::string& log : logs) tables.push_back(read_log(log, config, true));
  check::Periods periods_s{};
  for (const check::RoleCourse& course : watch.roles()) {
    const double rate_Hz = course.rate_Hz();
    if (rate_Hz > 0.0) periods_s[static_cast<std::size_t>(course.binding->role)] = 1.0 / rate_Hz;
  }
  return check::judge_constants(calibrate::calibrate(tables, config), config, periods_s);
}

void run_check(const CheckOptions& options) {
  const bool live = options.live_s > 0.0;
  if (live && !options.logs.empty()) {
    throw Failure{kUsage, "check: found logs and --live, expected one of them"};
  }
  if (!live) end_logs_when_stopped(options.logs);
  const daemon::Config config =
      load_configuration_for(options.logs, options.rate_Hz, options.config, "");
  Inputs inputs(options.logs);
  inputs.add(config.files);
  std::optional<OutputFile> json;
  if (!options.json.empty()) json.emplace(options.json, inputs, Existing::kReplaceResult);

  check::RoleWatch watch(config);
  DriveView seen;
  std::string what;
  if (live) {
    const auto port = open_buses_whole(config, stop_descriptor());
    observe(*port, config, watch, daemon::Duration::of_s(options.live_s), nullptr, seen);
    char seconds[32];
    std::snprintf(seconds, sizeof seconds, "%.4g", options.live_s);
    what = config.interface + " for " + seconds + " s";
  }
  Progress progress(!options.quiet);
  RunProgress run_progress(progress, options.logs.size());
  for (const std::string& log : options.logs) {
    if (!what.empty() && stop_asked()) break;
    observe_log(log, config, watch, progress, run_progress, seen);
    what += (what.empty() ? "" : ", ") + log;
  }
  progress.clear();
  const std::vector<can::Database> databases = databases_of(config);
  check::Verdict verdict = check::judge(watch, seen.windows.values(), seen.prospects, config,
                                        dbc_units(config, databases), !what.empty());
  judge_names(config, databases, verdict.roles);
  for (check::Finding& each : constants(options.logs, config, watch, verdict)) {
    verdict.across.push_back(std::move(each));
  }
  check::summarize_doubts(verdict);
  const check::Checked checked{config, watch, seen.prospects, verdict, what};
  if (json) {
    json->write(check::json(checked));
    json->close();
  }
  if (options.json != "-") text::print(stdout, check::text(checked));
}

}  // namespace

void add_check(command_line::Command app) {
  const command_line::Command command = app.add_subcommand(
      "check",
      "Does a configuration fit the car: every role, what belongs together, what is missing");
  auto options = std::make_shared<CheckOptions>();
  command
      .add_option("LOG", options->logs,
                  "CAN logs of drives, or tables of signals (.csv), all of the same vehicle")
      .type_name("");
  command.add_option("--config", options->config, "BeltGrip's configuration")
      .type_name("FILE")
      .required();
  command
      .add_option("--live", options->live_s,
                  "Listen to the configuration's bus for so many seconds; nothing is sent")
      .type_name("SECONDS")
      .range(0.1, 86400.0);
  add_rate_option(command, options->rate_Hz);
  command.add_option("--json", options->json, "As JSON, '-': standard output").type_name("FILE");
  command.add_flag("--quiet", options->quiet, kNoProgress);
  command.example("beltgrip check drive/trace.log --config drive/beltgrip.toml");
  command.example("beltgrip check --live 60 --config mycar.toml");
  command.callback([options] { run_check(*options); });
}

}  // namespace beltgrip::cli
