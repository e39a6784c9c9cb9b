// Construction of the pipeline: all its memory is taken here, at start-up.
#include <algorithm>
#include <cmath>

#include "daemon/core/pipeline_parts.h"

namespace beltgrip::daemon {

namespace {

// Independent of what the experiment uses: wider than its own limits, and it keeps to them.
SafetyLimits safety_limits(const Config& config) {
  SafetyLimits limits;
  limits.speed_min_rad_s = 0.85 * config.experiment.primary_speed_min_rad_s;
  limits.rate_max_N_per_s = config.estimator.ramp_rate_max_N_per_s;
  limits.spring_force_N = config.variator.secondary_spring_force_N;
  limits.centrifugal_N_s2 = config.variator.secondary_centrifugal_N_s2;
  limits.floor_force_N =
      config.variator.secondary_piston_area_m2 * config.experiment.secondary_pressure_floor_Pa;
  limits.pause_min = std::llround(config.experiment.cooldown_s * static_cast<double>(kSecond));
  return limits;
}

// A frame every 10 ms, one sample late at most.
ClampLimits clamp_limits(const Config& config) {
  constexpr double kFrameMax_s = 0.016;
  constexpr double kRounding_N = 1.0;
  constexpr std::uint32_t kFramesMax = 1510;  // 15 s, and the last ones
  return {config.variator.secondary_spring_force_N,
          config.estimator.ramp_rate_max_N_per_s * kFrameMax_s + kRounding_N, kFramesMax};
}

// Every identifier that may be asked for, once, at the shortest period of its roles.
PollLimits poll_limits(const Config& config) {
  PollLimits limits;
  if (config.diagnostics != Diagnostics::kPoll) return limits;
  for (const RoleBinding& role : config.roles) {
    if (!role.uds || !role.period_ms) continue;
    const auto period = static_cast<Duration>(*role.period_ms * static_cast<double>(kMillisecond));
    const auto end = limits.requests.begin() + static_cast<std::ptrdiff_t>(limits.size);
    const auto same = std::find_if(limits.requests.begin(), end, [&](const auto& each) {
      return each.bus == role.bus && each.id == role.uds->request &&
             each.identifier == role.uds->identifier;
    });
    if (same != end) {
      same->period = std::min(same->period, period);
    } else {
      *same = {role.bus, role.uds->request, role.uds->identifier, period};
      ++limits.size;
    }
  }
  return limits;
}
}  // namespace

Pipeline::Parts::Parts(const Config& given)
    : config(given),
      inputs(config),
      sampler(inputs, config.estimator.torque_is_engine),
      estimator(
          estimator::make_slip_curve_estimator(config.estimator, config.variator, config.sensors)),
      publisher(config.identifiers, sample_period(config)),
      gate(config.identifiers, config.control, clamp_limits(config), poll_limits(config)),
      arming(config),
      request(config),
      safety(safety_limits(config)) {
  if (config.corrected) {
    correction.emplace(*config.corrected, config.variator, config.estimator.sample_rate_hz);
  }
  estimator->reset();
  // A request to the transmission rests on every input that is there.
  buses[0].needed = true;
  for (const RoleBinding& role : config.roles) {
    const auto required = inputs.required();
    const bool is_required =
        std::find(required.begin(), required.end(), role.role) != required.end();
    if (is_required || commands()) buses[role.bus].needed = true;
  }
}

Pipeline::Pipeline(const Config& config) : parts_(std::make_unique<Parts>(config)) {}
Pipeline::~Pipeline() = default;

}  // namespace beltgrip::daemon
