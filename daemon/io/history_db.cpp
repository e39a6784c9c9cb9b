#include "daemon/io/history_db.h"

#include <sqlite3.h>
#include <sys/stat.h>
#include <unistd.h>
#include <zlib.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <charconv>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <functional>
#include <limits>
#include <optional>
#include <string_view>

#include "daemon/core/publish/names.h"

namespace beltgrip::daemon {

namespace {

using estimator::Direction;
using estimator::EndStop;
using estimator::PeakKind;
using estimator::StopReason;

constexpr int kApplicationId = 0x42475248;  // "BGRH"
constexpr int kBusy_ms = 2000;

constexpr const char* kSchema = R"(CREATE TABLE experiment (
  id INTEGER PRIMARY KEY,
  time_s REAL NOT NULL,
  fingerprint TEXT NOT NULL,
  outcome TEXT NOT NULL,
  stop_reason TEXT NOT NULL,
  kind TEXT NOT NULL,
  mu_max REAL,
  mu_max_std REAL,
  ci95_low REAL,
  ci95_high REAL,
  sensor_std REAL,
  sigma_stop_percent REAL,
  sigma_peak_percent REAL,
  samples INTEGER NOT NULL,
  duration_s REAL,
  direction TEXT NOT NULL,
  ratio TEXT NOT NULL,
  omega_p_rad_s REAL,
  omega_s_rad_s REAL,
  torque_Nm REAL,
  clamp_force_N REAL,
  oil_degC REAL,
  notes INTEGER NOT NULL,
  checksum INTEGER NOT NULL))";

constexpr const char* kColumns =
    "id, time_s, fingerprint, outcome, stop_reason, kind, mu_max, mu_max_std, ci95_low, ci95_high, "
    "sensor_std, "
    "sigma_stop_percent, sigma_peak_percent, samples, duration_s, direction, ratio, "
    "omega_p_rad_s, omega_s_rad_s, torque_Nm, clamp_force_N, oil_degC, notes, checksum";

// A row between HistoryRow and the file: each visitor sees every column once, in order.
struct Columns {
  std::function<void(std::int64_t&)> integer;
  std::function<void(double&)> number;  // no number: NULL
  std::function<void(std::string&)> text;
};

struct Stored {  // a row as the file has it
  std::int64_t id = 0, samples = 0, notes = 0;
  double duration_s = 0.0;
  std::string fingerprint, outcome, stop_reason, kind, direction, ratio;
  double time_s = 0.0;
  ExperimentResult result;  // its numbers

  void visit(const Columns& columns) {
    columns.integer(id);
    columns.number(time_s);
    for (std::string* each : {&fingerprint, &outcome, &stop_reason, &kind}) columns.text(*each);
    estimator::PeakEstimate& peak = result.peak;
    for (double* each :
         {&peak.mu_max, &peak.mu_max_std, &peak.ci95_low, &peak.ci95_high, &result.sensor_std,
          &result.sigma_stop_percent, &peak.sigma_peak_percent}) {
      columns.number(*each);
    }
    columns.integer(samples);
    columns.number(duration_s);
    columns.text(direction);
    columns.text(ratio);
    for (double* each : {&result.omega_p_rad_s, &result.omega_s_rad_s, &result.torque_Nm,
                         &result.clamp_force_N, &result.oil_degC}) {
      columns.number(*each);
    }
    columns.integer(notes);
  }
};

std::uint32_t checksum(Stored& stored) {
  std::string bytes;
  const auto add = [&](auto value) {
    std::array<char, 32> digits;
    bytes.append(digits.data(),
                 std::to_chars(digits.data(), digits.data() + digits.size(), value).ptr);
    bytes += '|';
  };
  stored.visit({[&](std::int64_t& value) { add(value); },
                [&](double& value) {
                  if (std::isnan(value)) bytes += '|';
                  if (!std::isnan(value)) add(value + 0.0);  // the file knows no -0
                },
                [&](std::string& value) { bytes += value + '|'; }});
  return static_cast<std::uint32_t>(
      crc32(0, reinterpret_cast<const Bytef*>(bytes.data()), static_cast<uInt>(bytes.size())));
}

template <typename Enum>
std::optional<Enum> enum_of(std::string_view name, int count, auto&& name_of) {
  for (int i = 0; i < count; ++i) {
    if (name_of(static_cast<Enum>(i)) == name) return static_cast<Enum>(i);
  }
  return std::nullopt;
}

