// Reachability and choice of the ramp: the closed forms against a numeric integration of the same
// motion, written here anew, over torque, ramp and lag; the chosen ramp against its limits.
#include "daemon/core/experiment/reachability.h"

#include <gtest/gtest.h>

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
  p.peak_slip = 0.02;
  return p;
}

Reaction reaction(double lag_s) { return {0.03, 0.05, 0.05, 0.01, 0.035, lag_s}; }

Ramp choose_ramp(const RampPoint& p, const Reaction& r, const SlipLimits& limits,
                 double rate_max_N_per_s) {
  RampSearch search(p, r, limits, rate_max_N_per_s);
  while (!search.step()) {
  }
  return search.ramp();
}

// Explicit Euler with a microsecond-fine step, states and events written out.
Excursion integrated(const RampPoint& p, const Reaction& r, double rate, double reaction_s) {
  const double dt = 2e-6;
  const double peak_N = p.torque_Nm * p.wedge_cosine / (2.0 * p.primary_radius_m * p.mu_expected);
  const double gain = p.torque_Nm * 1.21 / (p.inertia_kg_m2 * p.omega_p_rad_s);
  double force_N = peak_N, t = 0.0, seen_s = -1.0;
  // The quasi-static slip rate at the peak is a start value that decays into the growth as if it
  // had been an initial displacement: v0 / a e^(a t).
  const double a = gain * 0.4 / p.mu_expected;
  const double v0 = p.mu_expected * rate / (peak_N * 0.5);
  double x = 0.0, carried = v0;  // carried: v0 e^(a t)
  Excursion out;
  out.slip_max = p.peak_slip;
  bool told = false;
  double own_N = 0.0, told_force_N = 0.0, told_s = 0.0;
  while (t < 5.0) {
    if (!told) {
      force_N = peak_N - rate * t;
      const double shortfall = (peak_N - force_N) / peak_N;
      x += dt * (a * (x - (carried - v0) / a) + gain * shortfall + carried);
      carried += dt * a * carried;
      if (seen_s < 0.0 && x >= kSlipToSee) seen_s = t;
      if (seen_s >= 0.0 && out.slip_at_stop == 0.0 && t >= seen_s + r.detection_s) {
        out.slip_at_stop = p.peak_slip + x;
      }
      if (seen_s >= 0.0 && t >= seen_s + r.detection_s + reaction_s + r.dead_time_s) {
        told = true;
        told_s = t;
        own_N = p.own_force_N;
        told_force_N = force_N;
      }
    } else {
      force_N = own_N + (told_force_N - own_N) * std::exp(-(t - told_s) / r.lag_s);
      x += dt * (a * x + gain * (peak_N - force_N) / peak_N);
      if (x <= 0.0) break;
    }
    out.slip_max = std::max(out.slip_max, p.peak_slip + x);
    out.energy_J += dt * (p.peak_slip + x) * p.torque_Nm * p.omega_p_rad_s;
    t += dt;
    if (x > 10.0) break;
  }
  return out;
}

TEST(Reachability, LargestFrictionAtTheFloor) {
  RampPoint p = point(20.0);
  // 20 Nm at a floor of 2690 N: variator-facts 4.3, 60 km/h in overdrive with 0.1 MPa.
  p.floor_N = 500.0 + 0.0113 * 1e5 + 9.5e-3 * 300.0 * 300.0;
  EXPECT_NEAR(reachable_mu(p), 0.050, 0.0008);
  EXPECT_NEAR(peak_force_N(p, reachable_mu(p)), p.floor_N, 1e-9);
}

TEST(Reachability, ClosedFormAgainstIntegrationOverTorqueRampAndLag) {
  for (const double torque : {15.0, 25.0, 35.0, 50.0}) {
    for (const double rate : {30.0, 100.0, 300.0, 1000.0}) {
      for (const double lag : {0.05, 0.1, 0.15}) {
        for (const double reaction_s : {0.01, 0.06}) {
          const RampPoint p = point(torque);
          const Reaction r = reaction(lag);
          const Excursion closed = excursion(p, r, rate, reaction_s);
          const Excursion exact = integrated(p, r, rate, reaction_s);
          SCOPED_TRACE(testing::Message() << torque << " Nm " << rate << " N/s lag " << lag
                                          << " reaction " << reaction_s);
          if (exact.slip_max > 1.0) {
            EXPECT_GT(closed.slip_max, 0.10);
            continue;
          }
          EXPECT_NEAR(closed.slip_at_stop, exact.slip_at_stop, 0.01 * exact.slip_at_stop);
          EXPECT_NEAR(closed.slip_max, exact.slip_max, 0.01 * exact.slip_max);
          EXPECT_NEAR(closed.energy_J, exact.energy_J, 0.03 * exact.energy_J + 0.5);
        }
      }
    }
  }
}

