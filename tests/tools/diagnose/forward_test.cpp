// The simulation run forward, against the same physics integrated here by explicit steps of 10 us.
#include "tools/diagnose/infer/forward.h"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <numbers>

#include "tools/diagnose/infer/engine.h"

namespace beltgrip::diagnose {
namespace {

using Eigen::ArrayXd;
using Course = std::function<double(double t_s)>;

constexpr double kEnd_s = 12.0;
constexpr double kMuMax = 0.1, kPeakSlipLow = 0.03, kPeakSlipOverdrive = 0.02;
constexpr double kDeformationPerN = 1e-6, kLoss_Nm = 0.5, kTrueLossPerSpeed_Nms = 5e-3,
                 kLossPerN_Nm = 0.05e-3;
constexpr double kDrag_Nm = 0.5, kDragPerSpeed_Nms = 2e-3;  // at the secondary shaft
constexpr double kTrueSecondaryInertia_kgm2 = 0.1, kPrimaryInertia_kgm2 = 0.18;
constexpr double kArea_m2 = 0.0113, kSpring_N = 500.0;
constexpr double kLow = 0.405, kOverdrive = 2.25;
constexpr double kRadiusLow_m = 0.0324, kRadiusOverdrive_m = 0.0784;

void fill(SignalTable& table, Role role, const Course& course) {
  for (int i = 0; i <= static_cast<int>(kEnd_s * 100.0); ++i) {
    table[role].t_s.push_back(0.01 * i);
    table[role].value.push_back(course(0.01 * i));
  }
}

Campaign campaign_with(const SignalTable& table) {
  estimator::VariatorParameters variator;
  variator.primary_inertia_kg_m2 = kPrimaryInertia_kgm2;
  return make_campaign({prepare(table, variator)}, nominal_model(variator));
}

ModelState nominal_state(const Campaign& campaign) {
  ModelState state{Eigen::VectorXd(kNuisanceCount),
                   Eigen::VectorXd::Zero(static_cast<Eigen::Index>(campaign.slots.size())),
                   {}};
  for (int i = 0; i < kNuisanceCount; ++i) {
    state.nuisance[i] = campaign.nuisances[static_cast<std::size_t>(i)].nominal;
  }
  state.nuisance[kLossPerkN_Nm] = 1e3 * kLossPerN_Nm;
  state.nuisance[kSecondaryLossPerkN_Nm] = 0.0;
  // The curve of traction(), without departures.
  state.nuisance.segment(kShapeOverdrive, kEndOfShapes - kShapeOverdrive + 1).setZero();
  return state;
}

double& effect(const Campaign& campaign, ModelState& state, const std::string& label) {
  for (std::size_t i = 0; i < campaign.slots.size(); ++i) {
    if (campaign.slots[i].label() == label) return state.effects[static_cast<Eigen::Index>(i)];
  }
  throw std::invalid_argument(label);
}

const ForwardSignal& signal(const Forward& forward, const std::string& name) {
  for (const ForwardSignal& each : forward.signals) {
    if (each.name == name) return each;
  }
  throw std::invalid_argument(name);
}

// What drives the machine, between the samples of the grid.
double at(const ArrayXd& grid, double t_s) {
  const auto k = std::min(static_cast<Eigen::Index>(t_s / 0.1), grid.size() - 2);
  const double share = t_s / 0.1 - static_cast<double>(k);
  return (1.0 - share) * grid[k] + share * grid[k + 1];
}

double traction(double slip_share, double peak_slip_share) {
  const double stiffness = std::tan(std::numbers::pi / 2.6);
  return std::sin(1.3 * std::atan(stiffness * slip_share / peak_slip_share));
}

double capacity_Nm(double force_N, double radius_m) {
  return 2.0 * radius_m * force_N * kMuMax / std::cos(11.0 * std::numbers::pi / 180.0);
}

// d(speed)/dt over a stretch of the grid by the classical Runge-Kutta method; values on the grid.
ArrayXd integrated(const std::function<double(double t_s, double speed)>& rate, double speed,
                   int begin, int end, double step_s) {
  ArrayXd out = ArrayXd::Constant(end + 1, std::nan(""));
  const int steps = static_cast<int>(std::lround(0.1 / step_s));
  for (int k = begin;; ++k) {
    out[k] = speed;
    if (k == end) return out;
    for (int i = 0; i < steps; ++i) {
      const double t_s = 0.1 * k + step_s * i;
      const double a = rate(t_s, speed);
      const double b = rate(t_s + 0.5 * step_s, speed + 0.5 * step_s * a);
      const double c = rate(t_s + 0.5 * step_s, speed + 0.5 * step_s * b);
      const double d = rate(t_s + step_s, speed + step_s * c);
      speed += step_s / 6.0 * (a + 2.0 * b + 2.0 * c + d);
    }
  }
}

// A rig in low; the clamp force falls until the belt has to slip. What the free shaft is measured
// to do is nearly right at most: nothing of it may come through.
SignalTable rig(double measured_slip = 0.01, double steepness = 20.0) {
  SignalTable table;
  table.name = "rig";
  const Course speed = [](double t_s) { return 100.0 + 3.0 * std::sin(1.3 * t_s); };
  fill(table, Role::kPrimarySpeed, speed);
  fill(table, Role::kSecondarySpeed,
       [=](double t_s) { return speed(t_s) * kLow * (1.0 - measured_slip); });
  fill(table, Role::kSecondaryPressure, [](double t_s) { return 5.2e5 - 0.32e5 * t_s; });
  fill(table, Role::kPrimaryTorque, [](double) { return 17.0; });
  fill(table, Role::kSecondaryTorque,
       [=](double t_s) { return 37.0 + 5.0 * std::tanh(steepness * std::sin(2.0 * t_s)); });
  return table;
}

double rig_rate(const ExperimentData& data, double t_s, double omega_s) {
  const double force_N = kArea_m2 * at(data.pressure.value, t_s) + kSpring_N;
  const double ratio = kLow * (1.0 - kDeformationPerN * force_N);
  const double slip_share = 1.0 - omega_s / (at(data.omega_p.value, t_s) * ratio);
  const double belt_Nm = capacity_Nm(force_N, kRadiusLow_m) * traction(slip_share, kPeakSlipLow);
  return (belt_Nm / ratio - at(data.torque_s.value, t_s) - kDrag_Nm - kDragPerSpeed_Nms * omega_s) /
         kTrueSecondaryInertia_kgm2;
}

TEST(Forward, StiffRigFollowsTheFineIntegrationUpToThePeakAndEndsThere) {
  const Campaign campaign = campaign_with(rig());
  const ExperimentData& data = campaign.runs[0];
  const Forward forward = run_forward(campaign, 0, nominal_state(campaign));
  const auto begin = static_cast<int>(std::find(forward.grips.begin(), forward.grips.end(), true) -
                                      forward.grips.begin());
  auto end = begin;
  while (forward.grips[static_cast<std::size_t>(end) + 1]) ++end;
  ASSERT_GT(end - begin, 60);
  EXPECT_LT(end, data.stretches[0].begin + data.valid_count - 1);  // before the data end
  const auto rate = [&](double t_s, double speed) { return rig_rate(data, t_s, speed); };
  const ArrayXd& simulated = signal(forward, "secondary_speed").simulated;
  const ArrayXd truth = integrated(rate, simulated[begin], begin, end + 1, 1e-5);
  for (int k = begin + 1; k <= end; ++k) {
    // A speed sensor resolves 1e-4 at best. Where friction hardly resists any more, errors grow.
    const double slip_share = 1.0 - truth[k] / (data.omega_p.value[k] * kLow);
    EXPECT_NEAR(simulated[k] / truth[k], 1.0, slip_share < 0.7 * kPeakSlipLow ? 1e-5 : 2e-4) << k;
  }
  // The next sample is beyond the peak in truth too.
  const double force_N = kArea_m2 * data.pressure.value[end + 1] + kSpring_N;
  const double ratio = kLow * (1.0 - kDeformationPerN * force_N);
  EXPECT_GT(1.0 - truth[end + 1] / (data.omega_p.value[end + 1] * ratio), 0.99 * kPeakSlipLow);

  // Why it takes an implicit step: friction pulls at more than 2000/s.
  const double omega_s = simulated[begin];
  EXPECT_LT((rate(0.1 * begin, 1.0001 * omega_s) - rate(0.1 * begin, omega_s)) / (1e-4 * omega_s),
            -2000.0);
}

TEST(Forward, PredictsTheTorqueAtTheRigsPrimaryShaft) {
  const Campaign campaign = campaign_with(rig());
  const ExperimentData& data = campaign.runs[0];
  const Forward forward = run_forward(campaign, 0, nominal_state(campaign));
  const ArrayXd& omega_s = signal(forward, "secondary_speed").simulated;
  const ArrayXd& torque = signal(forward, "primary_torque").simulated;
  int compared = 0;
  for (int k = 0; k < data.size(); ++k) {
    if (!forward.grips[static_cast<std::size_t>(k)]) continue;
    const double force_N = kArea_m2 * data.pressure.value[k] + kSpring_N;
    const double ratio = kLow * (1.0 - kDeformationPerN * force_N);
    const double slip_share = 1.0 - omega_s[k] / (data.omega_p.value[k] * ratio);
    const double loss_Nm =
        kLoss_Nm + kTrueLossPerSpeed_Nms * data.omega_p.value[k] + kLossPerN_Nm * force_N;
    EXPECT_NEAR(torque[k],
                capacity_Nm(force_N, kRadiusLow_m) * traction(slip_share, kPeakSlipLow) + loss_Nm,
                1e-4);
    ++compared;
  }
  EXPECT_GT(compared, 60);
}

TEST(Forward, VehicleFollowsTheFineIntegration) {
  SignalTable table;
  table.name = "car";
  const Course speed = [](double t_s) { return 300.0 + 20.0 * std::sin(0.8 * t_s); };
  fill(table, Role::kSecondarySpeed, speed);
  fill(table, Role::kPrimarySpeed,
       [&](double t_s) { return speed(t_s) / (kOverdrive * (1.0 - 0.006)); });
  fill(table, Role::kSecondaryPressure, [](double t_s) { return 6e5 - 0.1e5 * t_s; });
  fill(table, Role::kEngineTorque, [](double t_s) { return 55.0 + 10.0 * std::sin(3.0 * t_s); });
  fill(table, Role::kSecondaryTorque, [](double) { return 20.0; });
  const Campaign campaign = campaign_with(table);
  const ExperimentData& data = campaign.runs[0];
  const Forward forward = run_forward(campaign, 0, nominal_state(campaign));
  const int begin = data.stretches[0].begin, end = begin + data.valid_count - 1;
  ASSERT_GT(end - begin, 100);
  const ArrayXd& simulated = signal(forward, "primary_speed").simulated;
  const auto rate = [&](double t_s, double omega_p) {
    const double force_N = kArea_m2 * at(data.pressure.value, t_s) + kSpring_N;
    const double ratio = kOverdrive * (1.0 - kDeformationPerN * force_N);
    const double slip_share = 1.0 - at(data.omega_s.value, t_s) / (omega_p * ratio);
    const double belt_Nm =
        capacity_Nm(force_N, kRadiusOverdrive_m) * traction(slip_share, kPeakSlipOverdrive);
    const double loss_Nm = kLoss_Nm + kTrueLossPerSpeed_Nms * omega_p + kLossPerN_Nm * force_N;
    return (at(data.torque.value, t_s) - loss_Nm - belt_Nm) / kPrimaryInertia_kgm2;
  };
  const ArrayXd truth = integrated(rate, simulated[begin], begin, end, 1e-5);
  for (int k = begin; k <= end; ++k) {
    ASSERT_TRUE(forward.grips[static_cast<std::size_t>(k)]) << k;
    EXPECT_NEAR(simulated[k] / truth[k], 1.0, 2e-6) << k;
  }
  const ArrayXd& torque_s = signal(forward, "secondary_torque").simulated;
  for (int k = begin + 5; k < end - 5; ++k) {
    const double force_N = kArea_m2 * data.pressure.value[k] + kSpring_N;
    const double ratio = kOverdrive * (1.0 - kDeformationPerN * force_N);
    const double slip_share = 1.0 - data.omega_s.value[k] / (truth[k] * ratio);
    const double belt_Nm =
        capacity_Nm(force_N, kRadiusOverdrive_m) * traction(slip_share, kPeakSlipOverdrive);
    const double acceleration = (data.omega_s.value[k + 1] - data.omega_s.value[k - 1]) / 0.2;
    const double drag_Nm = kDrag_Nm + kDragPerSpeed_Nms * data.omega_s.value[k];
    EXPECT_NEAR(torque_s[k], belt_Nm / ratio - kTrueSecondaryInertia_kgm2 * acceleration - drag_Nm,
                0.05)
        << k;
  }
}

// Without a sensor at the secondary shaft the torque before the belt decides what it carries.
TEST(Forward, RigWithoutSecondaryTorqueCarriesThePrimaryOne) {
  SignalTable table = rig(0.01, 1.0);
  table[Role::kSecondaryTorque] = {};
  const Campaign campaign = campaign_with(table);
  const ExperimentData& data = campaign.runs[0];
  const Forward forward = run_forward(campaign, 0, nominal_state(campaign));
  ASSERT_EQ(forward.signals.size(), 2U);  // the torque is no prediction here
  const ArrayXd& omega_s = signal(forward, "secondary_speed").simulated;
  int compared = 0;
  for (int k = 0; k < data.size(); ++k) {
    if (!std::isfinite(omega_s[k])) continue;
    const double force_N = kArea_m2 * data.pressure.value[k] + kSpring_N;
    const double ratio = kLow * (1.0 - kDeformationPerN * force_N);
    const double slip_share = 1.0 - omega_s[k] / (data.omega_p.value[k] * ratio);
    if (slip_share > 0.7 * kPeakSlipLow) continue;  // about to run away: no longer at rest
    const double carried_Nm =
        17.0 - kLoss_Nm - kTrueLossPerSpeed_Nms * data.omega_p.value[k] - kLossPerN_Nm * force_N;
    EXPECT_NEAR(capacity_Nm(force_N, kRadiusLow_m) * traction(slip_share, kPeakSlipLow), carried_Nm,
                0.1)
        << k;
    ++compared;
  }
  EXPECT_GT(compared, 60);
}

TEST(Forward, WhatTheFreeShaftIsMeasuredToDoDoesNotComeThrough) {
  const Campaign one = campaign_with(rig(0.01)), other = campaign_with(rig(0.014));
  // A radius that tilts with the torque and friction that changes with slip energy: both depend on
  // what is predicted.
  ModelState state = nominal_state(one);
  effect(one, state, "radius_tilt.per_Nm") = 1e-4;
  effect(one, state, "warm_up_drift.per_kJ") = -0.2;
  const Forward a = run_forward(one, 0, state), b = run_forward(other, 0, state);
  ASSERT_EQ(a.grips, b.grips);
  int compared = 0;
  for (std::size_t k = 0; k < a.grips.size(); ++k) {
    if (!a.grips[k]) continue;
    const auto i = static_cast<Eigen::Index>(k);
    EXPECT_NEAR(a.signals[0].measured[i] / b.signals[0].measured[i], 0.990 / 0.986, 1e-5);
    // Of these 4e-3 nothing is left but slip energy from before the first sample that counts.
    EXPECT_NEAR(a.signals[0].simulated[i] / b.signals[0].simulated[i], 1.0, 2e-4) << k;
    ++compared;
  }
  EXPECT_GT(compared, 60);
}

TEST(Forward, SensorsStandBetweenTheMachineAndItsReading) {
  const Campaign campaign = campaign_with(rig(0.01, 1.0));
  const ModelState plain = nominal_state(campaign);
  ModelState scaled = plain, late = plain, gained = plain;
  effect(campaign, scaled, "speed_scale.secondary") = 4e-3;
  effect(campaign, late, "channel_skew.delay_s@secondary_speed") = 0.1;
  effect(campaign, gained, "torque_gain.gain") = 0.05;
  const Forward truth = run_forward(campaign, 0, plain);
  const ArrayXd& speed = signal(truth, "secondary_speed").simulated;
  const ArrayXd& torque = signal(truth, "primary_torque").simulated;
  const Forward of_scaled = run_forward(campaign, 0, scaled);
  const Forward of_late = run_forward(campaign, 0, late);
  const Forward of_gained = run_forward(campaign, 0, gained);
  const ArrayXd& speed_scaled = signal(of_scaled, "secondary_speed").simulated;
  const ArrayXd& speed_late = signal(of_late, "secondary_speed").simulated;
  const ArrayXd& torque_gained = signal(of_gained, "primary_torque").simulated;
  int compared = 0;
  for (Eigen::Index k = 20; k < 60; ++k) {
    if (!std::isfinite(speed[k]) || !std::isfinite(speed_late[k])) continue;
    EXPECT_NEAR(speed_scaled[k] / speed[k], 1.004, 1e-8) << k;
    EXPECT_NEAR(speed_late[k], speed[k - 1], 0.1 * std::abs(speed[k] - speed[k - 1]) + 5e-3) << k;
    EXPECT_NEAR(torque_gained[k] / torque[k], 1.05, 1e-3) << k;  // of the slow copy
    ++compared;
  }
  EXPECT_GT(compared, 30);
}

}  // namespace
}  // namespace beltgrip::diagnose
