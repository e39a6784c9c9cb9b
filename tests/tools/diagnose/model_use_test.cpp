// What a model file changes: the simulated machine, and the estimator that is told of it. The truth
// is the simulation's own friction curve.
#include <gtest/gtest.h>

#include <cmath>
#include <nlohmann/json.hpp>
#include <sstream>

#include "estimator/signal/input_correction.h"
#include "tests/support/program.h"
#include "tools/diagnose/model/model_file.h"

namespace beltgrip::test {
namespace {

using nlohmann::json;

TEST(ModelFile, TheNominalOneIsRight) {
  const daemon::ModelFile nominal = diagnose::nominal_model({});
  EXPECT_NO_THROW(diagnose::parse_model(diagnose::model_text(nominal), "m.toml", nominal));
}

TEST(InputCorrection, TakesOutWhatItIsTold) {
  estimator::MachineEffects effects;
  effects.torque_bias_Nm = 3.0;
  effects.torque_gain = 0.05;
  effects.pressure_offset_Pa = 20e3;
  effects.pressure_gain = 0.02;
  effects.spring_N = 150.0;
  effects.secondary_speed_scale = 0.004;
  effects.end_stop_overdrive = -0.003;
  effects.deformation_per_kN = 2e-3;
  effects.loss_per_kN_Nm = 0.4;
  const estimator::VariatorParameters variator;
  estimator::InputCorrection correction(effects, variator, 200.0);
  // Truth: 40 Nm on the belt, 3 kN, slip 1 %.
  const double force_N = 3000.0, slip_share = 0.01, belt_Nm = 40.0;
  estimator::VariatorSample measured;
  measured.usable = true;
  measured.omega_p_rad_s = 105.0;
  const double ratio = variator.ratio_overdrive * (1.0 - 0.003) * (1.0 - 2e-3 * 3.0);
  measured.omega_s_rad_s = 105.0 * ratio * (1.0 - slip_share) * 1.004;
  measured.secondary_pressure_Pa = (force_N - 150.0 - 500.0) / 0.0113 * 1.02 + 20e3;
  measured.torque_Nm = (belt_Nm + 0.4 * 3.0) * 1.05 + 3.0;
  const estimator::VariatorSample& out = correction.correct(measured);
  EXPECT_NEAR(out.torque_Nm, belt_Nm, 1e-9);
  EXPECT_NEAR(out.secondary_pressure_Pa * 0.0113 + 500.0, force_N, 1e-6);
  EXPECT_NEAR(1.0 - out.omega_s_rad_s / out.omega_p_rad_s / variator.ratio_overdrive, slip_share,
              1e-12);
  EXPECT_EQ(correction.latency_s(), 0.0);
}

TEST(InputCorrection, OneLateChannelMakesTheOthersWait) {
  estimator::MachineEffects effects;
  effects.torque_delay_s = 0.0525;
  effects.lag_time_constant_s = 0.1;
  estimator::InputCorrection correction(effects, {}, 200.0);
  EXPECT_DOUBLE_EQ(correction.latency_s(), 0.0525);
  estimator::VariatorSample measured, out;
  measured.usable = true;
  for (int i = 0; i < 400; ++i) {
    const double t = 0.005 * i;
    measured.omega_p_rad_s = 100.0 + t;
    measured.omega_s_rad_s = 200.0 + 2.0 * t;
    measured.torque_Nm = 50.0 + 10.0 * (t - 0.0525);  // late
    measured.secondary_pressure_Pa = 5e5 + 1e4 * t;
    out = correction.correct(measured);
  }
  const double then = 0.005 * 399 - 0.0525;
  EXPECT_NEAR(out.torque_Nm, 50.0 + 10.0 * then, 1e-9);
  EXPECT_NEAR(out.omega_p_rad_s, 100.0 + then, 1e-9);
  EXPECT_NEAR(out.omega_s_rad_s, 200.0 + 2.0 * then, 1e-9);
  EXPECT_NEAR(out.secondary_pressure_Pa, 5e5 + 1e4 * (then - 0.1), 0.1);  // a lag follows by tau
}

class Machine : public testing::Test {
 protected:
  // mu_max of a ramp on the rig whose machine is `truth`, by an estimator that is told `told`.
  double mu_max(const std::string& truth, const std::string& told) {
    place_.write("truth.toml", truth);
    const RunResult made = beltgrip({"simulate", "--scenario", "paper-rig", "--seed", "5", "--set",
                                     "clamp.ramp_N_per_s=60", "--model", place_.path("truth.toml"),
                                     "--out-dir", place_.path("rig"), "--force"});
    EXPECT_EQ(made.status, 0) << made.err;
    place_.write("rig/told.toml", told);
    const json sealed = json::parse(place_.read("rig/truth.json"));
    EXPECT_NEAR(sealed.at("experiments")[0].at("mu_max").get<double>(), 0.105, 1e-6);
    std::string config = place_.read("rig/beltgrip.toml");
    if (!told.empty()) {
      config.insert(config.find("[estimator]\n") + 12, "model = \"told.toml\"\n");
    }
    place_.write("rig/told-config.toml", config);
    const RunResult replayed = beltgrip({"replay", place_.path("rig/trace.log"), "--config",
                                         place_.path("rig/told-config.toml"), "--json", "-"});
    EXPECT_EQ(replayed.status, 0) << replayed.err;
    std::istringstream lines(replayed.out);
    std::string first;
    std::getline(lines, first);
    const json result = json::parse(first, nullptr, false);
    if (!result.contains("mu_max") || result.at("mu_max").is_null()) {
      ADD_FAILURE() << replayed.out;
      return 0.0;
    }
    return result.at("mu_max");
  }

