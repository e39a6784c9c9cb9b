// The way to the belt's peak, as arming plans it: which point a request is planned for, whether it
// is in reach, whether waiting gains anything, whether there is time. Judged by an account of its
// own, for cars and drives that are drawn.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <random>

#include "daemon/core/experiment/arming.h"

namespace beltgrip::daemon {
namespace {

constexpr Duration kSample = 5 * kMillisecond;

Config config() {
  Config c;
  c.trigger = Trigger::kCoastDown;
  c.control = Control::kCommand;
  c.estimator.ratio = estimator::RatioChoice::kEither;
  c.variator.primary_inertia_kg_m2 = 0.18;
  c.variator.secondary_centrifugal_N_s2 = 9.5e-3;
  c.experiment.secondary_pressure_floor_Pa = 2e4;
  c.experiment.actuator_dead_time_s = 0.035;
  c.experiment.actuator_lag_s = 0.1;
  return c;
}

// A coast-down that slows evenly, and what is known of the belt.
struct Drive {
  Config car = config();
  bool low = false;
  double begins_rad_s = 130.0, slows_rad_s2 = 0.0, torque_Nm = 32.0, own_force_N = 4000.0;
  double known = 0.0, shown_fall = 0.0;
  Duration stale = 50 * kMillisecond;

  double at_rad_s(double held_s) const { return begins_rad_s - slows_rad_s2 * held_s; }
  double ratio() const { return low ? 0.405 : 2.25; }
  Arming::Now now(Duration held) const {
    Arming::Now now;
    now.t = kSecond + held;
    now.usable = true;
    now.omega_p_rad_s = at_rad_s(seconds(held));
    now.omega_s_rad_s = now.omega_p_rad_s * ratio();
    now.torque_Nm = -torque_Nm;
    now.clamp_force_N = own_force_N;
    now.mu_max_known = known;
    now.shown = {0.0, 0.0, shown_fall};
    now.stale = stale;
    return now;
  }

