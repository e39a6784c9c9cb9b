#include "tools/cli/history_from.h"

#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <filesystem>
#include <set>

#include "daemon/core/config/load/config_fingerprint.h"
#include "daemon/io/carried_keeper.h"
#include "daemon/io/history_keeper.h"
#include "tools/cli/replay_run.h"
#include "tools/cli/stop_signals.h"
#include "tools/text/terminal.h"

namespace beltgrip::cli {

namespace {

// Unix time of the year 1980: a stamp before it counts from the start of a recording.
constexpr double kEarliestDate_s = 315'532'800.0;

struct Dated {
  double time_s = 0.0;
  daemon::ExperimentResult result;
};

struct DatedWindow {
  double time_s = 0.0;
  daemon::CarriedWindow window;
};

struct Replayed {
  std::vector<Dated> results;
  std::vector<DatedWindow> carried;
};

// In the order of their times.
void sort_by_time(auto& all) {
  std::stable_sort(all.begin(), all.end(),
                   [](const auto& left, const auto& right) { return left.time_s < right.time_s; });
}

Replayed results_of(const std::vector<std::string>& logs, const daemon::Config& config,
                    std::vector<Failure>& unusable) {
  Replayed all;
  double undated_s = 0.0;                 // where the undated logs so far have come to
  std::set<std::filesystem::path> taken;  // one without dates would be another drive, later
  for (const std::string& log : logs) {
    std::error_code none;
    if (!taken.insert(std::filesystem::weakly_canonical(log, none)).second) continue;
    ReplayResult replayed;
    try {
      replayed = replay({log}, "", config, {});
    } catch (const Failure& failure) {
      unusable.push_back(failure);
      continue;
    }
    if (stop_asked()) break;  // of a log that is not read whole nothing is kept
    for (const std::string& warning : replayed.warnings) text::warn(warning);
    double last_s = undated_s;
    const auto time_of = [&](daemon::MonoTime end) {
      const double end_s = daemon::seconds(end.since_origin());
      if (end_s >= kEarliestDate_s) return end_s;
      last_s = std::max(last_s, undated_s + end_s);
      return undated_s + end_s;
    };
    for (const daemon::ExperimentResult& result : replayed.experiments) {
      all.results.push_back({time_of(result.end), result});
    }
    for (const daemon::CarriedWindow& window : replayed.carried_windows) {
      all.carried.push_back({time_of(window.end), window});
    }
    undated_s = last_s;
  }
  sort_by_time(all.results);
  sort_by_time(all.carried);
  return all;
}

// Times of what the history has under this fingerprint.
std::set<double> kept_in(const std::string& folder, const std::string& fingerprint) {
  std::set<double> times;
  const auto opened = daemon::HistoryDb::open_to_read(
      (std::filesystem::path(folder) / daemon::kHistoryFile).string());
  if (opened.db == nullptr) return times;
  for (const daemon::HistoryRow& row : opened.db->read().rows) {
    if (row.fingerprint == fingerprint) times.insert(row.time_s);
  }
  return times;
}

}  // namespace

std::vector<Failure> fill_history(const std::string& folder, const std::vector<std::string>& logs,
                                  const daemon::Config& config) {
  std::vector<Failure> unusable;
  std::error_code error;
  std::filesystem::create_directories(folder, error);
  if (access(folder.c_str(), W_OK | X_OK) != 0) {
    throw Failure{kCannotCreate, folder + ": cannot be written (" + std::strerror(errno) + ")"};
  }
  end_logs_when_stopped(logs);
  const Replayed replayed = results_of(logs, config, unusable);
  const std::vector<Dated>& results = replayed.results;
  const std::string fingerprint = config_fingerprint(config);
  const std::set<double> kept = kept_in(folder, fingerprint);
  double now_s = 0.0;
  const auto say = [](bool warning, const std::string& line) {
    if (warning) text::warn(line);
  };
  daemon::HistoryKeeper keeper(folder, fingerprint, say, [&] { return now_s; });
  keeper.open();
  for (const Dated& each : results) {
    if (kept.contains(each.time_s)) continue;
    now_s = each.time_s;
    keeper.take(each.result);
  }
  daemon::CarriedKeeper carried(folder, config, say);
  for (const DatedWindow& each : replayed.carried) carried.take(each.window, each.time_s);
  if (!carried.write()) throw Failure{kCannotWrite, folder + ": what was carried is not written"};
  const std::set<double> now_kept = kept_in(folder, fingerprint);
  for (const Dated& each : results) {
    if (now_kept.contains(each.time_s)) continue;
    throw Failure{kCannotWrite, folder + ": the history could not be written"};
  }
  return unusable;
}

}  // namespace beltgrip::cli
