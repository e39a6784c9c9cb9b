// The history file against everything that can happen to it: a crash after any part of a write, a
// loss of power, truncation, flipped bits, other versions, no right to write, a full disk. What was
// acknowledged is there afterwards; what is returned is what was written, to the bit.
#include <gtest/gtest.h>
#include <signal.h>
#include <sqlite3.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <limits>
#include <random>
#include <sstream>

#include "daemon/io/history_keeper.h"
#include "tests/daemon/io/crash_vfs.h"

namespace beltgrip::daemon {
namespace {

namespace fs = std::filesystem;
using estimator::PeakKind;
using test::CrashVfs;
using test::Files;

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

ExperimentResult result(double mu, int number = 0) {
  ExperimentResult each;
  each.start = MonoTime{kSecond};
  each.end = MonoTime{13'500 * kMillisecond};
  each.stopped = true;
  each.outcome = Outcome::kCompleted;
  each.stop_reason = estimator::StopReason::kSlope;
  each.peak = {PeakKind::kValue, mu, 0.002 * mu, 0.996 * mu, 1.004 * mu, 2.5, 900 + number};
  each.sensor_std = 0.0001;
  each.sigma_stop_percent = 2.9;
  each.samples = 2500;
  each.omega_p_rad_s = 150.25;
  each.omega_s_rad_s = 337.5;
  each.torque_Nm = 40.0;
  each.clamp_force_N = 2400.0;
  each.oil_degC = 81.5;
  return each;
}

HistoryRow row(int number) {
  HistoryRow each;
  each.time_s = 1.7e9 + 0.125 * number;
  each.fingerprint = "0123456789abcdef";
  each.result = result(0.1 + 1e-5 * number, number);
  return each;
}

bool same(double a, double b) { return a == b || (std::isnan(a) && std::isnan(b)); }

bool same(const HistoryRow& a, const HistoryRow& b) {
  const ExperimentResult &x = a.result, &y = b.result;
  return a.id == b.id && same(a.time_s, b.time_s) && a.fingerprint == b.fingerprint &&
         a.notes == b.notes && x.outcome == y.outcome && x.stop_reason == y.stop_reason &&
         x.peak.kind == y.peak.kind && same(x.peak.mu_max, y.peak.mu_max) &&
         same(x.peak.mu_max_std, y.peak.mu_max_std) && same(x.peak.ci95_low, y.peak.ci95_low) &&
         same(x.peak.ci95_high, y.peak.ci95_high) &&
         same(x.peak.sigma_peak_percent, y.peak.sigma_peak_percent) &&
         same(x.sigma_stop_percent, y.sigma_stop_percent) && x.samples == y.samples &&
         x.end - x.start == y.end - y.start && x.direction == y.direction &&
         x.end_stop == y.end_stop && same(x.omega_p_rad_s, y.omega_p_rad_s) &&
         same(x.omega_s_rad_s, y.omega_s_rad_s) && same(x.torque_Nm, y.torque_Nm) &&
         same(x.sensor_std, y.sensor_std) && same(x.clamp_force_N, y.clamp_force_N) &&
         same(x.oil_degC, y.oil_degC);
}

// Folders in memory where there are such: thousands of small files are made.
class Folder {
 public:
  Folder() {
    std::string pattern =
        (fs::exists("/dev/shm") ? "/dev/shm" : fs::temp_directory_path().string());
    pattern += "/beltgrip.XXXXXX";
    EXPECT_NE(mkdtemp(pattern.data()), nullptr);
    path_ = pattern;
  }
  ~Folder() {
    std::error_code ignored;
    fs::permissions(path_, fs::perms::owner_all, ignored);
    fs::remove_all(path_, ignored);
  }
  Folder(const Folder&) = delete;
  Folder& operator=(const Folder&) = delete;
  std::string file(const std::string& name = kHistoryFile) const { return path_ + "/" + name; }
  const std::string& path() const { return path_; }
  void clear() const {
    for (const auto& each : fs::directory_iterator(path_)) fs::remove(each.path());
  }
  void fill(const Files& files) const {
    clear();
    for (const auto& [name, bytes] : files) {
      std::ofstream(file(name), std::ios::binary) << bytes;
    }
  }
  std::string bytes(const std::string& name = kHistoryFile) const {
    std::ifstream in(file(name), std::ios::binary);
    std::ostringstream out;
    out << in.rdbuf();
    return out.str();
  }

 private:
  std::string path_;
};

std::vector<HistoryRow> write_rows(const std::string& path, int count) {
  std::vector<HistoryRow> rows;
  HistoryDb::Opened opened = HistoryDb::open(path);
  EXPECT_EQ(opened.trouble, HistoryTrouble::kNone) << opened.text;
  for (int i = 0; i < count; ++i) {
    rows.push_back(row(i));
    const Result<std::int64_t> id = opened.db->append(rows.back());
    EXPECT_TRUE(id) << id.error();
    rows.back().id = *id;
  }
  return rows;
}

// A keeper with a clock of its own and what it has said.
struct Keeper {
  explicit Keeper(const std::string& folder, const std::string& fingerprint = "0123456789abcdef")
      : keeper(
            folder, fingerprint,
            [this](bool warning, const std::string& line) {
              (warning ? warnings : infos).push_back(line);
            },
            [this] { return now_s += 0.001; }) {}
  double now_s = 1.7e9 + 1000.0;
  std::vector<std::string> warnings, infos;
  HistoryKeeper keeper;
};

TEST(HistoryDb, EveryValueComesBack) {
  const Folder folder;
  std::vector<HistoryRow> rows = write_rows(folder.file(), 3);
  {
    HistoryDb::Opened opened = HistoryDb::open(folder.file());
    ASSERT_NE(opened.db, nullptr) << opened.text;
    for (const double odd : {kNan, 0.0, -0.0, 1e-310, 0.9999999999999999}) {
      HistoryRow each = row(static_cast<int>(rows.size()));
      each.result.oil_degC = odd;
      each.result.peak.mu_max_std = odd;
      each.result.outcome = Outcome::kAborted;
      each.result.stop_reason = estimator::StopReason::kTraceEnd;
      each.result.peak.kind = PeakKind::kLowerBound;
      each.result.direction = estimator::Direction::kOverrun;
      each.result.end_stop = estimator::EndStop::kLow;
      each.notes = 63;
      each.fingerprint = "";
      const Result<std::int64_t> id = opened.db->append(each);
      ASSERT_TRUE(id) << id.error();
      each.id = *id;
      rows.push_back(each);
    }
    // Read by another connection while it is open.
    HistoryDb::Opened reader = HistoryDb::open_to_read(folder.file());
    ASSERT_NE(reader.db, nullptr) << reader.text;
    EXPECT_EQ(reader.db->read().rows.size(), rows.size());
    // The same result again stays one row.
    const Result<std::int64_t> again = opened.db->append(row(2));
    ASSERT_TRUE(again);
    EXPECT_EQ(*again, 3);
  }
  EXPECT_FALSE(fs::exists(folder.file("history.db-wal")));
  HistoryDb::Opened opened = HistoryDb::open_to_read(folder.file());
  ASSERT_NE(opened.db, nullptr) << opened.text;
  const HistoryContent content = opened.db->read();
  EXPECT_EQ(content.damaged, 0);
  ASSERT_EQ(content.rows.size(), rows.size());
  for (std::size_t i = 0; i < rows.size(); ++i) {
    EXPECT_EQ(content.rows[i].id, static_cast<std::int64_t>(i + 1));
    EXPECT_TRUE(same(content.rows[i], rows[i])) << i;
  }
}

TEST(HistoryDb, ReadingMakesAndChangesNothing) {
  const Folder folder;
  EXPECT_EQ(HistoryDb::open_to_read(folder.file()).trouble, HistoryTrouble::kMissing);
  EXPECT_TRUE(fs::is_empty(folder.path()));
  write_rows(folder.file(), 2);
  const std::string before = folder.bytes();
  HistoryDb::open_to_read(folder.file()).db->read();
  EXPECT_EQ(folder.bytes(), before);
  EXPECT_EQ(std::distance(fs::directory_iterator(folder.path()), {}), 1);
}

// --- crashes --------------------------------------------------------------------------------

struct Recorded {
  Files before;
  std::vector<test::FileOperation> operations;
  std::vector<HistoryRow> rows;  // old ones and the new one, which is the last
};

// Everything that appending the row after `old` ones does to the files.
Recorded record(int old) {
  const Folder folder;
  Recorded recorded;
  if (old > 0) recorded.rows = write_rows(folder.file(), old);
  if (old > 0) recorded.before[kHistoryFile] = folder.bytes();
  CrashVfs vfs;
  HistoryRow added = row(old);
  const Result<std::int64_t> id = HistoryDb::open(folder.file()).db->append(added);
  EXPECT_TRUE(id) << id.error();
  added.id = *id;
  recorded.rows.push_back(added);
  recorded.operations = vfs.operations;
  return recorded;
}

// Old or new, never else.
void expect_whole(const Folder& folder, const Files& files, const Recorded& recorded,
                  const std::string& where) {
  folder.fill(files);
  HistoryDb::Opened opened = HistoryDb::open(folder.file());
  ASSERT_EQ(opened.trouble, HistoryTrouble::kNone) << where << ": " << opened.text;
  const HistoryContent content = opened.db->read();
  ASSERT_EQ(content.damaged, 0) << where;
  ASSERT_GE(content.rows.size() + 1, recorded.rows.size()) << where;
  ASSERT_LE(content.rows.size(), recorded.rows.size()) << where;
  for (std::size_t i = 0; i < content.rows.size(); ++i) {
    ASSERT_TRUE(same(content.rows[i], recorded.rows[i])) << where;
  }
}

class CrashPoint : public testing::TestWithParam<int> {};

TEST_P(CrashPoint, OldOrNewAfterAnyPartOfAnyWrite) {
  const Recorded recorded = record(GetParam());
  const Folder folder;
  std::size_t points = 0;
  for (std::size_t i = 0; i <= recorded.operations.size(); ++i) {
    const std::size_t bytes =
        i < recorded.operations.size() ? recorded.operations[i].bytes.size() : 0;
    for (std::size_t partial = 0; partial <= bytes; ++points) {
      expect_whole(folder, test::after(recorded.before, recorded.operations, i, partial), recorded,
                   "operation " + std::to_string(i) + ", byte " + std::to_string(partial));
      if (HasFatalFailure()) return;
      const bool edge = partial < 4 || partial + 4 >= bytes;
      partial += edge ? 1 : std::min<std::size_t>(193, bytes - 4 - partial);
    }
  }
  EXPECT_GT(points, 80U);
}

// Writes reach the disk in any order until the file is synchronised.
TEST_P(CrashPoint, OldOrNewWhereOneWriteNeverReachedTheDisk) {
  using Kind = test::FileOperation::Kind;
  const Recorded recorded = record(GetParam());
  const Folder folder;
  for (std::size_t i = 0; i < recorded.operations.size(); ++i) {
    if (recorded.operations[i].kind != Kind::kWrite) continue;
    for (std::size_t end = i + 1; end <= recorded.operations.size(); ++end) {
      const auto& last = recorded.operations[end - 1];
      if (last.kind == Kind::kSync && last.file == recorded.operations[i].file) break;
      expect_whole(folder,
                   test::after(recorded.before, recorded.operations, end, 0, static_cast<int>(i)),
                   recorded, "write " + std::to_string(i) + " lost before " + std::to_string(end));
      if (HasFatalFailure()) return;
    }
  }
}

// Making the file, a row in the first page, a row that needs another page.
INSTANTIATE_TEST_SUITE_P(History, CrashPoint, testing::Values(0, 1, 14));

// A row that was acknowledged is there, whatever fails afterwards; one that was not acknowledged
// is there or not, but not in part.
TEST(HistoryDb, EveryFailureOfTheDisk) {
  for (const int status : {SQLITE_FULL, SQLITE_IOERR_WRITE, SQLITE_IOERR_FSYNC}) {
    for (int fail_at = 1; fail_at < 60; ++fail_at) {
      const Folder folder;
      std::vector<HistoryRow> acknowledged = write_rows(folder.file(), 3);
      {
        CrashVfs vfs;
        vfs.fail_with = status;
        vfs.fail_at = fail_at;
        HistoryDb::Opened opened = HistoryDb::open(folder.file());
        for (int i = 3; i < 6 && opened.db != nullptr; ++i) {
          HistoryRow each = row(i);
          const Result<std::int64_t> id = opened.db->append(each);
          if (!id) break;
          each.id = *id;
          acknowledged.push_back(each);
        }
      }
      HistoryDb::Opened opened = HistoryDb::open(folder.file());
      ASSERT_EQ(opened.trouble, HistoryTrouble::kNone) << opened.text << fail_at;
      const HistoryContent content = opened.db->read();
      ASSERT_EQ(content.damaged, 0);
      ASSERT_GE(content.rows.size(), acknowledged.size()) << fail_at;
      ASSERT_LE(content.rows.size(), acknowledged.size() + 1) << fail_at;
      for (std::size_t i = 0; i < acknowledged.size(); ++i) {
        ASSERT_TRUE(same(content.rows[i], acknowledged[i])) << fail_at;
      }
    }
  }
}

// --- damage -----------------------------------------------------------------------------------

// The keeper runs on with a file that was damaged: nothing that it returns is wrong, the file is
// still there under this name or another, byte for byte, and a new result is kept.
void expect_survives(const Folder& folder, const std::string& damaged,
                     const std::vector<HistoryRow>& written, const std::string& where) {
  folder.fill({{kHistoryFile, damaged}});
  {
    Keeper keeper(folder.path());
    keeper.keeper.open();
    const bool aside = fs::exists(folder.file("history.db.bad"));
    ASSERT_LE(keeper.warnings.size(), 1U) << where;
    ASSERT_EQ(aside,
              !keeper.warnings.empty() && keeper.warnings[0].find(".bad") != std::string::npos)
        << where;
    if (aside) {
      ASSERT_EQ(folder.bytes("history.db.bad"), damaged) << where;
    }
    keeper.keeper.take(result(0.0987));
  }
  HistoryDb::Opened opened = HistoryDb::open(folder.file());
  // A flipped bit in the version, or in what SQLite takes for the right to write: it stays as it
  // is.
  if (opened.trouble == HistoryTrouble::kNewer || opened.trouble == HistoryTrouble::kReadOnly) {
    ASSERT_EQ(folder.bytes(), damaged) << where;
    return;
  }
  ASSERT_EQ(opened.trouble, HistoryTrouble::kNone) << where << opened.text;
  const std::vector<HistoryRow> rows = opened.db->read().rows;
  ASSERT_FALSE(rows.empty()) << where;
  ASSERT_EQ(rows.back().result.peak.mu_max, 0.0987) << where;
  for (std::size_t i = 0; i + 1 < rows.size(); ++i) {
    HistoryRow each = rows[i];
    const auto found = std::find_if(written.begin(), written.end(), [&](const HistoryRow& one) {
      each.id = one.id;  // numbered anew
      return same(each, one);
    });
    ASSERT_NE(found, written.end()) << where << ", row " << i;
  }
}

TEST(HistoryKeeper, SurvivesTruncation) {
  const Folder folder;
  const std::vector<HistoryRow> written = write_rows(folder.file(), 20);
  const std::string whole = folder.bytes();
  for (std::size_t size = 0; size < whole.size(); size += size < 120 ? 7 : 331) {
    expect_survives(folder, whole.substr(0, size), written, std::to_string(size) + " bytes");
    if (HasFatalFailure()) return;
  }
}

TEST(HistoryKeeper, SurvivesFlippedBits) {
  const Folder folder;
  const std::vector<HistoryRow> written = write_rows(folder.file(), 20);
  const std::string whole = folder.bytes();
  std::mt19937_64 random(1);
  std::vector<std::size_t> bits;
  for (std::size_t bit = 0; bit < 8 * 100; ++bit) bits.push_back(bit);  // the header
  for (int i = 0; i < 700; ++i) bits.push_back(random() % (8 * whole.size()));
  for (const std::size_t bit : bits) {
    std::string damaged = whole;
    damaged[bit / 8] = static_cast<char>(damaged[bit / 8] ^ (1 << (bit % 8)));
    expect_survives(folder, damaged, written, "bit " + std::to_string(bit));
    if (HasFatalFailure()) return;
  }
}

TEST(HistoryKeeper, WhatIsReadableOfADamagedFileIsKept) {
  const Folder folder;
  const std::vector<HistoryRow> written = write_rows(folder.file(), 20);
  std::string damaged = folder.bytes();
  const std::size_t at = damaged.find("0123456789abcdef");  // in one of the rows
  ASSERT_NE(at, std::string::npos);
  damaged[at] = 'x';
  folder.fill({{kHistoryFile, damaged}});
  Keeper keeper(folder.path());
  EXPECT_EQ(keeper.keeper.open()
                .of(estimator::Direction::kDrive, estimator::EndStop::kOverdrive)
                .experiments,
            19);
  ASSERT_EQ(keeper.warnings.size(), 1U);
  EXPECT_NE(keeper.warnings[0].find("1 rows are damaged); it is kept as "), std::string::npos)
      << keeper.warnings[0];
  EXPECT_NE(keeper.warnings[0].find("19 of its experiments are in a new one"), std::string::npos);
  EXPECT_EQ(folder.bytes("history.db.bad"), damaged);
  // And again: the next one gets another name.
  folder.fill({{kHistoryFile, "rubbish"}, {"history.db.bad", damaged}});
  Keeper other(folder.path());
  EXPECT_FALSE(other.keeper.open().unwritten);
  EXPECT_EQ(folder.bytes("history.db.bad-2"), "rubbish");
  EXPECT_EQ(folder.bytes("history.db.bad"), damaged);
}

// --- a file that is not ours to write -----------------------------------------------------------

void execute(const std::string& path, const std::string& sql) {
  sqlite3* db = nullptr;
  ASSERT_EQ(sqlite3_open(path.c_str(), &db), SQLITE_OK);
  ASSERT_EQ(sqlite3_exec(db, sql.c_str(), nullptr, nullptr, nullptr), SQLITE_OK)
      << sqlite3_errmsg(db);
  sqlite3_close(db);
}

TEST(HistoryKeeper, LeavesANewerVersionAsItIs) {
  const Folder folder;
  write_rows(folder.file(), 5);
  execute(folder.file(), "ALTER TABLE experiment ADD COLUMN later TEXT; PRAGMA user_version = 2;");
  const std::string before = folder.bytes();
  Keeper keeper(folder.path());
  EXPECT_TRUE(keeper.keeper.open().unwritten);
  for (int i = 0; i < 3; ++i) {
    const estimator::LearnedFriction learned = keeper.keeper.take(result(0.1));
    EXPECT_TRUE(learned.unwritten);
    EXPECT_EQ(learned.groups[0].experiments, i + 1);
    keeper.now_s += 100.0;
    EXPECT_FALSE(keeper.keeper.retry());
  }
  ASSERT_EQ(keeper.warnings.size(), 1U);
  EXPECT_NE(keeper.warnings[0].find("its version is 2, this program knows 1"), std::string::npos);
  EXPECT_EQ(folder.bytes(), before);
  EXPECT_EQ(std::distance(fs::directory_iterator(folder.path()), {}), 1);
}

TEST(HistoryKeeper, SomeoneElsesDatabaseIsSetAside) {
  const Folder folder;
  execute(folder.file(), "CREATE TABLE notes (text TEXT); INSERT INTO notes VALUES ('mine');");
  const std::string before = folder.bytes();
  Keeper keeper(folder.path());
  EXPECT_FALSE(keeper.keeper.open().unwritten);
  EXPECT_EQ(folder.bytes("history.db.bad"), before);
}

// As another user than root, who may write everything.
class Unprivileged {
 public:
  Unprivileged() : root_(geteuid() == 0) {
    if (root_) {
      EXPECT_EQ(seteuid(65534), 0);
    }
  }
  ~Unprivileged() {
    if (root_) {
      EXPECT_EQ(seteuid(0), 0);
    }
  }

 private:
  bool root_;
};

TEST(HistoryKeeper, ReadOnlyIsReadAndSaidOnce) {
  const Folder folder;
  const std::vector<HistoryRow> written = write_rows(folder.file(), 6);
  const std::string before = folder.bytes();
  ASSERT_EQ(chmod(folder.file().c_str(), 0444), 0);
  ASSERT_EQ(chmod(folder.path().c_str(), 0555), 0);
  {
    const Unprivileged user;
    Keeper keeper(folder.path());
    const estimator::LearnedFriction learned = keeper.keeper.open();
    EXPECT_TRUE(learned.unwritten);
    EXPECT_EQ(learned.groups[0].experiments, 6);
    EXPECT_EQ(keeper.keeper.take(result(0.1)).groups[0].experiments, 7);
    for (int i = 0; i < 5; ++i) {
      keeper.now_s += 61.0;
      EXPECT_FALSE(keeper.keeper.retry());
    }
    EXPECT_EQ(keeper.warnings.size(), 1U);
    EXPECT_EQ(folder.bytes(), before);
    // Somebody gives the right back: what waited is written.
    {
      // As the owner.
      if (getuid() == 0) {
        ASSERT_EQ(seteuid(0), 0);
      }
      ASSERT_EQ(chmod(folder.path().c_str(), 0777), 0);
      ASSERT_EQ(chmod(folder.file().c_str(), 0666), 0);
      if (getuid() == 0) {
        ASSERT_EQ(seteuid(65534), 0);
      }
    }
    EXPECT_FALSE(keeper.keeper.retry());  // not yet a minute later
    keeper.now_s += 61.0;
    const auto now = keeper.keeper.retry();
    ASSERT_TRUE(now);
    EXPECT_FALSE(now->unwritten);
  }
  EXPECT_EQ(HistoryDb::open_to_read(folder.file()).db->read().rows.size(), 7U);
}

// SQLite finds a format of a later program in its header, which it may read but not write: the same
// for every user.
void forbid_writing(const std::string& path) {
  std::fstream file(path, std::ios::in | std::ios::out | std::ios::binary);
  file.seekp(18);
  file.put('\3');
}

TEST(HistoryKeeper, ReadOnlyWithoutAResultOfThisConfigurationIsReadOnce) {
  const Folder folder;
  write_rows(folder.file(), 6);
  forbid_writing(folder.file());
  Keeper keeper(folder.path(), "another");
  EXPECT_TRUE(keeper.keeper.open().unwritten);
  for (int i = 0; i < 5; ++i) {
    keeper.now_s += 61.0;
    EXPECT_FALSE(keeper.keeper.retry());
  }
  EXPECT_EQ(keeper.warnings.size(), 1U);
  ASSERT_EQ(keeper.infos.size(), 1U);
  EXPECT_NE(keeper.infos[0].find("6 experiments, 0 of them"), std::string::npos) << keeper.infos[0];
}

TEST(HistoryKeeper, ReadOnlyCountsUnderTheNextConfigurationToo) {
  const Folder folder;
  const std::string state = folder.file("state");
  fs::create_directory(state);
  const std::string path = state + "/" + kHistoryFile;
  write_rows(path, 6);
  forbid_writing(path);
  Keeper keeper(state, "another");
  keeper.keeper.open();
  keeper.keeper.take(result(0.1));
  EXPECT_EQ(keeper.keeper.change_fingerprint("0123456789abcdef").groups[0].experiments, 6);
  EXPECT_EQ(keeper.keeper.change_fingerprint("another").groups[0].experiments, 1);
  // It cannot even be read as the configuration changes, but later.
  fs::rename(state, folder.file("away"));
  EXPECT_EQ(keeper.keeper.change_fingerprint("0123456789abcdef").groups[0].experiments, 0);
  fs::rename(folder.file("away"), state);
  keeper.now_s += 61.0;
  const auto now = keeper.keeper.retry();
  ASSERT_TRUE(now);
  EXPECT_EQ(now->groups[0].experiments, 6);
  EXPECT_TRUE(now->unwritten);
  keeper.now_s += 61.0;
  EXPECT_FALSE(keeper.keeper.retry());
}

// A disk that gives an error, memory that is short: the file stays where it is, and counts as soon
// as it can be read.
TEST(HistoryKeeper, AFileThatCannotBeReadNowIsNotDamaged) {
  for (const int status : {SQLITE_IOERR_READ, SQLITE_NOMEM}) {
    bool failed = true;
    int fail_at = 0;
    while (failed) {
      const std::string where = std::to_string(status) + " at read " + std::to_string(++fail_at);
      const Folder folder;
      write_rows(folder.file(), 40);
      const std::string before = folder.bytes();
      Keeper keeper(folder.path());
      {
        CrashVfs vfs;
        vfs.fail_with = status;
        vfs.fail_read_at = fail_at;
        keeper.keeper.open();
        failed = vfs.fail_read_at == 0;
      }
      ASSERT_FALSE(fs::exists(folder.file("history.db.bad"))) << where;
      ASSERT_EQ(folder.bytes(), before) << where;
      ASSERT_LE(keeper.warnings.size(), 1U) << where;
      keeper.now_s += 61.0;
      keeper.keeper.retry();
      const estimator::LearnedFriction learned = keeper.keeper.take(result(0.1));
      ASSERT_EQ(learned.groups[0].experiments, 41) << where;
      ASSERT_FALSE(learned.unwritten) << where;
    }
    EXPECT_GT(fail_at, 5) << status;
  }
}

TEST(HistoryKeeper, RowsThatCannotBeReadNowComeLater) {
  const Folder folder;
  Keeper keeper(folder.path(), "another");
  {
    CrashVfs vfs;
    vfs.fail_with = SQLITE_IOERR_READ;
    EXPECT_FALSE(keeper.keeper.open().unwritten);
    write_rows(folder.file(), 40);  // by another program: what is in memory does not hold any more
    vfs.fail_read_at = 1;
    const estimator::LearnedFriction learned = keeper.keeper.change_fingerprint("0123456789abcdef");
    EXPECT_EQ(learned.groups[0].experiments, 0);
    EXPECT_TRUE(learned.unwritten);
  }
  keeper.now_s += 61.0;
  const auto now = keeper.keeper.retry();
  ASSERT_TRUE(now);
  EXPECT_EQ(now->groups[0].experiments, 40);
  EXPECT_FALSE(now->unwritten);
  EXPECT_EQ(keeper.warnings.size(), 1U);
  EXPECT_FALSE(fs::exists(folder.file("history.db.bad")));
}

// A full disk, as the limit of a file's size: writes beyond it fail.
TEST(HistoryKeeper, FullDiskLosesNothing) {
  const Folder folder;
  write_rows(folder.file(), 6);
  const std::string before = folder.bytes();
  struct Limit {
    Limit() {
      signal(SIGXFSZ, SIG_IGN);
      getrlimit(RLIMIT_FSIZE, &old);
      rlimit tight = old;
      tight.rlim_cur = 512;
      EXPECT_EQ(setrlimit(RLIMIT_FSIZE, &tight), 0);
    }
    ~Limit() { setrlimit(RLIMIT_FSIZE, &old); }
    rlimit old{};
  };
  Keeper keeper(folder.path());
  EXPECT_FALSE(keeper.keeper.open().unwritten);
  {
    const Limit limit;
    for (int i = 0; i < 4; ++i) {
      const estimator::LearnedFriction learned = keeper.keeper.take(result(0.1 + 1e-4 * i));
      EXPECT_TRUE(learned.unwritten);
      EXPECT_EQ(learned.groups[0].experiments, 7 + i);
      keeper.now_s += 61.0;
      keeper.keeper.retry();
    }
  }
  EXPECT_EQ(keeper.warnings.size(), 1U);
  EXPECT_EQ(folder.bytes(), before);
  keeper.now_s += 61.0;
  const auto now = keeper.keeper.retry();
  ASSERT_TRUE(now);
  EXPECT_FALSE(now->unwritten);
  EXPECT_EQ(HistoryDb::open_to_read(folder.file()).db->read().rows.size(), 10U);
}

TEST(HistoryKeeper, AFolderThatCannotBe) {
  const Folder folder;
  std::ofstream(folder.file("file")) << "x";
  Keeper keeper(folder.file("file") + "/below");
  EXPECT_TRUE(keeper.keeper.open().unwritten);
  EXPECT_TRUE(keeper.keeper.take(result(0.1)).groups[0].known);
  EXPECT_EQ(keeper.warnings.size(), 1U);
}

// A state folder that is mounted after the start: what it has counts from then on, as what was
// found before all that has been measured meanwhile, and that is judged by it.
TEST(HistoryKeeper, AFolderThatComesLateBringsItsResults) {
  const Folder folder;
  const std::string state = folder.file("state");
  std::ofstream(state) << "x";
  Keeper keeper(state);
  EXPECT_TRUE(keeper.keeper.open().unwritten);
  const estimator::LearnedFriction alone = keeper.keeper.take(result(0.07));
  EXPECT_EQ(alone.groups[0].experiments, 1);
  EXPECT_FALSE(alone.doubtful);
  fs::remove(state);
  fs::create_directory(state);
  const std::string path = state + "/" + kHistoryFile;
  write_rows(path, 12);
  keeper.now_s += 61.0;
  const auto now = keeper.keeper.retry();
  ASSERT_TRUE(now);
  EXPECT_FALSE(now->unwritten);
  EXPECT_EQ(now->groups[0].experiments, 13);
  EXPECT_EQ(now->memory.results, 13U);
  EXPECT_EQ(now->memory.values[0].mu_max, 0.07);
  EXPECT_TRUE(now->doubtful);
  const HistoryContent content = HistoryDb::open_to_read(path).db->read();
  ASSERT_EQ(content.rows.size(), 13U);
  EXPECT_EQ(content.rows[12].notes, note_bit(estimator::Note::kOutlier));
  keeper.now_s += 61.0;
  EXPECT_FALSE(keeper.keeper.retry());
}

// --- what it says -------------------------------------------------------------------------------

TEST(HistoryKeeper, OtherConfigurationsDoNotCount) {
  const Folder folder;
  {
    Keeper keeper(folder.path(), "one");
    keeper.keeper.open();
    for (int i = 0; i < 4; ++i) keeper.keeper.take(result(0.08));
  }
  {
    Keeper keeper(folder.path(), "two");
    EXPECT_FALSE(keeper.keeper.open().groups[0].known);
    EXPECT_NEAR(keeper.keeper.take(result(0.11)).groups[0].mu_max, 0.11, 1e-4);
  }
  Keeper keeper(folder.path(), "one");
  EXPECT_NEAR(keeper.keeper.open().groups[0].mu_max, 0.08, 1e-4);
  EXPECT_EQ(HistoryDb::open_to_read(folder.file()).db->read().rows.size(), 5U);
}

TEST(HistoryKeeper, DoubtIsNotedInTheRowAndAtTheNextStart) {
  const Folder folder;
  {
    Keeper keeper(folder.path());
    keeper.keeper.open();
    for (int i = 0; i < 12; ++i) {
      EXPECT_FALSE(keeper.keeper.take(result(i % 2 == 0 ? 0.1003 : 0.0997)).doubtful) << i;
    }
    EXPECT_TRUE(keeper.keeper.take(result(0.07)).doubtful);
    // An abort says nothing of friction and takes no doubt back.
    ExperimentResult aborted = result(0.0);
    aborted.outcome = Outcome::kAborted;
    aborted.peak = {};
    EXPECT_TRUE(keeper.keeper.take(aborted).doubtful);
  }
  const HistoryContent content = HistoryDb::open_to_read(folder.file()).db->read();
  ASSERT_EQ(content.rows.size(), 14U);
  EXPECT_EQ(content.rows[11].notes, 0U);
  EXPECT_EQ(content.rows[12].notes, note_bit(estimator::Note::kOutlier));
  EXPECT_NEAR(Keeper(folder.path()).keeper.open().groups[0].mu_max, 0.1, 3e-4);
}

// Rows that are whole but cannot be: judged, not believed.
TEST(HistoryKeeper, InsaneValuesAreNoKnowledge) {
  const Folder folder;
  {
    HistoryDb::Opened opened = HistoryDb::open(folder.file());
    int number = 0;
    for (const double mu : {kNan, -0.1, 1e300, std::numeric_limits<double>::infinity(), 0.0}) {
      HistoryRow each = row(number++);
      each.result.peak.mu_max = mu;
      ASSERT_TRUE(opened.db->append(each));
      each = row(number++);
      each.result.peak.mu_max_std = mu == 1e300 ? 0.0 : mu;
      ASSERT_TRUE(opened.db->append(each));
    }
  }
  Keeper keeper(folder.path());
  const estimator::LearnedFriction learned = keeper.keeper.open();
  EXPECT_FALSE(learned.groups[0].known);
  EXPECT_FALSE(learned.unwritten);
}

TEST(HistoryKeeper, AgeInflatesWhatIsKnown) {
  const Folder folder;
  write_rows(folder.file(), 20);
  const auto spread = [&](double years) {
    Keeper keeper(folder.path());
    keeper.now_s += years * 365.25 * 86400.0;
    return keeper.keeper.open().groups[0].mu_max_std;
  };
  EXPECT_LT(spread(0.0), 0.001);
  EXPECT_NEAR(spread(10.0), 0.016, 0.002);
  EXPECT_NEAR(spread(-1.0), 0.025, 0.002);  // rows from the future
}

}  // namespace
}  // namespace beltgrip::daemon
