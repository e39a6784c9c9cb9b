// What headless Chromium makes of the pages: nothing on its console, every sample there, a spike of
// one sample in an hour in sight, zoom by the mouse. The truth is made here or by other commands,
// not by the page.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <sstream>
#include <string>

#include "daemon/core/experiment/arming.h"
#include "tests/support/browser.h"
#include "tests/support/program.h"
#include "tools/report/html_page.h"

namespace beltgrip::test {
namespace {

using nlohmann::json;

constexpr int kWidth = 1280, kHeight = 900, kPhoneWidth = 390;

class Page : public testing::Test {
 protected:
  void SetUp() override { browser_.resize(kWidth, kHeight); }
  void open(const std::string& name) { browser_.open(place_.path(name)); }
  // What waits to come into sight is drawn by this.
  void see_everything() { browser_.evaluate("[...waiting.keys()].forEach(drawWaiting)"); }
  double number(const std::string& expression) { return browser_.evaluate(expression); }
  void demand(const std::vector<std::string>& arguments) {
    const RunResult run = beltgrip(arguments);
    ASSERT_EQ(run.status, 0) << run.err;
  }
  void expect_no_complaint() {
    for (const std::string& each : browser_.complaints()) ADD_FAILURE() << each;
  }

  Workplace place_;
  Browser browser_{place_.path("profile")};
};

TEST_F(Page, WhatIsWrongWithAPageIsSeen) {
  place_.write("page.html", "<img src=\"http://127.0.0.1:9/x\"><script>nobody();</script>");
  open("page.html");
  browser_.evaluate("console.warn('x')");
  const std::vector<std::string>& complaints = browser_.complaints();
  for (const char* what : {"asks for http://127.0.0.1:9/x", "nobody is not defined", "warning"}) {
    EXPECT_TRUE(std::any_of(complaints.begin(), complaints.end(), [&](const std::string& each) {
      return each.find(what) != std::string::npos;
    })) << what;
  }
}

// An hour at 200 Hz, a gap of a minute in it; one sample stands out.
constexpr double kPeriod_s = 0.005, kGap_s = 60.0, kSpikeHeight = 9.0;
constexpr std::size_t kSamples = 720'000, kSpike = 123'457, kGap = 500'000;

double time_s(std::size_t i) {
  return static_cast<double>(i) * kPeriod_s + (i < kGap ? 0.0 : kGap_s);
}
double value(std::size_t i) {
  return i == kSpike ? kSpikeHeight : std::sin(1e-3 * static_cast<double>(i));
}

class Hour : public Page {
 protected:
  void SetUp() override {
    Page::SetUp();
    report::Courses courses;
    courses.period_s = kPeriod_s;
    report::Course wave{"wave", {}};
    for (std::size_t i = 0; i < kSamples; ++i) {
      courses.t_s.push_back(time_s(i));
      wave.value.push_back(value(i));
    }
    const report::Lane lane{"stood", report::LaneKind::kForbids, {{10.0, 20.0}}};
    courses.panels = {{"lanes", {}, {}, {}, {lane}},
                      {"wave, m", {wave}, {{"level", 0.5}}, report::Interval{0.4, 0.6}, {}}};
    report::HtmlPage page("an hour");
    page.courses(courses);
    place_.write("page.html", page.text());
    open("page.html");
    see_everything();
  }
  // Where a time is on the screen, in the panel of the wave.
  double x_of(double t_s) {
    return number("stacks[0].graphs[1].toDomXCoord(" + std::to_string(t_s) + ") + " + kPlace +
                  ".left");
  }
  double middle() { return number(kPlace + ".top + " + kPlace + ".height / 2"); }
  // Of the wave, as drawn: [time, value, level].
  json rows() { return browser_.evaluate("stacks[0].graphs[1].file_"); }

