#include "daemon/io/history_keeper.h"

#include <cmath>
#include <filesystem>
#include <system_error>
#include <utility>

namespace beltgrip::daemon {

namespace {
// More than every group's window needs.
constexpr std::size_t kExperimentsMax = 1024;
}  // namespace

HistoryKeeper::HistoryKeeper(std::string folder, std::string fingerprint, Say say, Clock now_s)
    : folder_(std::move(folder)),
      path_((std::filesystem::path(folder_) / kHistoryFile).string()),
      fingerprint_(std::move(fingerprint)),
      say_(std::move(say)),
      now_s_(std::move(now_s)) {}

estimator::LearnedFriction HistoryKeeper::open() {
  retried_s_ = now_s_();
  open_file();
  return learned();
}

void HistoryKeeper::complain(const std::string& what) {
  if (!complained_) say_(true, path_ + ": " + what);
  complained_ = true;
}

void HistoryKeeper::open_file() {
  std::error_code error;
  std::filesystem::create_directories(folder_, error);
  HistoryDb::Opened opened = HistoryDb::open(path_);
  if (error && opened.trouble == HistoryTrouble::kMissing) opened.text = error.message();
  if (opened.trouble == HistoryTrouble::kCorrupt) {
    set_aside(opened.text);
    return;
  }
  if (opened.db != nullptr && experiments_.empty()) {
    const HistoryContent content = opened.db->read();
    if (content.damaged > 0) {
      opened.db.reset();
      set_aside(std::to_string(content.damaged) + " rows are damaged");
      return;
    }
    adopt(content);
    say_(false, path_ + ": " + std::to_string(content.rows.size()) + " experiments, " +
                    std::to_string(experiments_.size()) + " of them under this configuration");
  }
  switch (opened.trouble) {
    case HistoryTrouble::kNone:
      db_ = std::move(opened.db);
      break;
    case HistoryTrouble::kNewer:
      lost_ = true;
      complain("found a history that this version cannot use (" + opened.text +
               "); it stays as it is, results are not kept");
      break;
    case HistoryTrouble::kReadOnly:
      complain("found a history that cannot be written (" + opened.text +
               "); results are kept in memory, next attempt in a minute");
      break;
    default:
      complain("the history cannot be opened (" + opened.text +
               "); results are kept in memory, next attempt in a minute");
      break;
  }
}

// The damaged file goes to NAME.bad, its rows that are whole into a new one.
void HistoryKeeper::set_aside(const std::string& why) {
  namespace fs = std::filesystem;
  std::string aside = path_ + ".bad";
  for (int i = 2; fs::exists(aside); ++i) aside = path_ + ".bad-" + std::to_string(i);
  std::error_code error;
  fs::rename(path_, aside, error);
  if (error) {
    complain("found a damaged history (" + why + ") that cannot be renamed (" + error.message() +
             "); it stays as it is, results are kept in memory");
    lost_ = true;
    return;
  }
  std::error_code none;
  fs::rename(path_ + "-wal", aside + "-wal", none);
  fs::remove(path_ + "-shm", none);
  HistoryContent content;
  HistoryDb::Opened old = HistoryDb::open_to_read(aside);
  if (old.db != nullptr) content = old.db->read();
  old.db.reset();
  HistoryDb::Opened fresh = HistoryDb::open(path_);
  db_ = fresh.trouble == HistoryTrouble::kNone ? std::move(fresh.db) : nullptr;
  std::size_t copied = 0;
  std::string reason;
  for (HistoryRow row : content.rows) {
    if (db_ != nullptr && db_->append(row, reason)) {
      ++copied;
    } else {
      waiting_.push_back(row);
    }
  }
  if (experiments_.empty()) adopt(content);
  say_(true, path_ + ": found a damaged history (" + why + "); it is kept as " + aside + ", " +
                 std::to_string(copied) + " of its experiments are in a new one");
}

void HistoryKeeper::adopt(const HistoryContent& content) {
  for (const HistoryRow& row : content.rows) {
    if (row.fingerprint != fingerprint_) continue;
    experiments_.push_back(belt_experiment(row));
    notes_ = row.notes;
  }
  if (experiments_.size() > kExperimentsMax) {
    experiments_.erase(experiments_.begin(), experiments_.end() - kExperimentsMax);
  }
}

void HistoryKeeper::write_waiting() {
  std::string why;
  while (db_ != nullptr && !waiting_.empty()) {
    if (!db_->append(waiting_.front(), why)) {
      complain("the history cannot be written (" + why +
               "); results are kept in memory, next attempt in a minute");
      // Open again at the next attempt: the file may have gone.
      db_.reset();
      return;
    }
    waiting_.pop_front();
  }
  if (db_ != nullptr && complained_) {
    complained_ = false;
    say_(false, path_ + ": the history is written again");
  }
}

estimator::LearnedFriction HistoryKeeper::take(const ExperimentResult& result) {
  HistoryRow row;
  row.time_s = now_s_();
  row.fingerprint = fingerprint_;
  row.result = result;
  experiments_.push_back(belt_experiment(row));
  if (experiments_.size() > kExperimentsMax) experiments_.erase(experiments_.begin());
  if (result.outcome != Outcome::kAborted) {
    notes_ = estimator::notes_on_last(experiments_, row.time_s);
    if (result.peak.contradictory) notes_ |= note_bit(estimator::Note::kContradictory);
    row.notes = notes_;
  }
  if (!lost_) {
    if (waiting_.size() == kUnwrittenMax) waiting_.pop_front();
    waiting_.push_back(row);
    write_waiting();
  }
  return learned();
}

estimator::LearnedFriction HistoryKeeper::change_fingerprint(const std::string& fingerprint) {
  if (fingerprint == fingerprint_) return learned();
  fingerprint_ = fingerprint;
  experiments_.clear();
  notes_ = 0;
  HistoryContent content;
  if (db_ != nullptr) content = db_->read();
  content.rows.insert(content.rows.end(), waiting_.begin(), waiting_.end());
  adopt(content);
  return learned();
}

std::optional<estimator::LearnedFriction> HistoryKeeper::retry() {
  if (lost_ || db_ != nullptr) return std::nullopt;
  const double now_s = now_s_();
  // A clock that was set back must not put the attempt off.
  if (std::abs(now_s - retried_s_) < kRetry_s) return std::nullopt;
  retried_s_ = now_s;
  open_file();
  write_waiting();
  if (db_ == nullptr) return std::nullopt;
  return learned();
}

estimator::LearnedFriction HistoryKeeper::learned() const {
  estimator::LearnedFriction now = estimator::learn(experiments_, now_s_());
  now.doubtful = (notes_ & estimator::kDoubts) != 0;
  now.unwritten = db_ == nullptr || !waiting_.empty();
  return now;
}

}  // namespace beltgrip::daemon
