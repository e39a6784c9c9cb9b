// The checker itself: a quiet request passes, and each promise broken alone is found.
#include "tests/support/invariants.h"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>

#include "daemon/core/publish/own_frames.h"

namespace beltgrip::test {
namespace {

using daemon::Fault;
using daemon::fault_bit;
using daemon::SampleReport;
using daemon::State;

constexpr daemon::Duration kSample = 5 * daemon::kMillisecond;

daemon::Config config() {
  daemon::Config out;
  out.control = daemon::Control::kCommand;
  out.experiment.cooldown_s = 2.0;
  return out;
}

// Plays samples of a request that keeps every promise, unless a change is made to one of them.
class Player {
 public:
  struct Sample {
    SampleReport report;
    std::vector<can::CanFrame> frames;
  };
  using Change = std::function<void(Sample&)>;

  explicit Player(const daemon::Config& given = config())
      : invariants_(given), frames_(given.identifiers) {
    report_.t = daemon::MonoTime{100 * daemon::kSecond};
    report_.sample.omega_p_rad_s = 140.0;
    report_.sample.omega_s_rad_s = 315.0;
    announce();
  }
  // The inactive frames before a request.
  void announce(int frames = 5) {
    inactive_left_ = frames;
    play(frames, 0.0);
  }

  void play(int samples, double force_N, double fall_N = 0.0, const Change& change = {}) {
    for (int i = 0; i < samples; ++i) {
      report_.t += kSample;
      const bool asked = report_.request_force_N > 0.0;
      report_.request_force_N = force_N > 0.0 ? force_N - fall_N * i : 0.0;
      report_.state = force_N > 0.0 ? State::kRamping : State::kReleasing;
      report_.in_experiment = force_N > 0.0;
      if (asked && force_N == 0.0) inactive_left_ = 5;
      Sample now{report_, {}};
      if (force_N > 0.0 || inactive_left_ > 0) {
        now.frames.push_back(frames_.pack(
            daemon::ClampValues{force_N > 0.0, std::round(report_.request_force_N)}, counter_));
        counter_ = static_cast<std::uint8_t>((counter_ + 1) % 15);
        if (force_N == 0.0) --inactive_left_;
      }
      if (change) change(now);
      for (const can::CanFrame& frame : now.frames) invariants_.on_sent(frame);
      invariants_.on_report(now.report);
    }
  }
  // One sample of a request that stands, changed.
  void once(const Change& change) { play(1, 3000.0, 0.0, change); }

  bool found(const std::string& which) const { return invariants_.problems().contains(which); }
  std::string all() const {
    std::string out;
    for (const auto& [which, how] : invariants_.problems()) out += which + ": " + how + "\n";
    return out;
  }
  template <typename Values>
  can::CanFrame frame_of(const Values& values) const {
    return frames_.pack(values, 0);
  }

