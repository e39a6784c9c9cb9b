#include "daemon/io/history_keeper.h"

#include <algorithm>
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
  if (opened.db != nullptr && !adopted_) {
    const HistoryContent content = opened.db->read();
    if (content.trouble != HistoryTrouble::kNone) {
      opened.db.reset();
      opened.trouble = content.trouble;
      opened.text = content.text;
    } else if (content.damaged > 0) {
      opened.db.reset();
      set_aside(std::to_string(content.damaged) + " rows are damaged");
      return;
    } else {
      const std::size_t own = adopt(content);
      say_(false, path_ + ": " + std::to_string(content.rows.size()) + " experiments, " +
                      std::to_string(own) + " of them under this configuration");
    }
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
  if (!adopted_) adopt(content);
  std::vector<HistoryRow> unwritten;
  for (const HistoryRow& row : content.rows) {
    if (db_ == nullptr || !db_->append(row)) unwritten.push_back(row);
  }
  // They are older than what waits.
  waiting_.insert(waiting_.begin(), unwritten.begin(), unwritten.end());
  const std::size_t copied = content.rows.size() - unwritten.size();
  say_(true, path_ + ": found a damaged history (" + why + "); it is kept as " + aside + ", " +
                 std::to_string(copied) + " of its experiments are in a new one");
}

// What the file has of this fingerprint, and how much that is; after it what waits for the file: it
// was measured later, and is judged by what was there before.
std::size_t HistoryKeeper::adopt(const HistoryContent& content) {
  experiments_.clear();
  notes_ = 0;
  adopted_ = true;
  for (const HistoryRow& row : content.rows) {
    if (row.fingerprint != fingerprint_) continue;
    experiments_.push_back(belt_experiment(row));
    note(row);
  }
  const std::size_t found = experiments_.size();
  if (found > kExperimentsMax) {
    experiments_.erase(experiments_.begin(), experiments_.end() - kExperimentsMax);
  }
  for (HistoryRow& row : waiting_) {
    // An attempt that was reported as failed may have reached the disk after all.
    const bool there =
        std::any_of(content.rows.begin(), content.rows.end(), [&](const HistoryRow& each) {
          return each.time_s == row.time_s && each.fingerprint == row.fingerprint;
        });
    if (row.fingerprint == fingerprint_ && !there) judge(row);
  }
  return found;
}

// The newest result: counts, and what those before it say of it is noted.
void HistoryKeeper::judge(HistoryRow& row) {
  experiments_.push_back(belt_experiment(row));
  if (experiments_.size() > kExperimentsMax) experiments_.erase(experiments_.begin());
  if (row.result.outcome == Outcome::kAborted) return;
  row.notes |= estimator::notes_on_last(experiments_, row.time_s);
  if (row.result.peak.contradictory || row.result.peak.impossible) {
    row.notes |= note_bit(estimator::Note::kContradictory);
  }
  note(row);
}

// Only a measured value settles a doubt.
void HistoryKeeper::note(const HistoryRow& row) {
  const bool settles = row.result.outcome == Outcome::kCompleted;
  notes_ = row.notes | (settles ? 0U : notes_ & estimator::kDoubts);
}

void HistoryKeeper::write_waiting() {
  while (db_ != nullptr && !waiting_.empty()) {
    const Result<std::int64_t> id = db_->append(waiting_.front());
    if (!id) {
      complain("the history cannot be written (" + id.error() +
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
  if (result.slipped) row.notes |= note_bit(estimator::Note::kSlipped);
  judge(row);
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
  HistoryContent content;
  HistoryTrouble trouble = HistoryTrouble::kNone;
  if (db_ != nullptr) {
    content = db_->read();
    trouble = content.trouble;
    if (trouble != HistoryTrouble::kNone) {
      complain("the history cannot be read (" + content.text +
               "); results are kept in memory, next attempt in a minute");
    }
  } else if (!lost_) {
    // What cannot be written may still be read.
    const HistoryDb::Opened opened = HistoryDb::open_to_read(path_);
    trouble = opened.trouble;
    if (trouble == HistoryTrouble::kNone) {
      content = opened.db->read();
      trouble = content.trouble;
    }
  }
  if (trouble != HistoryTrouble::kNone) {
    content.rows.clear();
    db_.reset();
  }
  adopt(content);
  // Else at the next attempt.
  adopted_ = trouble == HistoryTrouble::kNone;
  return learned();
}

std::optional<estimator::LearnedFriction> HistoryKeeper::retry() {
  if (lost_ || db_ != nullptr) return std::nullopt;
  const double now_s = now_s_();
  // A clock that was set back must not put the attempt off.
  if (std::abs(now_s - retried_s_) < kRetry_s) return std::nullopt;
  retried_s_ = now_s;
  const bool adopted = adopted_;
  open_file();
  write_waiting();
  if (db_ == nullptr && adopted_ == adopted) return std::nullopt;
  return learned();
}

estimator::LearnedFriction HistoryKeeper::learned() const {
  estimator::LearnedFriction now = estimator::learn(experiments_, now_s_());
  now.doubtful = (notes_ & estimator::kDoubts) != 0;
  now.unwritten = db_ == nullptr || !waiting_.empty();
  return now;
}

}  // namespace beltgrip::daemon