bool is_name(const std::string& text) {
  constexpr std::size_t kLongest = 64;
  return text.size() <= kLongest &&
         std::all_of(text.begin(), text.end(), [](char c) { return c > ' ' && c < '\x7F'; });
}

// What a column may hold: no number, or one in its range. Wide: what a broken sensor has said is
// history too; what no program has written is none.
struct Range {
  double Stored::*own;  // one of these is set
  double ExperimentResult::*result;
  double estimator::PeakEstimate::*peak;
  double least, most;
  double& of(Stored& stored) const {
    return own != nullptr      ? stored.*own
           : result != nullptr ? stored.result.*result
                               : stored.result.peak.*peak;
  }
  bool holds(double value) const { return std::isnan(value) || (value >= least && value <= most); }
};
using Measured = ExperimentResult;
using Peak = estimator::PeakEstimate;
constexpr std::array kRanges{
    Range{&Stored::time_s, nullptr, nullptr, -4e10, 4e10},
    Range{&Stored::duration_s, nullptr, nullptr, 0.0, 1e7},
    Range{nullptr, nullptr, &Peak::mu_max, 0.0, 1.0},
    Range{nullptr, nullptr, &Peak::mu_max_std, 0.0, 1.0},
    Range{nullptr, nullptr, &Peak::ci95_low, -1.0, 1.0},
    Range{nullptr, nullptr, &Peak::ci95_high, -1.0, 10.0},
    Range{nullptr, nullptr, &Peak::sigma_peak_percent, 0.0, 1e3},
    Range{nullptr, &Measured::sensor_std, nullptr, 0.0, 1.0},
    Range{nullptr, &Measured::sigma_stop_percent, nullptr, 0.0, 1e6},
    Range{nullptr, &Measured::omega_p_rad_s, nullptr, -1e4, 1e4},
    Range{nullptr, &Measured::omega_s_rad_s, nullptr, -1e4, 1e4},
    Range{nullptr, &Measured::torque_Nm, nullptr, -1e4, 1e4},
    Range{nullptr, &Measured::clamp_force_N, nullptr, -1e6, 1e6},
    Range{nullptr, &Measured::oil_degC, nullptr, -60.0, 300.0},
};
constexpr std::int64_t kSamplesMost = 1'000'000'000;

// Wider than what an experiment is believed: earlier versions believed more.
constexpr double kMuLeast = 0.03, kMuMost = 0.25;

// A value is one that belts have, with an interval around it.
bool is_value(const Peak& peak) {
  return peak.mu_max >= kMuLeast && peak.mu_max <= kMuMost && peak.mu_max_std > 0.0 &&
         !(peak.ci95_low > peak.ci95_high);
}

// Whether a program of this project can have written it.
bool is_sane(Stored stored, PeakKind kind) {
  const bool in_range = std::all_of(kRanges.begin(), kRanges.end(), [&](const Range& range) {
    return range.holds(range.of(stored));
  });
  const bool counted = stored.samples >= 0 && stored.samples <= kSamplesMost && stored.notes >= 0 &&
                       stored.notes <= std::numeric_limits<std::uint32_t>::max();
  return in_range && counted && std::isfinite(stored.time_s) && is_name(stored.fingerprint) &&
         (kind != PeakKind::kValue || is_value(stored.result.peak));
}

// What is not in its range is not known.
void keep_to_ranges(Stored& stored) {
  for (const Range& range : kRanges) {
    double& value = range.of(stored);
    if (!range.holds(value)) value = std::numeric_limits<double>::quiet_NaN();
  }
}

Stored stored_of(const HistoryRow& row) {
  Stored stored;
  stored.id = row.id;
  stored.time_s = row.time_s;
  stored.fingerprint = row.fingerprint;
  stored.result = row.result;
  stored.samples = row.result.samples;
  stored.notes = row.notes;
  stored.duration_s = seconds(row.result.end - row.result.start);
  stored.outcome = outcome_name(row.result.outcome);
  stored.stop_reason = stop_reason_name(row.result.stop_reason);
  stored.kind = kind_name(row.result.peak.kind);
  stored.direction = direction_name(row.result.direction);
  stored.ratio = end_stop_name(row.result.end_stop);
  keep_to_ranges(stored);
  if (row.result.peak.kind == PeakKind::kValue && !is_value(stored.result.peak)) {
    stored.kind = kind_name(PeakKind::kNone);
  }
  return stored;
}

