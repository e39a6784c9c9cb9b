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
  double known = 0.0, carried = 0.0;
  FallRange shown_fall;  // most 0: none
  Duration stale = 50 * kMillisecond;

  double at_rad_s(double held_s) const { return begins_rad_s - slows_rad_s2 * held_s; }
  double ratio() const { return low ? 0.405 : 2.25; }
  Arming::Now now(Duration held) const {
    Arming::Now now;
    now.t = MonoTime{kSecond + held};
    now.usable = true;
    now.omega_p_rad_s = at_rad_s(seconds(held));
    now.omega_s_rad_s = now.omega_p_rad_s * ratio();
    now.torque_Nm = -torque_Nm;
    now.clamp_force_N = own_force_N;
    now.mu_max_known = known;
    now.mu_carried = carried;
    now.shown = {0.0, 0.0, shown_fall};
    now.stale = stale;
    return now;
  }

  double floor_N(double omega_p_rad_s) const {
    const double omega_s_rad_s = ratio() * omega_p_rad_s;
    return 500.0 + 0.0113 * car.experiment.secondary_pressure_floor_Pa +
           9.5e-3 * omega_s_rad_s * omega_s_rad_s;
  }
  // A belt of which nothing is known may have 0.085 to what is expected, or 5 % less or more than
  // it has carried, where that is more; one that is known 5 % less or more. Its peak lies at 2 % of
  // slip at the latest, in low at 3.5 %. Friction falls behind it by what is configured, by half of
  // that where a fault comes as well, as far as its own experiments leave that open.
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
    if (carried * 1.05 > point.mu_expected) point.mu_expected = carried * 1.05;
    if (carried * 0.95 > point.mu_least) point.mu_least = carried * 0.95;
    if (known > 0.0) {
      point.mu_expected = known * 1.05;
      point.mu_least = known * 0.95;
    }
    point.peak_slip_share = low ? 0.035 : 0.02;
    point.fall = 100.0 * car.experiment.fall_max_per_percent;
    point.fall_at_fault = 0.5 * point.fall;
    for (double* const each : {&point.fall, &point.fall_at_fault}) {
      if (shown_fall.most > 0.0 && *each > shown_fall.most) *each = shown_fall.most;
      if (shown_fall.most > 0.0 && *each < shown_fall.least) *each = shown_fall.least;
    }
    return point;
  }
  double peak_N(const RampPoint& point) const {
    return point.torque_Nm * std::cos(11.0 * std::numbers::pi / 180.0) /
           (2.0 * point.primary_radius_m * point.mu_expected);
  }
  // 600 N/s down to where a belt of 80 % of the least friction would peak, then the rate near the
  // top.
  double ramp_s(const RampPoint& point, double slip_rate_1_s, double fast_N_per_s = 600.0) const {
    const double peak = peak_N(point), answer_s = 0.135;
    double slow_N_per_s = ramp_at_the_top_N_per_s(point, answer_s, slip_rate_1_s);
    if (slow_N_per_s > fast_N_per_s) slow_N_per_s = fast_N_per_s;
    double near = peak * point.mu_expected / (0.8 * point.mu_least);
    if (own_force_N <= peak) return 0.0;
    if (own_force_N <= near) near = own_force_N;
    if (near < peak) near = peak;
    return (own_force_N - near) / fast_N_per_s + (near - peak) / slow_N_per_s;
  }
};

struct Found {
  std::uint32_t inhibits = 0;
  double figure = 0.0, limit = 0.0;  // where it is forbidden
  RequestPlan plan;                  // where it is not
  RampPoint point;                   // that decided
};

