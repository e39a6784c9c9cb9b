// The amplitude of what a speed does once per revolution, at any speed and sample rate: what the
// smoothing beside it takes away is given back.
#include "tools/diagnose/data/order_lines.h"

#include <gtest/gtest.h>

#include <cmath>

#include "tools/diagnose/data/signal_table.h"

namespace beltgrip::diagnose {
namespace {

// A shaft at omega_rad_s whose sensor's wheel runs out; no noise but the resolution.
Channel speed_with_ripple(double omega_rad_s, double amplitude, double period_s) {
  Channel out;
  for (int i = 0; i < static_cast<int>(60.0 / period_s); ++i) {
    const double t = i * period_s;
    const double value = omega_rad_s * (1.0 + amplitude * std::sin(omega_rad_s * t + 0.4));
    out.t_s.push_back(t);
    out.value.push_back(std::round(value / 0.001) * 0.001);
  }
  return out;
}

TEST(OrderLine, AmplitudeIsThatOfTheSensorAtEverySpeed) {
  constexpr double kAmplitude = 1.4e-3;
  for (const double period_s : {0.01, 0.005}) {
    for (const double omega_rad_s : {27.3, 52.0, 78.0, 81.7, 104.0, 131.0, 236.0}) {
      const OrderLine line = order_line(speed_with_ripple(omega_rad_s, kAmplitude, period_s));
      ASSERT_GE(line.pieces, 10) << omega_rad_s;
      // An unfinished revolution of a piece of four seconds leaks.
      const double share = 0.003 + 0.5 / (4.0 * omega_rad_s);
      EXPECT_NEAR(line.amplitude(), kAmplitude, share * kAmplitude)
          << omega_rad_s << " rad/s, every " << period_s << " s";
    }
  }
}

}  // namespace
}  // namespace beltgrip::diagnose
