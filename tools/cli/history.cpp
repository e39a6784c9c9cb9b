// beltgrip history: the experiments that a daemon has kept, and what they say together. Reads the
// file and changes nothing, while the daemon runs or not; with --from it fills one from logs.
#include <algorithm>
#include <array>
#include <cerrno>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <ctime>
#include <filesystem>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "daemon/core/publish/names.h"
#include "daemon/io/carried_keeper.h"
#include "daemon/io/history_db.h"
#include "tools/cli/command.h"
#include "tools/cli/configuration.h"
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
using estimator::Direction;
using estimator::EndStop;
using estimator::PeakKind;

constexpr const char* kDefaultFolder = "/var/lib/beltgrip";
constexpr std::array<const char*, estimator::kNoteCount> kNoteNames{
    "outlier",       "trend",  "wear", "directions_disagree", "end_stops_disagree",
    "contradictory", "slipped"};

struct Options {
  std::string file;
  std::string config;
  std::vector<std::string> from;
  std::string json;
  std::string csv;
};

struct Group {
  Direction direction;
  EndStop end_stop;
  estimator::FusedFriction fused;
  estimator::WearTest wear;
  const HistoryRow* since = nullptr;  // the first of those that the wear test compares
};

struct History {
  std::string path;
  std::vector<HistoryRow> rows;
  std::int64_t damaged = 0;
  std::string fingerprint;          // of the last row: its configuration is the one that counts
  std::size_t comparable = 0;       // rows under it
  std::vector<Group> groups;        // that hold a value
  daemon::CarriedBounds carried{};  // under it
};

// history.db in the folder, or in the only one of its folders that has one: the service gives each
// interface its own.
std::string in_folder(const std::string& folder) {
  namespace fs = std::filesystem;
  const fs::path direct = fs::path(folder) / daemon::kHistoryFile;
  std::error_code ignored;  // opening it says why
  if (fs::exists(direct, ignored)) return direct.string();
  std::vector<std::string> found;
  for (const auto& each : fs::directory_iterator(folder, ignored)) {
    const fs::path below = each.path() / daemon::kHistoryFile;
    if (fs::exists(below, ignored)) found.push_back(below.string());
  }
  if (found.size() > 1) {
    std::sort(found.begin(), found.end());
    std::string all;
    for (const std::string& each : found) all += (all.empty() ? "" : ", ") + each;
    throw Failure{kUsage, "history: found several, name one of them: " + all};
  }
  return found.empty() ? direct.string() : found.front();
}

std::string path_of(const Options& options) {
  namespace fs = std::filesystem;
  std::string path = options.file;
  if (path.empty() && !options.config.empty()) {
    const std::string folder = load_configuration(options.config, "").state_dir;
    if (!folder.empty()) path = (fs::path(options.config).parent_path() / folder).string();
  }
  if (path.empty()) path = kDefaultFolder;
  std::error_code ignored;
  return fs::is_directory(path, ignored) ? in_folder(path) : path;
}

// What was carried without slip, beside the history: under the configuration of its last
// experiment, or the newest where there is none.
daemon::CarriedBounds carried_beside(const History& history) {
  const std::string beside = std::filesystem::path(history.path).parent_path().string();
  const std::string folder = beside.empty() ? "." : beside;
  const std::string fingerprint = history.rows.empty() ? "" : history.rows.back().fingerprint;
  const auto found = daemon::read_carried(folder, fingerprint);
  if (const auto* bounds = std::get_if<daemon::CarriedBounds>(&found)) return *bounds;
  text::warn(folder + "/" + daemon::kCarriedFile + ": found no record of what was carried (" +
             std::get<std::string>(found) + ")");
  return {};
}

