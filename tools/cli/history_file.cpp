#include "tools/cli/history_file.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <ctime>
#include <filesystem>

#include "can_dbc/text/format.h"
#include "daemon/core/publish/names.h"
#include "daemon/io/carried_keeper.h"
#include "tools/cli/configuration.h"
#include "tools/cli/failure.h"
#include "tools/text/snake_case.h"
#include "tools/text/terminal.h"

namespace beltgrip::cli {

namespace {

using daemon::direction_name;
using daemon::end_stop_name;
using daemon::HistoryRow;
using estimator::Direction;
using estimator::EndStop;
using text::snake_case;

constexpr std::array<const char*, estimator::kNoteCount> kNoteNames{
    "outlier",       "trend",  "wear", "directions_disagree", "end_stops_disagree",
    "contradictory", "slipped"};

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

std::string path_of(const std::string& file, const std::string& config) {
  namespace fs = std::filesystem;
  std::string path = file;
  if (path.empty() && !config.empty()) {
    const std::string folder = load_configuration(config, "").state_dir;
    if (!folder.empty()) path = (fs::path(config).parent_path() / folder).string();
  }
  if (path.empty()) path = kHistoryFolder;
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
  if (found) return *found;
  text::warn(folder + "/" + daemon::kCarriedFile + ": found no record of what was carried (" +
             found.error() + ")");
  return {};
}

// As of the last experiment, so that the same file gives the same answer on any day.
void judge(History& history) {
  if (history.rows.empty()) return;
  history.fingerprint = history.rows.back().fingerprint;
  std::vector<estimator::BeltExperiment> experiments;
  std::vector<const HistoryRow*> rows;  // of the experiments
  for (const HistoryRow& row : history.rows) {
    if (row.fingerprint != history.fingerprint) continue;
    experiments.push_back(belt_experiment(row));
    rows.push_back(&row);
  }
  history.comparable = experiments.size();
  for (const Direction direction : {Direction::kDrive, Direction::kOverrun}) {
    for (const EndStop end_stop : {EndStop::kOverdrive, EndStop::kLow}) {
      HistoryGroup group{direction, end_stop,
                         fuse(experiments, direction, end_stop, history.rows.back().time_s),
                         wear(experiments, direction, end_stop)};
      const estimator::WearStep step = wear_step(experiments, direction, end_stop);
      if (group.wear.found || step.test.found) {
        const double p_value = std::min(group.wear.p_value, step.test.p_value);
        group.wear = step.test;
        group.wear.p_value = p_value;
        group.wear.found = true;
        group.since = rows[step.first];
      }
      if (group.fused.known) history.groups.push_back(group);
    }
  }
}

// "  4.0 % less friction since experiment 7 (2023-11-15), 99.9 % sure"; nothing where it is not
// less.
std::string wear_words(const HistoryGroup& group) {
  const estimator::WearTest& wear = group.wear;
  if (!wear.found || group.since == nullptr) return {};
  constexpr double kSurest_percent = 99.9;  // more is said of no test
  constexpr std::size_t kDate = 10;         // of the time
  const double sure_percent = std::min(kSurest_percent, 100.0 * (1.0 - wear.p_value));
  return format("  %.1f %% less friction since experiment %lld (%s), %.1f %% sure\n",
                -wear.change_percent, static_cast<long long>(group.since->id),
                utc(group.since->time_s).substr(0, kDate).c_str(), sure_percent);
}

}  // namespace

History read_history(const std::string& file, const std::string& config) {
  History history;
  history.path = path_of(file, config);
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
  judge(history);
  return history;
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

std::string fused_text(const HistoryGroup& group) {
  std::string out;
  const estimator::FusedFriction& fused = group.fused;
  out += format("%s, %s: mu_max %.4f, std %.4f, 95 %% %.4f .. %.4f, from %d experiment%s",
                snake_case(direction_name(group.direction)).c_str(),
                snake_case(end_stop_name(group.end_stop)).c_str(), fused.mu_max, fused.mu_max_std,
                fused.ci95_low, fused.ci95_high, fused.weighed, fused.weighed == 1 ? "" : "s");
  if (fused.weighed > 1) {
    out += format(" that scatter by %.1f %%", fused.repeatability_percent);
  }
  if (fused.last_waits) out += "; the last lies far off and counts when another one agrees with it";
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
  return out;
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

}  // namespace beltgrip::cli