std::optional<HistoryRow> row_of(const Stored& stored) {
  const auto outcome = enum_of<Outcome>(stored.outcome, 4, outcome_name);
  const auto reason = enum_of<StopReason>(
      stored.stop_reason, static_cast<int>(estimator::kStopReasonCount), stop_reason_name);
  const auto kind = enum_of<PeakKind>(stored.kind, 3, kind_name);
  const auto direction = enum_of<Direction>(stored.direction, 2, direction_name);
  const auto end_stop = enum_of<EndStop>(stored.ratio, 2, end_stop_name);
  if (!outcome || !reason || !kind || !direction || !end_stop || !is_sane(stored, *kind)) {
    return std::nullopt;
  }
  HistoryRow row;
  row.id = stored.id;
  row.time_s = stored.time_s;
  row.fingerprint = stored.fingerprint;
  row.result = stored.result;
  row.result.outcome = *outcome;
  row.result.stop_reason = *reason;
  row.result.peak.kind = *kind;
  row.result.direction = *direction;
  row.result.end_stop = *end_stop;
  row.result.samples = stored.samples;
  row.result.start = {};
  row.result.end = std::isfinite(stored.duration_s) && std::abs(stored.duration_s) < 1e9
                       ? MonoTime::of_ns(std::llround(stored.duration_s * 1e9))
                       : MonoTime{};
  row.notes = static_cast<std::uint32_t>(stored.notes);
  return row;
}

class Statement {
 public:
  Statement(sqlite3* db, const char* sql) {
    status_ = sqlite3_prepare_v2(db, sql, -1, &statement_, nullptr);
  }
  Statement(sqlite3* db, const std::string& sql) : Statement(db, sql.c_str()) {}
  ~Statement() { sqlite3_finalize(statement_); }
  Statement(const Statement&) = delete;
  Statement& operator=(const Statement&) = delete;
  int step() {
    if (status_ == SQLITE_OK || status_ == SQLITE_ROW) status_ = sqlite3_step(statement_);
    return status_;
  }
  sqlite3_stmt* get() const { return statement_; }

 private:
  sqlite3_stmt* statement_ = nullptr;
  int status_;
};

int run(sqlite3* db, const char* sql) {
  Statement statement(db, sql);
  int status;
  while ((status = statement.step()) == SQLITE_ROW) {
  }
  return status;
}

// The first integer of a query; the status where there is none.
int query(sqlite3* db, const char* sql, std::int64_t& value) {
  Statement statement(db, sql);
  const int status = statement.step();
  if (status == SQLITE_ROW) value = sqlite3_column_int64(statement.get(), 0);
  return status;
}

bool is_damage(int status) {
  return (status & 0xFF) == SQLITE_CORRUPT || (status & 0xFF) == SQLITE_NOTADB;
}

HistoryTrouble trouble_of(int status) {
  if (is_damage(status)) return HistoryTrouble::kCorrupt;
  if ((status & 0xFF) == SQLITE_CANTOPEN) return HistoryTrouble::kMissing;
  if ((status & 0xFF) == SQLITE_READONLY) return HistoryTrouble::kReadOnly;
  return HistoryTrouble::kNotWritten;
}

// Of a statement that only reads. A plain error: a format that SQLite does not know.
HistoryTrouble trouble_of_reading(int status) {
  return status == SQLITE_ERROR ? HistoryTrouble::kCorrupt : trouble_of(status);
}

// What integrity_check reports: a page that it could not read is not damaged for that.
HistoryTrouble trouble_of_report(std::string_view report) {
  constexpr std::string_view kUnread = "unable to get the page. error code=";
  int status = SQLITE_CORRUPT;
  if (const std::size_t at = report.find(kUnread); at != std::string_view::npos) {
    const std::string_view code = report.substr(at + kUnread.size());
    std::from_chars(code.data(), code.data() + code.size(), status);
  } else if (report.find("failed to get page") != std::string_view::npos) {
    status = SQLITE_IOERR;
  }
  return trouble_of(status);
}

