// A line a change, and none where nothing changes.
#include "tools/monitor/change_lines.h"

#include <gtest/gtest.h>

namespace beltgrip::monitor {
namespace {

View at(double t_s) {
  View view;
  view.source = "can0";
  view.wall_ns = 1'700'000'000'000'000'000 + static_cast<std::int64_t>(t_s * 1e9);
  view.silence_s = 0.0;
  view.state = "idle";
  return view;
}

TEST(ChangeLines, SayEachChangeOnceWithCandumpsStamp) {
  ChangeLines changes;
  EXPECT_EQ(changes.update(at(0.0)), "(1700000000.000000) can0 state idle\n");
  EXPECT_EQ(changes.update(at(0.1)), "");
  View view = at(0.25);
  view.state = "ramping";
  view.in_experiment = true;
  view.mu_star = 0.05;
  view.sigma_star_percent = 0.4;
  view.force_asked_N = 2500.0;
  EXPECT_EQ(changes.update(view),
            "(1700000000.250000) can0 state ramping, mu* 0.0500 at 0.40 % slip\n"
            "(1700000000.250000) can0 asks for 2500 N\n");
  view.force_asked_N = 2400.0;
  EXPECT_EQ(changes.update(view), "") << "that it goes down is no news";
  view.stop = true;
  EXPECT_EQ(changes.update(view), "(1700000000.250000) can0 STOP, mu* 0.0500 at 0.40 % slip\n");
  view.friction = {estimator::PeakKind::kValue, 0.1068, 0.001};
  view.outcome = "completed";
  view.reason = "slope";
  view.reason_means = "friction no longer rises with slip";
  EXPECT_EQ(changes.update(view),
            "(1700000000.250000) can0 outcome completed (slope: friction no longer rises with "
            "slip)\n(1700000000.250000) can0 mu_max 0.1068, 95 % 0.1048 to 0.1088\n");
}

TEST(ChangeLines, SayFaultsAndReasonsAsTheyComeAndGo) {
  ChangeLines changes;
  changes.update(at(0.0));
  View view = at(1.0);
  view.faults = {{"InputStale", "it came and has stopped", "", ""}};
  view.inhibits = {{"oil", "the oil is colder", "20 degC, limit 40 degC", "warm up"}};
  EXPECT_EQ(changes.update(view),
            "(1700000001.000000) can0 fault InputStale: it came and has stopped\n"
            "(1700000001.000000) can0 no experiment: oil (20 degC, limit 40 degC): the oil is "
            "colder; to do: warm up\n");
  view.inhibits[0].figure = "21 degC, limit 40 degC";
  EXPECT_EQ(changes.update(view), "") << "a figure alone is no news";
  EXPECT_EQ(changes.update(at(2.0)),
            "(1700000002.000000) can0 fault InputStale gone\n"
            "(1700000002.000000) can0 no longer: oil\n");
}

TEST(ChangeLines, SaySilenceAndWhatCannotBeBelieved) {
  ChangeLines changes;
  changes.update(at(0.0));
  View view = at(3.0);
  view.silence_s = 3.0;
  view.link = daemon::BusState::kAbsent;
  EXPECT_EQ(changes.update(view),
            "(1700000003.000000) can0 bus: interface is gone\n"
            "(1700000003.000000) can0 no frames for 3 s: is beltgripd running?\n");
  EXPECT_EQ(changes.update(at(4.0)),
            "(1700000004.000000) can0 bus: up\n(1700000004.000000) can0 frames of BeltGrip "
            "again\n");
  view = at(5.0);
  view.distrust = {1, 0, 0, "0x6A1: wrong CRC"};
  EXPECT_EQ(changes.update(view), "(1700000005.000000) can0 0x6A1: wrong CRC (1 such frames)\n");
  // A flood of them: one line a second, and none is lost from the count.
  for (int i = 1; i <= 10; ++i) {
    view.wall_ns += 100'000'000;
    view.distrust.wrong_crc += 1;
    const std::string said = changes.update(view);
    EXPECT_EQ(said, i < 10 ? "" : "(1700000006.000000) can0 0x6A1: wrong CRC (11 such frames)\n");
  }
}

}  // namespace
}  // namespace beltgrip::monitor
