#include "tools/diagnose/infer/noise_balance.h"

#include <algorithm>
#include <cmath>
#include <cstddef>

#include "tools/diagnose/infer/noise_probe.h"

namespace beltgrip::diagnose {
namespace {

// Chosen: of as many samples each, by the share that is the slip's. 6 and 10: the same names in
// five campaigns of other make (115, 228, 161, 219, 94 of tools/diagnose/RECORD.md).
constexpr std::size_t kBins = 8;
// Derived: samples that tell a variance as a median does, whose square is 2.7 times as uncertain as
// the mean of squares, to its own size. A fifth less or more: the same names in those five.
constexpr double kSamplesPerUnit = 5.4;
// Chosen, of the mean: no channel has less. A fifth less: the same; a fifth more: one of the five
// (161) has no name, as before both noises were weighed.
constexpr double kLeastNoise = 0.1;

}  // namespace

NoiseFactors noise_factors(std::vector<NoiseSample> samples) {
  std::sort(samples.begin(), samples.end(),
            [](const NoiseSample& a, const NoiseSample& b) { return a.slip_share < b.slip_share; });
  struct Bin {
    double share = 0.0, variance = 0.0, count = 0.0;
  };
  std::vector<Bin> bins;
  double mean = 0.0, all = 0.0;
  for (std::size_t i = 0; i < kBins; ++i) {
    Bin bin;
    std::vector<double> noise;
    for (std::size_t k = samples.size() * i / kBins; k < samples.size() * (i + 1) / kBins; ++k) {
      bin.share += samples[k].slip_share;
      noise.push_back(samples[k].noise);
    }
    bin.count = static_cast<double>(noise.size());
    const double sigma = robust_sigma(noise);
    if (!(sigma > 0.0)) return {};
    bin.share /= bin.count;
    bin.variance = sigma * sigma;
    mean += bin.count * bin.variance;
    all += bin.count;
    bins.push_back(bin);
  }
  mean /= all;
  // Least squares of the variance over the share, in units of the mean; beside that both are off by
  // as much as themselves, so that what these samples do not tell stays.
  double slip_slip = 1.0, slip_torque = 0.0, torque_torque = 1.0;
  double slip = 1.0, torque = 1.0;
  for (const Bin& bin : bins) {
    const double weight = bin.count / kSamplesPerUnit, of_torque = 1.0 - bin.share;
    slip_slip += weight * bin.share * bin.share;
    slip_torque += weight * bin.share * of_torque;
    torque_torque += weight * of_torque * of_torque;
    slip += weight * bin.share * bin.variance / mean;
    torque += weight * of_torque * bin.variance / mean;
  }
  const double determinant = slip_slip * torque_torque - slip_torque * slip_torque;
  const double of_slip =
      std::max((torque_torque * slip - slip_torque * torque) / determinant, kLeastNoise);
  const double of_torque =
      std::max((slip_slip * torque - slip_torque * slip) / determinant, kLeastNoise);
  const double larger = std::max(of_slip, of_torque);
  return {of_slip / larger, of_torque / larger};
}

void balance_noise(const ModelState& state, Campaign& campaign) {
  std::vector<NoiseSample> samples;
  for (int run = 0; run < static_cast<int>(campaign.runs.size()); ++run) {
    const ExperimentData& data = campaign.runs[static_cast<std::size_t>(run)];
    if (data.valid_count == 0) continue;
    const Residuals at = residuals_of(campaign, run, state);
    const Eigen::ArrayXd of_slip =
        (at.slope * at.weight * campaign.slip_noise_share_of(run)).square();
    constexpr int kReach = kFastProbe.reach();
    for (const auto& [begin, end] : data.stretches) {
      for (int k = begin + kReach; k + kReach < end; ++k) {
        samples.push_back(
            {kFastProbe.mean_at(of_slip, k), kFastProbe.at(at.value[kFrictionResidual], k)});
      }
    }
  }
  const NoiseFactors factors = noise_factors(std::move(samples));
  campaign.noise.slip_share *= std::sqrt(factors.slip);
  campaign.noise.torque_Nm *= std::sqrt(factors.torque);
  campaign.noise.force_N *= std::sqrt(factors.torque);
  for (std::size_t e = 0; e < campaign.slip_noise_share.size(); ++e) {
    double& share = campaign.slip_noise_share[e];
    share = std::max(share, campaign.runs[e].rounding_slip_share / campaign.noise.slip_share);
  }
}

}  // namespace beltgrip::diagnose
