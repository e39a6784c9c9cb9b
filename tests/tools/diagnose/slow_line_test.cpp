// What swings slower than ramps and sweeps leave lines of their own: told from their course, and
// from an answer to what drives the machine.
#include "tools/diagnose/infer/slow_line.h"

#include <gtest/gtest.h>

#include "tests/tools/diagnose/swinging_rig.h"
#include "tools/diagnose/decide/criticism.h"
#include "tools/diagnose/decide/thresholds.h"

namespace beltgrip::diagnose {
namespace {

constexpr double kSwing_Hz = 0.4;

TEST(SlowLine, IsNoneInARampsOwnCourse) {
  EXPECT_LT(slow_line(fitted({})).excess, 0.8 * thresholds::kSlowLine);
}

TEST(SlowLine, OfTheClampForceIsToldAtItsFrequency) {
  const SpectralLine line = slow_line(fitted({.force_share = 0.004, .force_Hz = kSwing_Hz}));
  EXPECT_GT(line.excess, thresholds::kSlowLine);
  EXPECT_NEAR(line.frequency_Hz, kSwing_Hz, 0.03);
  EXPECT_EQ(line.acts_on, "clamp_force");
}

// The same swing at twice the frequency of the torque's: a bent curve answers to that there.
TEST(SlowLine, IsNoneWhereTheMachineIsDrivenSo) {
  const SpectralLine line = slow_line(fitted({.force_share = 0.02,
                                              .force_Hz = kSwing_Hz,
                                              .torque_share = 0.1,
                                              .torque_Hz = 0.5 * kSwing_Hz}));
  EXPECT_LT(line.excess, thresholds::kSlowLine);
}

TEST(SlowLine, DecidesTheVerdict) {
  const Criticism criticism = criticise(fitted({.force_share = 0.004, .force_Hz = kSwing_Hz}));
  EXPECT_FALSE(criticism.test("slow_line").passed());
  const Unexplained told = what_is_left(criticism, false);
  EXPECT_EQ(told.kind, MisfitKind::kLine);
  EXPECT_NEAR(told.frequency_Hz.value_or(0.0), kSwing_Hz, 0.03);
}

}  // namespace
}  // namespace beltgrip::diagnose
