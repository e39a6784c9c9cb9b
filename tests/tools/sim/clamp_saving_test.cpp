// What MinClampForce would save against the controller's own clamping law over drives through a
// city: computed by the virtual vehicle with its own loss model, not measured on a car. Each drive
// (driver, road, hydraulics: one seed) is driven with the controller's law (a design friction, and
// a reserve of 25 Nm for what comes faster than its hydraulics) and with safety_factor 1.3 over the
// friction that the belt has and less reserve or none. The car answers each law a little otherwise,
// so the pairs are compared, and their difference has an interval.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstdio>

#include "tools/sim/vehicle_scenario.h"
#include "tools/sim/vehicle_simulation.h"

namespace beltgrip::sim {
namespace {

constexpr double kSafetyFactor = 1.3;
constexpr std::array<double, 2> kReserves_Nm{0.0, 10.0};
constexpr std::array<std::uint64_t, 4> kSeeds{7, 8, 9, 10};
constexpr double kStudent95 = 3.182;  // of as many pairs

struct Drive {  // means while the clutch is closed
  double force_N = 0.0;
  double loss_Nm = 0.0;  // of bearings and clamp, at the primary shaft
  double loss_W = 0.0;   // and its power
  double slip_W = 0.0;   // dissipated by slip
  double locked_s = 0.0;
  double macro_slip_s = 0.0;  // time beyond the slip of the peak
};

Drive drive(const VehicleScenario& scenario, std::uint64_t seed) {
  VehicleSimulation vehicle(scenario, seed);
  Drive sum;
  double time_s = 0.0;
  const double step_s = static_cast<double>(vehicle.step_ns()) * 1e-9;
  while (!vehicle.finished()) {
    vehicle.step();
    const VehicleTruth& truth = vehicle.truth();
    const double omega_p = vehicle.signals().omega_p_rad_s;
    if (omega_p < 50.0 || vehicle.signals().lockup_closed < 0.5) continue;
    const double loss_Nm = scenario.variator.primary_loss_Nm +
                           scenario.variator.primary_loss_Nm_per_N * truth.secondary_force_N;
    time_s += step_s;
    sum.force_N += truth.secondary_force_N * step_s;
    sum.loss_Nm += loss_Nm * step_s;
    sum.loss_W += loss_Nm * omega_p * step_s;
    sum.slip_W += truth.belt.slip_power_W * step_s;
    if (std::abs(truth.belt.slip) > truth.belt.peak_slip) sum.macro_slip_s += step_s;
  }
  sum.locked_s = time_s;
  for (double* each : {&sum.force_N, &sum.loss_Nm, &sum.loss_W, &sum.slip_W}) *each /= time_s;
  return sum;
}

// Mean of the differences of the pairs, and half its 95 % interval.
struct Difference {
  double mean = 0.0, half = 0.0;
};
Difference difference(const std::array<Drive, kSeeds.size()>& of,
                      const std::array<Drive, kSeeds.size()>& from, double Drive::*value) {
  constexpr double kPairs = static_cast<double>(kSeeds.size());
  Difference out;
  double squares = 0.0;
  for (std::size_t i = 0; i < kSeeds.size(); ++i) out.mean += (of[i].*value - from[i].*value);
  out.mean /= kPairs;
  for (std::size_t i = 0; i < kSeeds.size(); ++i) {
    const double off = of[i].*value - from[i].*value - out.mean;
    squares += off * off;
  }
  out.half = kStudent95 * std::sqrt(squares / (kPairs - 1.0) / kPairs);
  return out;
}

TEST(ClampSaving, OverDrivesThroughTheCity) {
  const VehicleScenarioResult city = shipped_vehicle_scenario("city");
  ASSERT_TRUE(city.errors.empty()) << city.errors.front();
  std::array<Drive, kSeeds.size()> own;
  double own_force_N = 0.0;
  for (std::size_t i = 0; i < kSeeds.size(); ++i) {
    own[i] = drive(city.scenario, kSeeds[i]);
    own_force_N += own[i].force_N / static_cast<double>(kSeeds.size());
    EXPECT_EQ(own[i].macro_slip_s, 0.0) << kSeeds[i];
    std::printf("own law: %.0f N, %.2f Nm lost, %.0f W of loss, %.0f W of slip over %.0f s\n",
                own[i].force_N, own[i].loss_Nm, own[i].loss_W, own[i].slip_W, own[i].locked_s);
  }
  // The law is F = (|T| + reserve) cos / (2 R_p design_friction).
  VehicleScenario known = city.scenario;
  const double friction = known.belt.overdrive.mu_max * std::min(1.0, known.belt.low_mu_factor);
  known.tcu.design_friction = friction / kSafetyFactor;
  for (const double reserve_Nm : kReserves_Nm) {
    known.tcu.torque_reserve_Nm = reserve_Nm;
    std::array<Drive, kSeeds.size()> saved;
    double macro_slip_s = 0.0;
    for (std::size_t i = 0; i < kSeeds.size(); ++i) {
      saved[i] = drive(known, kSeeds[i]);
      macro_slip_s += saved[i].macro_slip_s;
    }
    const Difference force_N = difference(saved, own, &Drive::force_N);
    const Difference loss_Nm = difference(saved, own, &Drive::loss_Nm);
    const Difference loss_W = difference(saved, own, &Drive::loss_W);
    const Difference slip_W = difference(saved, own, &Drive::slip_W);
    std::printf(
        "MinClampForce and %.0f Nm: %.0f +- %.0f N (%.0f %%), %.3f +- %.3f Nm, %.1f +- %.1f W of "
        "loss, %.1f +- %.1f W of slip; %.2f s beyond the peak\n",
        reserve_Nm, force_N.mean, force_N.half, 100.0 * force_N.mean / own_force_N, loss_Nm.mean,
        loss_Nm.half, loss_W.mean, loss_W.half, slip_W.mean, slip_W.half, macro_slip_s);
    EXPECT_LT(force_N.mean + force_N.half, 0.0);
    EXPECT_LT(loss_Nm.mean + loss_Nm.half, 0.0);
    // With the reserve the saving of power is smaller than what the drives differ by.
    EXPECT_LT(loss_W.mean + (reserve_Nm > 0.0 ? -1.0 : 1.0) * loss_W.half, 0.0);
    // Without enough reserve the hydraulics come too late for some of the torque's steps.
    EXPECT_EQ(macro_slip_s > 0.0, reserve_Nm < kReserves_Nm.back());
  }
}

}  // namespace
}  // namespace beltgrip::sim