  double floor_N(double omega_p_rad_s) const {
    const double omega_s_rad_s = ratio() * omega_p_rad_s;
    return 500.0 + 0.0113 * car.experiment.secondary_pressure_floor_Pa +
           9.5e-3 * omega_s_rad_s * omega_s_rad_s;
  }
  // A belt of which nothing is known may have 0.085 to what is expected; one that is known 5 % less
  // or more. Its peak lies at 2 % of slip at the latest, in low at 3.5 %. Friction that fell behind
  // it may fall half as much again, by 0.4 at the least; of an unknown belt by what is configured,
  // half of that where a fault comes as well.
  RampPoint point(double omega_p_rad_s) const {
    RampPoint point;
    point.torque_Nm = torque_Nm;
    point.omega_p_rad_s = omega_p_rad_s;
    point.primary_radius_m = low ? 0.0324 : 0.0784;
    point.wedge_cosine = std::cos(11.0 * std::numbers::pi / 180.0);
    point.inertia_kg_m2 = 0.18;
    point.own_force_N = own_force_N;
    point.floor_N = floor_N(omega_p_rad_s);
    point.mu_expected = car.experiment.friction_expected;
    point.mu_least = car.experiment.friction_expected < 0.085 ? point.mu_expected : 0.085;
    if (known > 0.0) {
      point.mu_expected = known * 1.05;
      point.mu_least = known * 0.95;
    }
    point.peak_slip = low ? 0.035 : 0.02;
    point.fall = 100.0 * car.experiment.fall_max_per_percent;
    point.fall_at_fault = 0.5 * point.fall;
    if (shown_fall > 0.0) {
      point.fall = shown_fall * 1.5 > 0.4 ? shown_fall * 1.5 : 0.4;
      point.fall_at_fault = point.fall;
    }
    return point;
  }
  double peak_N(const RampPoint& point) const {
    return point.torque_Nm * std::cos(11.0 * std::numbers::pi / 180.0) /
           (2.0 * point.primary_radius_m * point.mu_expected);
  }
  // 600 N/s down to where a belt of 80 % of the least friction would peak, then the rate near the
  // top.
  double ramp_s(const RampPoint& point, double slip_rate_1_s) const {
    const double peak = peak_N(point), answer_s = 0.135;
    double slow_N_per_s = ramp_at_the_top_N_per_s(point, answer_s, slip_rate_1_s);
    if (slow_N_per_s > 600.0) slow_N_per_s = 600.0;
    double near = peak * point.mu_expected / (0.8 * point.mu_least);
    if (own_force_N <= peak) return 0.0;
    if (own_force_N <= near) near = own_force_N;
    if (near < peak) near = peak;
    return (own_force_N - near) / 600.0 + (near - peak) / slow_N_per_s;
  }
};

struct Found {
  std::uint32_t inhibits = 0;
  double figure = 0.0, limit = 0.0;  // where it is forbidden
  RequestPlan plan;                  // where it is not
};

struct Searched {
  Crossing crossing;
  int steps = 0;
};
Searched search(const RampPoint& point, Duration stale) {
  Reaction reaction;
  reaction.detection_s = 0.03;
  reaction.stale_s = seconds(stale);
  reaction.dead_time_s = 0.035;
  reaction.lag_s = 0.1;
  Searched out;
  CrossingSearch one(point, reaction, SlipLimits{});
  do ++out.steps;
  while (!one.step());
  out.crossing = one.crossing();
  return out;
}

// The account. It looks after 1.5 s, one excursion a sample, and decides with the last of them.
struct Account {
  Found found;
  Duration decided = 1500 * kMillisecond;
};
Account account(const Drive& drive) {
  Account out;
  const double a = drive.slows_rad_s2, omega = drive.at_rad_s(1.5);
  const double ramped = omega - a * drive.ramp_s(drive.point(omega), 0.025);
  const RampPoint soon = drive.point(ramped < 105.0 ? 105.0 : ramped);
  // It may ride the floor for 15 s, but not into the last 1.5 s of the coast-down.
  double latest_rad_s = omega - 15.0 * a;
  if (latest_rad_s < 105.0 + 1.5 * a) latest_rad_s = 105.0 + 1.5 * a;
  if (latest_rad_s > soon.omega_p_rad_s) latest_rad_s = soon.omega_p_rad_s;
  const RampPoint latest = drive.point(latest_rad_s);
  if (drive.peak_N(latest) < latest.floor_N) {
    out.found = {inhibit_bit(Inhibit::kUnreachable), latest.floor_N, drive.peak_N(latest), {}};
    return out;
  }
  const double later_rad_s = 0.95 * soon.omega_p_rad_s;
  const Searched here = search(soon, drive.stale);
  const Searched later =
      search(drive.point(later_rad_s < latest_rad_s ? latest_rad_s : later_rad_s), drive.stale);
  out.decided += (here.steps + later.steps) * kSample;

  const double now_rad_s = drive.at_rad_s(seconds(out.decided));
  const double left_s = a > 0.0 ? (now_rad_s - 105.0) / a : 1e9;
  const bool safe = here.crossing.slip_rate_1_s > 0.0;
  const double needed_s = drive.ramp_s(soon, safe ? here.crossing.slip_rate_1_s : 0.025) + 1.0;
  // Waiting is worth a tenth of a point of slip, or reach; with three seconds to spare, and where
  // the car slows by 5 % within 8 s.
  const bool gains = later.crossing.peak_slip_told > here.crossing.peak_slip_told + 0.001 ||
                     drive.peak_N(soon) < soon.floor_N;
  if (a * 8.0 > 0.05 * now_rad_s && needed_s + 3.0 < left_s && gains) {
    out.found.inhibits = inhibit_bit(Inhibit::kWait);
  } else if (!safe) {
    out.found = {inhibit_bit(Inhibit::kRamp), 0.01 * soon.fall, 0.0, {}};
  } else {
    out.found.plan = {here.crossing, soon.mu_expected, soon.mu_least, soon.primary_radius_m};
    const double most_s = left_s < 15.0 ? left_s : 15.0;
    if (needed_s > most_s) {
      out.found.inhibits = inhibit_bit(Inhibit::kTime);
      out.found.figure = needed_s;
      out.found.limit = most_s;
    }
  }
  return out;
}

// What arming has found at the sample at which the account decides, and that it had not before.
void compare(const Drive& drive, int* count) {
  const Account expected = account(drive);
  const double last_rad_s = drive.at_rad_s(seconds(expected.decided));
  if (last_rad_s < 105.0) return;
  Arming arming(drive.car);
  for (Duration held = 0; held <= expected.decided; held += kSample) {
    ASSERT_FALSE(arming.cleared()) << held;
    ASSERT_EQ(arming.inhibits() & ~inhibit_bit(Inhibit::kInputs), 0U) << held;
    arming.step(drive.now(held));
  }
  const std::uint32_t inhibits = expected.found.inhibits;
  ASSERT_EQ(arming.inhibits(), inhibits) << drive.begins_rad_s << " " << drive.slows_rad_s2;
  ASSERT_EQ(arming.cleared(), inhibits == 0U);
  ++count[inhibits == 0U ? 31 : std::countr_zero(inhibits)];
  if ((inhibits & Arming::kForbids) != 0) {
    EXPECT_NEAR(arming.obstacle().figure, expected.found.figure, 1e-6);
    EXPECT_NEAR(arming.obstacle().limit, expected.found.limit, 1e-6);
  }
  if (inhibits != 0) return;
  const RequestPlan &plan = arming.plan(), &wanted = expected.found.plan;
  EXPECT_NEAR(plan.crossing.slip_rate_1_s, wanted.crossing.slip_rate_1_s, 1e-9);
  EXPECT_NEAR(plan.crossing.ramp_top_N_per_s, wanted.crossing.ramp_top_N_per_s, 1e-6);
  EXPECT_NEAR(plan.crossing.dearest.slip, wanted.crossing.dearest.slip, 1e-9);
  EXPECT_NEAR(plan.crossing.dearest.time_s, wanted.crossing.dearest.time_s, 1e-9);
  EXPECT_NEAR(plan.crossing.dearest.area_s, wanted.crossing.dearest.area_s, 1e-9);
  EXPECT_NEAR(plan.crossing.dearest.late_s, wanted.crossing.dearest.late_s, 1e-9);
  EXPECT_NEAR(plan.crossing.peak_slip_max, wanted.crossing.peak_slip_max, 1e-9);
  EXPECT_NEAR(plan.mu_expected, wanted.mu_expected, 1e-12);
  EXPECT_NEAR(plan.mu_least, wanted.mu_least, 1e-12);
  EXPECT_EQ(plan.primary_radius_m, wanted.primary_radius_m);
}

int counted(const int* count, Inhibit inhibit) { return count[static_cast<std::size_t>(inhibit)]; }

TEST(TheWay, IsWhatAnotherAccountSays) {
  int count[32] = {};
  std::mt19937_64 random(21);
  const auto draw = [&](double from, double to) {
    return std::uniform_real_distribution<double>(from, to)(random);
  };
  for (int i = 0; i < 5000 && !::testing::Test::HasFatalFailure(); ++i) {
    Drive drive;
    drive.low = i % 3 == 2;
    drive.begins_rad_s = draw(107.0, drive.low ? 250.0 : 180.0);
    drive.slows_rad_s2 = draw(0.0, 1.0) < 0.2 ? 0.0 : draw(0.2, 7.0);
    drive.torque_Nm = draw(12.0, i % 5 == 0 ? 70.0 : 40.0);
    drive.own_force_N = draw(0.8, 3.5) * drive.peak_N(drive.point(120.0));
    drive.known = i % 4 == 0 ? draw(0.08, 0.12) : 0.0;
    drive.shown_fall = i % 4 == 1 ? draw(0.1, 0.6) : 0.0;
    drive.car.experiment.friction_expected = i % 7 == 0 ? draw(0.075, 0.095) : 0.11;
    drive.car.experiment.secondary_pressure_floor_Pa = draw(5e3, 6e4);
    drive.stale = (50 + 40 * (i % 4)) * kMillisecond;
    SCOPED_TRACE(i);
    compare(drive, count);
  }
  // Every answer is among them.
  for (const Inhibit each :
       {Inhibit::kUnreachable, Inhibit::kWait, Inhibit::kRamp, Inhibit::kTime}) {
    EXPECT_GT(counted(count, each), 30) << static_cast<int>(each);
  }
  EXPECT_GT(count[31], 100);
}

}  // namespace
}  // namespace beltgrip::daemon
