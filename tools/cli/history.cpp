// beltgrip history: the experiments that a daemon has kept, and what they say together. Reads the
// file and changes nothing, while the daemon runs or not; with --from it fills one from logs.
#include <cerrno>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "can_dbc/text/format.h"
#include "can_dbc/text/number_text.h"
#include "daemon/core/publish/names.h"
#include "daemon/io/carried_keeper.h"
#include "daemon/io/history_db.h"
#include "tools/cli/command.h"
#include "tools/cli/configuration.h"
#include "tools/cli/history_file.h"
#include "tools/cli/history_from.h"
#include "tools/cli/output_file.h"
#include "tools/cli/replay_run.h"
#include "tools/text/json_writer.h"
#include "tools/text/snake_case.h"
#include "tools/text/terminal.h"

namespace beltgrip::cli {

namespace {

using daemon::direction_name;
using daemon::end_stop_name;
using daemon::HistoryRow;
using daemon::outcome_name;
using daemon::stop_reason_name;
using estimator::PeakKind;

struct HistoryOptions {
  std::string file;
  std::string config;
  std::vector<std::string> from;
  std::string json;
  std::string csv;
};

std::string lower(std::string_view name) { return text::snake_case(name); }

// One column of the rows, for JSON and CSV alike: text, or a number that may be missing.
struct Cell {
  const char* name;
  bool is_text;
  std::string text;
  double number = 0.0;
};

std::vector<Cell> cells(const HistoryRow& row) {
  const daemon::ExperimentResult& result = row.result;
  const estimator::PeakEstimate& peak = result.peak;
  const bool value = peak.kind == PeakKind::kValue;
  const auto text = [](const char* name, std::string content) {
    return Cell{name, true, std::move(content), 0.0};
  };
  const auto number = [](const char* name, double content, bool given = true) {
    return Cell{name, false, {}, given ? content : text::kJsonNull};
  };
  return {number("id", static_cast<double>(row.id)),
          number("time_s", row.time_s),
          text("time_utc", utc(row.time_s)),
          text("outcome", lower(outcome_name(result.outcome))),
          text("stop_reason", lower(stop_reason_name(result.stop_reason))),
          number("mu_max", peak.mu_max, value),
          number("mu_max_std", peak.mu_max_std, value),
          number("ci95_low", peak.ci95_low, value),
          number("ci95_high", peak.ci95_high, value),
          number("sensor_std", result.sensor_std, value),
          number("mu_max_lower_bound", peak.mu_max, peak.kind == PeakKind::kLowerBound),
          number("sigma_stop_percent", result.sigma_stop_percent),
          number("sigma_peak_percent", peak.sigma_peak_percent),
          number("samples", static_cast<double>(result.samples)),
          number("duration_s", static_cast<double>((result.end - result.start).ns()) * 1e-9),
          text("direction", lower(direction_name(result.direction))),
          text("ratio", lower(end_stop_name(result.end_stop))),
          number("speed_ratio", result.omega_s_rad_s / result.omega_p_rad_s),
          number("primary_speed_rad_s", result.omega_p_rad_s),
          number("torque_Nm", result.torque_Nm),
          number("clamp_force_N", result.clamp_force_N),
          number("oil_degC", result.oil_degC),
          text("notes", notes_text(row.notes, " ")),
          text("fingerprint", row.fingerprint)};
}

// Nothing where there is no value.
std::string cell_text(double value) { return std::isfinite(value) ? number_text(value) : ""; }

std::string json_lines(const History& history) {
  std::string out;
  text::JsonWriter json;
  for (const HistoryRow& row : history.rows) {
    json.begin_object().field("type", "experiment");
    for (const Cell& cell : cells(row)) {
      if (cell.is_text) {
        json.field(cell.name, cell.text);
      } else {
        json.field(cell.name, cell.number);
      }
    }
    out += json.end_object().take() + '\n';
  }
  for (const HistoryGroup& group : history.groups) {
    const estimator::FusedFriction& fused = group.fused;
    json.begin_object().field("type", "fused");
    json.field("direction", lower(direction_name(group.direction)));
    json.field("ratio", lower(end_stop_name(group.end_stop)));
    json.field("mu_max", fused.mu_max).field("mu_max_std", fused.mu_max_std);
    json.key("mu_max_ci95").begin_array().value(fused.ci95_low).value(fused.ci95_high).end_array();
    json.field("experiments", fused.experiments);
    json.field("repeatability_percent", fused.repeatability_percent);
    const bool drift = fused.drift_percent_std > 0.0;
    json.field("drift_percent_per_experiment", drift ? fused.drift_percent : text::kJsonNull);
    json.field("drift_percent_std", drift ? fused.drift_percent_std : text::kJsonNull);
    json.key("wear");
    const estimator::WearTest& wear = group.wear;
    if (wear.judged) {
      json.begin_object().field("found", wear.found).field("change_percent", wear.change_percent);
      json.key("ci95").begin_array().value(wear.ci95_low).value(wear.ci95_high).end_array();
      json.field("p_value", wear.p_value).field("before", wear.before).field("after", wear.after);
      json.field("since_id",
                 group.since != nullptr ? static_cast<double>(group.since->id) : text::kJsonNull);
      json.end_object();
    } else {
      json.null();
    }
    out += json.end_object().take() + '\n';
  }
  for (const auto& one : daemon::carried_json(history.carried)) {
    nlohmann::ordered_json line{{"type", "carried"}};
    line.update(one);
    line["time_utc"] = one.at("time_s").is_number() ? utc(one.at("time_s").get<double>()) : "-";
    out += line.dump() + '\n';
  }
  json.begin_object().field("type", "summary").field("file", history.path);
  json.field("experiments", history.rows.size()).field("damaged", history.damaged);
  json.field("fingerprint", history.fingerprint).field("comparable", history.comparable);
  return out + json.end_object().take() + '\n';
}

std::string csv(const History& history) {
  std::string out;
  for (const Cell& cell : cells(HistoryRow{})) {
    out += (out.empty() ? "" : ",") + std::string(cell.name);
  }
  out += '\n';
  for (const HistoryRow& row : history.rows) {
    bool first = true;
    for (const Cell& cell : cells(row)) {
      if (!first) out += ',';
      first = false;
      out += cell.is_text ? cell.text : cell_text(cell.number);
    }
    out += '\n';
  }
  return out;
}

std::string or_dash(double value, bool given, const char* pattern) {
  return given && std::isfinite(value) ? format(pattern, value) : "-";
}

std::string table(const History& history) {
  if (history.rows.empty()) return history.path + ": no experiment yet\n" + carried_lines(history);
  std::string out = format("%5s  %-20s  %-12s  %-11s  %-7s  %-9s  %8s  %7s  %6s  %5s  %4s  %s\n",
                           "id", "time (UTC)", "outcome", "stop", "torque", "ratio", "mu_max",
                           "std", "slip %", "Nm", "oil", "notes");
  for (const HistoryRow& row : history.rows) {
    const daemon::ExperimentResult& result = row.result;
    const estimator::PeakEstimate& peak = result.peak;
    const bool value = peak.kind == PeakKind::kValue;
    const bool bound = peak.kind == PeakKind::kLowerBound;
    std::string mu = or_dash(peak.mu_max, value || bound, "%.4f");
    if (bound) mu.insert(0, ">");
    std::string notes = notes_text(row.notes, ", ");
    if (row.fingerprint != history.fingerprint) {
      notes += notes.empty() ? "other configuration" : ", other configuration";
    }
    out += format("%5lld  %-20s  %-12s  %-11s  %-7s  %-9s  %8s  %7s  %6s  %5s  %4s  ",
                  static_cast<long long>(row.id), utc(row.time_s).c_str(),
                  lower(outcome_name(result.outcome)).c_str(),
                  lower(stop_reason_name(result.stop_reason)).c_str(),
                  lower(direction_name(result.direction)).c_str(),
                  lower(end_stop_name(result.end_stop)).c_str(), mu.c_str(),
                  or_dash(peak.mu_max_std, value, "%.4f").c_str(),
                  or_dash(result.sigma_stop_percent, true, "%.2f").c_str(),
                  or_dash(result.torque_Nm, true, "%.0f").c_str(),
                  or_dash(result.oil_degC, true, "%.0f").c_str());
    out += notes + '\n';
  }
  for (const HistoryGroup& group : history.groups) out += fused_text(group);
  if (history.comparable < history.rows.size()) {
    out += format("%zu experiments under other configurations are not compared\n",
                  history.rows.size() - history.comparable);
  }
  return out + carried_lines(history);
}

// A folder that is removed with what is in it.
class Scratch {
 public:
  Scratch() {
    // mkdtemp puts six characters of its own in the place of the X.
    std::string name = (std::filesystem::temp_directory_path() / "beltgrip-XXXXXX").string();
    if (mkdtemp(name.data()) == nullptr) {
      throw Failure{kCannotCreate, name + ": cannot be created (" + std::strerror(errno) + ")"};
    }
    path_ = name;
  }
  ~Scratch() {
    std::error_code ignored;
    std::filesystem::remove_all(path_, ignored);
  }
  Scratch(const Scratch&) = delete;
  Scratch& operator=(const Scratch&) = delete;
  const std::string& path() const { return path_; }