History read(const Options& options) {
  History history;
  history.path = path_of(options);
  const auto opened = daemon::HistoryDb::open_to_read(history.path);
  using daemon::HistoryTrouble;
  if (opened.trouble == HistoryTrouble::kMissing) {
    throw Failure{kNoInput, history.path + ": found no readable history (" + opened.text +
                                "), expected the history.db of a daemon or its folder"};
  }
  if (opened.db == nullptr) {
    throw Failure{kBadInput,
                  history.path + ": found a history that cannot be used (" + opened.text + ")"};
  }
  daemon::HistoryContent content = opened.db->read();
  if (opened.trouble == HistoryTrouble::kCorrupt) {
    if (content.rows.empty()) {
      throw Failure{kBadInput, history.path + ": found no history (" + opened.text +
                                   "), expected the history.db of a daemon"};
    }
    text::warn(history.path + ": damaged (" + opened.text + ")");
  }
  if (content.trouble != HistoryTrouble::kNone) {
    throw Failure{kBadInput,
                  history.path + ": found a history that cannot be read (" + content.text + ")"};
  }
  history.damaged = content.damaged;
  history.rows = std::move(content.rows);
  if (history.damaged > 0) {
    text::warn(history.path + ": " + std::to_string(history.damaged) + " rows damaged or missing");
  }
  history.carried = carried_beside(history);
  return history;
}

// Of the values that the wear test holds against those before.
const HistoryRow* first_of_the_last(const History& history, Direction direction, EndStop end_stop) {
  std::size_t left = estimator::kWearAfter;
  for (std::size_t i = history.rows.size(); i-- > 0;) {
    const HistoryRow& row = history.rows[i];
    if (row.fingerprint != history.fingerprint || row.result.direction != direction ||
        row.result.end_stop != end_stop || belt_experiment(row).kind != PeakKind::kValue) {
      continue;
    }
    if (--left == 0) return &row;
  }
  return nullptr;
}

// As of the last experiment, so that the same file gives the same answer on any day.
void judge(History& history) {
  if (history.rows.empty()) return;
  history.fingerprint = history.rows.back().fingerprint;
  std::vector<estimator::BeltExperiment> experiments;
  for (const HistoryRow& row : history.rows) {
    if (row.fingerprint == history.fingerprint) experiments.push_back(belt_experiment(row));
  }
  history.comparable = experiments.size();
  for (const Direction direction : {Direction::kDrive, Direction::kOverrun}) {
    for (const EndStop end_stop : {EndStop::kOverdrive, EndStop::kLow}) {
      Group group{direction, end_stop,
                  fuse(experiments, direction, end_stop, history.rows.back().time_s),
                  wear(experiments, direction, end_stop)};
      if (group.wear.judged) group.since = first_of_the_last(history, direction, end_stop);
      if (group.fused.known) history.groups.push_back(group);
    }
  }
}

std::string utc(double time_s) {
  constexpr double kLatest_s = 4e10;  // the year 3237
  if (!(std::abs(time_s) < kLatest_s)) return "-";
  const auto seconds = static_cast<std::time_t>(std::floor(time_s));
  std::tm parts{};
  gmtime_r(&seconds, &parts);
  std::array<char, 32> text{};
  std::strftime(text.data(), text.size(), "%Y-%m-%dT%H:%M:%SZ", &parts);
  return text.data();
}

std::string notes_text(std::uint32_t notes, const char* separator) {
  std::string text;
  for (std::size_t i = 0; i < kNoteNames.size(); ++i) {
    if ((notes >> i & 1U) == 0) continue;
    if (!text.empty()) text += separator;
    text += kNoteNames[i];
  }
  return text;
}

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
          number("duration_s", static_cast<double>(result.end - result.start) * 1e-9),
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

std::string number_text(double value) {
  if (!std::isfinite(value)) return {};
  std::array<char, 32> digits;
  return {digits.data(), std::to_chars(digits.data(), digits.data() + digits.size(), value).ptr};
}

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
  for (const Group& group : history.groups) {
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
      out += cell.is_text ? cell.text : number_text(cell.number);
    }
    out += '\n';
  }
  return out;
}

std::string format(const char* pattern, auto... values) {
  std::array<char, 256> line;
  std::snprintf(line.data(), line.size(), pattern, values...);
  return line.data();
}

std::string or_dash(double value, bool given, const char* pattern) {
  return given && std::isfinite(value) ? format(pattern, value) : "-";
}

