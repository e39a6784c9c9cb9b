// beltgrip report: the experiments of logs as one HTML file to look at.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "daemon/core/publish/names.h"
#include "estimator/physics/least_loss.h"
#include "tools/cli/command.h"
#include "tools/cli/configuration.h"
#include "tools/cli/output_file.h"
#include "tools/cli/replay_run.h"
#include "tools/cli/stop_signals.h"
#include "tools/report/experiment_page.h"
#include "tools/text/terminal.h"

namespace beltgrip::cli {

namespace {

struct Options {
  std::vector<std::string> logs;
  std::string config, method, interface;
  std::string out = "report.html";
};

std::string number(const char* pattern, auto... values) {
  char buffer[64];
  std::snprintf(buffer, sizeof buffer, pattern, values...);
  return buffer;
}

// The belt's last value, and where.
struct LastValue {
  std::string name;  // of its experiment
  double mu_max = 0.0, sigma_peak_percent = 0.0;
  estimator::EndStop end_stop = estimator::EndStop::kOverdrive;
};

// The samples of each experiment, and what came of it.
class Courses final : public daemon::SampleSink {
 public:
  explicit Courses(std::string log) : log_(std::move(log)) {}

  void on_report(const daemon::SampleReport& report) noexcept override {
    if (report.in_experiment && report.curve.usable) {
      const estimator::CurveEstimate& curve = report.curve;
      now_.t_s.push_back(static_cast<double>(report.t) * 1e-9);
      now_.mu_star.push_back(curve.mu_star);
      now_.sigma_star_percent.push_back(curve.sigma_star_percent);
      now_.friction_slope_per_percent.push_back(curve.friction_slope);
      now_.slip_variance.push_back(curve.slip_variance);
      now_.clamp_force_N.push_back(curve.clamp_force_N);
      sigma_most_percent_ = std::max(sigma_most_percent_, std::abs(curve.sigma_star_percent));
      energy_J_ = std::max(energy_J_, curve.slip_energy_J);
      now_.phase.push_back(static_cast<std::size_t>(curve.phase));
      end_stop_ = curve.end_stop;
    }
    if (!report.new_result) return;
    finish(report.result);
    all_.push_back(std::move(now_));
    now_ = {};
    energy_sum_J_ += energy_J_;
    energy_J_ = sigma_most_percent_ = 0.0;
  }
  std::vector<report::ExperimentCourse> take() { return std::move(all_); }
  // Dissipated by slip in all experiments, up to their results.
  double energy_sum_J() const { return energy_sum_J_; }
  const std::optional<LastValue>& last_value() const { return last_value_; }

 private:
  void finish(const daemon::ExperimentResult& result) {
    const double begin_s = static_cast<double>(result.start) * 1e-9;
    now_.name = log_ + number(", from %.2f s on", begin_s);
    if (result.stopped) now_.stop_s = static_cast<double>(result.end) * 1e-9;
    const bool value = result.outcome == daemon::Outcome::kCompleted;
    const estimator::PeakEstimate& peak = result.peak;
    if (value) {
      now_.peak = {peak.mu_max, peak.ci95_low, peak.ci95_high};
      last_value_ = {now_.name, peak.mu_max, peak.sigma_peak_percent, end_stop_};
    }
    const bool bound = !value && peak.kind == estimator::PeakKind::kLowerBound;
    now_.verdict = {now_.name,
                    outcome_text(result.outcome) + ", " + reason_text(result.stop_reason),
                    daemon::cause_text(result.stop_reason, result.cause),
                    value   ? number("%.4f", peak.mu_max)
                    : bound ? number("at least %.4f", peak.mu_max)
                            : "",
                    value ? number("%.4f .. %.4f", peak.ci95_low, peak.ci95_high) : "",
                    result.stopped ? number("%.2f", result.sigma_stop_percent) : "",
                    value ? number("%.2f", peak.sigma_peak_percent) : "",
                    number("%.1f", sigma_most_percent_),
                    number("%.0f", energy_J_)};
  }

