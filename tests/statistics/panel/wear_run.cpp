#include "wear_run.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <thread>
#include <vector>

#include "drawing.h"
#include "estimator/belt/belt_history.h"
#include "panel_run.h"
#include "random.h"

namespace beltgrip::panel {
namespace {

constexpr int kExperiments = 5;  // on each side
constexpr double kSlowest_N_per_s = 60.0, kFastest_N_per_s = 300.0;

struct Belt {
  int values = 0;
  bool judged = false, found = false;
  double scatter = 0.0;
};

double deviation(const std::vector<double>& values) {
  double mean = 0.0, squares = 0.0;
  for (const double each : values) mean += each / static_cast<double>(values.size());
  for (const double each : values) squares += (each - mean) * (each - mean);
  return std::sqrt(squares / static_cast<double>(values.size() - 1));
}

Belt judge_belt(std::uint64_t seed, NoiseClass noise, double drop) {
  Random random(seed ^ 0x99999999ULL);
  Scenario belt = draw_scenario(seed);
  while (!belt.curve.has_peak()) belt = draw_scenario(random.bits());
  set_noise(belt, noise);
  belt.mu_floor = 1e9;
  belt.ramp_N_per_s = random.log_between(kSlowest_N_per_s, kFastest_N_per_s);
  const FrictionCurve fresh = belt.curve;
  Belt out;
  std::vector<double> sides[2];
  for (int i = 0; i < 2 * kExperiments; ++i) {
    belt.seed = random.bits();
    belt.hold_s = random.between(1.5, 3.0);
    belt.curve = fresh.with_mu_max(fresh.mu_max() * (i < kExperiments ? 1.0 : 1.0 - drop));
    const Outcome outcome = run(belt, simulate(belt), {});
    if (outcome.peak.kind != estimator::PeakKind::kValue) continue;
    ++out.values;
    sides[i < kExperiments ? 0 : 1].push_back(std::log(outcome.peak.mu_max));
  }
  out.judged = sides[0].size() >= 2 && sides[1].size() >= 2;
  if (!out.judged) return out;
  out.found = estimator::compare(sides[0], sides[1]).found;
  out.scatter = 100.0 * std::max(deviation(sides[0]), deviation(sides[1]));
  return out;
}

}  // namespace

WearRates wear_rates(std::uint64_t first, int count, NoiseClass noise, double drop, int threads) {
  std::vector<Belt> belts(static_cast<std::size_t>(count));
  std::atomic<std::size_t> next = 0;
  const auto work = [&] {
    for (std::size_t i = next++; i < belts.size(); i = next++) {
      belts[i] = judge_belt(first + i, noise, drop);
    }
  };
  std::vector<std::thread> pool;
  for (int i = 1; i < threads; ++i) pool.emplace_back(work);
  work();
  for (std::thread& thread : pool) thread.join();

  WearRates rates;
  std::vector<double> scatter;
  int values = 0;
  for (const Belt& belt : belts) {
    ++rates.belts;
    values += belt.values;
    if (!belt.judged) continue;
    ++rates.judged;
    rates.found += belt.found ? 1 : 0;
    scatter.push_back(belt.scatter);
  }
  rates.values = 100.0 * values / std::max(1, 2 * kExperiments * rates.belts);
  if (!scatter.empty()) {
    std::nth_element(scatter.begin(),
                     scatter.begin() + static_cast<std::ptrdiff_t>(scatter.size() / 2),
                     scatter.end());
    rates.scatter = scatter[scatter.size() / 2];
  }
  return rates;
}

}  // namespace beltgrip::panel
