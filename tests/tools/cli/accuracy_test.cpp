// The paper's two belts, ten seeds each, both methods, the programs as users call them: mu_max, its
// error, and slip and delay at the stop beside the truth. Prints the table of
// estimator/ACCURACY.md.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <nlohmann/json.hpp>
#include <sstream>

#include "tests/support/program.h"

namespace beltgrip::test {
namespace {

constexpr int kSeeds = 10;

struct Trial {
  bool stopped = false, completed = false, covered = false;
  double mu_max = 0.0, error_percent = 0.0, stop_slip_percent = 0.0, delay_s = 0.0;
};

Trial trial(const Workplace& place, const std::string& method) {
  const auto truth = nlohmann::json::parse(place.read("truth.json"));
  const RunResult result =
      beltgrip({"replay", place.path("trace.log"), "--config", place.path("beltgrip.toml"),
                "--method", method, "--json", "-"});
  EXPECT_EQ(result.status, 0) << result.err;
  const auto found = nlohmann::json::parse(result.out.substr(0, result.out.find('\n')));
  Trial run;
  run.stopped = found.at("stop_s").is_number();
  run.completed = found.at("outcome") == "completed";
  const double mu_max = truth.at("mu_max").get<double>();
  if (run.completed) {
    run.mu_max = found.at("mu_max").get<double>();
    run.error_percent = 100.0 * (run.mu_max / mu_max - 1.0);
    run.covered = found.at("mu_max_ci95")[0] <= mu_max && mu_max <= found.at("mu_max_ci95")[1];
  }
  if (run.stopped) {
    run.stop_slip_percent = found.at("sigma_stop_percent").get<double>();
    run.delay_s =
        found.at("stop_s").get<double>() - truth.at("experiments")[0].at("peak_s").get<double>();
  }
  return run;
}

struct Column {
  double mean = 0.0, sd = 0.0, worst = 0.0;
};
Column column(const std::vector<Trial>& runs, double Trial::*field) {
  Column c;
  for (const Trial& run : runs) c.mean += run.*field / static_cast<double>(runs.size());
  for (const Trial& run : runs) {
    c.sd += std::pow(run.*field - c.mean, 2) / static_cast<double>(runs.size() - 1);
    if (std::abs(run.*field) > std::abs(c.worst)) c.worst = run.*field;
  }
  c.sd = std::sqrt(c.sd);
  return c;
}

TEST(Accuracy, PapersTwoBeltsTenSeedsBothMethods) {
  std::printf(
      "| belt, mu_max | method | stopped by itself | mu_max, mean +- sd | error, mean / worst "
      "| slip at stop, mean / worst | stop after the peak, mean / worst | truth in 95 %% interval "
      "|\n"
      "|---|---|---|---|---|---|---|---|\n");
  for (const char* belt : {"new", "worn"}) {
    std::vector<Trial> robust, paper;
    for (int seed = 1; seed <= kSeeds; ++seed) {
      Workplace place;
      ASSERT_EQ(beltgrip({"simulate", "--scenario", "paper-rig", "--belt", belt, "--seed",
                          std::to_string(seed), "--out-dir", place.path("")})
                    .status,
                0);
      robust.push_back(trial(place, "robust"));
      paper.push_back(trial(place, "paper"));
    }
    for (const auto* runs : {&robust, &paper}) {
      const auto count = [&](bool Trial::*flag) {
        return std::count_if(runs->begin(), runs->end(), [&](const Trial& r) { return r.*flag; });
      };
      const Column mu = column(*runs, &Trial::mu_max), error = column(*runs, &Trial::error_percent),
                   slip = column(*runs, &Trial::stop_slip_percent),
                   delay = column(*runs, &Trial::delay_s);
      std::printf(
          "| %s, %.3f | %s | %ld of %d | %.4f +- %.4f | %+.2f %% / %+.2f %% | %.2f %% / %.2f %% "
          "| %.2f s / %.2f s | %ld of %d |\n",
          belt, belt == std::string("new") ? 0.105 : 0.1, runs == &robust ? "robust" : "paper",
          count(&Trial::stopped), kSeeds, mu.mean, mu.sd, error.mean, error.worst, slip.mean,
          slip.worst, delay.mean, delay.worst, count(&Trial::covered), kSeeds);
    }
    // The default method: stops by itself in every trace, before 10 % of slip, within 1.5 %.
    for (const Trial& run : robust) {
      EXPECT_TRUE(run.stopped);
      EXPECT_TRUE(run.completed);
      EXPECT_LT(run.stop_slip_percent, 10.0);
      EXPECT_LT(std::abs(run.error_percent), 1.5);
      EXPECT_GT(run.delay_s, 0.0);
    }
    // The paper's method is the anchor: it finds a peak, low by some percent, and late.
    for (const Trial& run : paper) {
      EXPECT_TRUE(run.completed);
      EXPECT_LT(std::abs(run.error_percent), 15.0);
    }
  }
}

}  // namespace
}  // namespace beltgrip::test
