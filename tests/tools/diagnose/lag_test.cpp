// A clamp force that lags behind its pressure, where all ramps are alike: it shows after the clamp
// is closed again, in what is left of a step that is itself too fast to count.
#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "tools/diagnose/decide/namer.h"

namespace beltgrip::diagnose {
namespace {

constexpr double kLag_s = 0.3;
constexpr double kStep_s = 0.01, kEnd_s = 26.0, kClosed_s = 20.0;

// A rig of its own equations: friction 2x / (1 + x^2), which needs no inverse by iteration.
struct Rig {
  estimator::VariatorParameters variator;
  double lag_s = 0.0;
  double mu_max = 0.1, peak_slip_share = 0.02, omega_p = 100.0, torque_Nm = 50.0;

  double slip_share(double belt_Nm, double force_N) const {
    const double capacity_Nm = 2.0 * variator.primary_radius_overdrive_m * mu_max * force_N /
                               std::cos(variator.half_wedge_angle_rad);
    const double y = belt_Nm / capacity_Nm;
    return peak_slip_share * (1.0 - std::sqrt(1.0 - y * y)) / y;
  }

  // Down by one rate, closed again within a fifth of a second.
  SignalTable record(unsigned seed) const {
    std::mt19937 random(seed);
    std::normal_distribution<double> normal;
    SignalTable table;
    table.name = "run" + std::to_string(seed);
    double acting_N = 7000.0;
    for (int i = 0; i * kStep_s < kEnd_s; ++i) {
      const double t_s = i * kStep_s;
      const double ramp_N = 7000.0 - 150.0 * std::min(t_s, kClosed_s);
      const double force_N =
          t_s < kClosed_s ? ramp_N : std::min(7000.0, ramp_N + 15000.0 * (t_s - kClosed_s));
      acting_N += (force_N - acting_N) * (1.0 - std::exp(-kStep_s / std::max(lag_s, 1e-9)));
      const double loss_Nm = 0.5 + 5e-3 * omega_p + 5e-5 * acting_N;
      const double ratio = variator.ratio_overdrive * (1.0 - 1e-6 * acting_N);
      const double belt_Nm = torque_Nm * (1.0 + 0.03 * std::sin(0.9 * t_s + seed));
      const auto add = [&](Role role, double value) {
        table[role].t_s.push_back(t_s);
        table[role].value.push_back(value);
      };
      add(Role::kPrimarySpeed, omega_p * (1.0 + 5e-5 * normal(random)));
      add(Role::kSecondarySpeed,
          omega_p * ratio * (1.0 - slip_share(belt_Nm, acting_N)) * (1.0 + 5e-5 * normal(random)));
      add(Role::kPrimaryTorque, belt_Nm + loss_Nm + 0.1 * normal(random));
      add(Role::kSecondaryPressure,
          (force_N - variator.secondary_spring_force_N) / variator.secondary_piston_area_m2 +
              800.0 * normal(random));
    }
    return table;
  }
};

struct Named {
  Engine engine;
  Naming naming;
};
// Twelve runs: a little of the lag may be the machine's own play as well, less with more of them.
Named named(double lag_s) {
  Rig rig;
  rig.lag_s = lag_s;
  std::vector<ExperimentData> runs;
  for (unsigned seed = 0; seed < 12; ++seed) {
    rig.torque_Nm = seed % 2 == 0 ? 50.0 : 44.0;
    runs.push_back(prepare(rig.record(seed), rig.variator));
  }
  Engine engine(make_campaign(std::move(runs), nominal_model(rig.variator)));
  Naming naming = name_effects(engine, [] { return false; });
  return {std::move(engine), std::move(naming)};
}

TEST(HydraulicLag, IsFoundInItsSizeBehindAStepThatDoesNotCount) {
  const auto [engine, naming] = named(kLag_s);
  ASSERT_EQ(naming.accepted.size(), 1U);
  const int found = naming.accepted.front().slot;
  const Slot& slot = engine.campaign().slots[static_cast<std::size_t>(found)];
  EXPECT_EQ(slot.label(), "hydraulic_lag.time_constant_s");
  EXPECT_NEAR(naming.hypothesis.state.effects[found], kLag_s, 0.03 * kLag_s);
}

TEST(HydraulicLag, IsNotFoundWhereThereIsNone) { EXPECT_TRUE(named(0.0).naming.accepted.empty()); }

}  // namespace
}  // namespace beltgrip::diagnose