  const std::string kPlace = "stacks[0].graphs[1].graphDiv.parentElement.getBoundingClientRect()";
};

TEST_F(Hour, IsShownInFewRowsThatMissNothing) {
  EXPECT_EQ(number("stacks[0].times.length"), kSamples);
  EXPECT_EQ(number("stacks[0].graphs.length"), 2);
  const json all = rows();
  EXPECT_LT(all.size(), 2.2 * kWidth);
  EXPECT_GT(all.size(), 1.5 * kWidth);
  double least = 0.0, greatest = 0.0, before_s = -1.0;
  std::size_t gaps = 0;
  for (const json& row : all) {
    const double t_s = row[0];
    EXPECT_GT(t_s, before_s);
    before_s = t_s;
    if (row[1].is_null()) {
      ++gaps;
      EXPECT_GT(t_s, time_s(kGap - 1));
      EXPECT_LT(t_s, time_s(kGap));
      continue;
    }
    least = std::min(least, row[1].get<double>());
    greatest = std::max(greatest, row[1].get<double>());
  }
  EXPECT_EQ(gaps, 1U);
  EXPECT_NEAR(greatest, kSpikeHeight, 1e-3);
  EXPECT_NEAR(least, -1.0, 1e-3);
  expect_no_complaint();
}

TEST_F(Hour, TheMouseZoomsToEverySampleAndBack) {
  const double from_s = time_s(kSpike) - 20.0, to_s = time_s(kSpike) + 20.0;
  browser_.drag(x_of(from_s), middle(), x_of(to_s), middle());
  const double first_s = number("stacks[0].shown[0]"), last_s = number("stacks[0].shown[1]");
  const double pixel_s = (time_s(kSamples - 1) - time_s(0)) / (kWidth - 100);
  EXPECT_NEAR(first_s, from_s, 2.0 * pixel_s);
  EXPECT_NEAR(last_s, to_s, 2.0 * pixel_s);
  // And once more, to fewer samples than there are pixels.
  browser_.drag(x_of(time_s(kSpike) - 0.5), middle(), x_of(time_s(kSpike) + 0.5), middle());
  const double low_s = number("stacks[0].shown[0]"), high_s = number("stacks[0].shown[1]");
  EXPECT_LT(high_s - low_s, 1.3);
  std::size_t shown = 0, spikes = 0;
  for (const json& row : rows()) {
    const double t_s = row[0];
    if (t_s < low_s || t_s > high_s) continue;
    ++shown;
    const auto i = static_cast<std::size_t>(std::lround(t_s / kPeriod_s));
    EXPECT_NEAR(t_s, time_s(i), 1e-9);
    EXPECT_NEAR(row[1].get<double>(), value(i), 1e-3) << i;
    if (row[1].get<double>() > 2.0) ++spikes;
  }
  EXPECT_EQ(spikes, 1U);
  EXPECT_NEAR(static_cast<double>(shown), (high_s - low_s) / kPeriod_s, 1.0);
  // The other panel goes along.
  EXPECT_EQ(browser_.evaluate("stacks[0].graphs[0].xAxisRange()"), json({low_s, high_s}));
  browser_.double_click(x_of(0.5 * (low_s + high_s)), middle());
  EXPECT_EQ(browser_.evaluate("stacks[0].shown"), json({time_s(0), time_s(kSamples - 1)}));
  expect_no_complaint();
}

// For how many samples each inhibit stood while no experiment ran, by `--signals-out`: its column
// has a bit for each, behind that of the experiment.
std::array<double, daemon::kInhibitCount> samples_inhibited(const std::string& csv) {
  std::istringstream in(csv);
  std::string line, cell, before;
  std::getline(in, line);
  std::size_t column = 0;
  std::istringstream head(line);
  for (; std::getline(head, cell, ',') && !cell.starts_with("inhibits"); ++column) {
  }
  std::array<double, daemon::kInhibitCount> samples{};
  while (std::getline(in, line)) {
    std::istringstream row(line);
    for (std::size_t i = 0; i <= column; ++i) {
      before = cell;
      std::getline(row, cell, ',');
    }
    if (before == "1") continue;
    const auto bits = static_cast<std::uint32_t>(std::stoul(cell));
    for (std::size_t i = 0; i < samples.size(); ++i) samples[i] += bits >> i & 1U;
  }
  return samples;
}

TEST_F(Page, OfManyExperimentsThoseOutOfSightWait) {
  report::Courses courses;
  courses.period_s = kPeriod_s;
  courses.t_s = {0.0, kPeriod_s};
  courses.panels = {{"wave, m", {{"wave", {0.0, 1.0}}}, {}, {}, {}}};
  report::HtmlPage page("many");
  constexpr int kMany = 40;
  for (int i = 0; i < kMany; ++i) page.courses(courses);
  place_.write("page.html", page.text());
  open("page.html");
  EXPECT_GT(number("waiting.size"), 0);
  EXPECT_GE(number("stacks.length"), 24);
  EXPECT_EQ(number("stacks.length + waiting.size"), kMany);
  see_everything();
  EXPECT_EQ(number("stacks.length"), kMany);
  expect_no_complaint();
}

TEST_F(Page, OfADriveHasEverySampleOfTheReplay) {
  demand({"simulate", "--scenario", "demo", "--out-dir", place_.path("drive")});
  const std::string log = place_.path("drive/trace.log"),
                    config = place_.path("drive/beltgrip.toml");
  demand({"report", log, "--config", config, "--out", place_.path("page.html")});
  demand({"replay", log, "--config", config, "--trace", place_.path("trace.csv"), "--signals-out",
          place_.path("signals.csv"), "--json", place_.path("results.json")});
  open("page.html");
  EXPECT_EQ(number("waiting.size"), 0);   // so few are there at once, out of sight too
  EXPECT_EQ(number("stacks.length"), 3);  // the drive and two experiments
  EXPECT_EQ(number("charts.length"), 2);
  EXPECT_EQ(number("stacks[0].times.length"), lines(place_.read("signals.csv")) - 1);
  EXPECT_EQ(number("stacks[1].times.length + stacks[2].times.length"),
            lines(place_.read("trace.csv")) - 1);
  EXPECT_EQ(number("stacks[0].spec.marks.length"), 2);
  EXPECT_EQ(
      number("stacks[0].panels[0].lanes.filter(([name]) => name === 'experiment')[0][2].length"),
      4);
  const auto samples = samples_inhibited(place_.read("signals.csv"));
  for (std::size_t i = 0; i < samples.size(); ++i) {
    const std::string lane = "stacks[0].panels[0].lanes.filter(([name]) => name === '" +
                             std::string(daemon::kInhibits[i].name) + "')";
    ASSERT_EQ(number(lane + ".length"), samples[i] > 0.0 ? 1 : 0) << daemon::kInhibits[i].name;
    if (samples[i] == 0.0) continue;
    EXPECT_NEAR(number(lane + "[0][2].reduce((sum, t, k) => sum + (k % 2 ? t : -t), 0)"),
                samples[i] * kPeriod_s, kPeriod_s)  // the log ends between two samples
        << daemon::kInhibits[i].name;
  }
  // Of the clamping force that was asked for: what stands in the log's own frames.
  EXPECT_GT(number("stacks[0].panels[1].series[1].codes.filter((c) => c !== missing).length"),
            1000);
  browser_.resize(kPhoneWidth, kHeight);
  open("page.html");
  EXPECT_LE(number("document.body.scrollWidth"), kPhoneWidth);
  browser_.print(place_.path("page.pdf"));
  EXPECT_TRUE(place_.read("page.pdf").starts_with("%PDF"));
  EXPECT_EQ(number("waiting.size"), 0);  // all of it is printed
  expect_no_complaint();
}

TEST_F(Page, OfAHistoryHasEveryExperiment) {
  demand({"simulate", "--scenario", "demo", "--out-dir", place_.path("drive")});
  demand({"history", place_.path("belt"), "--from", place_.path("drive/trace.log"), "--config",
          place_.path("drive/beltgrip.toml"), "--csv", place_.path("belt.csv")});
  demand({"report", "--history", place_.path("belt"), "--out", place_.path("page.html")});
  open("page.html");
  see_everything();
  EXPECT_EQ(number("stacks.length"), 1);
  EXPECT_EQ(number("stacks[0].times.length"), lines(place_.read("belt.csv")) - 1);
  EXPECT_EQ(number("stacks[0].panels.length"), 1);  // overrun, overdrive
  EXPECT_EQ(browser_.evaluate("stacks[0].graphs[0].getLabels().slice(1)"),
            json({"value", "95 % from", "95 % to", "together"}));
  expect_no_complaint();
}

}  // namespace
}  // namespace beltgrip::test
