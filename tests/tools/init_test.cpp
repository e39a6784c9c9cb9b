// beltgrip init: names of signals as real cars have them are split into words, roles found by word
// and unit, every guess marked; the proposal for a fitting DBC can be used as it is.
#include <gtest/gtest.h>

#include "can_dbc/dbc_parser.h"
#include "tests/tools/program.h"
#include "tools/cli/role_guess.h"

namespace beltgrip {
namespace {

using Words = std::vector<std::string>;

TEST(Words, OfNamesInEveryStyle) {
  EXPECT_EQ(cli::words_of("PrimaryPulleySpeed"), (Words{"primary", "pulley", "speed"}));
  EXPECT_EQ(cli::words_of("N_PrimSpd2"), (Words{"n", "prim", "spd"}));
  EXPECT_EQ(cli::words_of("CVTOilTemp"), (Words{"cvt", "oil", "temp"}));
  EXPECT_EQ(cli::words_of("ENGINE_RPM"), (Words{"engine", "rpm"}));
  EXPECT_EQ(cli::words_of("__1"), Words{});
}

constexpr const char* kCar = R"(VERSION ""
BO_ 256 ENGINE_DATA: 8 ECU
 SG_ ENGINE_RPM : 0|16@1+ (0.25,0) [0|16000] "rpm" X
 SG_ EngTrqActual : 16|16@1- (0.1,0) [-500|500] "Nm" X
 SG_ EngTrqRequest : 32|16@1- (0.1,0) [-500|500] "Nm" X
BO_ 257 CVT_1: 8 TCU
 SG_ InputShaftSpeed : 0|16@1+ (1,0) [0|16000] "1/min" X
 SG_ OutputShaftSpeed : 16|16@1+ (1,0) [0|16000] "1/min" X
 SG_ SecPressTarget : 32|16@1+ (1,0) [0|8000] "kPa" X
 SG_ SecPress : 48|16@1+ (1,0) [0|8000] "kPa" X
BO_ 258 CVT_2: 8 TCU
 SG_ CvtOilTemp : 0|8@1+ (1,-40) [-40|215] "degC" X
 SG_ LockUpEngaged : 8|1@1+ (1,0) [0|1] "" X
 SG_ BrakeSwitch : 9|1@1+ (1,0) [0|1] "" X
 SG_ VehicleSpeed : 16|16@1+ (0.01,0) [0|300] "km/h" X
 SG_ AccelPedalPos : 32|8@1+ (0.4,0) [0|100] "%" X
 SG_ WheelSpeedFL : 40|16@1+ (0.01,0) [0|300] "km/h" X
)";

std::string guess(daemon::Role role) {
  static const std::vector<can::Database> databases = {can::parse_dbc(kCar).database};
  const auto candidates = cli::guess_role(role, databases);
  return candidates.empty() ? "" : candidates.front().signal->name;
}

TEST(Roles, AreFoundByWordAndUnit) {
  using daemon::Role;
  EXPECT_EQ(guess(Role::kPrimarySpeed), "InputShaftSpeed");
  EXPECT_EQ(guess(Role::kSecondarySpeed), "OutputShaftSpeed");
  EXPECT_EQ(guess(Role::kSecondaryPressure), "SecPress");
  EXPECT_EQ(guess(Role::kSecondaryPressureCommand), "SecPressTarget");
  EXPECT_EQ(guess(Role::kEngineTorque), "EngTrqActual");
  EXPECT_EQ(guess(Role::kEngineSpeed), "ENGINE_RPM");
  EXPECT_EQ(guess(Role::kOilTemperature), "CvtOilTemp");
  EXPECT_EQ(guess(Role::kVehicleSpeed), "VehicleSpeed");
  EXPECT_EQ(guess(Role::kAcceleratorPedal), "AccelPedalPos");
  EXPECT_EQ(guess(Role::kBrakePressed), "BrakeSwitch");
  EXPECT_EQ(guess(Role::kLockupClosed), "LockUpEngaged");
  EXPECT_EQ(guess(Role::kPrimaryTorque), "");
  EXPECT_EQ(guess(Role::kPrimaryPressure), "");
}

TEST(Init, ProposalForTheRigCanBeUsedAsItIs) {
  test::Workplace place;
  ASSERT_EQ(test::beltgrip({"simulate", "--start", "80", "--out-dir", place.path("")}).status, 0);
  const auto made = test::beltgrip({"init", place.path("vehicle.dbc"), "--interface", "can3",
                                    "--out", place.path("proposed.toml")});
  ASSERT_EQ(made.status, 0) << made.err;
  std::string text = place.read("proposed.toml");
  EXPECT_NE(text.find("interface = \"can3\""), std::string::npos);
  EXPECT_NE(text.find("primary_torque     = \"RIG_Torque.PrimaryTorque\"   # guessed, Nm"),
            std::string::npos)
      << text;
  place.write("proposed.toml", text + "\n[experiment]\ntrigger = \"always\"\n");
  const auto replayed =
      test::beltgrip({"replay", place.path("trace.log"), "--config", place.path("proposed.toml")});
  EXPECT_EQ(replayed.status, 0) << replayed.err;
  EXPECT_NE(replayed.out.find("completed"), std::string::npos) << replayed.out;
}

TEST(Init, WhatIsMissingIsSaid) {
  test::Workplace place;
  place.write("small.dbc",
              "BO_ 1 M: 8 X\n SG_ PrimarySpeed : 0|16@1+ (1,0) [0|1] \"\" X\n"
              " SG_ SecondarySpeed : 16|16@1+ (1,0) [0|1] \"rpm\" X\n");
  const auto result = test::beltgrip({"init", place.path("small.dbc")});
  ASSERT_EQ(result.status, 0) << result.err;
  EXPECT_NE(result.out.find("\n# primary_speed      = { signal = \"M.PrimarySpeed\", unit = "),
            std::string::npos)
      << result.out;
  EXPECT_NE(result.out.find("\nsecondary_speed    = \"M.SecondarySpeed\""), std::string::npos);
  EXPECT_NE(result.out.find("\n# secondary_pressure = \"Message.Signal\"   # NOT FOUND"),
            std::string::npos);
  EXPECT_NE(result.out.find("\n# engine_torque      = \"Message.Signal\"   # NOT FOUND"),
            std::string::npos);

  EXPECT_EQ(test::beltgrip({"init", place.path("none.dbc")}).status, 66);
  place.write("empty.dbc", "VERSION \"\"\n");
  EXPECT_EQ(test::beltgrip({"init", place.path("empty.dbc")}).status, 65);
}

}  // namespace
}  // namespace beltgrip