bool create(sqlite3* db) {
  const std::string version = "PRAGMA user_version = " + std::to_string(kHistoryVersion);
  const std::string application = "PRAGMA application_id = " + std::to_string(kApplicationId);
  const bool made = run(db, "BEGIN IMMEDIATE") == SQLITE_DONE && run(db, kSchema) == SQLITE_DONE &&
                    run(db, application.c_str()) == SQLITE_DONE &&
                    run(db, version.c_str()) == SQLITE_DONE && run(db, "COMMIT") == SQLITE_DONE;
  if (!made) run(db, "ROLLBACK");
  return made;
}

// What the file is, without changing it. fresh: nothing is in it yet.
HistoryTrouble inspect(sqlite3* db, bool& fresh, std::string& text) {
  const auto failed = [&](int status) {
    text = sqlite3_errmsg(db);
    return trouble_of_reading(status);
  };
  std::int64_t version = 0, application = 0, tables = 0;
  int status = query(db, "PRAGMA user_version", version);
  if (status == SQLITE_ROW) status = query(db, "PRAGMA application_id", application);
  if (status == SQLITE_ROW) status = query(db, "SELECT count(*) FROM sqlite_schema", tables);
  if (status != SQLITE_ROW) return failed(status);
  fresh = version == 0 && application == 0 && tables == 0;
  if (fresh) return HistoryTrouble::kNone;
  if (application != kApplicationId) {
    text = "it is not a history of BeltGrip";
    return HistoryTrouble::kCorrupt;
  }
  if (version > kHistoryVersion) {
    text = "its version is " + std::to_string(version) + ", this program knows " +
           std::to_string(kHistoryVersion);
    return HistoryTrouble::kNewer;
  }
  std::int64_t known = 0;
  const std::string schema =
      "SELECT count(*) FROM sqlite_schema WHERE sql = '" + std::string(kSchema) + "'";
  status = query(db, schema.c_str(), known);
  if (status != SQLITE_ROW) return failed(status);
  if (known != 1) {
    text = "its table is not that of version " + std::to_string(kHistoryVersion);
    return HistoryTrouble::kCorrupt;
  }
  Statement check(db, "PRAGMA integrity_check(1)");
  status = check.step();
  if (status != SQLITE_ROW) return failed(status);
  const auto* found = reinterpret_cast<const char*>(sqlite3_column_text(check.get(), 0));
  if (found == nullptr) return failed(SQLITE_NOMEM);
  if (version != kHistoryVersion || std::strcmp(found, "ok") != 0) {
    text = found;
    // SQLite's own report has several lines; an error is one.
    std::replace(text.begin(), text.end(), '\n', ' ');
    return trouble_of_report(text);
  }
  return HistoryTrouble::kNone;
}

bool has_content(const std::string& path) {
  struct stat status {};
  return stat(path.c_str(), &status) == 0 && status.st_size > 0;
}

// Something else than a file has the name: SQLite would wait at a FIFO for ever.
bool is_no_file(const std::string& path) {
  struct stat status {};
  return stat(path.c_str(), &status) == 0 && !S_ISREG(status.st_mode) && !S_ISDIR(status.st_mode);
}
HistoryDb::Opened no_file() { return {nullptr, HistoryTrouble::kMissing, "it is no regular file"}; }

// SQLite says only that it could not; an operator wants to know why. mode: what it needs of path.
std::string why_not_opened(sqlite3* db, const std::string& path, int mode) {
  const int denied = access(path.c_str(), mode);
  return denied == 0 ? sqlite3_errmsg(db) : std::strerror(errno);
}

// For a URI file name.
std::string escaped(const std::string& path) {
  constexpr std::string_view kHex = "0123456789ABCDEF";
  std::string out;
  for (const char c : path) {
    const auto byte = static_cast<unsigned char>(c);
    if (c == '%' || c == '?' || c == '#') {
      out += {'%', kHex[byte >> 4], kHex[byte & 15]};
    } else {
      out += c;
    }
  }
  return out;
}

}  // namespace

estimator::BeltExperiment belt_experiment(const HistoryRow& row) {
  estimator::BeltExperiment each;
  const ExperimentResult& result = row.result;
  each.time_s = row.time_s;
  each.kind = result.outcome == Outcome::kAborted ? PeakKind::kNone : result.peak.kind;
  each.mu_max = result.peak.mu_max;
  each.mu_max_std = result.peak.mu_max_std;
  each.ci95_low = result.peak.ci95_low;
  each.ci95_high = result.peak.ci95_high;
  each.sensor_std = result.sensor_std;
  each.direction = result.direction;
  each.end_stop = result.end_stop;
  each.omega_p_rad_s = result.omega_p_rad_s;
  each.torque_Nm = result.torque_Nm;
  each.oil_degC = result.oil_degC;
  each.slipped = (row.notes & note_bit(estimator::Note::kSlipped)) != 0;
  if (result.clamp_force_N > 0.0) {
    each.carried_Nm_per_N = std::abs(result.torque_Nm) / result.clamp_force_N;
  }
  return each;
}

