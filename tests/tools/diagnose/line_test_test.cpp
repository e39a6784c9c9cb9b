// Lines in the spectrum of residuals: what is red is none, and one between two frequencies is.
#include "tools/diagnose/infer/line_test.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <random>

#include "tests/tools/diagnose/recorded_runs.h"
#include "tools/diagnose/decide/namer.h"

namespace beltgrip::diagnose {
namespace {

constexpr double kPressure_Pa = 4e5;

// What the secondary speed shows beside its course, share of it.
struct Course {
  double white = 0.0;
  double red = 0.0;  // follows itself over red_s
  double red_s = 0.0;
  double ripple = 0.0, ripple_Hz = 0.0;
};

SignalTable steady(const estimator::VariatorParameters& variator, const Course& course,
                   unsigned seed) {
  std::mt19937 bits(seed);
  // The sum of twelve uniform numbers, the same with every library.
  const auto normal = [&] {
    double sum = -6.0;
    for (int i = 0; i < 12; ++i) sum += static_cast<double>(bits()) / 4294967296.0;
    return sum;
  };
  constexpr double kStep_s = 0.005;
  SignalTable table;
  double red = 0.0;
  const double keeps = course.red_s > 0.0 ? std::exp(-kStep_s / course.red_s) : 0.0;
  for (int i = 0; i < 9000; ++i) {
    const double t_s = kStep_s * i;
    const auto add = [&](Role role, double value) {
      table[role].t_s.push_back(t_s);
      table[role].value.push_back(value);
    };
    red = keeps * red + std::sqrt(1.0 - keeps * keeps) * normal();
    const double off =
        course.white * normal() + course.red * red +
        course.ripple * std::sin(2.0 * std::numbers::pi * course.ripple_Hz * t_s + seed);
    add(Role::kPrimarySpeed, 100.0);
    add(Role::kSecondarySpeed, 100.0 * variator.ratio_overdrive * (0.99 + off));
    add(Role::kSecondaryPressure, kPressure_Pa);
    add(Role::kPrimaryTorque, 50.0);
  }
  return table;
}

SpectralLine line_of(const Course& course, unsigned seed, unsigned count = 10) {
  const estimator::VariatorParameters variator;
  std::vector<ExperimentData> runs;
  for (unsigned i = 0; i < count; ++i) {
    runs.push_back(prepare(steady(variator, course, seed + i), variator));
  }
  const Campaign campaign = make_campaign(std::move(runs), nominal_model(variator));
  ModelState state;
  state.nuisance.setZero(kNuisanceCount);
  state.nuisance[kLnMuMax] = std::log(0.1);
  state.effects.setZero(static_cast<Eigen::Index>(campaign.slots.size()));
  return strongest_line(campaign, state);
}

TEST(LineTest, WhatFallsWithFrequencyIsNoLine) {
  for (unsigned seed = 0; seed < 5; ++seed) {
    const SpectralLine line = line_of({.white = 1e-3, .red = 2e-3, .red_s = 0.5}, 100 * seed);
    EXPECT_LT(line.excess, 4.5) << line.frequency_Hz;
    EXPECT_GT(line.excess, 0.0);
  }
}

TEST(LineTest, TheSlowCourseThatIsTakenOffLeavesNoLine) {
  const SpectralLine line = line_of({.white = 1e-3}, 1000, 60);
  EXPECT_LT(line.excess, 4.5) << line.frequency_Hz;
}

TEST(LineTest, ARippleIsFoundWhereverItLies) {
  for (const double hz : {0.775, 1.43, 2.475, 3.11}) {
    const SpectralLine line = line_of({.white = 1e-3, .ripple = 1.5e-4, .ripple_Hz = hz}, 7);
    EXPECT_GT(line.excess, 6.0) << hz;
    EXPECT_NEAR(line.frequency_Hz, hz, 0.03);
  }
}

}  // namespace
}  // namespace beltgrip::diagnose
