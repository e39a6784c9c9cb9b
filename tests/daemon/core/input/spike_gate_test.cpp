// Spikes against the rule written anew, over random courses with wild values, steps and noise that
// changes; and the rule's numbers by hand.
#include "daemon/core/input/spike_gate.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>
#include <vector>

namespace beltgrip::daemon {
namespace {

using Verdict = SpikeGate::Verdict;

// The rule over a list that grows: the course since it began anew, with what was left out filled
// in.
struct Rule {
  double step = 0.0;
  std::vector<double> course;
  std::vector<double> away;  // left out, as shares of their bounds
  double usual = 0.0;
  int learned = 0;
  double expected = 0.0, tested_by = 0.0;  // of the last value; 0: not tested

  // A straight line through the last five, by the slope between all pairs of them.
  double line_ahead(std::size_t steps) const {
    const double* last = course.data() + course.size() - 5;
    double mean = 0.0, slope = 0.0;
    for (int i = 0; i < 5; ++i) mean += last[i] / 5.0;
    for (int i = 0; i < 5; ++i) {
      for (int k = i + 1; k < 5; ++k) slope += (k - i) * (last[k] - last[i]) / 50.0;
    }
    return mean + slope * (2.0 + static_cast<double>(steps));
  }

  Verdict judge(double value, std::size_t most) {
    tested_by = 0.0;
    if (course.size() < 5) {
      course.push_back(value);
      return Verdict::kTaken;
    }
    const std::size_t missing = away.size();
    expected = line_ahead(missing + 1);
    const double off = std::fabs(value - expected);
    double bound = 5.5 * usual;
    bound = std::max(bound, 4.0 * step);
    bound = std::max(bound, 0.001 * std::fabs(value));
    bound += 0.25 * static_cast<double>(missing) * bound;
    if (learned >= 30) tested_by = bound;
    if (learned >= 30 && off > bound) {
      if (missing < most) {
        away.push_back(off / bound);
        return Verdict::kLeftOut;
      }
      usual = std::max(usual, off / 5.5);
      course = {value};
      away.clear();
      return Verdict::kTaken;
    }
    learned = std::min(learned + 1, 50);
    const double counted = learned < 30 ? off : std::min(off, 4.0 * usual + step);
    usual += (counted - usual) / learned;
    const bool wild = !away.empty() && *std::max_element(away.begin(), away.end()) > 1.5;
    const double before = course.back();
    for (std::size_t i = 1; i <= missing; ++i) {
      course.push_back(before + (value - before) * static_cast<double>(i) /
                                    static_cast<double>(missing + 1));
    }
    course.push_back(value);
    away.clear();
    return wild ? Verdict::kTakenAfterSpike : Verdict::kTaken;
  }
};

TEST(SpikeGate, DoesWhatItsRuleSays) {
  std::mt19937 random(11);
  std::normal_distribution<double> normal;
  std::uniform_real_distribution<double> share(0.0, 1.0);
  int seen[3] = {}, tested = 0;
  for (int run = 0; run < 2000; ++run) {
    // A tenth has no noise at all: the resolution or a thousandth of the value is the bound then.
    const double noise = run % 10 == 0 ? 0.0 : std::exp(4.0 * share(random) - 3.0);
    const double step = run % 3 == 0 ? 0.5 : 0.0;
    const double level = run % 4 == 0 ? 0.0 : 200.0;
    const double spikes = 0.02 + 0.2 * share(random);
    const std::size_t most = 1 + static_cast<std::size_t>(run % 4);
    SpikeGate gate(step);
    Rule rule{.step = step, .course = {}, .away = {}};
    double true_value = level, slope = 0.0;
    for (int i = 0; i < 200; ++i) {
      if (i == 150 && run % 5 == 0) {
        gate.reset();
        ASSERT_TRUE(std::isnan(gate.status().test_ratio));
        rule = Rule{.step = step, .course = {}, .away = {}};
      }
      if (share(random) < 0.03) slope = normal(random);
      if (share(random) < 0.02) true_value += 20.0 * normal(random);
      true_value += slope;
      const double now = i % 90 > 60 ? 3.0 * noise : noise;
      double value = true_value + now * normal(random);
      // From hardly beyond the bound to far away.
      if (share(random) < spikes) {
        value += (noise + step + 0.2) * std::exp(3.0 * share(random)) * (i % 2 == 0 ? 1.0 : -1.0);
      }
      const Verdict wanted = rule.judge(value, most);
      ASSERT_EQ(gate.judge(value, most), wanted) << run << ' ' << i;
      const estimator::ReadingStatus status = gate.status();
      ASSERT_EQ(std::isnan(status.test_ratio), !(rule.tested_by > 0.0)) << run << ' ' << i;
      if (rule.tested_by > 0.0) {
        ++tested;
        ASSERT_EQ(status.value, value);
        ASSERT_NEAR(status.expected, rule.expected, 1e-9);
        ASSERT_NEAR(status.test_ratio * rule.tested_by, std::fabs(value - rule.expected), 1e-8);
        ASSERT_NEAR(std::sqrt(2.0 * status.variance / M_PI), rule.usual, 1e-9);
      }
      ++seen[static_cast<int>(wanted)];
    }
  }
  for (const int each : seen) EXPECT_GT(each, 500);
  EXPECT_GT(tested, 100'000);
}

// A level course with no noise, in steps of 1: 4 is the most that goes on from it.
TEST(SpikeGate, NothingIsLeftOutBeforeThirtyValuesAreKnown) {
  for (int known = 0; known < 40; ++known) {
    SpikeGate gate(1.0);
    for (int i = 0; i < 5 + known; ++i) ASSERT_EQ(gate.judge(100.0, 3), Verdict::kTaken);
    EXPECT_EQ(gate.judge(104.5, 3), known < 30 ? Verdict::kTaken : Verdict::kLeftOut) << known;
  }
}

TEST(SpikeGate, FourStepsAreNoSpike) {
  SpikeGate gate(1.0);
  for (int i = 0; i < 60; ++i) gate.judge(100.0, 3);
  EXPECT_EQ(gate.judge(104.0, 3), Verdict::kTaken);
}

}  // namespace
}  // namespace beltgrip::daemon
