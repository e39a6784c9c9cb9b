// Construction of the pipeline: all its memory is taken here, at start-up.
#include "daemon/core/loop/pipeline_setup.h"

#include <cmath>
#include <utility>

#include "daemon/core/loop/pipeline_parts.h"
#include "estimator/physics/assumed_constants.h"

namespace beltgrip::daemon {

SafetyLimits safety_limits(const Config& config) {
  SafetyLimits limits;
  limits.speed_min_rad_s = limits::kMonitorSpeedShare * config.experiment.primary_speed_min_rad_s;
  limits.rate_max_N_per_s = config.estimator.ramp_rate_max_N_per_s;
  limits.spring_force_N = config.variator.secondary_spring_force_N;
  limits.centrifugal_N_s2 = config.variator.secondary_centrifugal_N_s2;
  limits.floor_force_N =
      config.variator.secondary_piston_area_m2 * config.experiment.secondary_pressure_floor_Pa;
  limits.pause_min = Duration::of_ns(std::llround(config.experiment.cooldown_s * 1e9));
  return limits;
}

Config as_read(Config config) {
  if (config.control == Control::kCommand) return config;
  for (std::size_t i = 0; i < estimator::kConstantCount; ++i) {
    const estimator::Assumption& each = estimator::assumptions()[i];
    if (config.assumed_constants.test(i)) config.variator.*each.value = each.quantile(0.5);
  }
  return config;
}

Pipeline::Parts::Parts(const Config& given, std::optional<RecordedRequests> recorded)
    : config(as_read(given)),
      input(config),
      estimate(config),
      evaluation(config),
      known(config),
      experiment(config, std::move(recorded)),
      safety(safety_limits(config)),
      output(config, sample_period(config)) {}

Pipeline::Pipeline(const Config& config) : parts_(std::make_unique<Parts>(config)) {}
Pipeline::Pipeline(const Config& config, RecordedRequests recorded)
    : parts_(std::make_unique<Parts>(config, std::move(recorded))) {}
Pipeline::~Pipeline() = default;

}  // namespace beltgrip::daemon
