// Construction of the pipeline: all its memory is taken here, at start-up.
#include <algorithm>
#include <cmath>

#include "daemon/core/loop/pipeline_parts.h"
#include "estimator/choice/make_estimator.h"

namespace beltgrip::daemon {

namespace {

// Independent of what the experiment uses: wider than its own limits, and it keeps to them.
SafetyLimits safety_limits(const Config& config) {
  SafetyLimits limits;
  limits.speed_min_rad_s = limits::kMonitorSpeedShare * config.experiment.primary_speed_min_rad_s;
  limits.rate_max_N_per_s = config.estimator.ramp_rate_max_N_per_s;
  limits.spring_force_N = config.variator.secondary_spring_force_N;
  limits.centrifugal_N_s2 = config.variator.secondary_centrifugal_N_s2;
  limits.floor_force_N =
      config.variator.secondary_piston_area_m2 * config.experiment.secondary_pressure_floor_Pa;
  limits.pause_min = std::llround(config.experiment.cooldown_s * static_cast<double>(kSecond));
  return limits;
}

ClampLimits clamp_limits(const Config& config) {
  constexpr double kRounding_N = 1.0;
  return {config.variator.secondary_spring_force_N,
          config.estimator.ramp_rate_max_N_per_s * limits::kGateFramePeriod_s + kRounding_N,
          limits::kGateFrames};
}

// Every identifier that may be asked for, once, at the shortest period of its roles.
PollLimits poll_limits(const Config& config) {
  static_assert(PollLimits::kMost >= kRoleCount, "one request a role");
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

// What is only watched is read best in the middle of what is possible: a force that is off by a
// constant bends the curve, and without any inertia the torque that slip takes from the belt cannot
// be seen. A request is made in the transmission's own measure of force, which the defaults are.
Config as_read(Config config) {
  if (config.control == Control::kCommand) return config;
  for (std::size_t i = 0; i < estimator::kConstantCount; ++i) {
    const estimator::Assumption& each = estimator::assumptions()[i];
    if (config.assumed_constants.test(i)) config.variator.*each.value = each.quantile(0.5);
  }
  return config;
}

}  // namespace

Pipeline::Parts::Parts(const Config& given)
    : config(as_read(given)),
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
  if (config.friction_is_assumed) {
    assumptions.emplace(config.variator, config.sensors, config.assumed_constants);
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
