// The history of experiments: one SQLite file in WAL mode. Every row carries a checksum; rows are
// only ever added, numbered from 1 without gaps. Helper thread and tools.
//
// Durability: an appended row is in the file and synchronised when append returns, and the write-
// ahead log is folded back, so that between two experiments there is one file, whole.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "daemon/core/base/result.h"
#include "daemon/core/experiment/experiment.h"
#include "estimator/belt/belt_history.h"

struct sqlite3;

namespace beltgrip::daemon {

inline constexpr const char* kHistoryFile = "history.db";
inline constexpr int kHistoryVersion = 1;  // of the schema: PRAGMA user_version

struct HistoryRow {
  std::int64_t id = 0;
  double time_s = 0.0;      // Unix time of the outcome
  std::string fingerprint;  // of the configuration
  ExperimentResult result;  // start and end: only their difference is kept
  std::uint32_t notes = 0;  // note_bit()s of belt_history.h
};
estimator::BeltExperiment belt_experiment(const HistoryRow& row);

enum class HistoryTrouble {
  kNone,
  kMissing,     // no such file, or it cannot be opened
  kCorrupt,     // no SQLite file, damaged, or not a history
  kNewer,       // schema of a later version
  kReadOnly,    // can be read but not written
  kNotWritten,  // disk full, I/O error, no memory, another has it: may pass
};

struct HistoryContent {
  std::vector<HistoryRow> rows;  // whose checksum is right, by id
  std::int64_t damaged = 0;      // rows whose checksum is wrong, and gaps in the sequence
  // Reading ended early, though nothing says that the file is damaged.
  HistoryTrouble trouble = HistoryTrouble::kNone;
  std::string text;  // what SQLite says then
};

class HistoryDb {
 public:
  struct Opened {
    std::unique_ptr<HistoryDb> db;  // empty with any trouble but kReadOnly
    HistoryTrouble trouble = HistoryTrouble::kNone;
    std::string text;  // what SQLite or the system says
  };
  // For writing: makes the file where there is none.
  static Opened open(const std::string& path);
  // Leaves no trace: neither file is made nor changed.
  static Opened open_to_read(const std::string& path);
  ~HistoryDb();
  HistoryDb(const HistoryDb&) = delete;
  HistoryDb& operator=(const HistoryDb&) = delete;

  // Rows that can be read, also of a damaged file.
  HistoryContent read();
  // The row's id in the file; where the same row is there already, it stays the only one. Or
  // nothing was added, and why.
  Result<std::int64_t> append(const HistoryRow& row);

 private:
  explicit HistoryDb(sqlite3* db) : db_(db) {}
  std::optional<std::int64_t> id_of(const HistoryRow& row);
  sqlite3* db_;
};

}  // namespace beltgrip::daemon
