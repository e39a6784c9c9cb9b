// beltgrip report: drives and their experiments, or a belt's history, as one HTML file to look at.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "can_dbc/text/format.h"
#include "daemon/core/publish/names.h"
#include "estimator/physics/least_loss.h"
#include "tools/cli/command.h"
#include "tools/cli/dbc_file.h"
#include "tools/cli/history_page.h"
#include "tools/cli/log_configuration.h"
#include "tools/cli/output_file.h"
#include "tools/cli/replay_run.h"
#include "tools/cli/report_courses.h"
#include "tools/cli/stop_signals.h"
#include "tools/report/drive_page.h"
#include "tools/report/experiment_page.h"
#include "tools/text/terminal.h"

namespace beltgrip::cli {

namespace {

struct ReportOptions {
  std::vector<std::string> logs;
  std::string config, method, interface, history;
  double rate_Hz = 0.0;
  std::string out = "report.html";
  bool quiet = false;
};

// What torque_reserve_Nm would cost least: shown, nothing chooses it.
void add_least_loss(report::HtmlPage& page, const daemon::Config& config, const LastValue& value) {
  const estimator::VariatorParameters& variator = config.variator;
  const double belt = estimator::kBeltLoss_Nm_per_N;
  const std::array<double, 2> losses = {belt, belt + estimator::pump_loss_Nm_per_N(variator)};
  std::array<double, losses.size()> shares{};
  for (std::size_t i = 0; i < losses.size(); ++i) {
    shares[i] = estimator::least_loss_share(variator, value.end_stop, value.mu_max,
                                            value.sigma_peak_percent, losses[i]);
  }
  page.heading("Reserve of least loss");
  page.paragraph(
      "torque_reserve_Nm with which MinClampForce costs least, by the last value (" + value.name +
      "), safety_factor " + format("%g", variator.safety_factor) +
      ". Configured: " + format("%g", variator.torque_reserve_Nm) +
      " Nm. A reserve must also hold what comes faster than the hydraulics; a force above the "
      "controller's own, or below its pressure floor, saves nothing.");
  std::vector<std::vector<std::string>> rows;
  for (const double torque_Nm : {25.0, 50.0, 100.0, 150.0}) {
    std::vector<std::string>& row = rows.emplace_back();
    row.push_back(format("%.0f", torque_Nm));
    for (const double share : shares) {
      row.push_back(
          format("%.1f", estimator::reserve_of_least_loss_Nm(variator, share, torque_Nm)));
    }
  }
  page.table({"torque at the primary, Nm",
              format("reserve, Nm: belt and bearings, %.2f Nm/kN", 1e3 * losses[0]),
              format("reserve, Nm: and a pump, %.2f Nm/kN", 1e3 * losses[1])},
             rows);
}

// Of a log among others: the path only where others have the same name in other folders.
std::string short_name(const std::string& log, const std::vector<std::string>& logs) {
  const auto name_of = [](const std::string& path) { return path.substr(path.rfind('/') + 1); };
  const auto same = std::count_if(logs.begin(), logs.end(), [&](const std::string& each) {
    return name_of(each) == name_of(log);
  });
  return same > 1 ? log : name_of(log);
}

void report_logs(const ReportOptions& options) {
  if (options.config.empty()) throw Failure{kUsage, "report: --config is required for logs"};
  end_logs_when_stopped(options.logs);
  Inputs inputs(options.logs);
  const daemon::Config config =
      load_configuration_for(options.logs, options.rate_Hz, options.config, options.method);
  inputs.add(config.files);
  inputs.demand_apart(options.out);
  std::vector<report::ExperimentCourse> experiments;
  std::vector<report::Drive> drives;
  std::optional<LastValue> last_value;
  report::HtmlPage page("BeltGrip: drives and experiments");
  for (const std::string& log : options.logs) {
    if (stop_asked() && !drives.empty()) break;
    Progress progress(!options.quiet);
    RunProgress run_progress(progress);
    ReportCourses courses(short_name(log, options.logs), config, run_progress);
    ReplayOutputs outputs;
    outputs.on_log = [&](const ports::LogTimeline& timeline) { run_progress.reads(timeline); };
    outputs.also = &courses;
    const ReplayResult result = replay({log}, options.interface, config, outputs);
    progress.clear();
    courses.finish(result);
    for (const std::string& warning : result.warnings) text::warn(warning);
    if (result.experiments.empty()) page.paragraph(log + ": " + no_experiment(result));
    if (courses.last_value()) last_value = courses.last_value();
    drives.push_back(courses.take_drive());
    for (auto& each : courses.take_experiments()) experiments.push_back(std::move(each));
  }
  std::array<std::string, report::kPhaseCount> phases;
  for (std::size_t i = 0; i < phases.size(); ++i) {
    phases[i] = daemon::phase_name(static_cast<estimator::Phase>(i));
  }
  if (!config.assumed.empty()) {
    std::string assumed =
        "Assumed, as the configuration leaves them out, and inside the interval: ";
    for (const std::string& key : config.assumed) {
      assumed += (&key == &config.assumed.front() ? "" : ", ") + key;
    }
    page.paragraph(assumed);
  }
  std::optional<report::PhaseThresholds> thresholds;
  if (config.estimator.method == estimator::Method::kPaper) {
    thresholds = {config.estimator.excitation_threshold, config.estimator.stop_slope,
                  config.estimator.peak_slope};
  }
  for (report::Drive& drive : drives) report::add_drive(page, std::move(drive));
  report::add_experiments(page, experiments, phases, thresholds);
  if (last_value) add_least_loss(page, config, *last_value);
  write_file(options.out, inputs, page.text(), Existing::kReplaceResult);
  text::print(stdout, counted(experiments.size(), "experiment") + ": " + options.out + "\n");
}

void report_history(const ReportOptions& options) {
  const History history = read_history(options.history, options.config);
  write_file(options.out, {options.config, history.path}, history_page(history),
             Existing::kReplaceResult);
  text::print(stdout, counted(history.rows.size(), "experiment") + ": " + options.out + "\n");
}

void run_report(const ReportOptions& options) {
  if (options.logs.empty() == options.history.empty()) {
    throw Failure{kUsage, "report: expected logs, or --history FILE"};
  }
  if (!options.history.empty()) return report_history(options);
  report_logs(options);
}

}  // namespace

void add_report(command_line::Command app) {
  const command_line::Command command = app.add_subcommand(
      "report", "Drives and their experiments, or a belt's history, as one HTML file");
  auto options = std::make_shared<ReportOptions>();
  command.add_option("LOG", options->logs, "Logs as for replay").type_name("");
  command.add_option("--config", options->config, "BeltGrip's configuration; required for logs")
      .type_name("FILE");
  command
      .add_option("--history", options->history,
                  "Instead of logs: a history.db or its folder, as for history")
      .type_name("FILE");
  command.add_option("--method", options->method, "Instead of the configuration's")
      .type_name("METHOD")
      .one_of({"robust", "paper"});
  command.add_option("--interface", options->interface, "Frames of this interface only")
      .type_name("INTERFACE");
  add_rate_option(command, options->rate_Hz);
  command.add_flag("--quiet", options->quiet, kNoProgress);
  command.add_option("--out", options->out, "The HTML file")
      .type_name("FILE")
      .capture_default_str();
  command.example("beltgrip report drive/trace.log --config drive/beltgrip.toml --out report.html");
  command.example("beltgrip report --history /var/lib/beltgrip --out belt.html");
  command.callback([options] { run_report(*options); });
}

}  // namespace beltgrip::cli
