// The monitor's layout: every size, every state, and the curve by hand.
#include "tools/monitor/layout.h"

#include <gtest/gtest.h>

#include "tools/monitor/plot.h"

namespace beltgrip::monitor {
namespace {

using estimator::Phase;

View busy() {
  View view;
  view.source = "can0";
  view.wall_ns = 1'700'000'000'000'000'000;
  view.silence_s = 0.01;
  view.listening_s = view.heard_s = 60.0;
  view.traffic = {812.0, 106e3, 500e3, 0, 0};
  view.state = "ramping";
  view.phase = "macro_slip";
  view.in_experiment = view.stop = true;
  view.mu_star = 0.098;
  view.sigma_star_percent = 0.87;
  view.friction_slope = 0.033;
  view.force_asked_N = 2058.0;
  view.force_given_N = 2101.4;
  view.force_least_N = 2536.0;
  view.friction = {estimator::PeakKind::kValue, 0.1068, 0.0078};
  view.experiment_count = 1;
  view.inhibits_known = true;
  for (int i = 1; i <= 40; ++i) {
    view.curve.push_back(
        {0.1 * i, 0.1 * i / (1.0 + 0.1 * i), i < 30 ? Phase::kExcited : Phase::kMacroSlip});
  }
  for (int i = 0; i < 20; ++i) {
    view.experiments.push_back(
        {-i * 60'000'000'000, "completed", "slip_energy", view.friction, 3.4});
  }
  for (const char* role :
       {"primary_speed", "secondary_speed", "secondary_pressure", "engine_torque", "primary_torque",
        "secondary_torque", "primary_pressure", "secondary_pressure_command", "engine_speed",
        "oil_temperature", "vehicle_speed", "accelerator_pedal", "brake_pressed", "lockup_closed",
        "experiment_permitted", "experiment_active"}) {
    view.inputs.push_back({role, "rpm", 123456.789, false, 1234.5, 1000.0, "learning", false});
  }
  return view;
}

View troubled() {
  View view = busy();
  view.in_experiment = false;
  view.silence_s = 7.0;
  view.link = daemon::BusState::kAbsent;
  view.distrust = {12, 3, 4, "0x6A1: wrong CRC"};
  const std::string much(300, 'x');
  for (int i = 0; i < 18; ++i) view.inhibits.push_back({"reason", much, "1 Nm, needs 2 Nm", much});
  for (int i = 0; i < 20; ++i) view.faults.push_back({"InputStale", much, "", much});
  view.source = "\x1b[2J \xc3\xa9 " + much;
  return view;
}

std::string shown(const View& view, int columns, int rows) {
  return text_of(layout(view, {columns, rows}));
}

// Nothing is wider than the terminal, nothing steers it.
TEST(Layout, FitsAnySize) {
  for (const View& view : {View{}, busy(), troubled()}) {
    for (int columns = 1; columns <= 220; columns += 3) {
      for (int rows = 1; rows <= 70; ++rows) {
        const std::vector<Line> lines = layout(view, {columns, rows});
        ASSERT_LE(lines.size(), static_cast<std::size_t>(rows));
        for (const Line& line : lines) {
          std::size_t length = 0;
          for (const Piece& piece : line) {
            length += piece.text.size();
            for (const char c : piece.text) ASSERT_TRUE(c >= 0x20 && c < 0x7F) << piece.text;
          }
          ASSERT_LE(length, static_cast<std::size_t>(columns));
        }
      }
    }
  }
}

TEST(Layout, SaysEverythingAt80x24) {
  const std::string text = shown(busy(), 80, 24);
  EXPECT_EQ(std::count(text.begin(), text.end(), '\n'), 24);
  for (const char* part :
       {"beltgrip monitor  can0  live", "812 frames/s, 106 kbit/s (21 % of 500)", "ramping",
        "phase macro_slip", "STOP", "mu* 0.0980 at 0.87 % slip, slope 0.0330 1/%",
        "asked 2058 N, given 2101 N, least that holds the belt 2536 N",
        "0.1068, 95 % 0.0915 to 0.1221", "primary_speed", "learning", "completed", "slip_energy",
        "0 slip sigma*", "... and ", "q quit"}) {
    EXPECT_NE(text.find(part), std::string::npos) << part << "\n" << text;
  }
}

TEST(Layout, SaysWhatTheBeltHasCarried) {
  View view = busy();
  EXPECT_EQ(shown(view, 100, 30).find("carried"), std::string::npos);
  daemon::CarriedBound& bound = view.carried.front();
  bound.mu_star = 0.08;
  bound.mu_max_least = 0.0709;
  bound.held_s = 10.0;  // 2000 N, of which 1500 N were needed at mu* 0.08
  bound.force_N_s = 20e3;
  bound.used_N_s = 0.06 * 20e3;
  const std::string text = shown(view, 100, 30);
  EXPECT_NE(text.find("without slip, " + daemon::group_text(0) +
                      ": mu_max at least 0.0709, reserve 25 %"),
            std::string::npos)
      << text;
}

TEST(Layout, ShowsMoreWhereThereIsRoom) {
  const std::string text = shown(busy(), 200, 60);
  EXPECT_EQ(std::count(text.begin(), text.end(), '\n'), 60);
  EXPECT_NE(text.find("experiment_active"), std::string::npos) << text;
  EXPECT_EQ(text.find("... and "), std::string::npos) << text;
}

TEST(Layout, SaysWhyNothingBegins) {
  View view;
  view.source = "can0";
  view.inhibits_known = true;
  view.silence_s = 0.1;
  view.inhibits = {{"torque", "the torque on the belt lies outside its window",
                    "3.2 Nm, needs 10 to 100 Nm", ""}};
  EXPECT_NE(shown(view, 120, 24)
                .find("why      torque (3.2 Nm, needs 10 to 100 Nm): the torque on the belt lies "
                      "outside its window\n"),
            std::string::npos)
      << shown(view, 120, 24);
  // No inhibit of the inputs, and a fault that the daemon tells of.
  View faulty = view;
  faulty.inhibits.clear();
  EXPECT_NE(shown(faulty, 120, 24).find("nothing keeps an experiment from beginning"),
            std::string::npos);
  faulty.faults = {{"SampleLate", "a sample came late", "", ""}};
  EXPECT_NE(shown(faulty, 120, 24).find("by the inputs nothing; the faults may"), std::string::npos)
      << shown(faulty, 120, 24);
  // Rows that no other reason takes hold the rest of a long one.
  view.inhibits[0].figure = "3.2 Nm, needs 10 to 100 Nm in overrun, coasting";
  EXPECT_NE(shown(view, 80, 24)
                .find("in overrun, coasting): the torque on\n"
                      "         the belt lies outside its window\n"),
            std::string::npos)
      << shown(view, 80, 24);
}

TEST(Layout, SaysThatNobodySpeaks) {
  View view;
  view.listening_s = 2.9;
  EXPECT_EQ(shown(view, 80, 24).find("is beltgripd running?"), std::string::npos);
  view.listening_s = 3.0;
  EXPECT_NE(shown(view, 80, 24).find("no frames for 3 s: is beltgripd running?"),
            std::string::npos);
  view.link = daemon::BusState::kAbsent;
  EXPECT_NE(shown(view, 80, 24).find("interface is gone"), std::string::npos);
  EXPECT_EQ(shown(view, 80, 24).find("is beltgripd running?"), std::string::npos);
  const std::string bad = shown(troubled(), 120, 24);
  EXPECT_NE(bad.find("12 wrong CRC, 3 wrong counter, 4 of another version; last 0x6A1"),
            std::string::npos)
      << bad;
}

TEST(Layout, WhatWasSaidLongAgoIsNotShownAsNow) {
  View view = busy();
  view.faults.push_back({"InputStale", "it came and has stopped", "", ""});
  view.silence_s = 2.9;
  view.link = daemon::BusState::kDown;
  EXPECT_NE(shown(view, 80, 24).find("no frames for 3 s\n"), std::string::npos)
      << shown(view, 80, 24);
  EXPECT_NE(shown(view, 80, 24).find("mu* 0.0980"), std::string::npos);
  view.silence_s = 3.0;
  const std::string text = shown(view, 80, 24);
  EXPECT_NE(text.find("state    ramping 3 s ago"), std::string::npos) << text;
  EXPECT_NE(text.find("now      mu* -\n"), std::string::npos) << text;
  EXPECT_NE(text.find("clamp    asked -, given 2101 N"), std::string::npos) << text;
  EXPECT_NE(text.find("mu_max   0.1068"), std::string::npos) << "a result stays";
  for (const char* gone : {"STOP", "InputStale"}) {
    EXPECT_EQ(text.find(gone), std::string::npos) << gone << "\n" << text;
  }
}

TEST(Layout, ATextThatIsCutSaysSo) {
  View view = busy();
  view.in_experiment = false;
  view.inhibits = {{"inputs", std::string(300, 'x'), "", ""}};
  EXPECT_NE(shown(view, 80, 24).find("xxx...\n"), std::string::npos) << shown(view, 80, 24);
}

// 20 columns are 13 cells of slip up to 1.05 * 2 %, 9 rows are 8 of mu* up to 1.05 * 0.1.
TEST(Plot, PutsPointsWhereTheyBelong) {
  const std::vector<CurvePoint> points{
      {0.0, 0.0, Phase::kQuiet}, {2.0, 0.1, Phase::kMacroSlip}, {1.05, 0.0525, Phase::kPeak}};
  const std::vector<std::string> lines = plot(points, {}, 20, 9);
  ASSERT_EQ(lines.size(), 9U);
  EXPECT_EQ(lines[7], " 0.000|.            ");
  EXPECT_EQ(lines[0], " 0.105|           x ");
  EXPECT_EQ(lines[4], "   mu*|      ^      ");
  EXPECT_EQ(lines[8], "      0 slip sigma*");
}

TEST(Plot, DrawsTheBandOfTheValue) {
  const Friction friction{estimator::PeakKind::kValue, 0.08, 0.01};
  const std::vector<std::string> lines = plot({}, friction, 30, 22);
  const double most = 1.05 * (0.08 + 1.96 * 0.01);
  const auto row = [&](double mu) {
    return static_cast<std::size_t>(std::lround((1.0 - mu / most) * 20.0));
  };
  EXPECT_EQ(lines[row(0.08)].substr(7), std::string(23, '-'));
  EXPECT_EQ(lines[row(0.08 - 1.96 * 0.01)].substr(7), std::string(23, ':'));
  EXPECT_EQ(lines[row(0.08 + 1.96 * 0.01)].substr(7), std::string(23, ':'));
}

}  // namespace
}  // namespace beltgrip::monitor