// "  4.0 % less friction since experiment 7 (2023-11-15), 99.9 % sure"; nothing where it is not
// less.
std::string wear_words(const Group& group) {
  const estimator::WearTest& wear = group.wear;
  if (!wear.found || group.since == nullptr) return {};
  constexpr double kSurest_percent = 99.9;  // more is said of no test
  constexpr std::size_t kDate = 10;         // of the time
  const double sure_percent = std::min(kSurest_percent, 100.0 * (1.0 - wear.p_value));
  return format("  %.1f %% less friction since experiment %lld (%s), %.1f %% sure\n",
                -wear.change_percent, static_cast<long long>(group.since->id),
                utc(group.since->time_s).substr(0, kDate).c_str(), sure_percent);
}

std::string carried_lines(const History& history) {
  std::string out;
  for (std::size_t group = 0; group < history.carried.size(); ++group) {
    const daemon::CarriedBound& bound = history.carried[group];
    if (bound.known()) {
      out += daemon::group_text(group) + ", " + utc(bound.time_s) + ": " +
             daemon::carried_text(bound) + '\n';
    } else if (bound.refused_mu_star > 0.0) {
      out += daemon::group_text(group) + ": " + daemon::refused_text(bound) + '\n';
    }
  }
  return out;
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
  for (const Group& group : history.groups) {
    const estimator::FusedFriction& fused = group.fused;
    out += format(
        "%s, %s: mu_max %.4f, std %.4f, 95 %% %.4f .. %.4f, from %d experiments that "
        "scatter by %.1f %%",
        lower(direction_name(group.direction)).c_str(),
        lower(end_stop_name(group.end_stop)).c_str(), fused.mu_max, fused.mu_max_std,
        fused.ci95_low, fused.ci95_high, fused.experiments, fused.repeatability_percent);
    if (fused.drift_percent_std > 0.0) {
      out += format("; drift %+.3f +- %.3f %% an experiment", fused.drift_percent,
                    fused.drift_percent_std);
    }
    out += '\n';
    const estimator::WearTest& wear = group.wear;
    if (wear.judged) {
      out += format("  the last %d against %d before: %+.1f %%, 95 %% %+.1f .. %+.1f, p %.2g: %s\n",
                    wear.after, wear.before, wear.change_percent, wear.ci95_low, wear.ci95_high,
                    wear.p_value, wear.found ? "WEAR" : "no wear");
      out += wear_words(group);
    }
  }
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
History read_logs(const Options& options, int& exit_code) {
  if (options.config.empty()) throw Failure{kUsage, "history: --from needs --config"};
  const daemon::Config config = load_configuration(options.config, "");
  const std::optional<Scratch> scratch =
      options.file.empty() ? std::make_optional<Scratch>() : std::nullopt;
  Options filled = options;
  filled.file = scratch ? scratch->path() : folder_of(options.file);
  for (const std::string& line : fill_history(filled.file, options.from, config)) {
    text::complain(line);
    exit_code = kBadInput;
  }
  History history = read(filled);
  if (scratch) history.path = std::to_string(options.from.size()) + " logs";
  return history;
}

void run(const Options& options) {
  if (options.json == "-" && options.csv == "-") {
    throw Failure{kUsage, "history: only one of --json and --csv can be standard output"};
  }
  int exit_code = kDone;
  History history = options.from.empty() ? read(options) : read_logs(options, exit_code);
  judge(history);
  // SQLite's files beside it belong to it.
  Inputs inputs{
      options.config, history.path, history.path + "-wal", history.path + "-shm",
      (std::filesystem::path(history.path).parent_path() / daemon::kCarriedFile).string()};
  inputs.add(options.from);
  std::optional<OutputFile> json_file, csv_file;
  if (!options.json.empty()) json_file.emplace(options.json, inputs);
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
  auto options = std::make_shared<Options>();
  command
      .add_option("FILE", options->file,
                  "history.db or its folder (default: the configuration's state_dir, else " +
                      std::string(kDefaultFolder) + ")")
      .type_name("");
  command
      .add_option("--config", options->config,
                  "BeltGrip's configuration: for its state_dir, and for --from")
      .type_name("FILE");
  command
      .add_option("--from", options->from,
                  "Replay these logs of one vehicle: FILE comes to hold their experiments too; "
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
  command.callback([options] { run(*options); });
}

}  // namespace beltgrip::cli
