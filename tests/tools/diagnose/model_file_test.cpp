// The model file: what is written reads back; errors name file, line and key.
#include "tools/diagnose/model/model_file.h"

#include <gtest/gtest.h>

#include <string_view>
#include <vector>

#include "tools/diagnose/model/effects/effect.h"

namespace beltgrip::diagnose {
namespace {

std::string file_error_of(const std::string& text) {
  try {
    parse_model(text, "m.toml", nominal_model({}));
  } catch (const ModelError& error) {
    return error.text;
  }
  return "no error";
}

TEST(ModelFile, ReadsBackWhatItWrites) {
  ModelFile model = nominal_model({});
  model.variator.ratio_low = 0.41;
  model.friction["mu_max"] = 0.0937;
  model.driveline["deformation_per_kN"] = 1.25e-3;
  model.effects["wear"].parameters = {{"step", 0.05}, {"at", 4.0}};
  model.effects["channel_skew"].parameters = {{"delay_s", -0.012}};
  model.effects["channel_skew"].role = "secondary_speed";
  const ModelFile read = parse_model(model_text(model), "m.toml", nominal_model({}));
  EXPECT_EQ(model_text(read), model_text(model));
  EXPECT_EQ(read.effects.at("channel_skew").role, "secondary_speed");
}

TEST(ModelFile, WhatWasLearnedReadsBack) {
  ModelFile model = nominal_model({});
  daemon::ModelLearned& learned = model.learned["friction_over_oil_temperature"];
  learned.acts_on = "friction";
  learned.depends_on = {"oil_temperature"};
  learned.knots = {40.0, 60.0, 100.0};
  learned.values = {0.0, -0.02, 1e-3};
  learned.covariance = {4e-6, 1e-6, 0.0, 1e-6, 4e-6, 1e-6, 0.0, 1e-6, 4e-6};
  learned.box["oil_temperature"] = {40.0, 100.0};
  learned.law = "kink at 60 degC";
  const ModelFile read = parse_model(model_text(model), "m.toml", nominal_model({}));
  EXPECT_EQ(model_text(read), model_text(model));
  const std::vector<estimator::LearnedTerm> terms = daemon::learned_terms(read);
  ASSERT_EQ(terms.size(), 1U);
  EXPECT_EQ(terms[0].point, estimator::LearnedPoint::kFriction);
  EXPECT_EQ(terms[0].variable, estimator::LearnedVariable::kOilTemperature);
  EXPECT_DOUBLE_EQ(terms[0].at(50.0), -0.01);
  EXPECT_DOUBLE_EQ(terms[0].at(0.0), 0.0);
}

TEST(ModelFile, WhatIsWrongWithALearnedTermIsNamed) {
  const std::string good = "[learned.a]\nacts_on = \"torque\"\ndepends_on = [\"primary_speed\"]\n";
  EXPECT_EQ(file_error_of(good + "knots = [1, 2]\nvalues = [0, 1.5]\n"), "no error");
  EXPECT_EQ(file_error_of("[learned.a]\nacts_on = \"oil\"\n"),
            "m.toml:2: learned.a.acts_on: found \"oil\", expected one of torque, torque_gain, "
            "clamp_force, ratio or friction");
  EXPECT_EQ(file_error_of(good + "knots = [2, 1]\nvalues = [0, 1]\n"),
            "m.toml:4: learned.a.knots: found 2 numbers, expected 2 to 64 numbers, each above the "
            "last");
  EXPECT_EQ(file_error_of(good + "knots = [1, 2]\nvalues = [0]\n"),
            "m.toml:5: learned.a.values: found 1 numbers, expected 2, one for each knot");
  EXPECT_EQ(file_error_of(good + "knots = [1, 2]\nvalues = [0, 1]\ncovariance = [[1, 2]]\n"),
            "m.toml:6: learned.a.covariance: found 2 numbers, expected 2 rows of 2");
  EXPECT_EQ(
      file_error_of(good + "knots = [1, 2]\nvalues = [0, 1]\nbox = { primary_speed = [2, 1] }\n"),
      "m.toml:6: learned.a.box.primary_speed: found an array, expected [lowest, highest]");
  EXPECT_EQ(file_error_of(good + "knot = [1, 2]\n"),
            "m.toml:4: learned.a.knot: found an unknown key, expected acts_on, depends_on, knots, "
            "values, covariance, box or law; nearest is \"knots\"");
}

// A force of the turning oil that is 5e-4 less than its maker states: the file says it, and a fit
// from it begins there.
TEST(ModelFile, HoldsTheForceOfTheTurningOilThatWasFitted) {
  estimator::VariatorParameters variator;
  variator.secondary_centrifugal_N_s2 = 8e-3;
  ModelFile model = nominal_model(variator);
  Eigen::VectorXd nuisance = Eigen::VectorXd::Zero(kNuisanceCount);
  nuisance[kCentrifugalOff_N_s2] = -5e-4;
  store_machine(nuisance, model);
  EXPECT_NEAR(model.variator.secondary_centrifugal_N_s2, 7.5e-3, 1e-15);
  EXPECT_EQ(nuisances_of(model)[kCentrifugalOff_N_s2].nominal, 0.0);
}

TEST(ModelFile, NominalMachineSurvivesTheWayThroughTheFile) {
  const NuisanceTable direct = default_nuisances();
  const NuisanceTable through = nuisances_of(nominal_model({}));
  for (std::size_t i = 0; i < direct.size(); ++i) {
    EXPECT_NEAR(through[i].nominal, direct[i].nominal, 1e-12) << direct[i].name;
  }
}

// Instances of one effect: a role takes the value to the one that has it alone; one that these data
// do not have, or none, to the one without.
TEST(ModelFile, ARoleSaysWhichInstanceIsMeant) {
  const auto row = [](std::string_view id) -> const EffectRow* {
    for (const EffectRow& each : effect_rows()) {
      if (each.id == id) return &each;
    }
    return nullptr;
  };
  const EffectRow* hysteresis = row("clamp_hysteresis");
  const std::vector<Slot> slots{{hysteresis, 0, ""},
                                {hysteresis, 0, "raised"},
                                {hysteresis, 0, "lowered"},
                                {row("hydraulic_lag"), 0, ""}};
  const auto values = [&](const std::string& role, const std::string& lag_role) {
    ModelFile model = nominal_model({});
    model.effects["clamp_hysteresis"].parameters = {{"force_N", 150.0}};
    model.effects["clamp_hysteresis"].role = role;
    model.effects["hydraulic_lag"].parameters = {{"time_constant_s", 0.1}};
    model.effects["hydraulic_lag"].role = lag_role;
    const Eigen::VectorXd out = slot_values(model, slots);
    return std::vector<double>(out.begin(), out.end());
  };
  EXPECT_EQ(values("", ""), (std::vector<double>{150.0, 0.0, 0.0, 0.1}));
  EXPECT_EQ(values("lowered", "command"), (std::vector<double>{0.0, 0.0, 150.0, 0.1}));
}

TEST(ModelFile, ErrorsNameFileLineAndKey) {
  EXPECT_EQ(file_error_of("[effects.magic]\nsize = 1\n"),
            "m.toml:1: effects.magic: found an unknown effect, expected the name of an effect");
  EXPECT_EQ(file_error_of("[effects.wear]\nsteps = 1\n"),
            "m.toml:2: effects.wear.steps: found an unknown key, expected step, at or "
            "per_experiment; nearest is \"step\"");
  EXPECT_EQ(file_error_of("[variator]\nratio_low = \"a\"\n"),
            "m.toml:2: variator.ratio_low: found \"a\", expected a number from 0.1 to 10");
  EXPECT_EQ(file_error_of("[variator]\nratio_low = 99.0\n"),
            "m.toml:2: variator.ratio_low: found 99, expected a number from 0.1 to 10");
  EXPECT_EQ(file_error_of("[driveline]\ncomand_gain = 1\n")
                .find("m.toml:2: driveline.comand_gain: found an unknown key, expected "
                      "deformation_per_kN, "),
            0U);
}

}  // namespace
}  // namespace beltgrip::diagnose
