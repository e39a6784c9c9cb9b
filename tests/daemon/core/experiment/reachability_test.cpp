// Reachability and choice of the crossing: the closed forms against a numeric integration of the
// same motion, written here anew, over torque, slip rate, fall and lag; the crossing against the
// limits.
#include "daemon/core/experiment/reachability.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

namespace beltgrip::daemon {
namespace {

RampPoint point(double torque_Nm, double omega_p = 140.0) {
  RampPoint p;
  p.torque_Nm = torque_Nm;
  p.omega_p_rad_s = omega_p;
  p.primary_radius_m = 0.0784;
  p.wedge_cosine = std::cos(11.0 / 57.29577951308232);
  p.inertia_kg_m2 = 0.18;
  p.own_force_N = (torque_Nm + 25.0) * p.wedge_cosine / (2.0 * 0.0784 * 0.09);
  p.floor_N = 1500.0;
  p.mu_expected = 0.105;
  p.mu_least = 0.085;
  p.fall = 0.8;
  p.fall_at_fault = 0.4;
  p.peak_slip_share = 0.02;
  return p;
}

Reaction reaction(double lag_s) { return {0.03, 0.05, 0.05, 0.01, 0.035, lag_s}; }

CrossingSearch searched(const RampPoint& p, const Reaction& r) {
  CrossingSearch search(p, r, SlipLimits{});
  while (!search.step()) {
  }
  while (!search.fall_known()) search.step_fall();
  return search;
}

// Explicit Euler with a microsecond-fine step, states and events written out.
Excursion integrated(const RampPoint& p, const Reaction& r, double slip_rate, double fall,
                     double slip_detectable_share, double reaction_s) {
  const double dt = 2e-6;
  const double peak_N = p.torque_Nm * p.wedge_cosine / (2.0 * p.primary_radius_m * p.mu_least);
  const double gain = p.torque_Nm * 1.05 / (p.inertia_kg_m2 * p.omega_p_rad_s);
  // The force that is missing at the top, and stays away until the actuator answers.
  const double low_N = peak_N * (1.0 - slip_rate / gain);
  double force_N = low_N, t = 0.0, seen_s = -1.0, told_s = -1.0, x = 0.0;
  Excursion out;
  while (t < 5.0) {
    if (seen_s < 0.0 && x >= slip_detectable_share) seen_s = t;
    if (seen_s >= 0.0 && told_s < 0.0 && t >= seen_s + r.detection_s + reaction_s + r.dead_time_s) {
      told_s = t;
    }
    if (told_s >= 0.0) {
      force_N = p.own_force_N + (low_N - p.own_force_N) * std::exp(-(t - told_s) / r.lag_s);
    }
    x += dt * gain * ((peak_N - force_N) / peak_N + fall * x / p.mu_least);
    t += dt;
    if (x <= 0.0 || x > 10.0) break;
    out.slip_share = std::max(out.slip_share, x);
    out.area_s += dt * x;
  }
  out.time_s = t;
  return out;
}

TEST(Reachability, LargestFrictionAtTheFloor) {
  RampPoint p = point(20.0);
  // 20 Nm at a floor of 2690 N: variator-facts 4.3, 60 km/h in overdrive with 0.1 MPa.
  p.floor_N = 500.0 + 0.0113 * 1e5 + 9.5e-3 * 300.0 * 300.0;
  EXPECT_NEAR(reachable_mu(p), 0.050, 0.0008);
  EXPECT_NEAR(peak_force_N(p, reachable_mu(p)), p.floor_N, 1e-9);
}

TEST(Reachability, ClosedFormAgainstIntegrationOverTorqueSlipRateFallAndLag) {
  int caught = 0, lost = 0;
  for (const double torque : {15.0, 25.0, 35.0, 50.0}) {
    for (const double rate : {0.01, 0.025, 0.04}) {
      for (const double fall : {0.05, 0.4, 0.8}) {
        for (const double lag : {0.05, 0.1, 0.15}) {
          for (const double reaction_s : {0.01, 0.06}) {
            const RampPoint p = point(torque);
            const Reaction r = reaction(lag);
            const Excursion closed = excursion(p, r, rate, fall, 0.005, reaction_s);
            const Excursion exact = integrated(p, r, rate, fall, 0.005, reaction_s);
            SCOPED_TRACE(testing::Message() << torque << " Nm " << rate << " /s fall " << fall
                                            << " lag " << lag << " reaction " << reaction_s);
            if (exact.slip_share > 1.0) {
              ++lost;
              EXPECT_GT(closed.slip_share, 0.10);
              continue;
            }
            ++caught;
            EXPECT_NEAR(closed.slip_share, exact.slip_share, 0.01 * exact.slip_share);
            EXPECT_NEAR(closed.time_s, exact.time_s, 0.01 * exact.time_s);
            EXPECT_NEAR(closed.area_s, exact.area_s, 0.01 * exact.area_s + 1e-5);
          }
        }
      }
    }
  }
  EXPECT_GT(caught, 100);
  EXPECT_GT(lost, 5);
}

// From where it is: by the same motion, stepped.
double stepped_J(const RampPoint& p, const Reaction& r, const Beyond& now, double told_s) {
  const double dt = 2e-6, peak_N = peak_force_N(p, p.mu_least);
  const double gain = p.torque_Nm * 1.05 / (p.inertia_kg_m2 * p.omega_p_rad_s);
  // As steep a fall as is assumed, or as steep as explains all of the rate.
  const double most = now.slip_rate_1_s / now.beyond_share * p.mu_least / gain;
  const double fall = std::min(p.fall, most);
  const double low_N =
      peak_N * (1.0 - now.slip_rate_1_s / gain + fall * now.beyond_share / p.mu_least);
  double x = now.beyond_share, t = 0.0, energy_J = 0.0;
  while (x > 0.0 && x < 10.0) {
    const double answers_s = t - told_s - r.dead_time_s;
    const double force_N =
        answers_s < 0.0 ? low_N
                        : p.own_force_N + (low_N - p.own_force_N) * std::exp(-answers_s / r.lag_s);
    energy_J += dt * p.torque_Nm * p.omega_p_rad_s * (now.slip_share - now.beyond_share + x);
    x += dt * gain * ((peak_N - force_N) / peak_N + fall * x / p.mu_least);
    t += dt;
  }
  return x > 0.0 ? 1e9 : energy_J;
}

TEST(Reachability, TheEnergyToComeIsThatOfTheSameMotionStepped) {
  int caught = 0, lost = 0;
  for (const double torque_Nm : {15.0, 30.0, 50.0}) {
    for (const double mu : {0.07, 0.085, 0.12}) {
      for (const double beyond : {0.001, 0.005, 0.015}) {
        for (const double rate_1_s : {0.01, 0.03, 0.09}) {
          for (const double told_s : {0.03, 0.08}) {
            RampPoint p = point(torque_Nm);
            p.mu_least = mu;
            const Reaction r = reaction(0.1);
            const Beyond now{.slip_share = 0.05, .beyond_share = beyond, .slip_rate_1_s = rate_1_s};
            const double exact_J = stepped_J(p, r, now, told_s);
            const double closed_J = energy_to_come_J(p, r, now, told_s);
            SCOPED_TRACE(testing::Message() << torque_Nm << " Nm, mu " << mu << ", beyond "
                                            << beyond << ", " << rate_1_s << " /s " << told_s);
            if (exact_J > 1e6) {
              ++lost;
              EXPECT_GT(closed_J, 1e6);
              continue;
            }
            ++caught;
            EXPECT_NEAR(closed_J, exact_J, 0.01 * exact_J);
          }
        }
      }
    }
  }
  EXPECT_GT(caught, 80);
  EXPECT_GT(lost, 5);
}

// Slower is dearer: time beyond the peak, and with it energy, grows as the crossing creeps.
TEST(Reachability, CreepingOverThePeakTakesLonger) {
  const Reaction r = reaction(0.1);
  const double fast = excursion(point(30.0), r, 0.03, 0.05, 0.008, 0.01).time_s;
  EXPECT_GT(excursion(point(30.0), r, 0.01, 0.05, 0.008, 0.01).time_s, 1.5 * fast);
}

TEST(Reachability, WorseInEveryRespectIsWorse) {
  const auto slip_share = [](const RampPoint& p, const Reaction& r, double rate, double fall,
                             double reaction_s) {
    return excursion(p, r, rate, fall, 0.003, reaction_s).slip_share;
  };
  const Reaction r = reaction(0.1);
  const double base = slip_share(point(30.0), r, 0.02, 0.4, 0.06);
  EXPECT_GT(slip_share(point(35.0), r, 0.02, 0.4, 0.06), base);
  EXPECT_GT(slip_share(point(30.0), r, 0.03, 0.4, 0.06), base);
  EXPECT_GT(slip_share(point(30.0), r, 0.02, 0.6, 0.06), base);
  EXPECT_GT(slip_share(point(30.0), r, 0.02, 0.4, 0.08), base);
  EXPECT_GT(slip_share(point(30.0), reaction(0.15), 0.02, 0.4, 0.06), base);
  EXPECT_GT(slip_share(point(30.0, 110.0), r, 0.02, 0.4, 0.06), base);
  RampPoint light = point(30.0);
  light.inertia_kg_m2 = 0.12;
  EXPECT_GT(slip_share(light, r, 0.02, 0.4, 0.06), base);
}

TEST(Reachability, AForceThatCannotCatchTheBeltIsNoEnd) {
  RampPoint p = point(50.0);
  p.own_force_N = peak_force_N(p, p.mu_least);  // the controller's own force is no more than that
  EXPECT_GT(excursion(p, reaction(0.1), 0.03, 0.4, 0.003, 0.06).slip_share, 1.0);
  EXPECT_EQ(searched(p, reaction(0.1)).crossing().slip_rate_1_s, 0.0);
}

// exp(200 1/s * 5 s) is more than a double holds. The own force is strong but slow: x is 0.002 when
// the actuator is told, of which it takes back 5 * 2 / (200 * 202 * 0.5) = 0.0005.
TEST(Reachability, ARunawayBeyondAllFiguresIsNotCaught) {
  RampPoint p = point(50.0);
  p.inertia_kg_m2 = 0.075;
  p.mu_least = 0.05;
  p.own_force_N = 3.0 * peak_force_N(p, p.mu_least);
  Reaction r;
  r.lag_s = 0.5;
  EXPECT_GT(excursion(p, r, 0.02, 2.0, 0.002, 0.0).slip_share, 1.0);
}

// The force that is on its way at the top is what the ramp fell within the actuator's answer.
TEST(Reachability, TheRampAtTheTopHoldsTheSlipRate) {
  const RampPoint p = point(30.0);
  const double rate_N_per_s = ramp_at_the_top_N_per_s(p, 0.125, 0.025);
  const double missing = rate_N_per_s * 0.125 / peak_force_N(p, p.mu_expected);
  EXPECT_NEAR(missing * 30.0 * 1.05 / (0.18 * 140.0), 0.025, 1e-12);
}

// 10 %, 0.8 m/s and 90 J, by the integration: at the latest peak that has room the crossing keeps
// all of them and meets one. On a flat top the request ends itself, what is still to come counted.
TEST(Reachability, TheCrossingKeepsEveryLimitAtTheLatestPeakWithRoom) {
  int found = 0, refused = 0;
  for (double torque = 10.0; torque <= 70.0; torque += 10.0) {
    for (double omega = 105.0; omega <= 195.0; omega += 30.0) {
      for (const double lag : {0.05, 0.1, 0.15, 0.3}) {
        const RampPoint p = point(torque, omega);
        const Reaction r = reaction(lag);
        const Crossing crossing = searched(p, r).crossing();
        SCOPED_TRACE(testing::Message() << torque << " Nm " << omega << " rad/s lag " << lag);
        if (crossing.slip_rate_1_s <= 0.0) {
          ++refused;
          continue;
        }
        ++found;
        EXPECT_GT(crossing.peak_slip_max_share, p.peak_slip_share);
        double nearest = 0.0;
        const auto expect_kept = [&](double fall, double to_see, double reaction_s) {
          const Excursion e = integrated(p, r, crossing.slip_rate_1_s, fall, to_see, reaction_s);
          const double slip_share = crossing.peak_slip_max_share + e.slip_share;
          // On a flat top the request ends itself.
          const double energy_J =
              fall > 0.05 ? (crossing.peak_slip_max_share * e.time_s + e.area_s) * torque * omega
                          : 0.0;
          for (const double share :
               {slip_share / 0.10, slip_share * omega * 0.0784 / 0.8, energy_J / 90.0}) {
            EXPECT_LT(share, 1.02);
            nearest = std::max(nearest, share);
          }
        };
        expect_kept(0.8, 0.003, 0.01);
        expect_kept(0.05, 0.008, 0.01);
        expect_kept(0.4, 0.003, 0.06);
        expect_kept(0.05, 0.008, 0.06);
        EXPECT_GT(nearest, 0.85);
      }
    }
  }
  EXPECT_GT(found, 40);
  EXPECT_GT(refused, 20);
}

TEST(Reachability, ASlowInputCostsRoom) {
  Reaction slow = reaction(0.1);
  slow.stale_s = 0.25;  // 10 Hz
  EXPECT_LT(searched(point(20.0), slow).crossing().peak_slip_max_share,
            searched(point(20.0), reaction(0.1)).crossing().peak_slip_max_share);
}

// What the noise of the slip rate hides is seen later: 0.35 s of it, where that is more than 0.3
// points.
TEST(Reachability, NoiseOfTheSlipRateCostsRoom) {
  RampPoint quiet = point(25.0), loud = quiet, louder = quiet;
  loud.slip_rate_noise_1_s = 0.008;
  louder.slip_rate_noise_1_s = 0.02;
  const Reaction r = reaction(0.08);
  const double rate = searched(quiet, r).crossing().slip_rate_1_s;
  ASSERT_EQ(rate, 0.025);
  EXPECT_EQ(searched(loud, r).crossing().dearest.slip_share,
            searched(quiet, r).crossing().dearest.slip_share);
  ASSERT_EQ(searched(louder, r).crossing().slip_rate_1_s, rate);
  EXPECT_EQ(searched(louder, r).crossing().dearest.slip_share,
            std::max(excursion(louder, r, rate, 0.8, 0.007, 0.01).slip_share,
                     excursion(louder, r, rate, 0.4, 0.007, 0.06).slip_share));
}

// A crossing that would run on for more than 2.5 points is none, whatever room there is.
TEST(Reachability, ACrossingNearToNotBeingCaughtIsNone) {
  for (double torque = 15.0; torque < 50.0; torque += 1.0) {
    const Crossing crossing = searched(point(torque), reaction(0.12)).crossing();
    if (crossing.slip_rate_1_s > 0.0) {
      EXPECT_LT(crossing.dearest.slip_share, 0.025) << torque;
    }
  }
  EXPECT_EQ(searched(point(49.0), reaction(0.12)).crossing().slip_rate_1_s, 0.0);
}

// A faster shaft slips faster at the same slip, and dissipates more.
TEST(Reachability, ThereIsLessRoomAtAHigherSpeed) {
  const Crossing crossing = searched(point(25.0), reaction(0.08)).crossing();
  ASSERT_GT(crossing.slip_rate_1_s, 0.0);
  EXPECT_LT(peak_slip_max_share(crossing, SlipLimits{}, 25.0, 170.0, 0.0784),
            peak_slip_max_share(crossing, SlipLimits{}, 25.0, 130.0, 0.0784));
}

// At 30 Nm and 140 rad/s a whole turn of slip is 4200 W, and 0.8 m/s are 7.29 %. With a point of
// slip on its way: that limit leaves 6.29 %; 90 J in 0.4 s, with 0.2 % s on its way, 4.86 %.
TEST(Reachability, TheNearestLimitDecides) {
  const auto room = [](const Excursion& dearest) {
    Crossing crossing;
    crossing.dearest = dearest;
    return peak_slip_max_share(crossing, SlipLimits{}, 30.0, 140.0, 0.0784);
  };
  EXPECT_NEAR(room({0.01, 0.1, 0.002}), 0.0629, 1e-4);
  EXPECT_NEAR(room({0.01, 0.4, 0.002}), 0.0486, 1e-4);
}

// Two slip rates, each with a steep and a flat top, with and without a silence; the excursions
// are those held against the integration above. The energy of a steep fall counts; a flat top tells
// the latest peak for which 70 J last for 0.8 points and the answer.
Crossing chosen(const RampPoint& p, const Reaction& r) {
  Crossing best;
  for (const double rate : {0.025, 0.02}) {
    Crossing tried;
    Excursion level;
    for (const double silence_s : {0.0, std::max(r.stale_s, r.timeout_s)}) {
      const double fall = silence_s > 0.0 ? p.fall_at_fault : p.fall;
      const double reaction_s = silence_s + r.cycle_s;
      const Excursion steep = excursion(p, r, rate, fall, 0.003, reaction_s);
      const Excursion flat = excursion(p, r, rate, 0.05, 0.008, reaction_s);
      tried.dearest.slip_share =
          std::max({tried.dearest.slip_share, steep.slip_share, flat.slip_share});
      tried.dearest.time_s = std::max(tried.dearest.time_s, steep.time_s);
      tried.dearest.area_s = std::max(tried.dearest.area_s, steep.area_s);
      level.time_s = std::max(level.time_s, flat.time_s);
      level.area_s = std::max(level.area_s, flat.area_s);
    }
    tried.slip_rate_1_s = rate;
    // Of the force that is missing at the top, w seconds' worth a second.
    const double peak_N = p.torque_Nm * p.wedge_cosine / (2.0 * p.primary_radius_m * p.mu_expected);
    const double w = p.torque_Nm * 1.05 / (p.inertia_kg_m2 * p.omega_p_rad_s);
    tried.ramp_top_N_per_s = rate / w * peak_N / (r.dead_time_s + r.lag_s);
    tried.peak_slip_max_share =
        peak_slip_max_share(tried, {}, p.torque_Nm, p.omega_p_rad_s, p.primary_radius_m);
    const double turn_W = p.torque_Nm * p.omega_p_rad_s;
    tried.peak_slip_detectable_share =
        std::min(tried.peak_slip_max_share, (70.0 / turn_W - level.area_s) / level.time_s);
    if (tried.dearest.slip_share < 0.025 && tried.peak_slip_max_share > p.peak_slip_share &&
        tried.peak_slip_detectable_share > best.peak_slip_detectable_share) {
      best = tried;
    }
  }
  return best;
}

// Of one rate alone, and what it costs, as in the search over all.
TEST(Reachability, ASearchOfOneRateTriesNoOther) {
  const RampPoint p = point(25.0);
  const Reaction r = reaction(0.08);
  for (const double rate_1_s : {0.025, 0.02}) {
    CrossingSearch one(p, r, SlipLimits{}, rate_1_s);
    int steps = 1;
    while (!one.step()) ++steps;
    EXPECT_EQ(steps, 4);
    EXPECT_EQ(one.crossing().slip_rate_1_s, rate_1_s);
    EXPECT_EQ(one.crossing().dearest.time_s,
              std::max(excursion(p, r, rate_1_s, 0.8, 0.003, 0.01).time_s,
                       excursion(p, r, rate_1_s, 0.4, 0.003, 0.06).time_s));
  }
}

TEST(Reachability, TheSearchTakesTheRateThatTellsTheLatestPeak) {
  int found = 0, none = 0;
  double rates[2] = {};
  for (const double torque : {8.0, 15.0, 25.0, 35.0, 45.0}) {
    for (const double omega : {100.0, 140.0, 200.0, 300.0}) {
      for (const double lag : {0.02, 0.1, 0.2}) {
        for (const double at_fault : {0.1, 0.4}) {
          RampPoint p = point(torque, omega);
          p.fall_at_fault = at_fault;
          Reaction r = reaction(lag);
          r.stale_s = 0.04 + lag;  // longer or shorter than the time-out
          CrossingSearch search(p, r, SlipLimits{});
          int steps = 1;
          while (!search.step()) ++steps;
          const Crossing wanted = chosen(p, r);
          EXPECT_EQ(steps, 8);
          // Where a fall stands in the way, the one that is survived takes six halvings.
          const bool runs_on = search.denied().wall == CrossingWall::kFall;
          EXPECT_EQ(search.fall_known(), !runs_on);
          int tells = 0;
          for (; !search.fall_known() && tells < 20; ++tells) search.step_fall();
          EXPECT_LE(tells, runs_on ? 12 : 0);
          EXPECT_GE(tells, runs_on ? 6 : 0);
          EXPECT_EQ(search.denied().wall == CrossingWall::kNone, wanted.slip_rate_1_s > 0.0);
          for (int i = 0; i < 2; ++i) {  // once done, it stays as it is
            const Crossing& crossing = search.crossing();
            EXPECT_EQ(crossing.slip_rate_1_s, wanted.slip_rate_1_s);
            EXPECT_NEAR(crossing.ramp_top_N_per_s, wanted.ramp_top_N_per_s,
                        1e-9 * wanted.ramp_top_N_per_s);
            EXPECT_DOUBLE_EQ(crossing.peak_slip_max_share, wanted.peak_slip_max_share);
            EXPECT_DOUBLE_EQ(crossing.peak_slip_detectable_share,
                             wanted.peak_slip_detectable_share);
            EXPECT_DOUBLE_EQ(crossing.dearest.area_s, wanted.dearest.area_s);
            EXPECT_TRUE(search.step());
          }
          ++(wanted.slip_rate_1_s > 0.0 ? found : none);
          for (const double rate : {0.025, 0.02}) {
            rates[std::lround(200.0 * rate) - 4] += wanted.slip_rate_1_s == rate ? 1.0 : 0.0;
          }
        }
      }
    }
  }
  EXPECT_GT(found, 20);
  EXPECT_GT(none, 5);
  EXPECT_GT(rates[0], 0.0);
  EXPECT_GT(rates[1], 0.0);
}

// Of the slowest crossing, by nothing wrong and by silence: the slip beyond the peak, where
// friction falls by this share of what must be survived.
double runs_on(const RampPoint& p, const Reaction& r, double share) {
  const double silence_s = std::max(r.stale_s, r.timeout_s);
  return std::max(
      excursion(p, r, 0.02, share * p.fall, 0.003, r.cycle_s).slip_share,
      excursion(p, r, 0.02, share * p.fall_at_fault, 0.003, silence_s + r.cycle_s).slip_share);
}

TEST(Reachability, WhatStandsInTheWayIsToldWithItsNumbers) {
  // A fall that is too steep: the one that is survived, to a sixty-fourth of what must be.
  RampPoint steep = point(25.0);
  steep.fall = 3.0;
  const CrossingDenied fall = searched(steep, reaction(0.1)).denied();
  ASSERT_EQ(fall.wall, CrossingWall::kFall);
  EXPECT_DOUBLE_EQ(fall.limit, 3.0);
  const double share = fall.figure / fall.limit;
  EXPECT_GT(share, 0.1);
  EXPECT_LT(runs_on(steep, reaction(0.1), share), 0.025);
  EXPECT_GE(runs_on(steep, reaction(0.1), share + 1.0 / 64.0), 0.025);
  // An own force that does not hold the belt behind any peak: no fall is survived.
  RampPoint weak = point(25.0);
  weak.own_force_N = 0.9 * peak_force_N(weak, weak.mu_least);
  const CrossingDenied none = searched(weak, reaction(0.1)).denied();
  EXPECT_EQ(none.wall, CrossingWall::kFall);
  EXPECT_DOUBLE_EQ(none.figure, 0.0);
  // A shaft that turns fast: 0.8 m/s at 450 rad/s and 78.4 mm are 2.27 % of slip, and the excursion
  // comes beside the peak.
  RampPoint fast = point(8.0, 450.0);
  const CrossingDenied slip_share = searched(fast, reaction(0.05)).denied();
  ASSERT_EQ(slip_share.wall, CrossingWall::kSlip);
  EXPECT_DOUBLE_EQ(slip_share.limit, 0.02);
  EXPECT_LT(slip_share.figure, 0.8 / (450.0 * 0.0784) - 0.008);
  EXPECT_GT(slip_share.figure, 0.8 / (450.0 * 0.0784) - 0.025);
  // A late peak under much torque, where a fall is gentle: energy.
  RampPoint late = point(45.0, 140.0);
  late.own_force_N *= 3.0;
  late.fall = late.fall_at_fault = 0.1;
  late.peak_slip_share = 0.06;
  const CrossingDenied energy = searched(late, reaction(0.1)).denied();
  ASSERT_EQ(energy.wall, CrossingWall::kEnergy);
  EXPECT_DOUBLE_EQ(energy.limit, 90.0);
  EXPECT_GT(energy.figure, 90.0);
  EXPECT_LT(energy.figure, 200.0);
}

TEST(Reachability, WhatIsNotCaughtIsTooMuchInEveryRespect) {
  RampPoint weak = point(50.0);
  weak.own_force_N = 0.5 * peak_force_N(weak, weak.mu_least);
  const Excursion lost = excursion(weak, reaction(0.1), 0.025, 0.8, 0.003, 0.06);
  EXPECT_GT(lost.slip_share, 1e3);
  EXPECT_GT(lost.time_s, 1e3);
  EXPECT_GT(lost.area_s, 1e3);
}

// Each wall by another account: of every case, which one it is, and its figure.
TEST(Reachability, TheWallIsTheFirstThatAnotherAccountMeets) {
  int falls = 0, slips = 0, energies = 0;
  for (const double fall : {0.05, 0.1, 0.2, 0.3, 0.5, 0.8, 1.2, 2.0, 3.0}) {
    for (const double share_at_fault : {0.3, 1.0}) {
      for (const double torque_Nm : {8.0, 15.0, 25.0, 34.0, 45.0}) {
        for (const double omega_rad_s : {60.0, 104.0, 140.0, 250.0, 450.0}) {
          for (const double peak : {0.02, 0.06, 0.07}) {
            RampPoint p = point(torque_Nm, omega_rad_s);
            p.fall = fall;
            p.fall_at_fault = share_at_fault * fall;
            p.peak_slip_share = peak;
            // A controller with much reserve where the fault weighs as much as the fall.
            if (share_at_fault == 1.0) p.own_force_N *= 3.0;
            Reaction r = reaction(share_at_fault == 1.0 ? 0.04 : 0.08);
            if (share_at_fault == 1.0) r.stale_s = 0.2;
            CrossingSearch search = searched(p, r);
            if (search.denied().wall == CrossingWall::kNone) continue;
            // What is told stays as it is.
            const CrossingDenied told = search.denied();
            for (int i = 0; i < 5; ++i) search.step_fall();
            EXPECT_EQ(search.denied().figure, told.figure);

            const double silence_s = std::max(r.stale_s, r.timeout_s) + r.cycle_s;
            Excursion steep;
            for (const bool fault : {false, true}) {
              const double of = fault ? p.fall_at_fault : p.fall;
              const double wait_s = fault ? silence_s : r.cycle_s;
              const Excursion one = excursion(p, r, 0.02, of, 0.003, wait_s);
              const Excursion other = excursion(p, r, 0.02, 0.05, 0.008, wait_s);
              steep.slip_share = std::max({steep.slip_share, one.slip_share, other.slip_share});
              steep.time_s = std::max(steep.time_s, one.time_s);
              steep.area_s = std::max(steep.area_s, one.area_s);
            }
            const double room = std::min(SlipLimits{}.slip_max_share,
                                         SlipLimits{}.slip_speed_max_m_s / (omega_rad_s * 0.0784));
            if (steep.slip_share >= 0.025) {
              ++falls;
              EXPECT_EQ(told.wall, CrossingWall::kFall) << steep.slip_share;
              // To a sixty-fourth, by both of its cases.
              const double share = told.figure / told.limit;
              if (runs_on(p, r, 1.0) >= 0.025) {  // else a flat top does
                EXPECT_GE(runs_on(p, r, share + 1.0 / 64.0), 0.025) << fall << share_at_fault;
              }
              if (share > 0.0) {
                EXPECT_LT(runs_on(p, r, share), 0.025);
              }
            } else if (room - steep.slip_share <= peak) {
              ++slips;
              EXPECT_EQ(told.wall, CrossingWall::kSlip) << steep.slip_share;
            } else {
              ++energies;
              ASSERT_EQ(told.wall, CrossingWall::kEnergy) << steep.slip_share;
              const double turn_W = torque_Nm * omega_rad_s;
              const double by_fall = turn_W * (peak * steep.time_s + steep.area_s);
              EXPECT_NEAR(told.figure, by_fall, 1e-9 * told.figure);
            }
          }
        }
      }
    }
  }
  EXPECT_GT(falls, 20);
  EXPECT_GT(slips, 10);
  EXPECT_GT(energies, 5);
}

}  // namespace
}  // namespace beltgrip::daemon
