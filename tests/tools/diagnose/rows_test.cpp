// What is done to all samples in lanes is what the equations say sample by sample or one array
// after the other: the same bits.
#include <gtest/gtest.h>

#include <bit>
#include <cmath>
#include <random>

#include "tests/tools/diagnose/recorded_runs.h"
#include "tools/diagnose/infer/residuals.h"
#include "tools/diagnose/model/curve_family.h"
#include "tools/diagnose/model/lanes.h"

namespace beltgrip::diagnose {
namespace {

using Eigen::ArrayXd;
using Eigen::Index;

// But for the sign of zero.
void expect_same(const ArrayXd& found, const ArrayXd& expected) {
  ASSERT_EQ(found.size(), expected.size());
  for (Index k = 0; k < found.size(); ++k) {
    ASSERT_EQ(std::bit_cast<std::uint64_t>(found[k] + 0.0),
              std::bit_cast<std::uint64_t>(expected[k] + 0.0))
        << k << ": " << found[k] << ", expected " << expected[k];
  }
}

// One experiment at each end stop.
const Campaign& recorded(blind::Setting setting) {
  const auto record = [](blind::Setting of) {
    blind::Trial trial;
    trial.machine.setting = of;
    blind::PlannedRun run;
    run.duration_s = 30.0;
    for (const bool low : {false, true}) {
      run.low = low;
      trial.plan.push_back(run);
    }
    return campaign_of(trial);
  };
  static const Campaign kRig = record(blind::Setting::kRig), kCar = record(blind::Setting::kCar);
  return setting == blind::Setting::kRig ? kRig : kCar;
}

ModelState somewhere(const Campaign& campaign) {
  std::mt19937_64 random(3);
  std::uniform_real_distribution<double> off(-0.5, 0.5);
  ModelState out;
  out.nuisance.resize(kNuisanceCount);
  for (int i = 0; i < kNuisanceCount; ++i) {
    const NuisanceRow& row = campaign.nuisances[static_cast<std::size_t>(i)];
    const double tolerance = i >= kShapeOverdrive && i <= kEndOfShapes ? 0.05 : row.tolerance;
    out.nuisance[i] = row.nominal + off(random) * tolerance;
  }
  out.nuisance[kPlay_N] = 0.0;  // no equation of single samples
  out.effects.setZero(static_cast<Index>(campaign.slots.size()));
  return out;
}

TEST(Rows, AreTheSameByAnyRegisters) {
  std::mt19937_64 random(5);
  std::normal_distribution<double> normal;
  const ArrayXd a = ArrayXd::NullaryExpr(103, [&] { return normal(random); });
  const ArrayXd b = ArrayXd::NullaryExpr(103, [&] { return normal(random); });
  const auto by = [&](auto rows) {
    ArrayXd out(a.size());
    rows(a.size(), [a = a.data(), b = b.data(), to = out.data()](std::ptrdiff_t k) BELTGRIP_INLINE {
      to[k] = a[k] / b[k] + std::max(a[k] * b[k], 0.1) * a[k];
    });
    return out;
  };
  const ArrayXd by_two = by([](auto... all) { rows_by_two(all...); });
  expect_same(by([](auto... all) { for_rows(all...); }), by_two);
  expect_same(by_two, a / b + (a * b).max(0.1) * a);
}

TEST(Rows, TheMachineIsWhatItsEquationsSayOfWholeArrays) {
  for (const blind::Setting setting : {blind::Setting::kRig, blind::Setting::kCar}) {
    const Campaign& campaign = recorded(setting);
    const estimator::VariatorParameters& variator = campaign.variator;
    const ModelState state = somewhere(campaign);
    const Eigen::VectorXd& x = state.nuisance;
    for (int run = 0; run < static_cast<int>(campaign.runs.size()); ++run) {
      const ExperimentData& data = campaign.runs[static_cast<std::size_t>(run)];
      const ArrayXd pressure = data.pressure.value + 1e3, torque = data.torque.value - 0.5;
      const Quantities q = quantities(campaign, data, {pressure, torque}, run, state);
      const bool low = run == 1;
      const ArrayXd omega_p = data.omega_p.value, omega_s = data.omega_s.value;
      const ArrayXd beside = variator.secondary_spring_force_N +
                             variator.secondary_centrifugal_N_s2 * omega_s.square();
      const ArrayXd force = variator.secondary_piston_area_m2 * pressure + beside;
      expect_same(q.force_N, force);
      ArrayXd loss =
          x[kLossConstant_Nm] + x[kLossPerSpeed_Nms] * omega_p + x[kLossPerkN_Nm] * 1e-3 * force;
      if (data.torque_is_engine) {
        loss += variator.primary_inertia_kg_m2 *
                (data.omega_p.slope + data.omega_p.slow_slope - data.omega_p.slow_slope);
      }
      expect_same(q.belt_torque, torque - loss);
      const ArrayXd deformation =
          x[kDeformationPerkN] * 1e-3 * force + x[kDeformationPerkN2] * 1e-6 * force.square();
      expect_same(q.deformation, deformation);
      const double unloaded = low ? variator.ratio_low * std::exp(x[kLnRatioLow])
                                  : variator.ratio_overdrive * std::exp(x[kLnRatioOverdrive]);
      const ArrayXd ratio = unloaded * (1.0 - deformation).max(0.05);
      const auto is_valid = [&](Index k) { return data.valid[static_cast<std::size_t>(k)]; };
      const auto valid = [&](const ArrayXd& values) {
        ArrayXd out = ArrayXd::Zero(values.size());
        for (Index k = 0; k < out.size(); ++k) {
          if (is_valid(k)) out[k] = values[k];
        }
        return out;
      };
      expect_same(valid(q.ratio), valid(ratio));
      expect_same(valid(q.slip_share), valid(1.0 - omega_s / (omega_p * ratio)));
      const double lever_m =
          2.0 / std::cos(variator.half_wedge_angle_rad) * std::exp(x[kLnMuMax]) *
          (low ? variator.primary_radius_low_m : variator.primary_radius_overdrive_m);
      expect_same(valid(q.capacity), valid(lever_m * force.max(50.0)));
      if (!data.torque_s.present) continue;
      ArrayXd balance = q.belt_torque + data.torque.slow - torque -
                        q.ratio * (1.0 + x[kDeformationLost] * deformation) *
                            (data.torque_s.slow / (1.0 + x[kSecondaryTorqueGain]) +
                             x[kSecondaryInertia_kgm2] * data.omega_s.slow_slope +
                             (x[kSecondaryLoss_Nm] + x[kSecondaryLossPerSpeed_Nms] * omega_s +
                              x[kSecondaryLossPerkN_Nm] * 1e-3 * force));
      if (data.torque_is_engine) {
        balance += variator.primary_inertia_kg_m2 * (data.omega_p.slope - data.omega_p.slow_slope);
      }
      expect_same(valid(q.balance), valid(balance));
    }
  }
}

// Of the whole experiment, where one exponential is taken, and of each sample.
TEST(Rows, FrictionIsChangedByWhatTheEffectSays) {
  const Campaign& campaign = recorded(blind::Setting::kRig);
  constexpr double kSize = 0.03;
  constexpr int kRun = 1;
  const ExperimentData& data = campaign.runs[kRun];
  const ModelState before = somewhere(campaign);
  const ArrayXd without = quantities(campaign, data, kRun, before).capacity;
  int tried = 0;
  for (std::size_t i = 0; i < campaign.slots.size(); ++i) {
    const std::string label = campaign.slots[i].label();
    ArrayXd factor;
    if (label == "wear.per_experiment") factor.setConstant(data.size(), 1.0 - kSize * kRun);
    if (label == "friction_speed.per_ln_speed") {
      factor = 1.0 + kSize * (data.omega_p.value / 105.0).log();
    }
    if (factor.size() == 0) continue;
    ModelState with = before;
    with.effects[static_cast<Index>(i)] = kSize;
    const ArrayXd found = quantities(campaign, data, kRun, with).capacity;
    EXPECT_LT((found / (without * factor) - 1.0).abs().maxCoeff(), 1e-13) << label;
    ++tried;
  }
  EXPECT_EQ(tried, 2);
}

TEST(Rows, DerivativesAreThoseOfEachSample) {
  const Campaign& campaign = recorded(blind::Setting::kRig);
  const ModelState state = somewhere(campaign);
  constexpr double kScale = 0.3;
  for (int run = 0; run < static_cast<int>(campaign.runs.size()); ++run) {
    const ExperimentData& data = campaign.runs[static_cast<std::size_t>(run)];
    Residuals at = residuals_of(campaign, run, state);
    prepare_derivatives(campaign, run, state, at);
    const auto rows = [&](int parameter, ResidualKind kind) {
      return derivative_rows(campaign, run, state, at, parameter,
                             kScale)[static_cast<std::size_t>(kind)];
    };
    const auto expected = [&](auto of_sample) {
      std::vector<double> out;
      for (int k = 0; k < data.size(); ++k) {
        if (data.valid[static_cast<std::size_t>(k)]) out.push_back(of_sample(k) * kScale);
      }
      return ArrayXd(Eigen::Map<const ArrayXd>(out.data(), static_cast<Index>(out.size())));
    };
    ASSERT_GT(data.valid_count, 100);
    expect_same(rows(kLnMuMax, kFrictionResidual),
                expected([&](int k) { return -at.clean_Nm[k] * at.weight[k]; }));
    expect_same(rows(kLossConstant_Nm, kFrictionResidual),
                expected([&](int k) { return -at.weight[k]; }));
    expect_same(rows(kLossConstant_Nm, kBalanceResidual),
                expected([&](int k) { return -at.balance_weight[k]; }));
    const bool low = run == 1;
    const double change = low ? 1.0 : 0.0;
    if (low) {
      expect_same(rows(kLnRatioLow, kFrictionResidual), expected([&](int k) {
                    const double slip_share = (1.0 - at.measured.slip_share[k]) * change;
                    return -(at.slope[k] * slip_share) * at.weight[k];
                  }));
    }
    for (int mode = 0; mode < kShapeKnots; ++mode) {
      const auto of_mode = [&](int k) {
        const double departure = mode_shape(mode).departure(spline_position(std::abs(at.foot[k])));
        return at.calm_capacity_Nm[k] * departure * -std::copysign(at.weight[k], at.foot[k]);
      };
      expect_same(rows(kShapeOverdrive + mode, kFrictionResidual), expected(of_mode));
      if (low) {
        expect_same(rows(kShapeLow + mode, kFrictionResidual), expected(of_mode));
      } else {
        EXPECT_EQ(rows(kShapeLow + mode, kFrictionResidual).size(), 0);
      }
    }
  }
}

}  // namespace
}  // namespace beltgrip::diagnose