TEST(Reachability, WorseInEveryRespectIsWorse) {
  const Reaction r = reaction(0.1);
  const double base = excursion(point(30.0), r, 200.0, 0.06).slip_max;
  EXPECT_GT(excursion(point(35.0), r, 200.0, 0.06).slip_max, base);
  EXPECT_GT(excursion(point(30.0), r, 250.0, 0.06).slip_max, base);
  EXPECT_GT(excursion(point(30.0), r, 200.0, 0.08).slip_max, base);
  EXPECT_GT(excursion(point(30.0), reaction(0.15), 200.0, 0.06).slip_max, base);
  RampPoint light = point(30.0);
  light.inertia_kg_m2 = 0.12;
  EXPECT_GT(excursion(light, r, 200.0, 0.06).slip_max, base);
}

TEST(Reachability, AForceThatCannotCatchTheBeltIsNoEnd) {
  RampPoint p = point(50.0);
  p.own_force_N =
      peak_force_N(p, p.mu_expected);  // the controller's own force is no more than that
  const Excursion lost = excursion(p, reaction(0.1), 300.0, 0.06);
  EXPECT_GT(lost.slip_max, 1.0);
  EXPECT_EQ(choose_ramp(p, reaction(0.1), SlipLimits{}, 300.0).rate_N_per_s, 0.0);
}

TEST(Reachability, TheChosenRampKeepsEveryLimitAndIsTheFastestThatDoes) {
  int chosen = 0, refused = 0;
  for (double torque = 10.0; torque <= 60.0; torque += 5.0) {
    for (double omega = 105.0; omega <= 200.0; omega += 15.0) {
      for (const double lag : {0.05, 0.1, 0.15, 0.3}) {
        const RampPoint p = point(torque, omega);
        const Reaction r = reaction(lag);
        const SlipLimits limits;
        const Ramp ramp = choose_ramp(p, r, limits, 300.0);
        const auto keeps = [&](double rate) {
          const Excursion nominal = excursion(p, r, rate, 0.01);
          const Excursion worst = excursion(p, r, rate, 0.06);
          return nominal.slip_at_stop <= 0.05 && nominal.slip_max <= 0.10 &&
                 nominal.energy_J <= 50.0 && worst.slip_max <= 0.10 &&
                 worst.slip_speed_max_m_s <= 0.8 && worst.energy_J <= 100.0;
        };
        if (ramp.rate_N_per_s > 0.0) {
          ++chosen;
          EXPECT_LE(ramp.rate_N_per_s, 300.0);
          EXPECT_TRUE(keeps(ramp.rate_N_per_s));
          if (ramp.rate_N_per_s < 300.0) {
            EXPECT_FALSE(keeps(ramp.rate_N_per_s / 0.82));
          }
          EXPECT_NEAR(ramp.duration_s, (p.own_force_N - peak_force_N(p, 0.105)) / ramp.rate_N_per_s,
                      1e-9);
        } else {
          ++refused;
          EXPECT_FALSE(keeps(300.0));
        }
      }
    }
  }
  EXPECT_GT(chosen, 50);
  EXPECT_GT(refused, 50);
}

TEST(Reachability, ASlowInputCostsRate) {
  Reaction slow = reaction(0.1);
  slow.stale_s = 0.25;  // 10 Hz
  EXPECT_LT(choose_ramp(point(30.0), slow, SlipLimits{}, 300.0).rate_N_per_s,
            choose_ramp(point(30.0), reaction(0.1), SlipLimits{}, 300.0).rate_N_per_s);
}

}  // namespace
}  // namespace beltgrip::daemon
