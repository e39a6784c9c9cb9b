// The next experiment is the one that is expected to tell most: the planned run is what the model
// says, and the choice is that of somebody who knows the physics.
#include "tools/diagnose/decide/next_ramp.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "tests/tools/diagnose/recorded_runs.h"

namespace beltgrip::diagnose {
namespace {

blind::Trial equal_ramps(const std::vector<blind::Planted>& planted = {}) {
  blind::Trial out;
  out.seed = 21;
  out.plan = blind::paper_plan(6);
  out.planted = planted;
  return out;
}

Engine fitted(const blind::Trial& trial) {
  Engine out(campaign_of(trial));
  out.fit_machine();
  out.update_noise();
  return out;
}

int slot_of(const Engine& engine, std::string_view effect, std::string_view parameter) {
  const std::vector<Slot>& slots = engine.campaign().slots;
  const auto found = std::find_if(slots.begin(), slots.end(), [&](const Slot& each) {
    return each.row->id == effect && each.row->parameter == parameter;
  });
  return found == slots.end() ? -1 : static_cast<int>(found - slots.begin());
}

Ramp some_ramp() {
  Ramp out;
  out.speed_rad_s = 160.0;
  out.torque_Nm = 50.0;
  out.oil_C = 80.0;
  out.start_force_N = 6000.0;
  out.ramp_N_s = 240.0;
  return out;
}

// A torque that no clamp force of the menu carries.
TEST(PlannedRun, SaysNothingWhereTheBeltDoesNotGrip) {
  const Engine engine = fitted(equal_ramps());
  ModelState state = engine.state();
  state.effects[slot_of(engine, "torque_delay", "delay_s")] = 0.05;
  Ramp ramp = some_ramp();
  ramp.start_force_N = 1500.0;
  ramp.torque_Nm = 400.0;
  const Campaign planned = planned_next(engine.campaign(), ramp, state);
  EXPECT_EQ(planned.runs[engine.campaign().runs.size()].valid_count, 0);
}

// Asked for its torque before any of its samples counts.
TEST(PlannedRun, IsOfAMachineWhoseFrictionFollowsTheTorque) {
  const Engine engine = fitted(equal_ramps());
  ModelState state = engine.state();
  estimator::LearnedTerm term;
  term.point = estimator::LearnedPoint::kFriction;
  term.variable = estimator::LearnedVariable::kTorque;
  term.count = 2;
  term.knot = {20.0, 80.0};
  term.value = {0.0, 0.06};
  state.learned = {term};
  const Campaign planned = planned_next(engine.campaign(), some_ramp(), state);
  const int run = static_cast<int>(engine.campaign().runs.size());
  ASSERT_GT(planned.runs[static_cast<std::size_t>(run)].valid_count, 100);
  EXPECT_LT(residuals_of(planned, run, state).value[kFrictionResidual].abs().maxCoeff(), 0.01);
}

TEST(PlannedRun, LeavesNothingUnderTheStateThatItWasMadeWith) {
  const Engine engine = fitted(equal_ramps());
  ModelState state = engine.state();
  state.effects[slot_of(engine, "centrifugal_force", "coefficient_N_s2")] = 0.004;
  state.effects[slot_of(engine, "torque_loss", "per_kN_Nm")] = 0.3;
  state.effects[slot_of(engine, "speed_scale", "secondary")] = 0.004;
  const Campaign planned = planned_next(engine.campaign(), some_ramp(), state);
  const int run = static_cast<int>(engine.campaign().runs.size());
  const Residuals same = residuals_of(planned, run, state);
  const Residuals other = residuals_of(planned, run, engine.state());
  EXPECT_GT(planned.runs[static_cast<std::size_t>(run)].valid_count, 100);
  for (const auto kind :
       {static_cast<std::size_t>(kFrictionResidual), static_cast<std::size_t>(kBalanceResidual)}) {
    EXPECT_LT(same.value[kind].abs().maxCoeff(), 0.01) << kind;
    EXPECT_GT(other.value[kind].abs().maxCoeff(), 3.0) << kind;  // sigmas
  }
}

TEST(PlannedRun, GoesToThePeakAndUpAgain) {
  const Engine engine = fitted(equal_ramps());
  const Campaign planned = planned_next(engine.campaign(), some_ramp(), engine.state());
  const int run = static_cast<int>(engine.campaign().runs.size());
  const ExperimentData& data = planned.runs[static_cast<std::size_t>(run)];
  const Residuals at = residuals_of(planned, run, engine.state());
  EXPECT_GT(at.foot.maxCoeff(), 0.8);  // slip over that at the peak
  EXPECT_LT(at.foot.maxCoeff(), 1.0);
  const auto turn = std::min_element(data.pressure.value.begin(), data.pressure.value.end());
  EXPECT_GT(turn - data.pressure.value.begin(), 60);
  EXPECT_GT(data.pressure.value.end() - turn, 60);
}

// Pulleys that give way read as slip: a ramp that turned at that would not begin.
TEST(NextRamp, TurnsBehindWhatReadsAsSlipAtItsStart) {
  const Engine engine = fitted(equal_ramps());
  ModelState state = engine.state();
  state.nuisance[kDeformationPerkN2] = 0.0;
  for (const double per_kN : {0.0, 3e-3, 1e-2}) {
    state.nuisance[kDeformationPerkN] = per_kN;
    const Ramp ramp = ramp_like_first(engine.campaign(), state, Varied::kRepeat);
    EXPECT_GT(ramp.turn_slip_percent, 0.1 * per_kN * ramp.start_force_N + 0.5) << per_kN;
    EXPECT_GE(ramp.turn_slip_percent, 3.0);
  }
}

TEST(NextRamp, TurnsBehindALatePeak) {
  const Engine engine = fitted(equal_ramps());
  ModelState state = engine.state();
  state.nuisance[kLnPeakSlipOverdrive] = std::log(0.045);
  const Ramp ramp = ramp_like_first(engine.campaign(), state, Varied::kRepeat);
  EXPECT_GT(ramp.turn_slip_percent, 4.5);
  EXPECT_LT(ramp.turn_slip_percent, 8.0);
}

// By integration over the time since the peak, of a force that falls on: what the belt slips until
// it is gripped, 0.15 s behind the turn.
TEST(NextRamp, FallsSoSlowlyThatTheBeltIsGrippedInTime) {
  const Engine engine = fitted(equal_ramps());
  for (const double peak_slip : {0.015, 0.03, 0.045}) {
    ModelState state = engine.state();
    state.nuisance[kLnPeakSlipOverdrive] = std::log(peak_slip);
    state.nuisance[kSecondaryInertia_kgm2] = 0.05;
    state.nuisance[kDeformationPerkN] = state.nuisance[kDeformationPerkN2] = 0.0;
    const Ramp ramp = ramp_like_first(engine.campaign(), state, Varied::kRate);
    const double ratio = engine.campaign().variator.ratio_overdrive;
    const double slips_N = ramp.grip_step_N / 0.3;
    double slip = peak_slip, rate = 0.0, force_N = slips_N, gripped_s = 1e9;
    for (double t_s = 0.0; t_s < gripped_s; t_s += 1e-4) {
      if (slip >= 0.01 * ramp.turn_slip_percent && gripped_s > 1e8) gripped_s = t_s + 0.15;
      force_N -= 1e-4 * ramp.ramp_N_s;
      rate += 1e-4 * (1.0 - force_N / slips_N) * ramp.torque_Nm / ratio /
              (0.05 * ratio * ramp.speed_rad_s);
      slip += 1e-4 * rate;
    }
    EXPECT_LT(slip, 0.092) << peak_slip;
  }
}

// A peak behind all slip that a belt may have: the ramp turns before it, and takes no longer than
// any other.
TEST(NextRamp, EndsWhereThePeakIsFarBehind) {
  const Engine engine = fitted(equal_ramps());
  ModelState state = engine.state();
  for (const double peak_slip : {0.07, 0.1, 0.5}) {
    state.nuisance[kLnPeakSlipOverdrive] = std::log(peak_slip);
    Ramp ramp = ramp_like_first(engine.campaign(), state, Varied::kRepeat);
    ASSERT_GE(ramp.ramp_N_s, 20.0) << peak_slip;
    EXPECT_LT(ramp.turn_slip_percent, 9.0) << peak_slip;
    for (const double ramp_N_s : {ramp.ramp_N_s, 0.01, 0.0}) {
      ramp.ramp_N_s = ramp_N_s;
      const Campaign planned = planned_next(engine.campaign(), ramp, state);
      EXPECT_LE(planned.runs[engine.campaign().runs.size()].size(), 600) << peak_slip;
    }
  }
}

// Oil that turns fast presses by itself: no ramp of the pressure ends below that.
TEST(NextRamp, IsNoFasterThanTheTurningOilLetsItSlip) {
  const Engine engine = fitted(equal_ramps());
  Campaign campaign = engine.campaign();
  campaign.variator.secondary_centrifugal_N_s2 = 0.05;
  const Ramp ramp = ramp_like_first(campaign, engine.state(), Varied::kSpeed);
  const double radius_m = campaign.variator.primary_radius_overdrive_m;
  const double slips_N = ramp.torque_Nm * std::cos(campaign.variator.half_wedge_angle_rad) /
                         (2.0 * radius_m * std::exp(engine.state().nuisance[kLnMuMax]));
  const double omega_s_rad_s = ramp.speed_rad_s * campaign.variator.ratio_overdrive;
  EXPECT_LT(campaign.variator.secondary_spring_force_N + 0.05 * omega_s_rad_s * omega_s_rad_s,
            0.9 * slips_N);
}

// A ratio error at one end stop and a scale error of a speed: the other end stop tells.
TEST(NextRamp, GoesToTheOtherEndStopWhereOnlyThatTells) {
  const Engine engine = fitted(equal_ramps({{"speed_scale", {{"secondary", 0.006}}, {}}}));
  std::vector<Hypothesis> rivals;
  for (const int slot : {slot_of(engine, "speed_scale", "secondary"),
                         slot_of(engine, "end_stop_ratio", "overdrive")}) {
    ASSERT_GE(slot, 0);
    rivals.push_back(engine.refine({slot}, 20));
  }
  const auto next = tell_apart(engine, rivals);
  ASSERT_TRUE(next);
  EXPECT_TRUE(next->ramp.is_low);
  EXPECT_GT(next->nats, 3.0);
}

// The same cause twice: nothing to tell.
TEST(NextRamp, IsNoneBetweenWhatDoesTheSame) {
  const Engine engine = fitted(equal_ramps({{"spring_force", {{"force_N", -400.0}}, {}}}));
  std::vector<Hypothesis> rivals;
  for (const int slot : {slot_of(engine, "spring_force", "force_N"),
                         slot_of(engine, "pressure_offset", "offset_Pa")}) {
    ASSERT_GE(slot, 0);
    rivals.push_back(engine.refine({slot}, 20));
  }
  EXPECT_FALSE(tell_apart(engine, rivals));
}

TEST(NextRamp, TurnsFasterToSeeTheOilTurning) {
  const Engine engine = fitted(equal_ramps());  // at 105 rad/s
  const int slot = slot_of(engine, "centrifugal_force", "coefficient_N_s2");
  const auto next = look_for(engine, {{slot, 1.0}});
  ASSERT_TRUE(next);
  EXPECT_EQ(next->slot, slot);
  EXPECT_GE(next->ramp.speed_rad_s, 160.0);
}

// What was followed is worth less the next time.
TEST(NextRamp, IsWorthLessOnceItWasMade) {
  blind::Trial trial = equal_ramps();
  const Engine before = fitted(trial);
  const std::vector<WantedSlot> wanted{
      {slot_of(before, "centrifugal_force", "coefficient_N_s2"), 1.0}};
  const auto first = look_for(before, wanted);
  ASSERT_TRUE(first);
  blind::PlannedRun run;
  run.low = first->ramp.is_low;
  run.speed_rad_s = first->ramp.speed_rad_s;
  run.torque_Nm = first->ramp.torque_Nm;
  run.temperature_C = first->ramp.oil_C;
  run.ramp_N_s = first->ramp.ramp_N_s;
  trial.plan.push_back(run);
  const auto second = look_for(fitted(trial), wanted);
  EXPECT_LT(second ? second->nats : 0.0, 0.7 * first->nats);
}

// No ramp at constant speed shows what an inertia takes.
TEST(NextRamp, IsNoneForWhatNoRampShows) {
  const Engine engine = fitted(equal_ramps());
  const int slot = slot_of(engine, "inertia_torque", "inertia_kg_m2");
  ASSERT_GE(slot, 0);
  EXPECT_FALSE(look_for(engine, {{slot, 1.0}}));
  EXPECT_FALSE(look_for(engine, {}));
}

}  // namespace
}  // namespace beltgrip::diagnose
