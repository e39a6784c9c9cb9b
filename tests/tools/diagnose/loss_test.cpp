// Torque that is lost on its way. Behind the belt, before the torque that is measured at the
// secondary shaft: any machine has some, and a large one is a finding. No loss drives. The
// recordings are the blind generator's.
#include <gtest/gtest.h>

#include <cmath>

#include "tests/tools/diagnose/recorded_runs.h"
#include "tools/diagnose/decide/namer.h"

namespace beltgrip::diagnose {
namespace {

struct Diagnosed {
  Engine engine;
  Naming naming;
};

Diagnosed diagnosed(const blind::Machine& machine) {
  blind::Trial trial;
  trial.seed = 7;
  trial.machine = machine;
  blind::Random random(trial.seed);
  trial.plan = blind::draw_plan(random, trial.machine.setting, 10);
  // Drag at one shaft is told from drag at the other by both end stops.
  for (const std::size_t i : {1U, 4U, 7U}) {
    trial.plan[i].low = true;
    trial.plan[i].torque_Nm = 40.0;
  }
  Engine engine(campaign_of(trial));
  Naming naming = name_effects(engine, [] { return false; });
  return {std::move(engine), std::move(naming)};
}

Diagnosed diagnosed(double drag_Nm, double drag_per_speed_Nms) {
  blind::Machine machine;
  machine.secondary_loss_Nm = drag_Nm;
  machine.secondary_loss_per_speed_Nms = drag_per_speed_Nms;
  return diagnosed(machine);
}

// At 2 % of slip in overdrive, where the generator's belt has its peak of 0.1.
double friction_at_peak(const Diagnosed& d) {
  const Eigen::VectorXd& machine = d.naming.hypothesis.state.nuisance;
  const CurveShape curve(
      std::span<const double, kShapeKnots>(machine.data() + kShapeOverdrive, kShapeKnots), 0.0);
  const double at = std::log(0.02) - machine[kLnPeakSlipOverdrive];
  return std::exp(machine[kLnMuMax]) * curve.evaluate(std::exp(at)).value;
}

// Left out of the machine, 2 Nm at 230 rad/s pass for 5 % of the friction.
TEST(SecondaryLoss, OfAHealthyMachineIsNoFindingAndNoFriction) {
  for (const double drag_Nm : {0.0, 1.2}) {
    SCOPED_TRACE(drag_Nm);
    const Diagnosed d = diagnosed(drag_Nm, drag_Nm / 400.0);
    EXPECT_TRUE(d.naming.accepted.empty());
    EXPECT_NEAR(friction_at_peak(d), 0.1, 0.001);
  }
}

TEST(SecondaryLoss, BeyondThatIsFoundInItsSize) {
  const Diagnosed d = diagnosed(4.5, 0.002);
  ASSERT_EQ(d.naming.accepted.size(), 1U);
  const Accepted& found = d.naming.accepted.front();
  EXPECT_EQ(d.engine.campaign().slots[static_cast<std::size_t>(found.slot)].label(),
            "secondary_loss.constant_Nm");
  // Of the 4.5 Nm some are the machine's own: 0.5 and 0.6 more or less.
  const double size_Nm = d.naming.hypothesis.state.effects[found.slot];
  EXPECT_NEAR(size_Nm + d.naming.hypothesis.state.nuisance[kSecondaryLoss_Nm], 4.5, 0.15);
  EXPECT_NEAR(size_Nm, 4.0, 1.2);
  // And what is lost at the other shaft is that machine's own.
  EXPECT_NEAR(d.naming.hypothesis.state.nuisance[kLossConstant_Nm], 0.5, 0.3);
}

// 5 Nm more at the belt than at the shaft: the shaft's torque is wrong, no bearing drives.
TEST(Loss, ThatDrivesIsNone) {
  blind::Machine machine;
  machine.loss_Nm = -5.0;
  const Diagnosed d = diagnosed(machine);
  bool named = false;
  for (const Accepted& each : d.naming.accepted) {
    const Slot& slot = d.engine.campaign().slots[static_cast<std::size_t>(each.slot)];
    if (slot.row->id == "torque_loss") {
      EXPECT_GT(d.naming.hypothesis.state.effects[each.slot], -1.0);
    }
    named |= slot.row->id == "torque_bias";
  }
  EXPECT_TRUE(named);
}

TEST(SecondaryLoss, IsNothingToFitWithoutThatTorque) {
  blind::Trial trial;
  trial.seed = 3;
  trial.plan = blind::paper_plan(1);
  SignalTable table = parse_csv(blind::record(trial).csv.front(), "run.csv");
  table[Role::kSecondaryTorque] = {};
  const std::vector<ExperimentData> runs{prepare(table, {})};
  for (const Slot& slot : make_slots(runs)) EXPECT_NE(slot.row->id, "secondary_loss");
}

}  // namespace
}  // namespace beltgrip::diagnose
