// A sample of the blind test, the same trials every time; the long version is the program blind.
// With so few trials a bound says little: the figures that count are those of tools/DIAGNOSE.md.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdio>

#include "tests/statistics/blind/blind_table.h"
#include "tests/statistics/blind/blind_trial.h"

namespace beltgrip::blind {
namespace {

TEST(Blind, NamesWhatIsThereAndNothingElse) {
  constexpr std::uint64_t kFirst = 78'000'003;
  constexpr int kTrials = 8;
  std::vector<nlohmann::json> ledger;
  int healthy = 0, alarms = 0, clear = 0, named = 0;
  // Right answers: a name that is right, and silence where nothing is wrong.
  int right = 0, by_correlation = 0, by_error = 0;
  for (int i = 0; i < kTrials; ++i) {
    const nlohmann::json entry = run_trial(kFirst + static_cast<std::uint64_t>(i));
    const nlohmann::json& findings = entry.at("findings");
    const nlohmann::json& rivals = entry.at("rivals");
    if (entry.at("kind") == "nothing") {
      ++healthy;
      const bool alarm = !findings.empty() || entry.contains("unknown");
      alarms += alarm;
      right += !alarm;
      by_correlation += rivals.at("correlation") == "";
      by_error += rivals.at("error") == "";
    }
    const nlohmann::json& truth = entry.at("truth");
    if (entry.at("kind") == "single" && truth[0].contains("oracle") &&
        truth[0].at("oracle").get<double>() >= 0.95) {
      const std::string effect = truth[0].at("effect");
      ++clear;
      const bool found = !findings.empty() && findings[0].at("effect") == effect;
      named += found;
      right += found;
      by_correlation += rivals.at("correlation") == effect;
      by_error += rivals.at("error") == effect;
    }
    ledger.push_back(entry);
  }
  std::fputs(table_text(ledger).c_str(), stdout);
  EXPECT_GE(healthy, 2);
  EXPECT_EQ(alarms, 0) << "of " << healthy;
  EXPECT_GE(clear, 3);
  EXPECT_GE(named, clear - 1) << "of " << clear;
  EXPECT_GT(right, by_correlation);
  EXPECT_GT(right, by_error);
}

// Pairs of which one was lost: a late speed whose acceleration was not late, a first step that led
// to the wrong one of two alike and an end stop that one experiment alone shows, a second cause of
// a thousandth of the first one's evidence, a pressure that is late beside its own steps.
TEST(Blind, NamesWhatIsThereOfAPair) {
  for (const std::uint64_t number :
       {4'102'000'329U, 4'102'000'380U, 4'102'000'416U, 4'102'000'030U}) {
    SCOPED_TRACE(number);
    const nlohmann::json entry = run_trial(number);
    ASSERT_EQ(entry.at("kind"), "pair");
    const nlohmann::json& findings = entry.at("findings");
    EXPECT_EQ(findings.size(), 2U) << findings;
    for (const nlohmann::json& planted : entry.at("truth")) {
      EXPECT_TRUE(std::any_of(findings.begin(), findings.end(), [&](const nlohmann::json& each) {
        return each.at("effect") == planted.at("effect");
      })) << planted;
    }
  }
}

// A pressure that is early by 0.15 s is one that acts late: the same equation under two names.
TEST(Blind, TwoNamesOfOneEquationAreOneClass) {
  const nlohmann::json entry = run_trial(8'101'000'059U);
  const nlohmann::json& first = entry.at("findings").at(0);
  EXPECT_EQ(first.at("effect"), "hydraulic_lag");
  EXPECT_EQ(first.at("aliases"), nlohmann::json::array({"channel_skew"}));
}

// What the oracle's ceiling, the table and the names rest on: the truth never reaches the tool.
TEST(Blind, TheSameNumberIsTheSameTrial) {
  const Envelope a = draw_envelope(7), b = draw_envelope(7);
  EXPECT_EQ(record(a.trial).csv, record(b.trial).csv);
  EXPECT_NE(record(a.trial).csv, record(draw_envelope(8).trial).csv);
}

}  // namespace
}  // namespace beltgrip::blind