 private:
  Invariants invariants_;
  daemon::OwnFrames frames_;
  SampleReport report_;
  std::uint8_t counter_ = 0;
  int inactive_left_ = 0;
};

TEST(Invariants, AQuietRequestBreaksNone) {
  Player player;
  player.play(400, 3000.0, 1.0);
  player.play(600, 0.0);
  player.announce();
  player.play(100, 2500.0, 1.0);
  player.play(20, 0.0);
  EXPECT_EQ(player.all(), "");
}

TEST(Invariants, ARequestNeedsFiveInactiveFramesBeforeIt) {
  for (const int frames : {0, 4}) {
    Player player;
    player.play(400, 3000.0, 1.0);
    player.play(600, 0.0);
    if (frames > 0) player.announce(frames);
    player.play(1, 2500.0);
    EXPECT_TRUE(player.found("I5")) << frames;
  }
}

TEST(Invariants, EachIsFoundAlone) {
  const std::pair<const char*, Player::Change> cases[] = {
      {"I1", [](Player::Sample& s) { s.report.state = State::kIdle; }},
      {"I1", [](Player::Sample& s) { s.frames[0].data[2] = 0; }},
      {"I2", [](Player::Sample& s) { s.report.request_force_N += 1.0; }},
      {"I2", [](Player::Sample& s) { s.report.request_force_N -= 4.0; }},
      {"I2", [](Player::Sample& s) { s.report.request_force_N = 400.0; }},
      {"I3", [](Player::Sample& s) { s.report.faults = fault_bit(Fault::kInputStale); }},
      {"I3", [](Player::Sample& s) { s.report.faults = fault_bit(Fault::kForeignSender); }},
      {"I3", [](Player::Sample& s) { s.report.macro_slip_stop = true; }},
      {"I5", [](Player::Sample& s) { s.frames[0].data[0] ^= 1; }},
      {"I5", [](Player::Sample& s) { s.frames[0].data[1] ^= 2; }},
      {"I5", [](Player::Sample& s) { s.frames[0].length = 7; }},
      {"I5", [](Player::Sample& s) { s.frames[0].id.value = 0x6A4; }},
      {"I5", [](Player::Sample& s) { s.report.request_force_N -= 1.0; }},
      {"I7", [](Player::Sample& s) { s.report.curve.mu_star = std::nan(""); }},
      {"I7",
       [](Player::Sample& s) {
         s.report.result.peak.kind = estimator::PeakKind::kValue;
         s.report.result.peak.mu_max = 0.1;
       }},
      {"I8", [](Player::Sample& s) { s.report.t -= 2 * kSample; }},
      {"I8", [](Player::Sample& s) { s.report.t += kSample; }},
  };
  int index = 0;
  for (const auto& [which, change] : cases) {
    SCOPED_TRACE(index++);
    Player player;
    player.play(20, 3000.0);
    ASSERT_EQ(player.all(), "");
    player.once(change);
    EXPECT_TRUE(player.found(which)) << player.all();
  }
}

TEST(Invariants, TheStopFlagStaysUpUntilTheExperimentIsOver) {
  Player player;
  const auto flag = [](bool up) {
    return [up](Player::Sample& s) {
      s.report.in_experiment = true;
      s.report.macro_slip_stop = up;
    };
  };
  player.play(5, 3000.0);
  player.play(5, 0.0, 0.0, flag(true));
  EXPECT_FALSE(player.found("I4"));
  player.play(1, 0.0, 0.0, flag(false));
  EXPECT_TRUE(player.found("I4"));
}

TEST(Invariants, ARequestEndsWithAnInactiveFrameAtOnceAndFiveInAll) {
  Player none;
  none.play(5, 3000.0);
  none.play(1, 0.0, 0.0, [](Player::Sample& s) { s.frames.clear(); });
  EXPECT_TRUE(none.found("I3"));
  Player four;
  four.play(5, 3000.0);
  four.play(4, 0.0);
  four.play(20, 0.0, 0.0, [](Player::Sample& s) { s.frames.clear(); });
  EXPECT_TRUE(four.found("I5"));
}

TEST(Invariants, CoolDownAndDuration) {
  Player soon;
  soon.play(10, 3000.0);
  soon.play(300, 0.0);  // 1.5 s
  EXPECT_FALSE(soon.found("I2"));
  soon.play(1, 3000.0);
  EXPECT_TRUE(soon.found("I2"));
  Player longest;
  longest.play(3001, 3000.0);
  EXPECT_EQ(longest.all(), "");
  longest.play(2, 3000.0);
  EXPECT_TRUE(longest.found("I2"));
}

TEST(Invariants, ValidOnlyWithAValue) {
  Player player;
  player.play(5, 3000.0);
  player.once([&](Player::Sample& s) {
    can::CanFrame frame = player.frame_of(daemon::EstimateValues{});
    frame.data[1] |= 0x40;
    s.frames.push_back(frame);
  });
  EXPECT_TRUE(player.found("I6"));
}

TEST(Invariants, TenLinesASecondAreNeverExceeded) {
  Player player;
  player.play(400, 0.0, 0.0, [](Player::Sample& s) {
    s.report.faults =
        s.report.t.since_origin() / kSample % 2 == 0 ? fault_bit(Fault::kInputRange) : 0U;
  });
  EXPECT_FALSE(player.found("I9")) << player.all();
}

TEST(Invariants, AnAbortWithoutACauseIsFound) {
  Player player;
  player.play(5, 3000.0);
  player.once([](Player::Sample& s) {
    s.report.new_result = true;
    s.report.result.outcome = daemon::Outcome::kAborted;
  });
  EXPECT_TRUE(player.found("I9"));
}

TEST(Invariants, FramesOfResultAndStateSayWhatTheReportSays) {
  Player state;
  state.play(5, 3000.0);
  state.once(
      [&](Player::Sample& s) { s.frames.push_back(state.frame_of(daemon::StatusValues{})); });
  EXPECT_TRUE(state.found("I13"));
  Player count;
  count.once([&](Player::Sample& s) {
    daemon::EstimateValues values;
    values.experiment_count = 1;
    s.frames.push_back(count.frame_of(values));
  });
  EXPECT_TRUE(count.found("I13"));
}

TEST(Invariants, MinClampForceBelowWhatTheLastValueNeedsIsFound) {
  for (const auto& [force_N, broken] : {std::pair{2000.0, true}, {2400.0, true}, {2444.0, false}}) {
    Player player;
    const double asked_N = force_N;
    player.once([&](Player::Sample& s) {
      s.report.new_result = true;
      s.report.result.outcome = daemon::Outcome::kCompleted;
      s.report.result.peak.kind = estimator::PeakKind::kValue;
      s.report.result.peak.mu_max = 0.1;
      s.report.curve.usable = s.report.sample.usable = true;
      s.report.curve.torque_p_Nm = 30.0;
      daemon::EstimateValues values;
      values.kind = estimator::PeakKind::kValue;
      values.mu_max = 0.1;
      values.experiment_count = 1;
      values.min_clamp_force_N = asked_N;  // 1.3 * 30 cos(11 deg) / (2 * 0.0784 * 0.1) = 2442 N
      s.frames.push_back(player.frame_of(values));
    });
    EXPECT_EQ(player.found("I15"), broken) << force_N;
  }
}

// A value, then an experiment in which the belt slips at less and gives none.
TEST(Invariants, MinClampForceThatForgetsASlipIsFound) {
  for (const auto& [force_N, broken] : {std::pair{2444.0, true}, {3200.0, true}, {3260.0, false}}) {
    Player player;
    const double asked_N = force_N;
    const auto say = [&](Player::Sample& s, bool value, double min_clamp_N) {
      s.report.new_result = true;
      s.report.result.outcome =
          value ? daemon::Outcome::kCompleted : daemon::Outcome::kInconclusive;
      s.report.result.stop_reason = estimator::StopReason::kSlope;
      s.report.result.peak.kind =
          value ? estimator::PeakKind::kValue : estimator::PeakKind::kLowerBound;
      s.report.result.peak.mu_max = value ? 0.1 : 0.06;
      s.report.curve.usable = s.report.sample.usable = true;
      s.report.curve.torque_p_Nm = 30.0;
      daemon::EstimateValues values;
      values.kind = estimator::PeakKind::kValue;
      values.mu_max = 0.1;
      values.experiment_count = 1;
      values.min_clamp_force_N = min_clamp_N;
      s.frames.push_back(player.frame_of(values));
    };
    player.once([&](Player::Sample& s) { say(s, true, 2444.0); });
    player.once([&](Player::Sample& s) {
      s.report.state = daemon::State::kRamping;
      s.report.curve.usable = s.report.sample.usable = true;
      s.report.curve.mu_star = 0.075;  // three quarters: 3257 N
    });
    player.once([&](Player::Sample& s) { say(s, false, asked_N); });
    EXPECT_EQ(player.found("I15"), broken) << force_N;
  }
}

TEST(Invariants, InObserveNoClampFrame) {
  daemon::Config observe = config();
  observe.control = daemon::Control::kObserve;
  Player player(observe);
  player.once([](Player::Sample&) {});
  EXPECT_TRUE(player.found("I14"));
  EXPECT_TRUE(player.found("I1"));
}

}  // namespace
}  // namespace beltgrip::test
