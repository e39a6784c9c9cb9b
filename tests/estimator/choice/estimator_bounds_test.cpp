// What holds for every method whatever comes in: outputs are finite, unusable samples leave no
// trace, the same samples give the same bits, and nothing is allocated after construction.
#include <gtest/gtest.h>

#include <bit>
#include <cmath>
#include <cstdint>
#include <limits>
#include <memory>
#include <random>
#include <vector>

#include "estimator/choice/make_estimator.h"
#include "estimator/method/slip_curve_estimator.h"
#include "tests/estimator/choice/rig_trace.h"
#include "tests/support/alloc_guard.h"

namespace beltgrip::estimator {
namespace {

using test::AllocGuard;
using test::Rig;
using test::TracePoint;

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
constexpr double kInfinity = std::numeric_limits<double>::infinity();

std::vector<double> numbers(const CurveEstimate& e) {
  return {e.mu_star,       e.sigma_star_percent, e.slip_variance, e.friction_slope,
          e.clamp_force_N, e.torque_p_Nm,        e.slip_energy_J};
}
std::vector<double> numbers(const PeakEstimate& e) {
  return {e.mu_max, e.mu_max_std, e.ci95_low, e.ci95_high, e.sigma_peak_percent};
}

using Bits = std::vector<std::uint64_t>;
Bits bits(const CurveEstimate& e) {
  Bits out = {static_cast<std::uint64_t>(e.t_ns),     static_cast<std::uint64_t>(e.phase),
              static_cast<std::uint64_t>(e.stop),     static_cast<std::uint64_t>(e.direction),
              static_cast<std::uint64_t>(e.end_stop), e.usable};
  for (const double number : numbers(e)) out.push_back(std::bit_cast<std::uint64_t>(number));
  return out;
}
Bits bits(const PeakEstimate& e) {
  Bits out = {static_cast<std::uint64_t>(e.kind), static_cast<std::uint64_t>(e.samples)};
  for (const double number : numbers(e)) out.push_back(std::bit_cast<std::uint64_t>(number));
  return out;
}

void conclude(SlipCurveEstimator& estimator) {
  int calls = 0;
  while (!estimator.conclude()) ASSERT_LT(++calls, 10000);
}

class EveryMethod : public testing::TestWithParam<Method> {
 protected:
  std::unique_ptr<SlipCurveEstimator> estimator(const Rig& rig = {}) const {
    EstimatorSettings settings = rig_settings(rig);
    settings.method = GetParam();
    return make_slip_curve_estimator(settings, {}, {});
  }
};

TEST_P(EveryMethod, AnUnusableSampleLeavesNoTrace) {
  Rig rig;
  rig.ramp_N_per_s = 100.0;
  const auto trace = rig_trace(rig);
  const auto plain = estimator();
  const auto disturbed = estimator();
  int kind = 0;
  for (const TracePoint& point : trace) {
    if (point.sample.t_ns > 0 && ++kind % 3 == 0) {
      VariatorSample bad = point.sample;
      bad.t_ns -= 1;
      bad.torque_Nm = -3e4;
      bad.omega_s_rad_s = 0.0;
      if (kind % 9 == 0) {
        bad.usable = false;
      } else if (kind % 9 == 3) {
        bad.omega_p_rad_s = kNaN;
      } else {
        bad.secondary_pressure_Pa = -kInfinity;
      }
      ASSERT_FALSE(disturbed->step(bad).usable);
    }
    ASSERT_EQ(bits(disturbed->step(point.sample)), bits(plain->step(point.sample)));
  }
  conclude(*plain);
  conclude(*disturbed);
  EXPECT_EQ(bits(plain->peak()), bits(disturbed->peak()));
  EXPECT_NE(plain->peak().kind, PeakKind::kNone);
}

TEST_P(EveryMethod, ASecondRunAfterResetGivesTheSameBits) {
  Rig rig;
  rig.ramp_N_per_s = 100.0;
  const auto trace = rig_trace(rig);
  Rig other = rig;
  other.torque_Nm = -35.0;
  const auto disturbance = rig_trace(other);
  const auto reused = estimator();
  Bits first, second;
  for (Bits* all : {&first, &second}) {
    for (const TracePoint& point : trace) {
      const Bits now = bits(reused->step(point.sample));
      all->insert(all->end(), now.begin(), now.end());
    }
    conclude(*reused);
    const Bits peak = bits(reused->peak());
    all->insert(all->end(), peak.begin(), peak.end());
    // What comes between leaves nothing behind.
    reused->reset();
    for (const TracePoint& point : disturbance) reused->step(point.sample);
    conclude(*reused);
    reused->reset();
  }
  EXPECT_TRUE(first == second);
}

TEST_P(EveryMethod, NothingInNothingOut) {
  const auto fresh = estimator();
  conclude(*fresh);
  EXPECT_EQ(fresh->peak().kind, PeakKind::kNone);
  EXPECT_FALSE(fresh->step({}).usable);
  conclude(*fresh);
  EXPECT_EQ(fresh->peak().kind, PeakKind::kNone);
}

// Puts values without sense into a sample: far off, of every size and sign, not numbers.
class Garbage {
 public:
  explicit Garbage(std::uint64_t seed) : random_(seed) {}
  // One value in so many from now on.
  void rarity(unsigned one_in) { one_in_ = one_in; }
  VariatorSample operator()(VariatorSample sample) {
    for (double* field : {&sample.omega_p_rad_s, &sample.omega_s_rad_s,
                          &sample.secondary_pressure_Pa, &sample.torque_Nm}) {
      if (random_() % one_in_ == 0) *field = value(*field);
    }
    if (random_() % one_in_ == 0) {
      sample.t_ns += static_cast<std::int64_t>(random_() % 4'000'000'000) - 2'000'000'000;
    }
    sample.usable = random_() % one_in_ != 1;
    return sample;
  }

 private:
  double unit() { return static_cast<double>(random_() >> 11) * 0x1p-53; }
  double value(double usual) {
    switch (random_() % 8) {
      case 0:
        return 0.0;
      case 1:
        return -usual * unit();
      case 2:
        return (unit() - 0.5) * std::pow(10.0, 616.0 * unit() - 308.0);  // of every size
      case 3:
        return unit() < 0.5 ? std::numeric_limits<double>::max()
                            : std::numeric_limits<double>::denorm_min();
      case 4:
        return unit() < 0.5 ? kNaN : kInfinity;
      default:
        return usual * std::pow(10.0, 12.0 * unit() - 6.0);
    }
  }

  std::mt19937_64 random_;
  unsigned one_in_ = 1;
};

TEST_P(EveryMethod, GarbageGivesFiniteNumbers) {
  Rig rig;
  rig.ramp_N_per_s = 150.0;
  const auto trace = rig_trace(rig);
  const auto subject = estimator(rig);
  Garbage garbage(7);
  int samples = 0, usable = 0, peaks = 0;
  for (int run = 0; samples < 200'000; ++run) {
    const unsigned rarities[] = {5000, 1000, 100, 10, 1};
    garbage.rarity(rarities[run % 5]);
    for (const TracePoint& point : trace) {
      const VariatorSample sample = garbage(point.sample);
      const CurveEstimate& now = subject->step(sample);
      ++samples;
      usable += now.usable;
      for (const double number : numbers(now)) {
        ASSERT_TRUE(std::isfinite(number))
            << "run " << run << ", " << sample.t_ns << " ns: " << sample.omega_p_rad_s << ' '
            << sample.omega_s_rad_s << ' ' << sample.secondary_pressure_Pa << ' '
            << sample.torque_Nm;
      }
    }
    conclude(*subject);
    peaks += subject->peak().kind != PeakKind::kNone;
    for (const double number : numbers(subject->peak())) {
      ASSERT_TRUE(std::isfinite(number)) << "peak of run " << run;
    }
    if (subject->peak().kind == PeakKind::kValue) {
      ASSERT_GT(subject->peak().mu_max_std, 0.0) << run;
    }
    subject->reset();
  }
  // The garbage got in.
  EXPECT_GT(usable, 10'000);
  EXPECT_GT(peaks, 10);
}

TEST_P(EveryMethod, AllocatesNothingAfterConstruction) {
  Rig rig;
  rig.ramp_N_per_s = 100.0;
  const auto trace = rig_trace(rig);
  const auto subject = estimator();
  const AllocGuard guard;
  for (int runs = 0; runs < 2; ++runs) {
    for (const TracePoint& point : trace) {
      if (subject->step(point.sample).stop != StopReason::kNone) break;
    }
    while (!subject->conclude()) {
    }
    subject->reset();
  }
  const std::size_t allocations = AllocGuard::allocations();
  const std::size_t frees = AllocGuard::frees();
  EXPECT_EQ(allocations, 0U) << "the first of " << AllocGuard::first_size() << " bytes";
  EXPECT_EQ(frees, 0U);
}

TEST(AllocGuardHere, SeesAnAllocation) {
  const AllocGuard guard;
  const auto planted = std::make_unique<volatile int>(1);
  EXPECT_EQ(AllocGuard::allocations(), 1U);
}

INSTANTIATE_TEST_SUITE_P(Methods, EveryMethod, testing::Values(Method::kPaper, Method::kRobust),
                         [](const auto& each) {
                           return each.param == Method::kPaper ? "paper" : "robust";
                         });

}  // namespace
}  // namespace beltgrip::estimator
