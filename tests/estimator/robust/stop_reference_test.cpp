// The stop detector beside the same written a second time (stop_reference.h), after every cell of
// drawn ramps: torque measured or of an engine, quiet to harsh, curves that peak, level off, rise
// on or run away.
#include "tests/estimator/robust/stop_reference.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <string>

#include "estimator/robust/stop_detector.h"

namespace beltgrip::estimator {
namespace {

constexpr double kRate_hz = 200.0;
constexpr double kTraction = 6.3;  // c, 1/m: overdrive
// Derived: what keeps a division from zero in one and not in the other.
constexpr double kDigits = 1e-5;

struct Ramp {
  double peak_percent = 2.0, fall = 0.02, mu_max = 0.1;
  double torque_Nm = 30.0, torque_drift_Nm_per_s = 0.0, torque_noise_Nm = 0.1, wander_Nm = 0.0;
  double slip_noise_percent = 0.02, force_noise_N = 5.0, speed_noise_rad_s = 0.02;
  double inertia_kg_m2 = 0.0;
  double ends_percent = 9.9;
  double gains_percent_per_s = 0.25;
  double runs_away_from_s = 1e9, runs_away_percent_per_s = 0.0;
  double accelerates_rad_s2 = 2.0;  // for each percent behind the top
};

// Up to the top a parabola, behind it falling or level.
double friction(const Ramp& ramp, double slip_percent) {
  const double u = slip_percent / ramp.peak_percent;
  if (u < 1.0) return ramp.mu_max * (0.25 + 0.75 * (2.0 * u - u * u));
  return ramp.mu_max * (1.0 - ramp.fall * (u - 1.0));
}

Ramp draw(std::mt19937_64& random) {
  const auto between = [&random](double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(random);
  };
  const double noise = std::pow(10.0, between(-1.0, 0.7));
  Ramp out;
  out.peak_percent = between(0.8, 9.0);
  out.fall = between(0.0, 1.0) < 0.3 ? 0.0 : between(0.0, 0.1);
  out.torque_Nm = between(15.0, 60.0);
  out.torque_drift_Nm_per_s = between(-0.3, 0.3);
  out.torque_noise_Nm = 0.3 * noise;
  out.wander_Nm = between(0.0, 1.0) < 0.5 ? 0.0 : 0.1 * noise;
  out.slip_noise_percent = 0.03 * noise;
  out.force_noise_N = 8.0 * noise;
  out.speed_noise_rad_s = 0.02 * noise;
  out.inertia_kg_m2 = between(0.0, 1.0) < 0.5 ? 0.0 : 0.18;
  out.gains_percent_per_s = between(0.15, 1.2);
  return out;
}

struct Compared {
  int cells = 0, rising = 0, level = 0;
  StopReason stop = StopReason::kNone;
  std::string differs;
};

// Both look at the record; what they do not agree on.
std::string difference(StopDetector& detector, test::StopReference& reference,
                       const ExperimentRecord& record, StopReason& stop) {
  stop = reference.step(record);
  if (detector.step(record) != stop) return "stop";
  if (detector.level() != reference.level()) return "level";
  if (detector.rising() != reference.rising()) return "rising";
  if (detector.smallest_slip_percent() != reference.smallest_slip_percent()) return "smallest slip";
  if (std::abs(detector.slope() - reference.slope()) >
      kDigits * std::abs(reference.slope()) + 1e-9) {
    return "slope " + std::to_string(detector.slope()) + " for " +
           std::to_string(reference.slope());
  }
  return "";
}

Compared compare(const Ramp& ramp, std::mt19937_64& random) {
  std::normal_distribution<double> normal;
  ExperimentRecord record(kRate_hz);
  StopDetector detector;
  detector.reset(kTraction, ramp.inertia_kg_m2);
  test::StopReference reference(kTraction, ramp.inertia_kg_m2);
  Compared out;
  const double faded = std::exp(-1.0 / (kRate_hz * 1.2));
  double slip_percent = 0.1, wander = normal(random), omega = 110.0;
  for (int i = 0; slip_percent < ramp.ends_percent && i < 40 * kRate_hz; ++i) {
    const double t_s = i / kRate_hz;
    // Slow at first; over the top slip gains pace.
    const double pace = t_s < 1.5 ? 0.1 : slip_percent > ramp.peak_percent ? 6.0 : 1.0;
    const double runs = t_s > ramp.runs_away_from_s ? ramp.runs_away_percent_per_s : 0.0;
    slip_percent += (pace * ramp.gains_percent_per_s + runs) / kRate_hz;
    wander = faded * wander + std::sqrt(1.0 - faded * faded) * normal(random);
    const double torque = ramp.torque_Nm + ramp.torque_drift_Nm_per_s * t_s;
    const double over = std::max(0.0, slip_percent - ramp.peak_percent);
    const double acceleration =
        ramp.inertia_kg_m2 > 0.0
            ? std::min(ramp.accelerates_rad_s2 * over, 0.7 * ramp.torque_Nm / ramp.inertia_kg_m2)
            : 0.0;
    omega += acceleration / kRate_hz;
    const double carried = torque - ramp.inertia_kg_m2 * acceleration;
    const Cell sample{
        .t_s = t_s,
        .slip_percent = slip_percent + ramp.slip_noise_percent * normal(random),
        .torque_Nm = torque + ramp.wander_Nm * wander + ramp.torque_noise_Nm * normal(random),
        .clamp_force_N = kTraction * std::abs(carried) / friction(ramp, slip_percent) +
                         ramp.force_noise_N * normal(random),
        .omega_p_rad_s = omega + ramp.speed_noise_rad_s * normal(random)};
    if (!record.step(sample)) continue;
    ++out.cells;
    out.differs = difference(detector, reference, record, out.stop);
    if (!out.differs.empty()) out.differs += " at " + std::to_string(t_s) + " s";
    out.rising += reference.rising() ? 1 : 0;
    out.level += reference.level() ? 1 : 0;
    if (out.stop != StopReason::kNone || !out.differs.empty()) break;
  }
  return out;
}

TEST(StopReference, SaysTheSameAfterEveryCell) {
  std::mt19937_64 random(20);
  int slopes = 0, backups = 0, none = 0, level = 0, rising = 0;
  for (int i = 0; i < 150; ++i) {
    const Compared found = compare(draw(random), random);
    EXPECT_EQ(found.differs, "") << "ramp " << i;
    slopes += found.stop == StopReason::kSlope;
    backups += found.stop == StopReason::kSlip || found.stop == StopReason::kSlipRate;
    none += found.stop == StopReason::kNone;
    level += found.level > 0;
    rising += found.rising > 0;
  }
  // What they agree on is worth something only where all of it happened.
  EXPECT_GT(slopes, 60);
  EXPECT_GT(backups + none, 5);
  EXPECT_GT(level, 60);
  EXPECT_GT(rising, 100);
}

// Friction that rises on, so that nothing but slip itself ends it: slowly to the most that is gone
// to, or so fast that it would be beyond it soon, at any time and with any noise.
TEST(StopReference, SaysTheSameOfABeltThatRunsAway) {
  std::mt19937_64 random(22);
  int slip = 0, rate = 0, at_once = 0;
  for (int i = 0; i < 120; ++i) {
    const auto between = [&random](double low, double high) {
      return std::uniform_real_distribution<double>(low, high)(random);
    };
    Ramp ramp = draw(random);
    ramp.peak_percent = 40.0;
    ramp.ends_percent = 20.0;
    ramp.runs_away_from_s = between(0.3, 4.0);
    ramp.runs_away_percent_per_s = std::pow(10.0, between(0.3, 2.2));
    const Compared found = compare(ramp, random);
    EXPECT_EQ(found.differs, "") << "ramp " << i;
    slip += found.stop == StopReason::kSlip;
    rate += found.stop == StopReason::kSlipRate;
    at_once += found.stop == StopReason::kSlipRate && found.cells < 1.2 * kRate_hz;
  }
  EXPECT_GT(slip, 10);
  EXPECT_GT(rate, 30);
  EXPECT_GT(at_once, 10);
}

// Where all slip there is hardly shows: below the least that an elasticity is taken at, with gains
// about the smallest that is looked at, and under noise that only the longest cells average.
TEST(StopReference, SaysTheSameOfLittleSlip) {
  std::mt19937_64 random(23);
  int level = 0, rising = 0;
  for (int i = 0; i < 60; ++i) {
    const auto between = [&random](double low, double high) {
      return std::uniform_real_distribution<double>(low, high)(random);
    };
    Ramp ramp = draw(random);
    ramp.peak_percent = between(0.2, 0.6);
    ramp.gains_percent_per_s = between(0.02, 0.15);
    ramp.slip_noise_percent *= i % 3 == 0 ? 30.0 : 0.1;
    const Compared found = compare(ramp, random);
    EXPECT_EQ(found.differs, "") << "ramp " << i;
    level += found.level > 0;
    rising += found.rising > 0;
  }
  EXPECT_GT(level, 20);
  EXPECT_GT(rising, 20);
}

// What the belt no longer carries speeds the shaft up: the force falls, friction stays.
TEST(StopReference, SaysTheSameWhereTheShaftTakesTheTorque) {
  std::mt19937_64 random(25);
  int level = 0, slopes = 0;
  for (int i = 0; i < 60; ++i) {
    Ramp ramp = draw(random);
    ramp.inertia_kg_m2 = 0.18;
    ramp.fall = 0.0;
    ramp.peak_percent = std::uniform_real_distribution<double>(0.8, 4.0)(random);
    ramp.accelerates_rad_s2 = std::uniform_real_distribution<double>(50.0, 400.0)(random);
    const Compared found = compare(ramp, random);
    EXPECT_EQ(found.differs, "") << "ramp " << i;
    level += found.level > 0;
    slopes += found.stop == StopReason::kSlope;
  }
  EXPECT_GT(level, 20);
  EXPECT_GT(slopes, 10);
}

// Friction that lies level here and rises there, and slip that moves on slowly, fast or not at all:
// what was level is found and taken back many times.
TEST(StopReference, SaysTheSameOfLevelsAndRises) {
  std::mt19937_64 random(26);
  const auto one_of = [&random](std::initializer_list<double> all) {
    return all.begin()[std::uniform_int_distribution<std::size_t>(0, all.size() - 1)(random)];
  };
  std::normal_distribution<double> normal;
  int taken_back = 0;
  for (int drive = 0; drive < 60; ++drive) {
    ExperimentRecord record(kRate_hz);
    StopDetector detector;
    detector.reset(kTraction, 0.0);
    test::StopReference reference(kTraction, 0.0);
    double slip_percent = 0.1, friction = 0.04, pace = 0.1, slope = 0.02, until_s = 2.0;
    double next_percent = 0.5;
    bool was_level = false;
    for (int i = 0; i < 20 * kRate_hz && slip_percent < 9.0; ++i) {
      const double t_s = i / kRate_hz;
      if (t_s > until_s) {
        pace = one_of({0.0, 0.1, 0.3, 1.0, 3.0});
        until_s += one_of({0.3, 0.6, 1.2, 2.4});
      }
      if (slip_percent > next_percent) {
        slope = one_of({0.0, 0.0, 0.02, 0.05});
        next_percent += one_of({0.2, 0.4, 0.8});
      }
      slip_percent += pace / kRate_hz;
      friction += slope * pace / kRate_hz;
      const Cell sample{.t_s = t_s,
                        .slip_percent = slip_percent + 0.002 * normal(random),
                        .torque_Nm = 30.0 + 0.02 * normal(random),
                        .clamp_force_N = kTraction * 30.0 / friction + normal(random),
                        .omega_p_rad_s = 110.0};
      if (!record.step(sample)) continue;
      StopReason stop = StopReason::kNone;
      ASSERT_EQ(difference(detector, reference, record, stop), "") << drive << ", " << t_s << " s";
      taken_back += was_level && !detector.level();
      was_level = detector.level();
    }
  }
  EXPECT_GT(taken_back, 60);
}

// A torque against the direction is no friction, neither level nor rising.
TEST(StopReference, SaysTheSameOfATorqueTheOtherWay) {
  std::mt19937_64 random(24);
  for (int i = 0; i < 20; ++i) {
    Ramp ramp = draw(random);
    ramp.torque_Nm *= -1.0;
    const Compared found = compare(ramp, random);
    EXPECT_EQ(found.differs, "") << "ramp " << i;
    EXPECT_EQ(found.rising + found.level, 0) << "ramp " << i;
  }
}

// A detector that is used again begins anew.
TEST(StopReference, ASecondExperimentOwesNothingToTheFirst) {
  StopDetector used, fresh;
  ExperimentRecord record(kRate_hz);
  // Friction rises, lies level from a slip on, and slip stands still at another: then it was level.
  const auto drive = [&](StopDetector& detector, double level_percent, double stands_percent) {
    record.reset();
    double seen = 0.0;
    for (int i = 0; i < 2000; ++i) {
      const double slip_percent = std::min(0.1 + 0.002 * i, stands_percent);
      const Cell sample{
          .t_s = i / kRate_hz,
          .slip_percent = slip_percent,
          .torque_Nm = 30.0,
          .clamp_force_N = kTraction * 30.0 / (0.03 + 0.02 * std::min(slip_percent, level_percent)),
          .omega_p_rad_s = 110.0};
      if (!record.step(sample)) continue;
      detector.step(record);
      seen += (detector.slope() + (detector.level() ? 1.0 : 0.0)) * i;
    }
    return seen + detector.smallest_slip_percent();
  };
  used.reset(kTraction, 0.0);
  drive(used, 2.5, 4.1);  // level at its end
  used.reset(kTraction, 0.0);
  fresh.reset(kTraction, 0.0);
  EXPECT_EQ(drive(used, 0.8, 1.3), drive(fresh, 0.8, 1.3));
}

}  // namespace
}  // namespace beltgrip::estimator
