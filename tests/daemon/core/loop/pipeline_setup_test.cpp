// What the configuration says is what monitor and reading are made with.
#include "daemon/core/loop/pipeline_setup.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "daemon/core/loop/pipeline.h"
#include "estimator/physics/assumed_constants.h"

namespace beltgrip::daemon {
namespace {

TEST(PipelineSetup, TheMonitorHasTheConfigurationsLimits) {
  Config config;
  config.experiment.primary_speed_min_rad_s = 120.0;
  config.experiment.secondary_pressure_floor_Pa = 3e5;
  config.experiment.cooldown_s = 7.25;
  config.estimator.ramp_rate_max_N_per_s = 470.0;
  config.variator.secondary_spring_force_N = 640.0;
  config.variator.secondary_centrifugal_N_s2 = 0.011;
  config.variator.secondary_piston_area_m2 = 0.012;
  const SafetyLimits limits = safety_limits(config);
  EXPECT_DOUBLE_EQ(limits.speed_min_rad_s, 102.0);  // 85 %
  EXPECT_DOUBLE_EQ(limits.rate_max_N_per_s, 470.0);
  EXPECT_DOUBLE_EQ(limits.spring_force_N, 640.0);
  EXPECT_DOUBLE_EQ(limits.centrifugal_N_s2, 0.011);
  EXPECT_DOUBLE_EQ(limits.floor_force_N, 3600.0);
  EXPECT_EQ(limits.pause_min, 7250 * kMillisecond);
}

TEST(PipelineSetup, WhatIsAssumedIsReadInTheMiddleWhereItIsOnlyWatched) {
  Config config;
  config.control = Control::kObserve;
  // Every second constant is assumed, the others are stated.
  for (std::size_t i = 0; i < estimator::kConstantCount; ++i) {
    config.assumed_constants.set(i, i % 2 == 0);
    config.variator.*estimator::assumptions()[i].value = 0.5;
  }
  const Config read = as_read(config);
  for (std::size_t i = 0; i < estimator::kConstantCount; ++i) {
    const estimator::Assumption& each = estimator::assumptions()[i];
    EXPECT_DOUBLE_EQ(read.variator.*each.value, i % 2 == 0 ? each.quantile(0.5) : 0.5) << each.key;
  }
}

TEST(PipelineSetup, ARequestIsMadeInTheTransmissionsOwnMeasure) {
  Config config;
  config.control = Control::kCommand;
  config.assumed_constants.set();
  const Config read = as_read(config);
  for (const estimator::Assumption& each : estimator::assumptions()) {
    EXPECT_EQ(read.variator.*each.value, config.variator.*each.value) << each.key;
  }
}

// With control "command" five frames at the start tell the controller that nothing is asked for; a
// replay of such a drive tells it nothing.
TEST(PipelineSetup, AReplaySendsNoClampFrame) {
  Config config;
  config.control = Control::kCommand;
  Pipeline live(config), replay(config, RecordedRequests({}));
  const auto clamp_frames = [&](Pipeline& pipeline) {
    std::ptrdiff_t count = 0;
    for (MonoTime t{kSecond}; t < MonoTime{2 * kSecond}; t += 5 * kMillisecond) {
      Outbox outbox;
      pipeline.on_sample(t, outbox);
      const auto end = outbox.frames.begin() + static_cast<std::ptrdiff_t>(outbox.size);
      count += std::count_if(outbox.frames.begin(), end, [&](const can::CanFrame& frame) {
        return frame.id.value == config.identifiers.clamp;
      });
    }
    return count;
  };
  EXPECT_EQ(clamp_frames(live), 5);
  EXPECT_EQ(clamp_frames(replay), 0);
}

}  // namespace
}  // namespace beltgrip::daemon