HistoryDb::Opened HistoryDb::open(const std::string& path) {
  Opened opened;
  if (is_no_file(path)) return no_file();
  sqlite3* db = nullptr;
  int status = sqlite3_open_v2(
      path.c_str(), &db, SQLITE_OPEN_READWRITE | SQLITE_OPEN_CREATE | SQLITE_OPEN_NOMUTEX, nullptr);
  opened.db.reset(new HistoryDb(db));
  const auto fail = [&](HistoryTrouble trouble, const std::string& text) {
    opened.trouble = trouble;
    opened.text = text;
    opened.db.reset();
    return std::move(opened);
  };
  if (status != SQLITE_OK) {
    const bool there = access(path.c_str(), F_OK) == 0;
    const std::string folder = std::filesystem::path(path).parent_path().string();
    return fail(HistoryTrouble::kMissing,
                there ? why_not_opened(db, path, R_OK) : why_not_opened(db, folder, W_OK | X_OK));
  }
  sqlite3_extended_result_codes(db, 1);
  sqlite3_busy_timeout(db, kBusy_ms);
  bool fresh = false;
  std::string text;
  const bool read_only = sqlite3_db_readonly(db, "main") == 1;
  if (read_only) {
    // Not even its write-ahead log may be made.
    opened.db.reset();
    opened = open_to_read(path);
    if (opened.trouble == HistoryTrouble::kNone) opened.trouble = HistoryTrouble::kReadOnly;
    opened.text = opened.text.empty() ? "it is read-only" : opened.text;
    return opened;
  }
  const HistoryTrouble found = inspect(db, fresh, text);
  if (found != HistoryTrouble::kNone) return fail(found, text);
  if (sqlite3_db_readonly(db, "main") == 1) {  // its header says so
    opened.trouble = HistoryTrouble::kReadOnly;
    opened.text = "its header forbids it";
    return opened;
  }
  status = run(db, "PRAGMA journal_mode = WAL");
  if (status == SQLITE_DONE) status = run(db, "PRAGMA synchronous = FULL");
  if (status == SQLITE_DONE) status = run(db, "PRAGMA wal_autocheckpoint = 0");
  if (status != SQLITE_DONE || (fresh && !create(db))) {
    const int code = sqlite3_extended_errcode(db);
    return fail(trouble_of(code), sqlite3_errmsg(db));
  }
  run(db, "PRAGMA wal_checkpoint(TRUNCATE)");
  return opened;
}

HistoryDb::Opened HistoryDb::open_to_read(const std::string& path) {
  Opened opened;
  if (is_no_file(path)) return no_file();
  sqlite3* db = nullptr;
  // Without anything in the write-ahead log the file is complete by itself, and SQLite needs no
  // files beside it, which it may not be allowed to make.
  const bool alone = !has_content(path + "-wal");
  const std::string uri = "file:" + escaped(path) + (alone ? "?immutable=1" : "?mode=ro");
  const int status = sqlite3_open_v2(
      uri.c_str(), &db, SQLITE_OPEN_READONLY | SQLITE_OPEN_URI | SQLITE_OPEN_NOMUTEX, nullptr);
  opened.db.reset(new HistoryDb(db));
  if (status != SQLITE_OK) {
    opened.text = why_not_opened(db, path, R_OK);
    opened.trouble = HistoryTrouble::kMissing;
    opened.db.reset();
    return opened;
  }
  sqlite3_extended_result_codes(db, 1);
  sqlite3_busy_timeout(db, kBusy_ms);
  bool fresh = false;
  opened.trouble = inspect(db, fresh, opened.text);
  if (opened.trouble == HistoryTrouble::kNone && fresh) {
    opened.trouble = HistoryTrouble::kCorrupt;
    opened.text = "it is empty";
  }
  // A damaged one may still have rows.
  if (opened.trouble != HistoryTrouble::kNone && opened.trouble != HistoryTrouble::kCorrupt) {
    opened.db.reset();
  }
  return opened;
}