 private:
  std::string path_;
};

// Where --from writes: FILE is a history.db, or its folder, that need not be there.
std::string folder_of(const std::string& file) {
  const std::filesystem::path path(file);
  if (path.filename() == daemon::kHistoryFile) {
    return path.has_parent_path() ? path.parent_path().string() : ".";
  }
  std::error_code ignored;
  if (std::filesystem::exists(path, ignored) && !std::filesystem::is_directory(path, ignored)) {
    throw Failure{kUsage, file + ": --from fills a folder, or a file that is named " +
                              std::string(daemon::kHistoryFile)};
  }
  return file;
}

// What logs have, and of what history: in FILE, or for this answer alone.
History read_logs(const HistoryOptions& options, int& exit_code) {
  if (options.config.empty()) throw Failure{kUsage, "history: --from needs --config"};
  const daemon::Config config = load_configuration(options.config, "");
  const std::optional<Scratch> scratch =
      options.file.empty() ? std::make_optional<Scratch>() : std::nullopt;
  HistoryOptions filled = options;
  filled.file = scratch ? scratch->path() : folder_of(options.file);
  for (const Failure& failure : fill_history(filled.file, options.from, config)) {
    text::complain(failure.text);
    if (exit_code == kDone) exit_code = failure.exit_code;
  }
  History history = read_history(filled.file, options.config);
  if (scratch) history.path = std::to_string(options.from.size()) + " logs";
  return history;
}

void run_history(const HistoryOptions& options) {
  if (options.json == "-" && options.csv == "-") {
    throw Failure{kUsage, "history: only one of --json and --csv can be standard output"};
  }
  int exit_code = kDone;
  History history = options.from.empty() ? read_history(options.file, options.config)
                                         : read_logs(options, exit_code);
  // SQLite's files beside it belong to it.
  Inputs inputs{
      options.config, history.path, history.path + "-wal", history.path + "-shm",
      (std::filesystem::path(history.path).parent_path() / daemon::kCarriedFile).string()};
  inputs.add(options.from);
  std::optional<OutputFile> json_file, csv_file;
  if (!options.json.empty()) json_file.emplace(options.json, inputs, Existing::kReplaceResult);
  if (!options.csv.empty()) csv_file.emplace(options.csv, inputs);
  if (json_file) json_file->write(json_lines(history));
  if (csv_file) csv_file->write(csv(history));
  if (json_file) json_file->close();
  if (csv_file) csv_file->close();
  if (options.json != "-" && options.csv != "-") text::print(stdout, table(history));
  if (exit_code != kDone) throw Failure{exit_code, ""};
}

}  // namespace

void add_history(command_line::Command app) {
  const command_line::Command command = app.add_subcommand(
      "history", "The experiments that the daemon has kept, and what they say together");
  auto options = std::make_shared<HistoryOptions>();
  command
      .add_option("FILE", options->file,
                  "history.db or its folder (default: the configuration's state_dir, else " +
                      std::string(kHistoryFolder) + ")")
      .type_name("");
  command
      .add_option("--config", options->config,
                  "BeltGrip's configuration: for its state_dir, and for --from")
      .type_name("FILE");
  command
      .add_option("--from", options->from,
                  "Replay these CAN logs of one vehicle: FILE comes to hold their experiments too; "
                  "without FILE they are only shown")
      .type_name("LOG");
  command.add_option("--json", options->json, "As JSON lines, '-': standard output")
      .type_name("FILE");
  command.add_option("--csv", options->csv, "The experiments as CSV, '-': standard output")
      .type_name("FILE");
  command.example("beltgrip history");
  command.example("beltgrip history --from drive/trace.log --config drive/beltgrip.toml");
  command.example("beltgrip history fleet/car17 --from car17/*.log.zst --config mycar.toml");
  command.example("beltgrip history --config mycar.toml --csv belt.csv");
  command.callback([options] { run_history(*options); });
}

}  // namespace beltgrip::cli