  Workplace place_;
};

TEST_F(Machine, AToldEstimatorIsNearerToTheTruth) {
  struct Case {
    const char* model;
    double before_min;  // relative error of an estimator that is not told, at least
  };
  constexpr Case kCases[] = {
      {"[effects.torque_loss]\nconstant_Nm = 1.0\nper_kN_Nm = 0.4\n", 0.02},
      {"[effects.torque_bias]\nbias_Nm = -3.0\n", 0.04},
      {"[effects.torque_gain]\ngain = 0.05\n", 0.03},
      {"[effects.pressure_offset]\noffset_Pa = 2.0e4\n", 0.05},
      {"[effects.pressure_gain]\ngain = -0.04\n", 0.03},
      {"[effects.spring_force]\nforce_N = 200.0\n", 0.05},
      {"[effects.centrifugal_force]\ncoefficient_N_s2 = 5e-3\n", 0.05},
      {"[effects.clamp_hysteresis]\nforce_N = 150.0\n", 0.03},
      {"[variator]\nsecondary_piston_area_m2 = 0.0118\n[driveline]\nloss_constant_Nm = 2.0\n",
       0.02},
  };
  for (const Case& each : kCases) {
    const double before = std::abs(mu_max(each.model, "") / 0.105 - 1.0);
    const double after = std::abs(mu_max(each.model, each.model) / 0.105 - 1.0);
    EXPECT_GT(before, each.before_min) << each.model;
    EXPECT_LT(after, 0.004) << each.model;
  }
}

TEST_F(Machine, DelaysAndGeometryAreTakenOutToo) {
  // They move the curve in slip and time, less its height: with the model it is where it was.
  const std::string model =
      "[effects.torque_delay]\ndelay_s = 0.08\n[effects.hydraulic_lag]\ntime_constant_s = 0.3\n"
      "[effects.pulley_deformation]\nper_kN = 3e-3\n[effects.end_stop_ratio]\noverdrive = 0.004\n";
  EXPECT_NEAR(mu_max(model, model), 0.105, 0.0004);
}

TEST_F(Machine, FrictionDependsAsTheModelSays) {
  place_.write("cold.toml", "[effects.friction_temperature]\nper_K = -1e-3\n");
  const RunResult made =
      beltgrip({"simulate", "--scenario", "paper-rig", "--set", "run.oil_degC=40", "--set",
                "clamp.ramp_N_per_s=60", "--model", place_.path("cold.toml"), "--json", "-"});
  EXPECT_EQ(made.status, 0) << made.err;
  EXPECT_NE(made.out.find("\"mu_max\":0.1092"), std::string::npos) << made.out;  // 0.105 * 1.04
}

TEST_F(Machine, AModelThatCannotBeUsedIsSaid) {
  place_.write("bad.toml", "[effects.torque_bias]\nbias = 1\n");
  const RunResult bad = beltgrip({"simulate", "--model", place_.path("bad.toml")});
  EXPECT_EQ(bad.status, 78);
  EXPECT_NE(bad.err.find("bad.toml:2: effects.torque_bias.bias: found an unknown key, expected "
                         "bias_Nm"),
            std::string::npos)
      << bad.err;
  EXPECT_EQ(beltgrip({"simulate", "--model", place_.path("none.toml")}).status, 66);
}

}  // namespace
}  // namespace beltgrip::test