HistoryDb::~HistoryDb() { sqlite3_close(db_); }

HistoryContent HistoryDb::read() {
  HistoryContent content;
  // By place, not by name: a damaged name costs no rows.
  Statement statement(db_, "SELECT * FROM experiment ORDER BY rowid");
  std::int64_t last = 0;
  int status;
  while ((status = statement.step()) == SQLITE_ROW) {
    Stored stored;
    int column = 0;
    sqlite3_stmt* row = statement.get();
    stored.visit({[&](std::int64_t& value) { value = sqlite3_column_int64(row, column++); },
                  [&](double& value) {
                    value = sqlite3_column_type(row, column) == SQLITE_NULL
                                ? std::numeric_limits<double>::quiet_NaN()
                                : sqlite3_column_double(row, column);
                    ++column;
                  },
                  [&](std::string& value) {
                    const auto* text =
                        reinterpret_cast<const char*>(sqlite3_column_text(row, column));
                    const int size = sqlite3_column_bytes(row, column++);
                    if (text != nullptr) value.assign(text, static_cast<std::size_t>(size));
                  }});
    const std::optional<HistoryRow> good = row_of(stored);
    const bool whole =
        good && stored.id > last && sqlite3_column_int64(row, column) == checksum(stored);
    if (!whole || stored.id != last + 1) ++content.damaged;
    last = stored.id;
    if (whole) content.rows.push_back(*good);
  }
  if (status == SQLITE_DONE) return content;
  const HistoryTrouble trouble = trouble_of_reading(status);
  if (trouble == HistoryTrouble::kCorrupt) {
    ++content.damaged;
  } else {
    content.trouble = trouble;
    content.text = sqlite3_errmsg(db_);
  }
  return content;
}

std::optional<std::int64_t> HistoryDb::id_of(const HistoryRow& row) {
  Statement same(db_,
                 "SELECT id FROM experiment WHERE time_s = ? AND fingerprint = ? AND mu_max IS ?");
  sqlite3_bind_double(same.get(), 1, row.time_s);
  sqlite3_bind_text(same.get(), 2, row.fingerprint.data(), static_cast<int>(row.fingerprint.size()),
                    SQLITE_TRANSIENT);
  sqlite3_bind_double(same.get(), 3, row.result.peak.mu_max);
  if (same.step() != SQLITE_ROW) return std::nullopt;
  return sqlite3_column_int64(same.get(), 0);
}

Result<std::int64_t> HistoryDb::append(const HistoryRow& row) {
  const auto fail = [&] {
    std::string why = sqlite3_errmsg(db_);
    run(db_, "ROLLBACK");
    return why;
  };
  if (run(db_, "BEGIN IMMEDIATE") != SQLITE_DONE) return fail();
  std::int64_t last = 0;
  // An attempt that was reported as failed may have reached the disk after all.
  if (const std::optional<std::int64_t> known = id_of(row)) {
    run(db_, "ROLLBACK");
    return *known;
  }
  if (query(db_, "SELECT coalesce(max(id), 0) FROM experiment", last) != SQLITE_ROW) return fail();
  HistoryRow numbered = row;
  numbered.id = last + 1;
  Stored stored = stored_of(numbered);
  std::string sql = std::string("INSERT INTO experiment (") + kColumns + ") VALUES (?";
  for (const char* c = kColumns; *c != '\0'; ++c) sql += *c == ',' ? ", ?" : "";
  Statement insert(db_, sql + ")");
  int at = 0;
  sqlite3_stmt* statement = insert.get();
  stored.visit({[&](std::int64_t& value) { sqlite3_bind_int64(statement, ++at, value); },
                // SQLite stores what is no number as NULL by itself.
                [&](double& value) { sqlite3_bind_double(statement, ++at, value); },
                [&](std::string& value) {
                  sqlite3_bind_text(statement, ++at, value.data(), static_cast<int>(value.size()),
                                    SQLITE_TRANSIENT);
                }});
  sqlite3_bind_int64(statement, ++at, checksum(stored));
  if (insert.step() != SQLITE_DONE) return fail();
  if (run(db_, "COMMIT") != SQLITE_DONE) return fail();
  // Where it cannot be folded back now (a reader, a full disk), the row is safe in the log.
  run(db_, "PRAGMA wal_checkpoint(TRUNCATE)");
  return numbered.id;
}

}  // namespace beltgrip::daemon