struct Searched {
  Crossing crossing;
  CrossingDenied denied;
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
  out.denied = one.denied();
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
    out.found = {
        inhibit_bit(Inhibit::kUnreachable), latest.floor_N, drive.peak_N(latest), {}, latest};
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
  const bool gains = later.crossing.peak_slip_detectable_share >
                         here.crossing.peak_slip_detectable_share + 0.001 ||
                     drive.peak_N(soon) < soon.floor_N;
  if (a * 8.0 > 0.05 * now_rad_s && needed_s + 3.0 < left_s && gains) {
    out.found.inhibits = inhibit_bit(Inhibit::kWait);
  } else if (!safe) {
    out.found = {inhibit_bit(Inhibit::kRamp), here.denied.figure, here.denied.limit, {}, soon};
  } else {
    out.found.plan = {here.crossing, soon, {}};
    out.found.point = soon;
    const double most_s = left_s < 15.0 ? left_s : 15.0;
    if (needed_s > most_s) {
      out.found.inhibits = inhibit_bit(Inhibit::kTime);
      out.found.figure = needed_s;
      out.found.limit = most_s;
    }
  }
  return out;
}

// What would do. Out of reach: at that speed the floor is the force of the peak, where it ever is.
// Too slow: that ramp ends in time and one that is a fifth slower does not; none beyond 10 kN/s,
// and in steps of a fifth from 600 N/s the fifteenth, 9244 N/s, is the last before.
void expect_would_do(const Drive& drive, const Found& found, double needed) {
  if (found.inhibits == inhibit_bit(Inhibit::kUnreachable)) {
    const bool ever = drive.floor_N(0.0) < drive.peak_N(found.point);
    ASSERT_EQ(std::isfinite(needed), ever);
    if (!ever) return;
    EXPECT_NEAR(drive.floor_N(needed), drive.peak_N(found.point), 1e-6);
  }
  if (found.inhibits == inhibit_bit(Inhibit::kTime)) {
    const auto ends = [&](double rate_N_per_s) {
      const double slip_rate_1_s = found.plan.crossing.slip_rate_1_s;
      return drive.ramp_s(found.point, slip_rate_1_s, rate_N_per_s) + 1.0 <= found.limit;
    };
    ASSERT_EQ(std::isfinite(needed), ends(600.0 * std::pow(1.2, 15) * (1.0 + 1e-9)));
    if (!std::isfinite(needed)) return;
    EXPECT_TRUE(ends(needed * (1.0 + 1e-9))) << needed;
    EXPECT_FALSE(ends(needed / 1.2 * (1.0 - 1e-9))) << needed;
  }
}

