// Which names are told by the course of what they explain. That noise names nothing is tested where
// it is wired, on the generator that shares no code with this (tests/statistics/blind).
#include "tools/diagnose/decide/by_course.h"

#include <gtest/gtest.h>

namespace beltgrip::diagnose {
namespace {

TEST(IsSlow, WhatFollowsARateADirectionOrAnAngleIsNot) {
  for (const std::string_view fast :
       {"rate of secondary_pressure", "direction of secondary_pressure",
        "acceleration of primary_speed", "angle of the primary shaft", "rate of the channel"}) {
    EXPECT_FALSE(is_slow(fast)) << fast;
  }
  for (const std::string_view slow : {"nothing", "torque", "secondary_speed", "oil_temperature"}) {
    EXPECT_TRUE(is_slow(slow)) << slow;
  }
}

// The words are those of the table of effects.
TEST(IsSlow, OfTheEffectsSixActFast) {
  std::vector<std::string> fast;
  for (const EffectRow& row : effect_rows()) {
    if (is_slow(row.depends_on)) continue;
    if (fast.empty() || fast.back() != row.id) fast.emplace_back(row.id);
  }
  EXPECT_EQ(fast, (std::vector<std::string>{"inertia_torque", "torque_delay", "hydraulic_lag",
                                            "clamp_hysteresis", "speed_ripple", "channel_skew"}));
}

}  // namespace
}  // namespace beltgrip::diagnose
