// Many foot points at once are those found one by one, bit by bit.
#include "tools/diagnose/infer/foot_points.h"

#include <gtest/gtest.h>

#include <bit>
#include <cmath>
#include <random>

namespace beltgrip::diagnose {
namespace {

constexpr int kBatches = 400;

class Draw {
 public:
  double normal() { return normal_(random_); }
  double uniform(double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(random_);
  }
  std::size_t count() {
    return std::uniform_int_distribution<std::size_t>(1, FootBatch::kMost)(random_);
  }
  CurveShape curve(double fall) {
    std::array<double, kShapeKnots> departure{};
    const double rough = std::exp(uniform(-9.0, -1.5));  // up to what no friction has
    for (double& each : departure) each = rough * normal();
    return CurveShape(departure, fall);
  }
  // slip_most: in slips at the peak.
  FootBatch batch(const CurveShape& curve, double slip_most) {
    const double peak = std::exp(uniform(-5.0, -3.0));
    const double sigma = std::exp(uniform(-12.0, -4.0));
    FootBatch out(curve, peak, uniform(0.0, 1.0));
    const double spread = std::exp(uniform(-28.0, -8.0));
    const double off = std::exp(uniform(-6.0, 0.5));  // from the curve, in capacities
    const double force_share = std::exp(uniform(-9.0, -2.0));
    const double slip_of_force = uniform(0.0, 2.0) * sigma;
    for (std::size_t i = count(); i-- > 0;) {
      const double x = uniform(-slip_most, slip_most), capacity_Nm = uniform(20.0, 150.0);
      const double torque_Nm = capacity_Nm * (curve.evaluate(x).value + off * normal());
      out.add(x * peak, torque_Nm, capacity_Nm, uniform(0.0, 1.0) < 0.3 ? 0.0 : spread,
              {sigma * sigma, std::exp(uniform(-6.0, 4.0)), force_share, slip_of_force});
    }
    return out;
  }

 private:
  std::mt19937_64 random_{20};
  std::normal_distribution<double> normal_;
};

void expect_same(const FootBatch& a, const FootBatch& b, std::size_t count) {
  const auto bits = [](double value) { return std::bit_cast<std::uint64_t>(value); };
  for (std::size_t i = 0; i < count; ++i) {
    ASSERT_EQ(bits(a.x(i)), bits(b.x(i))) << a.x(i) << " " << b.x(i);
    ASSERT_EQ(bits(a.model_Nm(i)), bits(b.model_Nm(i)));
    ASSERT_EQ(bits(a.calm(i)), bits(b.calm(i)));
    ASSERT_EQ(bits(a.slope(i)), bits(b.slope(i)));
    ASSERT_EQ(bits(a.weight(i)), bits(b.weight(i)));
    ASSERT_EQ(bits(a.value(i)), bits(b.value(i)));
  }
}

void compare(double slip_most, double fall) {
  Draw draw;
  for (int i = 0; i < kBatches; ++i) {
    const CurveShape curve = draw.curve(fall);
    FootBatch simple = draw.batch(curve, slip_most);
    FootBatch wide = simple, pairs = simple;
    simple.find_simply();
    wide.find();
    expect_same(simple, wide, simple.count());
    if (fall != 0.0) continue;
    pairs.find_in_pairs();
    expect_same(simple, pairs, simple.count());
  }
}

TEST(FootPoints, OfManySamplesAreThoseOfEach) { compare(3.0, 0.0); }

// Searches that leave the table of the curve are made anew, one by one.
TEST(FootPoints, BeyondTheTableToo) { compare(8.0, 0.0); }

TEST(FootPoints, OfACurveThatFalls) { compare(3.0, 0.1); }

// Two samples of a belt at x, in drive and overrun, whose clamp force is read too high and too low
// by one sigma of its noise: its pulleys seem to give way by more and by less.
class ForceReadWrong : public testing::TestWithParam<double> {
 protected:
  static constexpr double kPeak = 0.02, kCapacity_Nm = 80.0, kForceShare = 1e-3;
  static constexpr double kSlipOfForce = 6e-6;
  FootBatch found(double reading_share) const {
    constexpr FootNoise kNoise{1e-16, 1e-10, kForceShare, kSlipOfForce};
    FootBatch out(curve_, kPeak, reading_share);
    for (const double sigmas : {1.0, -1.0}) {
      out.add(GetParam() * kPeak - sigmas * kSlipOfForce,
              kCapacity_Nm * curve_.evaluate(GetParam()).value,
              kCapacity_Nm * (1.0 + sigmas * kForceShare), 0.0, kNoise);
    }
    out.find();
    return out;
  }

 private:
  CurveShape curve_{std::array<double, kShapeKnots>{}, 0.0};
};

// In drive, where the curve rises, the one makes up for the other; counted each for itself, the
// distance there is less than its noise. In overrun both go one way.
TEST_P(ForceReadWrong, CountsOnce) {
  const FootBatch batch = found(1.0);
  EXPECT_NEAR(std::abs(batch.value(0)), 1.0, 0.01);
  EXPECT_NEAR(batch.value(0), -batch.value(1), 0.01);
}

// Else all columns of a fit have the clamp force's noise in them.
TEST_P(ForceReadWrong, IsInNoSlopeWhereItIsNoise) {
  const FootBatch noise = found(1.0), rests = found(0.0);
  EXPECT_NEAR(noise.slope(0) / noise.slope(1), 1.0, 0.02 * kForceShare);
  EXPECT_NEAR(rests.slope(0) / rests.slope(1), 1.0 + 2.0 * kForceShare, 0.1 * kForceShare);
  EXPECT_NEAR(noise.calm(0), 1.0 - kForceShare, 0.02 * kForceShare);
  EXPECT_EQ(rests.calm(0), 1.0);
}

INSTANTIATE_TEST_SUITE_P(FootPoints, ForceReadWrong,
                         testing::Values(0.1, 0.3, 0.6, 0.95, -0.1, -0.3, -0.6, -0.95));

}  // namespace
}  // namespace beltgrip::diagnose
