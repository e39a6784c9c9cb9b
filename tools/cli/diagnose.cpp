#include "tools/cli/diagnose.h"

#include <unistd.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <ctime>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "daemon/core/config/load/load_config.h"
#include "daemon/core/config/options/config.h"
#include "tools/cli/history_file.h"
#include "tools/cli/log_table.h"
#include "tools/cli/output_file.h"
#include "tools/cli/replay_run.h"
#include "tools/cli/stop_signals.h"
#include "tools/diagnose/infer/parallel.h"
#include "tools/diagnose/infer/rerun.h"
#include "tools/diagnose/report/html.h"
#include "tools/diagnose/report/json.h"
#include "tools/diagnose/run/diagnose.h"
#include "tools/text/terminal.h"

namespace beltgrip::cli {
namespace {

struct DiagnoseOptions {
  std::string config, model, json, report, model_out, next_out;
  std::vector<std::string> logs, held_out;
  int jobs = 1;
  bool force = false;
};

bool is_table(const std::string& path) { return path.ends_with(".csv"); }

struct Loaded {
  daemon::Config config;
  diagnose::Accuracies stated;  // of the sensors
  std::vector<daemon::AssumedAccuracy> assumed;
  estimator::ConstantSet assumed_constants;
};

Loaded load(const DiagnoseOptions& options) {
  const bool tables = std::all_of(options.logs.begin(), options.logs.end(), is_table) &&
                      std::all_of(options.held_out.begin(), options.held_out.end(), is_table);
  const daemon::ConfigResult result = daemon::load_config(
      options.config, tables ? daemon::ConfigScope::kVariator : daemon::ConfigScope::kSignals);
  for (const std::string& warning : result.warnings) text::warn(warning);
  if (!result.config) {
    for (std::size_t i = 0; i + 1 < result.errors.size(); ++i) {
      text::complain(result.errors[i].text);
    }
    throw Failure{result.exit_code(), result.errors.back().text};
  }
  return {*result.config, result.stated, result.assumed, result.left_out};
}

// What the fit has seen says nothing of experiments that it has not.
void demand_apart(const std::string& held_out, const std::vector<std::string>& logs) {
  for (const std::string& log : logs) {
    std::error_code none_there;
    if (held_out != log && !std::filesystem::equivalent(held_out, log, none_there)) continue;
    throw Failure{kUsage, "--held-out " + held_out + ": found an experiment of the fit" +
                              (held_out == log ? "" : " (" + log + ")") +
                              ", expected one that is none"};
  }
}

diagnose::SignalTable read(const std::string& path, const daemon::Config& config) {
  if (!is_table(path)) return read_log(path, config);
  try {
    return diagnose::read_csv(path);
  } catch (const diagnose::TableError& error) {
    throw Failure{error.missing_file ? kNoInput : kBadInput, error.text};
  }
}

constexpr double kSameExperiment_s = 2.0;  // starts: a correction may wait for a late channel

// The experiments that the estimator finds in it: by the configured trigger in a log, all of it in
// a table.
std::vector<daemon::ExperimentResult> estimate(const std::string& path,
                                               const daemon::Config& config) {
  if (!is_table(path)) return replay({path}, "", config, {}).experiments;
  const auto whole = diagnose::estimate(read(path, config), config);
  return whole ? std::vector{*whole} : std::vector<daemon::ExperimentResult>{};
}

// As [estimator] model does.
daemon::Config told(daemon::Config config, const daemon::ModelFile& model) {
  config.variator = model.variator;
  config.corrected = daemon::whole_machine(model);
  config.learned = daemon::learned_terms(model);
  return config;
}

// Every experiment again with the estimator told the model before and after.
std::vector<diagnose::Rerun> rerun(const std::vector<std::string>& paths,
                                   const daemon::Config& with_before,
                                   const daemon::Config& with_after, int jobs) {
  using Found = std::vector<daemon::ExperimentResult>;
  std::vector<std::array<Found, 2>> found(paths.size());
  diagnose::in_parallel(jobs, 2 * paths.size(), [&](std::size_t i) {
    found[i / 2][i % 2] = estimate(paths[i / 2], i % 2 == 0 ? with_before : with_after);
  });
  std::vector<diagnose::Rerun> out;
  for (std::size_t i = 0; i < paths.size(); ++i) {
    const Found& then = found[i][1];
    for (const daemon::ExperimentResult& each : found[i][0]) {
      diagnose::Rerun row{paths[i], static_cast<double>(each.start.ns()) * 1e-9,
                          diagnose::measured(each, with_before.variator), std::nullopt};
      const auto same = std::find_if(then.begin(), then.end(), [&](const auto& other) {
        return std::abs(static_cast<double>((other.start - each.start).ns())) * 1e-9 <
               kSameExperiment_s;
      });
      if (same != then.end()) row.after = diagnose::measured(*same, with_after.variator);
      if (row.before || row.after) out.push_back(std::move(row));
    }
  }
  return out;
}

void show_progress(double share, const std::string& what) {
  constexpr int kWidth = 30;
  const int filled = static_cast<int>(share * kWidth);
  std::fprintf(stderr, "\r[%s%s] %-12s", std::string(static_cast<std::size_t>(filled), '#').c_str(),
               std::string(static_cast<std::size_t>(kWidth - filled), ' ').c_str(), what.c_str());
  if (share >= 1.0) std::fprintf(stderr, "\n");
}

// "2026-11-26", UTC.
std::string today() { return utc(static_cast<double>(std::time(nullptr))).substr(0, 10); }

void run_diagnose(const DiagnoseOptions& options) {
  end_in_good_order();
  const auto [config, stated, assumed, assumed_constants] = load(options);
  diagnose::Request request;
  daemon::ModelFile before = diagnose::nominal_model(config.variator);
  if (!options.model.empty()) {
    try {
      before = diagnose::read_model(options.model, before);
    } catch (const diagnose::ModelError& error) {
      throw Failure{error.missing_file ? kNoInput : kConfiguration, error.text};
    }
  }
  request.model = before;
  request.accuracies = stated;
  request.assumed = assumed;
  if (options.model.empty()) request.assumed_constants = assumed_constants;
  request.is_model_given = !options.model.empty();
  Inputs inputs(options.logs);
  for (const std::string& path : options.held_out) demand_apart(path, options.logs);
  inputs.add(options.held_out);
  inputs.add(config.files);
  inputs.add(options.model);
  const auto output = [&](const std::string& path, Existing existing = Existing::kReplaceResult) {
    return path.empty() ? nullptr : std::make_unique<OutputFile>(path, inputs, existing);
  };
  const auto json = output(options.json);
  const auto model_out = output(options.model_out, unless_forced(options.force));
  const auto report = output(options.report);
  const auto next_out = output(options.next_out);
  for (const std::string& path : options.logs) request.experiments.push_back(read(path, config));
  for (const std::string& path : options.held_out) request.held_out.push_back(read(path, config));
  request.with_plots = report != nullptr;
  request.jobs = options.jobs;
  request.stop = [] { return stop_asked(); };
  if (isatty(STDERR_FILENO) != 0) request.progress = show_progress;
  diagnose::Answer answer = diagnose::diagnose(std::move(request));
  if (!answer.impossible.empty()) throw Failure{kBadInput, answer.impossible};
  const bool has_found = !answer.diagnosis.findings.empty() || !answer.diagnosis.learned.empty();
  if (answer.diagnosis.complete && has_found) {
    std::vector<std::string> all = options.logs;
    all.insert(all.end(), options.held_out.begin(), options.held_out.end());
    answer.diagnosis.reruns = rerun(all, options.model.empty() ? config : told(config, before),
                                    told(config, answer.extended), options.jobs);
  }
  if (options.json != "-") text::print(stdout, diagnose::plain_text(answer.diagnosis));
  if (json) {
    json->write(diagnose::json_text(answer.diagnosis));
    json->close();
  }
  if (report) {
    report->write(diagnose::html_text(
        answer.diagnosis, answer.plots,
        {"beltgrip " BELTGRIP_VERSION, today(), options.config, options.model}));
    report->close();
  }
  if (model_out) {
    model_out->write(diagnose::model_text(answer.extended));
    model_out->close();
  }
  if (next_out) {
    const auto& next = answer.diagnosis.next_experiment;
    next_out->write(next ? next->scenario : "# no experiment is left to ask for\n");
    next_out->close();
  }
}

}  // namespace

void add_diagnose(command_line::Command app) {
  const auto options = std::make_shared<DiagnoseOptions>();
  const command_line::Command command = app.add_subcommand(
      "diagnose", "shows what the simulation gets wrong, names the cause, extends the model");
  command.add_option("LOG", options->logs, "one experiment each: .csv, or a log")
      .type_name("")
      .required();
  command.add_option("--config", options->config, "configuration (TOML)")
      .type_name("FILE")
      .required();
  command.add_option("--model", options->model, "model file: what the simulation believes")
      .type_name("FILE");
  command.add_option("--held-out", options->held_out, "experiments for the gain only")
      .type_name("FILE");
  command.add_option("--json", options->json, "result as JSON; - for standard output")
      .type_name("FILE");
  command.add_option("--report", options->report, "result with plots as one HTML file")
      .type_name("FILE");
  command.add_option("--model-out", options->model_out, "writes the extended model")
      .type_name("FILE");
  command.add_option("--next-out", options->next_out, "writes the next experiment, a scenario")
      .type_name("FILE");
  command.add_flag("--force", options->force, "replace the file of --model-out where it exists");
  command.add_option("--jobs", options->jobs, "threads; the same answer for any number")
      .range(1, 256);
  command.example(
      "beltgrip diagnose run*.csv --config mycar.toml --report found.html --model-out model.toml");
  command.callback([options] { run_diagnose(*options); });
}

}  // namespace beltgrip::cli
