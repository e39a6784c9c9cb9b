// A channel that comes late: all that follows from it is put back to its time.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <string_view>

#include "tests/tools/diagnose/recorded_runs.h"
#include "tests/tools/diagnose/rig_table.h"
#include "tools/diagnose/decide/namer.h"
#include "tools/diagnose/model/effects/effect.h"
#include "tools/diagnose/model/model_file.h"
#include "tools/diagnose/model/variator_model.h"

namespace beltgrip::diagnose {
namespace {

constexpr double kDelay_s = 0.08;
constexpr double kInertia_kgm2 = 0.3, kTorque_Nm = 60.0;

// A rig in overdrive without loss and slip, its speed swept; the secondary speed comes late.
ExperimentData swept(const estimator::VariatorParameters& variator) {
  SignalTable table;
  for (int i = 0; i < 6000; ++i) {
    const double t_s = 0.01 * i;
    const auto add = [&](Role role, double value) {
      table[role].t_s.push_back(t_s);
      table[role].value.push_back(value);
    };
    const auto speed = [](double at_s) { return 120.0 + 30.0 * std::sin(0.7 * at_s); };
    const double ratio = variator.ratio_overdrive;
    const double acceleration = ratio * 30.0 * 0.7 * std::cos(0.7 * t_s);
    add(Role::kPrimarySpeed, speed(t_s));
    add(Role::kSecondarySpeed, ratio * speed(t_s - kDelay_s));
    add(Role::kSecondaryPressure, 5e5);
    add(Role::kPrimaryTorque, kTorque_Nm);
    add(Role::kSecondaryTorque, kTorque_Nm / ratio - kInertia_kgm2 * acceleration);
  }
  return prepare(table, variator);
}

TEST(Timing, TheAccelerationOfALateSpeedIsLateToo) {
  const estimator::VariatorParameters variator;
  const ExperimentData run = swept(variator);
  ASSERT_GT(run.valid_count, 400);
  const NuisanceTable table = nuisances_of(nominal_model(variator));
  Eigen::VectorXd machine(kNuisanceCount);
  for (int i = 0; i < kNuisanceCount; ++i) {
    machine[i] = table[static_cast<std::size_t>(i)].nominal;
  }
  machine[kSecondaryInertia_kgm2] = kInertia_kgm2;
  machine[kLossConstant_Nm] = machine[kLossPerSpeed_Nms] = machine[kDeformationPerkN] = 0.0;
  machine[kLossPerkN_Nm] = 0.0;
  machine[kSecondaryLoss_Nm] = machine[kSecondaryLossPerSpeed_Nms] =
      machine[kSecondaryLossPerkN_Nm] = 0.0;
  const std::vector<Slot> slots = make_slots({run});
  Eigen::VectorXd late = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(slots.size()));
  for (std::size_t i = 0; i < slots.size(); ++i) {
    if (slots[i].label() == "channel_skew.delay_s@secondary_speed") {
      late[static_cast<Eigen::Index>(i)] = kDelay_s;
    }
  }
  ASSERT_NE(late.sum(), 0.0);
  const auto largest = [&](const Eigen::VectorXd& effects) {
    const Quantities q = evaluate(run, 0, variator, machine, {&slots, effects, {}, {}});
    double balance_Nm = 0.0, slip_share = 0.0;
    for (int k = 20; k + 20 < run.size(); ++k) {  // the ends have neighbours on one side only
      if (!run.valid[static_cast<std::size_t>(k)]) continue;
      balance_Nm = std::max(balance_Nm, std::abs(q.balance[k]));
      slip_share = std::max(slip_share, std::abs(q.slip_share[k]));
    }
    return std::pair{balance_Nm, slip_share};
  };
  const auto [on_time_Nm, on_time_slip] = largest(late);
  const auto [late_Nm, late_slip] = largest(Eigen::VectorXd::Zero(late.size()));
  EXPECT_GT(late_slip, 0.01);
  EXPECT_LT(on_time_slip, 5e-4);
  EXPECT_GT(late_Nm, 1.5);
  EXPECT_LT(on_time_Nm, 0.4);  // the slow copies' own rounding of the sweep
}

bool is_named(const Naming& naming, const Engine& engine, std::string_view effect) {
  return std::any_of(naming.accepted.begin(), naming.accepted.end(), [&](const Accepted& each) {
    return engine.campaign().slots[static_cast<std::size_t>(each.slot)].row->id == effect;
  });
}

blind::Trial equal_ramps() {
  blind::Trial out;
  out.seed = 5006;
  blind::Random random(out.seed);
  out.machine = blind::draw_machine(random);
  out.plan = blind::paper_plan(10);
  out.planted.push_back({"friction_temperature", {{"per_K", 0.008}}, {}});
  return out;
}

// Ten ramps at one torque of a belt whose friction grows with the temperature; a delay of the
// torque fitted what their forms leave about the peak.
TEST(TorqueDelay, IsNoNameWhereTheTorqueIsHeld) {
  Engine engine(campaign_of(equal_ramps()));
  EXPECT_FALSE(engine.campaign().torque_moves);
  const Naming naming = name_effects(engine, [] { return false; });
  EXPECT_TRUE(is_named(naming, engine, "friction_temperature"));
  EXPECT_FALSE(is_named(naming, engine, "torque_delay"));
}

// Slip alone moves them there.
TEST(SpeedsMove, NotInRampsAtOneSpeed) { EXPECT_FALSE(campaign_of(equal_ramps()).speeds_move); }

TEST(ChannelSkew, OfASpeedIsOneWhereTheyMove) {
  blind::Trial trial;
  trial.seed = 4;
  blind::Random random(trial.seed);
  trial.plan = blind::draw_plan(random, trial.machine.setting, 8);
  trial.planted.push_back({"channel_skew", {{"delay_s", 0.05}}, "secondary_speed"});
  Engine engine(campaign_of(trial));
  EXPECT_TRUE(engine.campaign().speeds_move);
  const Naming naming = name_effects(engine, [] { return false; });
  EXPECT_TRUE(is_named(naming, engine, "channel_skew"));
}

// Of a pressure that is held there is its noise alone, which a lag takes off.
TEST(PressureMoves, NotByItsNoise) {
  const estimator::VariatorParameters variator;
  const auto moves = [&](double ramp_Pa_s) {
    const SignalTable table = rig_table(4000, 0.01, [&](double t_s) -> RigSample {
      return {100.0, 100.0 * variator.ratio_overdrive * 0.995,
              6e5 - ramp_Pa_s * t_s + 5e3 * std::sin(1700.0 * t_s), 50.0};
    });
    return make_campaign({prepare(table, variator)}, nominal_model(variator)).pressure_moves;
  };
  EXPECT_FALSE(moves(0.0));
  EXPECT_TRUE(moves(4e3));
}

TEST(TorqueDelay, IsOneWhereItIsMoved) {
  blind::Trial trial;
  trial.seed = 4;
  blind::Random random(trial.seed);
  trial.plan = blind::draw_plan(random, trial.machine.setting, 8);
  trial.planted.push_back({"torque_delay", {{"delay_s", 0.12}}, {}});
  Engine engine(campaign_of(trial));
  EXPECT_TRUE(engine.campaign().torque_moves);
  const Naming naming = name_effects(engine, [] { return false; });
  EXPECT_TRUE(is_named(naming, engine, "torque_delay"));
}

}  // namespace
}  // namespace beltgrip::diagnose
