// Keeps every experiment: in the history file where that can be written, in memory whatever
// happens, and says what they all say together. A file that is damaged is set aside under another
// name, and what can be read of it goes into a new one; one of a newer version or one that cannot
// be written stays as it is. One that can be read only after the start counts from then on. Each
// trouble is said once. Start-up, then helper thread.
#pragma once

#include <deque>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "daemon/io/history_db.h"

namespace beltgrip::daemon {

class HistoryKeeper {
 public:
  static constexpr double kRetry_s = 60.0;
  static constexpr std::size_t kUnwrittenMax = 1024;  // rows that wait for a disk
  using Say = std::function<void(bool warning, const std::string& line)>;
  using Clock = std::function<double()>;  // Unix time in s

  HistoryKeeper(std::string folder, std::string fingerprint, Say say, Clock now_s);

  // Once, at the start.
  estimator::LearnedFriction open();
  estimator::LearnedFriction take(const ExperimentResult& result);
  // The experiments of another configuration count from now on.
  estimator::LearnedFriction change_fingerprint(const std::string& fingerprint);
  // Writes what waits, at most once in kRetry_s; a value when something has changed.
  std::optional<estimator::LearnedFriction> retry();

 private:
  void open_file();
  void set_aside(const std::string& why);
  std::size_t adopt(const HistoryContent& content);
  void judge(HistoryRow& row);
  void note(const HistoryRow& row);
  void write_waiting();
  void complain(const std::string& what);
  estimator::LearnedFriction learned() const;

  std::string folder_, path_, fingerprint_;
  Say say_;
  Clock now_s_;
  std::unique_ptr<HistoryDb> db_;  // for writing; empty while the file cannot be written
  bool adopted_ = false;           // what the file has of this fingerprint is in experiments_
  bool lost_ = false;              // the file belongs to a newer version: not ours to write
  bool complained_ = false;
  double retried_s_ = 0.0;
  std::deque<HistoryRow> waiting_;
  std::vector<estimator::BeltExperiment> experiments_;  // of this fingerprint, oldest first
  std::uint32_t notes_ = 0;                             // on the last result, and doubts before it
};

}  // namespace beltgrip::daemon
