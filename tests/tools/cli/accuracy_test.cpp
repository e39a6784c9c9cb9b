// The paper's two belts, ten seeds each, the default method, the programs as users call them:
// mu_max, its error, and slip and delay at the stop beside the truth. The table is in
// estimator/PAPER.md.
#include <gtest/gtest.h>

#include <cmath>
#include <nlohmann/json.hpp>

#include "tests/support/program.h"

namespace beltgrip::test {
namespace {

constexpr int kSeeds = 10;

struct Trial {
  bool stopped = false, completed = false;
  double error_percent = 0.0, stop_slip_percent = 0.0, delay_s = 0.0;
};

Trial trial(const Workplace& place) {
  const auto truth = nlohmann::json::parse(place.read("truth.json"));
  const RunResult result = beltgrip(
      {"replay", place.path("trace.log"), "--config", place.path("beltgrip.toml"), "--json", "-"});
  EXPECT_EQ(result.status, 0) << result.err;
  const auto found = nlohmann::json::parse(result.out.substr(0, result.out.find('\n')));
  Trial run;
  run.stopped = found.at("stop_s").is_number();
  run.completed = found.at("outcome") == "completed";
  const double mu_max = truth.at("mu_max").get<double>();
  if (run.completed) {
    run.error_percent = 100.0 * (found.at("mu_max").get<double>() / mu_max - 1.0);
  }
  if (run.stopped) {
    run.stop_slip_percent = found.at("sigma_stop_percent").get<double>();
    run.delay_s =
        found.at("stop_s").get<double>() - truth.at("experiments")[0].at("peak_s").get<double>();
  }
  return run;
}

TEST(Accuracy, PapersTwoBeltsTenSeeds) {
  for (const char* belt : {"new", "worn"}) {
    for (int seed = 1; seed <= kSeeds; ++seed) {
      SCOPED_TRACE(testing::Message() << belt << " " << seed);
      Workplace place;
      ASSERT_EQ(beltgrip({"simulate", "--scenario", "paper-rig", "--belt", belt, "--seed",
                          std::to_string(seed), "--out-dir", place.path("")})
                    .status,
                0);
      // Stops by itself in every trace, before 10 % of slip, within 1.5 %.
      const Trial run = trial(place);
      EXPECT_TRUE(run.stopped);
      EXPECT_TRUE(run.completed);
      EXPECT_LT(run.stop_slip_percent, 10.0);
      EXPECT_LT(std::abs(run.error_percent), 1.5);
      EXPECT_GT(run.delay_s, 0.0);
    }
  }
}

}  // namespace
}  // namespace beltgrip::test
