// What MinClampForce would save against the controller's own clamping law over a drive through a
// city: computed by the virtual vehicle with its own loss model, not measured on a car. The
// controller runs once with its law (a design friction, and a reserve of 25 Nm for what comes
// faster than its hydraulics), once with safety_factor 1.3 over the friction that the belt has and
// nothing else, and once with that and a smaller reserve; driver, road and hydraulics are the same.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "tools/sim/vehicle_scenario.h"
#include "tools/sim/vehicle_simulation.h"

namespace beltgrip::sim {
namespace {

constexpr double kSafetyFactor = 1.3;
constexpr double kReserve_Nm = 10.0;

struct Drive {  // means while the clutch is closed
  double force_N = 0.0;
  double loss_Nm = 0.0;  // of bearings and clamp, at the primary shaft
  double loss_W = 0.0;   // and its power
  double slip_W = 0.0;   // dissipated by slip
  double locked_s = 0.0;
  double macro_slip_s = 0.0;  // time beyond the slip of the peak
};

Drive drive(const VehicleScenario& scenario) {
  VehicleSimulation vehicle(scenario, 7);
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

TEST(ClampSaving, OverADriveThroughTheCity) {
  const VehicleScenarioResult city = shipped_vehicle_scenario("city");
  ASSERT_TRUE(city.errors.empty()) << city.errors.front();
  const Drive own = drive(city.scenario);
  const auto print = [](const char* law, const Drive& one) {
    std::printf(
        "%s: %.0f N, %.2f Nm lost, %.0f W of loss and %.0f W of slip over %.0f s, %.2f s "
        "beyond the peak\n",
        law, one.force_N, one.loss_Nm, one.loss_W, one.slip_W, one.locked_s, one.macro_slip_s);
  };
  print("own law", own);
  EXPECT_EQ(own.macro_slip_s, 0.0);
  // The law is F = (|T| + reserve) cos / (2 R_p design_friction).
  VehicleScenario known = city.scenario;
  const double friction = known.belt.overdrive.mu_max * std::min(1.0, known.belt.low_mu_factor);
  known.tcu.design_friction = friction / kSafetyFactor;
  for (const double reserve_Nm : {0.0, kReserve_Nm}) {
    known.tcu.torque_reserve_Nm = reserve_Nm;
    const Drive saved = drive(known);
    print(reserve_Nm > 0.0 ? "MinClampForce and 10 Nm" : "MinClampForce alone", saved);
    EXPECT_LT(saved.force_N, own.force_N);
    EXPECT_LT(saved.loss_Nm, own.loss_Nm);
    EXPECT_LT(saved.loss_W, own.loss_W);
    // Without any reserve the hydraulics come too late for some of the torque's steps.
    EXPECT_EQ(saved.macro_slip_s > 0.0, reserve_Nm == 0.0);
  }
}

}  // namespace
}  // namespace beltgrip::sim
