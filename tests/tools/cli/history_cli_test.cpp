// beltgrip history as users call it: a table, JSON lines, CSV, on a file that it leaves as it is,
// and one line for every file that is none.
#include <gtest/gtest.h>

#include <filesystem>
#include <nlohmann/json.hpp>
#include <sstream>

#include "daemon/io/history_db.h"
#include "tests/support/program.h"

namespace beltgrip::test {
namespace {

using daemon::HistoryDb;
using daemon::HistoryRow;

HistoryRow row(int number, double mu) {
  HistoryRow each;
  each.time_s = 1.7e9 + 3600.0 * number;
  each.fingerprint = "00000000deadbeef";
  each.result.end = daemon::MonoTime{12'500 * daemon::kMillisecond};
  each.result.outcome = daemon::Outcome::kCompleted;
  each.result.stop_reason = estimator::StopReason::kSlope;
  each.result.peak = {estimator::PeakKind::kValue, mu, 3e-4, mu - 6e-4, mu + 6e-4, 2.5, 900};
  each.result.sigma_stop_percent = 2.9;
  each.result.samples = 2500;
  each.result.omega_p_rad_s = 150.0;
  each.result.omega_s_rad_s = 330.0;
  each.result.torque_Nm = 40.0;
  each.result.clamp_force_N = 2400.0;
  return each;
}

class History : public testing::Test {
 protected:
  // Ten experiments of one belt that has lost 4 % on the way, one without a value, one of another
  // configuration.
  void fill() {
    const auto opened = HistoryDb::open(place.path("history.db"));
    std::vector<HistoryRow> rows;
    rows.push_back(row(0, 0.12));
    rows.back().fingerprint = "other";
    for (int i = 1; i <= 10; ++i) {
      rows.push_back(row(i, (i <= 5 ? 0.105 : 0.1008) + 1e-4 * (i % 3)));
    }
    rows.push_back(row(11, 0.09));
    rows.back().result.outcome = daemon::Outcome::kInconclusive;
    rows.back().result.peak.kind = estimator::PeakKind::kLowerBound;
    rows.back().notes = 1;
    for (const HistoryRow& each : rows) ASSERT_TRUE(opened.db->append(each));
  }
  Workplace place;
};

TEST_F(History, Table) {
  fill();
  const RunResult result = beltgrip({"history", place.path("")});
  EXPECT_EQ(result.status, 0) << result.err;
  EXPECT_EQ(result.err, "");
  EXPECT_NE(result.out.find("2023-11-14T23:13:20Z  completed     slope"), std::string::npos)
      << result.out;
  EXPECT_NE(result.out.find(">0.0900"), std::string::npos);
  EXPECT_NE(result.out.find("outlier"), std::string::npos);
  EXPECT_NE(result.out.find("WEAR"), std::string::npos);
  // The sixth of the ten, whose id is 7: by the rows above, 0.105 to 0.1008.
  EXPECT_NE(
      result.out.find("\n  4.0 % less friction since experiment 7 (2023-11-15), 99.9 % sure\n"),
      std::string::npos)
      << result.out;
  EXPECT_NE(result.out.find("1 experiments under other configurations"), std::string::npos);
}

// Ten experiments after the fall, and four: the words name the first after it both times.
TEST_F(History, WearIsToldWhereItBegan) {
  for (const int after : {4, 10}) {
    Workplace belt;
    const auto opened = HistoryDb::open(belt.path("history.db"));
    for (int i = 1; i <= 10 + after; ++i) {
      ASSERT_TRUE(opened.db->append(row(i, (i <= 10 ? 0.105 : 0.0945) + 1e-4 * (i % 3))));
    }
    const RunResult result = beltgrip({"history", belt.path("")});
    EXPECT_NE(result.out.find("\n  10.0 % less friction since experiment 11 ("), std::string::npos)
        << result.out;
    EXPECT_NE(result.out.find("the last " + std::to_string(after) + " against 10 before: -10"),
              std::string::npos)
        << result.out;
  }
}

// The same log, recorded so many seconds later.
std::string later(const std::string& log, long seconds) {
  std::istringstream in(log);
  std::string out;
  for (std::string line; std::getline(in, line);) {
    const std::size_t point = line.find('.');
    out += '(' + std::to_string(std::stol(line.substr(1, point - 1)) + seconds) +
           line.substr(point) + '\n';
  }
  return out;
}

// Five drives with the new belt of the paper and five with the worn one, given in any order: the
// dates of their stamps say how they follow each other. The worn belt has lost 5 % (0.105, 0.100).
TEST_F(History, FromLogs) {
  std::vector<std::string> logs;
  for (int i = 0; i < 10; ++i) {
    const std::string folder = place.path("drive" + std::to_string(i));
    const RunResult made = beltgrip({"simulate", "--belt", i < 5 ? "new" : "worn", "--start", "80",
                                     "--seed", std::to_string(i + 1), "--out-dir", folder});
    ASSERT_EQ(made.status, 0) << made.err;
    const std::string name = "drive" + std::to_string(i) + "/trace.log";
    place.write(name, later(place.read(name), 1'700'000'000 + 86'400L * i));
    logs.insert(logs.begin() + (i % 2 == 0 ? 0 : i / 2), place.path(name));
  }
  const auto history = [&](std::vector<std::string> words, const std::vector<std::string>& from) {
    words.insert(words.begin(), "history");
    words.insert(words.end(), {"--config", place.path("drive0/beltgrip.toml"), "--from"});
    words.insert(words.end(), from.begin(), from.end());
    return beltgrip(words);
  };
  const RunResult shown = history({}, logs);
  EXPECT_EQ(shown.status, 0) << shown.err;
  EXPECT_NE(shown.out.find("WEAR"), std::string::npos) << shown.out;
  EXPECT_NE(shown.out.find("the last 5 against 5 before: -"), std::string::npos) << shown.out;
  // Kept, also if it is said twice or in two parts, and one log cannot be used.
  const std::string kept = place.path("fleet/car17");
  std::vector<std::string> first(logs.begin(), logs.begin() + 4);
  first.push_back(place.path("none.log"));
  const RunResult part = history({kept}, first);
  EXPECT_EQ(part.status, 66) << part.err;
  EXPECT_EQ(lines(part.err), 1) << part.err;
  place.write("empty.log", "nothing\n");
  EXPECT_EQ(history({}, {place.path("empty.log")}).status, 65);
  EXPECT_EQ(history({kept}, {logs.begin() + 4, logs.end()}).status, 0);
  EXPECT_EQ(history({kept}, logs).status, 0);
  const auto opened = HistoryDb::open_to_read(place.path("fleet/car17/history.db"));
  ASSERT_NE(opened.db, nullptr) << opened.text;
  EXPECT_EQ(opened.db->read().rows.size(), 10U);
  // And if a log is there twice, without dates as well.
  place.write("undated.log", later(place.read("drive0/trace.log"), -1'700'000'000));
  const std::string once = place.path("undated.log");
  EXPECT_EQ(history({place.path("one")}, {once, once}).status, 0);
  const auto one = HistoryDb::open_to_read(place.path("one/history.db"));
  ASSERT_NE(one.db, nullptr) << one.text;
  EXPECT_EQ(one.db->read().rows.size(), 1U);
}

// What the belt carried, beside its experiments or without any: kept, and not counted twice.
TEST_F(History, ShowsWhatWasCarriedWithoutSlip) {
  const std::string drive = place.path("drive");
  ASSERT_EQ(beltgrip({"simulate", "--scenario", "cruise-drive-torque", "--duration", "8",
                      "--out-dir", drive})
                .status,
            0);
  const auto carried = [&](const std::vector<std::string>& words) {
    const RunResult result = beltgrip(words);
    EXPECT_EQ(result.status, 0) << result.err;
    std::istringstream in(result.out);
    nlohmann::json found;
    for (std::string line; std::getline(in, line);) {
      const auto event = nlohmann::json::parse(line);
      if (event.at("type") == "carried") found = event;
    }
    return found;
  };
  const std::string config = drive + "/beltgrip.toml";
  const std::vector<std::string> fill{
      "history", place.path("car"), "--from", drive + "/trace.log", "--config",
      config,    "--json",          "-"};
  const nlohmann::json first = carried(fill);
  ASSERT_FALSE(first.is_null());
  EXPECT_EQ(first.at("direction"), "drive");
  EXPECT_EQ(first.at("ratio"), "overdrive");
  EXPECT_GT(first.at("mu_max_lower_bound"), 0.03);
  EXPECT_LT(first.at("mu_max_lower_bound"), 0.105) << "the simulated belt's mu_max";
  EXPECT_GE(first.at("held_s"), 4.0);
  EXPECT_EQ(carried(fill), first) << "the same log again";
  const std::string file = place.read("car/carried.json");
  EXPECT_EQ(carried({"history", place.path("car"), "--json", "-"}), first) << "kept";
  const RunResult table = beltgrip({"history", place.path("car")});
  EXPECT_NE(table.out.find("no experiment yet\ndrive, overdrive, "), std::string::npos)
      << table.out;
  EXPECT_NE(table.out.find("a lower bound, no value\n"), std::string::npos) << table.out;
  // Its file is no place for an answer.
  EXPECT_EQ(
      beltgrip({"history", place.path("car"), "--json", place.path("car/carried.json")}).status,
      64);
  EXPECT_EQ(place.read("car/carried.json"), file);
  place.write("car/carried.json", "{");
  const RunResult damaged = beltgrip({"history", place.path("car")});
  EXPECT_EQ(damaged.status, 0);
  EXPECT_EQ(lines(damaged.err), 1) << damaged.err;
}

TEST_F(History, FromLogsNeedsAConfigurationAndAFolder) {
  place.write("a.txt", "mine");
  for (const std::vector<std::string>& words :
       {std::vector<std::string>{"history", "--from", "a.log"},
        {"history", place.path("a.txt"), "--from", "a.log", "--config", "c.toml"}}) {
    const RunResult result = beltgrip(words);
    EXPECT_NE(result.status, 0);
    EXPECT_EQ(lines(result.err), 1) << result.err;
  }
  EXPECT_EQ(place.read("a.txt"), "mine");
}

TEST_F(History, JsonLines) {
  fill();
  const RunResult result = beltgrip({"history", place.path("history.db"), "--json", "-"});
  EXPECT_EQ(result.status, 0) << result.err;
  std::istringstream in(result.out);
  std::vector<nlohmann::json> all;
  for (std::string line; std::getline(in, line);) all.push_back(nlohmann::json::parse(line));
  ASSERT_EQ(all.size(), 14U);
  EXPECT_EQ(all[1]["type"], "experiment");
  EXPECT_EQ(all[1]["outcome"], "completed");
  EXPECT_EQ(all[1]["mu_max"], 0.1051);
  EXPECT_EQ(all[1]["torque_Nm"], 40.0);
  EXPECT_TRUE(all[1]["oil_degC"].is_null());
  EXPECT_TRUE(all[1]["mu_max_lower_bound"].is_null());
  EXPECT_TRUE(all[11]["mu_max"].is_null());
  EXPECT_EQ(all[11]["mu_max_lower_bound"], 0.09);
  EXPECT_EQ(all[11]["notes"], "outlier");
  const nlohmann::json& fused = all[12];
  EXPECT_EQ(fused["type"], "fused");
  EXPECT_EQ(fused["experiments"], 10);
  EXPECT_NEAR(fused["mu_max"].get<double>(), 0.1009, 3e-4);
  EXPECT_EQ(fused["wear"]["found"], true);
  EXPECT_NEAR(fused["wear"]["change_percent"].get<double>(), -4.0, 0.2);
  EXPECT_EQ(fused["wear"]["since_id"], 7);
  EXPECT_EQ(all[13]["experiments"], 12);
  EXPECT_EQ(all[13]["comparable"], 11);
}

TEST_F(History, CsvAndTheFileStaysAsItIs) {
  fill();
  const std::string before = place.read("history.db");
  const RunResult result =
      beltgrip({"history", place.path("history.db"), "--csv", place.path("out.csv")});
  EXPECT_EQ(result.status, 0) << result.err;
  EXPECT_NE(result.out, "");
  const std::string csv = place.read("out.csv");
  EXPECT_EQ(lines(csv), 13);
  EXPECT_TRUE(csv.starts_with("id,time_s,time_utc,outcome,stop_reason,mu_max,")) << csv;
  std::istringstream in(csv);
  for (std::string line; std::getline(in, line);) {
    EXPECT_EQ(std::count(line.begin(), line.end(), ','), 23) << line;
  }
  EXPECT_EQ(place.read("history.db"), before);
  EXPECT_FALSE(std::filesystem::exists(place.path("history.db-wal")));
}

TEST_F(History, OneFolderForEachInterface) {
  fill();
  std::filesystem::create_directories(place.path("can0"));
  std::filesystem::rename(place.path("history.db"), place.path("can0/history.db"));
  EXPECT_EQ(lines(beltgrip({"history", place.path(""), "--csv", "-"}).out), 13);
  std::filesystem::create_directories(place.path("can1"));
  std::filesystem::copy(place.path("can0/history.db"), place.path("can1/history.db"));
  const RunResult several = beltgrip({"history", place.path("")});
  EXPECT_EQ(several.status, 64);
  EXPECT_NE(several.err.find("can0/history.db, "), std::string::npos) << several.err;
}

TEST_F(History, WhatIsNone) {
  const auto fails = [&](const std::vector<std::string>& arguments, int status,
                         const std::string& text) {
    const RunResult result = beltgrip(arguments);
    EXPECT_EQ(result.status, status) << result.err;
    EXPECT_EQ(lines(result.err), 1) << result.err;
    EXPECT_EQ(result.out, "");
    EXPECT_NE(result.err.find(text), std::string::npos) << result.err;
  };
  fails({"history", place.path("")}, 66, "history.db: found no readable history");
  place.write("history.db", "");
  fails({"history", place.path("")}, 65, "it is empty");
  place.write("history.db", std::string(5000, 'x'));
  fails({"history", place.path("")}, 65, "file is not a database");
  std::filesystem::remove(place.path("history.db"));
  fill();
  fails({"history", place.path(""), "--json", "-", "--csv", "-"}, 64, "only one of");
  const std::string whole = place.read("history.db");
  place.write("history.db", whole.substr(0, 5000));
  fails({"history", place.path("")}, 65, "found no history");
  place.write("history.db", whole);
  std::string damaged = whole;
  const std::size_t at = damaged.find("deadbeef");
  damaged[at] = 'x';
  place.write("history.db", damaged);
  const RunResult result = beltgrip({"history", place.path(""), "--csv", "-"});
  EXPECT_EQ(result.status, 0);
  EXPECT_EQ(lines(result.out), 12);
  EXPECT_NE(result.err.find("1 rows damaged or missing"), std::string::npos) << result.err;
}

}  // namespace
}  // namespace beltgrip::test