// What arming has found at the sample at which the account decides, and that it had not before.
void compare(const Drive& drive, int* count) {
  const Account expected = account(drive);
  const double last_rad_s = drive.at_rad_s(seconds(expected.decided));
  if (last_rad_s < 105.0) return;
  Arming arming(drive.car);
  for (Duration held{}; held <= expected.decided; held += kSample) {
    ASSERT_FALSE(arming.cleared()) << held;
    ASSERT_EQ(arming.inhibits() & ~inhibit_bit(Inhibit::kInputs), 0U) << held;
    arming.step(drive.now(held));
  }
  const std::uint32_t inhibits = expected.found.inhibits;
  ASSERT_EQ(arming.inhibits(), inhibits) << drive.begins_rad_s << " " << drive.slows_rad_s2;
  ASSERT_EQ(arming.cleared(), inhibits == 0U);
  ++count[inhibits == 0U ? 31 : std::countr_zero(inhibits)];
  if ((inhibits & Arming::kForbids) != 0) {
    // The fall that is survived is told a little later.
    if (arming.obstacle().wall == CrossingWall::kFall) {
      EXPECT_TRUE(std::isnan(arming.obstacle().figure));
    } else {
      EXPECT_NEAR(arming.obstacle().figure, expected.found.figure, 1e-6);
    }
    EXPECT_NEAR(arming.obstacle().limit, expected.found.limit, 1e-6);
    expect_would_do(drive, expected.found, arming.obstacle().needed);
  }
  if (inhibits != 0) return;
  const RequestPlan &plan = arming.plan(), &wanted = expected.found.plan;
  EXPECT_NEAR(plan.crossing.slip_rate_1_s, wanted.crossing.slip_rate_1_s, 1e-9);
  EXPECT_NEAR(plan.crossing.ramp_top_N_per_s, wanted.crossing.ramp_top_N_per_s, 1e-6);
  EXPECT_NEAR(plan.crossing.dearest.slip_share, wanted.crossing.dearest.slip_share, 1e-9);
  EXPECT_NEAR(plan.crossing.dearest.time_s, wanted.crossing.dearest.time_s, 1e-9);
  EXPECT_NEAR(plan.crossing.dearest.area_s, wanted.crossing.dearest.area_s, 1e-9);
  EXPECT_NEAR(plan.crossing.peak_slip_max_share, wanted.crossing.peak_slip_max_share, 1e-9);
  EXPECT_NEAR(plan.point.mu_expected, wanted.point.mu_expected, 1e-12);
  EXPECT_NEAR(plan.point.mu_least, wanted.point.mu_least, 1e-12);
  EXPECT_EQ(plan.point.primary_radius_m, wanted.point.primary_radius_m);
  EXPECT_EQ(plan.point.own_force_N, wanted.point.own_force_N);
  EXPECT_NEAR(plan.reaction.stale_s, seconds(drive.stale), 1e-12);
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
    drive.carried = i % 3 == 1 ? draw(0.06, 0.13) : 0.0;
    if (i % 4 == 1) {
      drive.shown_fall.least = draw(0.0, 0.8);
      drive.shown_fall.most = drive.shown_fall.least + draw(0.1, 1.0);
    }
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

// The last seconds of a coast-down, from where a ramp that is a little faster would do to where
// none does.
TEST(TheWay, SaysWhichRampWouldBeFastEnough) {
  int count[32] = {};
  Drive drive;
  drive.slows_rad_s2 = 4.0;
  drive.own_force_N = 9000.0;
  for (double left_s = 2.0; left_s < 12.0; left_s += 0.01) {
    drive.begins_rad_s = 105.0 + 4.0 * (1.58 + left_s);
    SCOPED_TRACE(left_s);
    compare(drive, count);
  }
  EXPECT_GT(counted(count, Inhibit::kTime), 500);
}

// A sine of two windows, of 130 ms: from one to the next its slope turns round, so that the noise
// is the steepest slope of a line through thirteen of its points. With 1.6 %/s a steep fall is seen
// after 0.4 points of slip instead of 0.3, some 25 ms later.
TEST(TheWay, ReckonsWithTheNoiseOfTheSpeeds) {
  const auto wave = [](double sample) { return std::sin(std::numbers::pi * sample / 13.0); };
  double moment = 0.0, square_s = 0.0;
  for (int i = -6; i <= 6; ++i) {
    moment += 0.005 * i * wave(i);
    square_s += 0.005 * i * 0.005 * i;
  }
  for (const bool low : {false, true}) {
    Drive drive;
    drive.low = low;
    drive.torque_Nm = low ? 20.0 : 30.0;
    drive.own_force_N = 2.5 * drive.peak_N(drive.point(130.0));
    RampPoint shaken = drive.point(130.0);
    shaken.slip_rate_noise_1_s = 0.016;
    const Crossing wanted = search(shaken, drive.stale).crossing;
    ASSERT_GT(wanted.slip_rate_1_s, 0.0);
    const Crossing quiet = search(drive.point(130.0), drive.stale).crossing;
    ASSERT_GT(wanted.dearest.time_s, quiet.dearest.time_s + 0.02);
    Arming arming(drive.car);
    for (int i = 0; i < 400; ++i) {
      Arming::Now now = drive.now(i * kSample);
      now.omega_s_rad_s *= 1.0 + 0.016 * square_s / moment * wave(i);
      arming.step(now);
    }
    ASSERT_TRUE(arming.cleared()) << low;
    EXPECT_EQ(arming.plan().crossing.slip_rate_1_s, wanted.slip_rate_1_s);
    EXPECT_NEAR(arming.plan().crossing.dearest.time_s, wanted.dearest.time_s, 0.002);
  }
}

}  // namespace
}  // namespace beltgrip::daemon
