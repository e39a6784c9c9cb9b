#include "tools/diagnose/infer/scatter_base.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <optional>

#include "tools/diagnose/infer/conditions.h"

namespace beltgrip::diagnose {
namespace {

// Chosen: nearer than these no cause of interest tells two experiments apart.
constexpr double kSameSpeed = 0.02, kSameTorque = 0.03, kSamePressure = 0.1, kSameRate = 0.3;
constexpr double kSameTorque_Nm = 1.0, kSameOil_K = 5.0;

bool near(double a, double b, double relative, double absolute = 0.0) {
  return std::abs(a - b) <= relative * std::max(std::abs(a), std::abs(b)) + absolute;
}

bool repeat(const Conditions& a, const Conditions& b) {
  return a.stop == b.stop && near(a.speed_rad_s, b.speed_rad_s, kSameSpeed) &&
         near(a.torque_Nm, b.torque_Nm, kSameTorque, kSameTorque_Nm) &&
         near(a.pressure_Pa, b.pressure_Pa, kSamePressure) &&
         near(a.rate_Pa_s, b.rate_Pa_s, kSameRate) && a.oil_C.has_value() == b.oil_C.has_value() &&
         (!a.oil_C || std::abs(*a.oil_C - *b.oil_C) <= kSameOil_K);
}

}  // namespace

std::vector<int> replicate_groups(const Campaign& campaign) {
  const std::size_t runs = campaign.runs.size();
  std::vector<std::optional<Conditions>> all(runs);
  for (std::size_t e = 0; e < runs; ++e) {
    if (campaign.runs[e].valid_count > 0) all[e] = conditions_of(campaign.runs[e]);
  }
  std::vector<int> out(runs, -1);
  int groups = 0;
  for (std::size_t first = 0; first < runs; ++first) {
    const auto& here = all[first];
    if (!here || out[first] >= 0) continue;
    for (std::size_t other = first + 1; other < runs; ++other) {
      const auto& there = all[other];
      if (!there || out[other] >= 0 || !repeat(*here, *there)) continue;
      out[first] = groups;
      out[other] = groups;
    }
    groups += out[first] >= 0;
  }
  return out;
}

ScatterBase scatter_base(const Engine& engine) {
  const std::vector<int> groups = replicate_groups(engine.campaign());
  const std::vector<RandomVector> offsets = engine.offsets();
  std::map<int, std::vector<RandomVector>> by_group;
  std::size_t used = 0;  // offsets are those of the experiments with valid samples
  for (std::size_t e = 0; e < groups.size(); ++e) {
    if (engine.campaign().runs[e].valid_count == 0) continue;
    const RandomVector& here = offsets[used++];
    if (groups[e] >= 0) by_group[groups[e]].push_back(here);
  }
  RandomVector squares = RandomVector::Zero();
  double degrees = 0.0;
  for (const auto& [group, members] : by_group) {
    RandomVector mean = RandomVector::Zero();
    for (const RandomVector& each : members) mean += each;
    mean /= static_cast<double>(members.size());
    for (const RandomVector& each : members) squares += (each - mean).square();
    degrees += static_cast<double>(members.size()) - 1.0;
  }
  ScatterBase out;
  out.from_replicates = degrees > 0.0;
  out.degrees = degrees + kScatterPriorRuns;
  out.scatter.variance =
      (squares + kScatterPriorRuns * default_scatter().variance) / (degrees + kScatterPriorRuns);
  return out;
}

ScatterRatios scatter_ratios(const Engine& engine, const Scatter& base) {
  constexpr std::size_t kRunsMin = 3;  // fewer show no scatter
  if (engine.summaries().size() < kRunsMin) return {};
  const auto runs = static_cast<double>(engine.summaries().size());
  // The fit's estimate leans on the usual scatter as on that many experiments.
  const RandomVector own = mean_square_of(engine.scatter().variance, runs);
  const RandomVector ratio = (own / base.variance).max(0.0).sqrt();
  return {ratio[0], ratio[1], ratio[2]};
}

}  // namespace beltgrip::diagnose