  std::string log_;
  report::ExperimentCourse now_;
  std::vector<report::ExperimentCourse> all_;
  double energy_J_ = 0.0, sigma_most_percent_ = 0.0, energy_sum_J_ = 0.0;
  estimator::EndStop end_stop_ = estimator::EndStop::kOverdrive;
  std::optional<LastValue> last_value_;
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
      "), safety_factor " + number("%g", variator.safety_factor) +
      ". Configured: " + number("%g", variator.torque_reserve_Nm) +
      " Nm. A reserve must also hold what comes faster than the hydraulics; a force above the "
      "controller's own, or below its pressure floor, saves nothing.");
  std::vector<std::vector<std::string>> rows;
  for (const double torque_Nm : {25.0, 50.0, 100.0, 150.0}) {
    std::vector<std::string>& row = rows.emplace_back();
    row.push_back(number("%.0f", torque_Nm));
    for (const double share : shares) {
      row.push_back(
          number("%.1f", estimator::reserve_of_least_loss_Nm(variator, share, torque_Nm)));
    }
  }
  page.table({"torque at the primary, Nm",
              number("reserve, Nm: belt and bearings, %.2f Nm/kN", 1e3 * losses[0]),
              number("reserve, Nm: and a pump, %.2f Nm/kN", 1e3 * losses[1])},
             rows);
}

void run(const Options& options) {
  end_streams_when_stopped(options.logs);
  Inputs inputs(options.logs);
  const daemon::Config config = load_configuration(options.config, options.method);
  inputs.add(config.files);
  inputs.demand_apart(options.out);
  std::vector<report::ExperimentCourse> experiments;
  std::optional<LastValue> last_value;
  std::string none;
  double energy_J = 0.0;
  for (const std::string& log : options.logs) {
    Courses courses(log.substr(log.rfind('/') + 1));
    ReplayOutputs outputs;
    outputs.also = &courses;
    const ReplayResult result = replay({log}, options.interface, config, outputs);
    for (const std::string& warning : result.warnings) {
      text::warn(warning);
    }
    if (result.experiments.empty()) none += log + ": " + no_experiment(result) + "\n";
    if (courses.last_value()) last_value = courses.last_value();
    energy_J += courses.energy_sum_J();
    for (auto& each : courses.take()) experiments.push_back(std::move(each));
  }
  report::HtmlPage page("BeltGrip: experiments");
  std::array<std::string, report::kPhaseCount> phases;
  for (std::size_t i = 0; i < phases.size(); ++i) {
    phases[i] = daemon::phase_name(static_cast<estimator::Phase>(i));
  }
  if (!none.empty()) page.paragraph(none);
  if (!config.assumed.empty()) {
    std::string assumed =
        "Assumed, as the configuration leaves them out, and inside the interval: ";
    for (const std::string& key : config.assumed) {
      assumed += (&key == &config.assumed.front() ? "" : ", ") + key;
    }
    page.paragraph(assumed);
  }
  if (!experiments.empty()) {
    page.paragraph(std::to_string(experiments.size()) + " experiments; the belt slipped away " +
                   number("%.0f", energy_J) +
                   " J in them, creep included, from each start to its result.");
  }
  std::optional<report::PhaseThresholds> thresholds;
  if (config.estimator.method == estimator::Method::kPaper) {
    thresholds = {config.estimator.excitation_threshold, config.estimator.stop_slope,
                  config.estimator.peak_slope};
  }
  report::add_experiments(page, experiments, phases, thresholds);
  if (last_value) add_least_loss(page, config, *last_value);
  write_file(options.out, inputs, page.text());
  text::print(stdout, std::to_string(experiments.size()) + " experiments: " + options.out + "\n");
}

}  // namespace

void add_report(command_line::Command app) {
  const command_line::Command command =
      app.add_subcommand("report", "The experiments of logs as one HTML file");
  auto options = std::make_shared<Options>();
  command.add_option("LOG", options->logs, "Logs as for replay").type_name("").required();
  command.add_option("--config", options->config, "BeltGrip's configuration")
      .type_name("FILE")
      .required();
  command.add_option("--method", options->method, "Instead of the configuration's")
      .type_name("METHOD")
      .one_of({"robust", "paper"});
  command.add_option("--interface", options->interface, "Frames of this interface only")
      .type_name("INTERFACE");
  command.add_option("--out", options->out, "The HTML file")
      .type_name("FILE")
      .capture_default_str();
  command.example("beltgrip report drive/trace.log --config drive/beltgrip.toml --out report.html");
  command.callback([options] { run(*options); });
}

}  // namespace beltgrip::cli
