// beltgrip init: names of signals as real cars have them are split into words, roles found by word
// and unit, every guess marked; the proposal for a fitting DBC can be used as it is.
#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <set>
#include <sstream>

#include "can_dbc/dbc/parser.h"
#include "daemon/core/config/load/load_config.h"
#include "daemon/core/config/options/config.h"
#include "tests/support/program.h"
#include "tools/cli/role_guess.h"
#include "tools/cli/role_words.h"

namespace beltgrip {
namespace {

using Words = std::vector<std::string>;

TEST(Words, OfNamesInEveryStyle) {
  EXPECT_EQ(cli::words_of("PrimaryPulleySpeed"), (Words{"primary", "pulley", "speed"}));
  EXPECT_EQ(cli::words_of("N_PrimSpd2"), (Words{"n", "prim", "spd"}));
  EXPECT_EQ(cli::words_of("CVTOilTemp"), (Words{"cvt", "oil", "temp"}));
  EXPECT_EQ(cli::words_of("ENGINE_RPM"), (Words{"engine", "rpm"}));
  EXPECT_EQ(cli::words_of("__1"), Words{});
  EXPECT_EQ(cli::words_of("Sekund\xC3\xA4rdruck, entr\xC3\xA9"
                          "e"),
            (Words{"sekundaerdruck", "entree"}));
  EXPECT_EQ(cli::all_words_of("Motordrehzahl"), (Words{"motordrehzahl", "engine", "drehzahl"}));
  EXPECT_EQ(cli::all_words_of("Sekundaerdruck"), (Words{"sekundaerdruck", "sekundaer", "druck"}));
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

// One signal, by its name, comment and unit.
bool is_candidate(daemon::Role role, const std::string& name, const std::string& unit,
                  const std::string& comment = "", int bits = 16, const std::string& values = "") {
  const std::string dbc =
      "VERSION \"\"\nBO_ 256 Getriebe_1: 8 X\n SG_ " + name + " : 0|" + std::to_string(bits) +
      "@1+ (1,0) [0|1] \"" + unit + "\" X\n" +
      (comment.empty() ? "" : "CM_ SG_ 256 " + name + " \"" + comment + "\";\n") +
      (values.empty() ? "" : "VAL_ 256 " + name + " " + values + " ;\n");
  return !cli::guess_role(role, {can::parse_dbc(dbc).database}).empty();
}

TEST(Roles, AreFoundInFourLanguagesAndByAbbreviations) {
  using daemon::Role;
  struct Case {
    Role role;
    const char* unit;
    std::vector<const char*> names;
  };
  for (const Case& each :
       {Case{Role::kPrimarySpeed,
             "1/min",
             {"Primaerdrehzahl", "NPri", "VitessePrimaire_N", "RegimeEntree", "NyuryokuKaitensu",
              "PuraimariKaiten", "N_Turbine", "Turbinendrehzahl", "Eingangsdrehzahl"}},
        Case{Role::kSecondarySpeed,
             "rpm",
             {"Sekundaerdrehzahl", "NSek", "Abtrieb_Drehzahl", "RegimeSecondaire", "RegimeSortie",
              "ShutsuryokuKaitensu", "nab", "SecPulleySpd"}},
        Case{Role::kSecondaryPressure,
             "bar",
             {"Sekundaerdruck", "PSek", "p_sec", "PressionSecondaire", "SekandariYuatsu"}},
        Case{Role::kEngineTorque,
             "Nm",
             {"Motormoment", "mdmot", "CoupleMoteur", "EnjinToruku", "EngTrqActual"}},
        Case{Role::kEngineSpeed,
             "1/min",
             {"Motordrehzahl", "nmot", "RegimeMoteur", "EnjinKaitensu", "EngSpd"}},
        Case{Role::kOilTemperature,
             "degC",
             {"Oeltemperatur", "Getriebeoeltemperatur", "TemperatureHuile", "YuOn", "CvtfTemp"}},
        Case{Role::kVehicleSpeed,
             "km/h",
             {"Fahrzeuggeschwindigkeit", "vfzg", "VitesseVehicule", "Shasoku", "VSP"}},
        Case{Role::kAcceleratorPedal, "%", {"Fahrpedal", "PedaleAccelerateur", "ApedPos"}}}) {
    for (const char* name : each.names) {
      // "YuOn" is one word to a Japanese engineer.
      const std::string written = std::string(name) == "YuOn" ? "Yuon" : name;
      EXPECT_TRUE(is_candidate(each.role, written, each.unit)) << name;
    }
  }
  for (const char* name : {"Wandlerueberbrueckung", "WK_zu", "Pontage", "Rokkuappu"}) {
    EXPECT_TRUE(is_candidate(daemon::Role::kLockupClosed, name, "", "", 1)) << name;
  }
}

// Whole files in the short styles of makers: the signal of each role that stands as a line; 0:
// none.
TEST(Roles, AreFoundInTheShortStylesOfMakers) {
  using daemon::Role;
  constexpr std::array kRoles{Role::kPrimarySpeed, Role::kSecondarySpeed,  Role::kSecondaryPressure,
                              Role::kEngineTorque, Role::kEngineSpeed,     Role::kOilTemperature,
                              Role::kVehicleSpeed, Role::kAcceleratorPedal};
  struct Style {
    std::array<const char*, 8> names;
    const char *speed_unit, *others;
  };
  const std::array kStyles{
      Style{{"nPrim", "nSek", "pSek", "MMotIst", "nMot", nullptr, "vFzg", nullptr},
            "1/min",
            "nPrimSoll MMotSoll pPrim"},
      Style{{"NPRI", "NSEC", "PSEC", "TQENG", "NENG", "TATF", "VSP", "APO"}, "rpm", "PPRI PSECTGT"},
      Style{{"CVT_DR_PLY_SPD", "CVT_DN_PLY_SPD", "CVT_DN_PLY_PRS", "ENG_TRQ_EST", "ENG_RPM",
             "CVTF_TEMP", nullptr, "PEDAL_GAS"},
            "rpm",
            "CVT_DR_PLY_PRS CVT_DN_PLY_PRS_TGT"},
      Style{{"PrmryPulySpd", "ScndryPulySpd", "ScndryPulyPrs", "EngTrqActExtRng", "EngSpd",
             "TransOilTmp", "VehSpd", nullptr},
            "rpm",
            "PrmryPulyPrs ScndryPulyPrsCmnd EngTrqDrvrReqd"},
      Style{{"VITESSE_POULIE_MOTRICE", "VITESSE_POULIE_MENEE", "PRESSION_POULIE_MENEE",
             "COUPLE_MOTEUR", "REGIME_MOTEUR", "TEMP_HUILE_BV", "VITESSE_VEHICULE", nullptr},
            "tr/min",
            "CONSIGNE_PRESSION_MENEE"},
      Style{{"PRI_KAITENSUU", "SEC_KAITENSUU", "SEC_YUATSU", "ENJIN_TORUKU", "ENJIN_KAITENSUU",
             nullptr, "SHASOKU", "AKUSERU_KAIDO"},
            "rpm",
            "MOKUHYO_SEC_YUATSU"},
      Style{{"InputShaftSpeed", "OutputShaftSpeed", "SecPulleyClampPress", "ActualEngineTorque",
             "EngineSpeed", "TransOilTemp1", "WheelBasedVehicleSpeed", "AccelPedalPos1"},
            "rpm",
            ""},
      Style{
          {"GE_Drehzahl_Primaer", "GE_Drehzahl_Sekundaer", "GE_Druck_Sekundaer", "MO_Mom_Ist_Summe",
           "MO_Drehzahl_01", "GE_Oeltemp", "ESP_v_Signal", "MO_Fahrpedalrohwert_01"},
          "Unit_MinutInver",
          "GE_Druck_Primaer GE_Druck_Soll_Sek MO_Mom_Soll_Roh"},
  };
  for (const Style& style : kStyles) {
    const std::array<const char*, 8> units{style.speed_unit, style.speed_unit, "bar",  "Nm",
                                           style.speed_unit, "degC",           "km/h", "%"};
    std::string dbc = "VERSION \"\"\n";
    int id = 256;
    const auto add = [&](const std::string& name, const char* unit) {
      dbc += "BO_ " + std::to_string(id) + " S_" + std::to_string(id) + ": 8 X\n SG_ " + name +
             " : 0|16@1+ (1,0) [0|0] \"" + unit + "\" X\n";
      ++id;
    };
    // Those that are none come first.
    std::istringstream others(style.others);
    for (std::string name; others >> name;) {
      for (const char* unit : {style.speed_unit, "bar", "Nm"}) add(name, unit);
    }
    for (std::size_t i = 0; i < kRoles.size(); ++i) {
      if (style.names[i] != nullptr) add(style.names[i], units[i]);
    }
    const std::vector<can::Database> databases{can::parse_dbc(dbc).database};
    for (std::size_t i = 0; i < kRoles.size(); ++i) {
      const auto found = cli::guess_role(kRoles[i], databases);
      const std::string name = found.empty() ? std::string() : found[0].signal->name;
      EXPECT_STREQ(name.c_str(), style.names[i] == nullptr ? "" : style.names[i])
          << daemon::role_name(kRoles[i]);
    }
  }
}

// An electric motor is no engine, a limiter's speed not the car's; one wheel's is not either.
TEST(Roles, OfShortNamesAreNotGuessedTooFar) {
  using daemon::Role;
  EXPECT_FALSE(is_candidate(Role::kEngineSpeed, "CR_Mcu_MotActRotSpd_rpm", "rpm"));
  EXPECT_FALSE(is_candidate(Role::kVehicleSpeed, "SLD_VS", "km/h"));
  EXPECT_FALSE(is_candidate(Role::kVehicleSpeed, "v_Rad_VL", "km/h"));
  EXPECT_FALSE(is_candidate(Role::kVehicleSpeed, "WheelSpeed_FL", "km/h"));
  EXPECT_FALSE(is_candidate(Role::kPrimaryTorque, "Clutch_Driving_Tq", "Nm"));
}

// "AccPedal" may be the adaptive cruise's, "OilTemp" the engine's, "TorqueActual" anything's: never
// a role's line, but beside the empty one. What another role claims is not offered.
TEST(Roles, ThatLackAWordAreOfferedToAPerson) {
  const std::vector<can::Database> databases = {can::parse_dbc(R"(VERSION ""
BO_ 256 ECU_Torque: 8 ECU
 SG_ TorqueActual : 0|16@1- (0.1,0) [-500|500] "Nm" X
 SG_ TorqueCounter : 16|8@1+ (1,0) [0|255] "Nm" X
 SG_ EngineSpeed : 32|16@1+ (0.25,0) [0|16000] "rpm" X
BO_ 257 Status: 8 TCU
 SG_ OilTemp : 0|8@1+ (1,-40) [-40|215] "degC" X
 SG_ AccPedal : 8|8@1+ (0.4,0) [0|100] "%" X
)")
                                                    .database};
  const auto offered = [&](daemon::Role role) {
    EXPECT_TRUE(cli::guess_role(role, databases).empty());
    std::string names;
    for (const auto& each : cli::guess_in_part(role, databases)) names += each.signal->name + " ";
    return names;
  };
  EXPECT_EQ(offered(daemon::Role::kEngineTorque), "TorqueActual ");
  EXPECT_EQ(offered(daemon::Role::kOilTemperature), "OilTemp ");
  EXPECT_EQ(offered(daemon::Role::kAcceleratorPedal), "AccPedal ");
  EXPECT_EQ(offered(daemon::Role::kPrimarySpeed), "");
}

TEST(Roles, AreFoundByTheCommentWhereTheNameIsANumber) {
  using daemon::Role;
  EXPECT_TRUE(is_candidate(Role::kPrimarySpeed, "S1", "rpm", "Primary pulley speed"));
  EXPECT_TRUE(is_candidate(Role::kSecondaryPressure, "S1", "bar", "Sekund\xC3\xA4rdruck"));
  EXPECT_FALSE(is_candidate(Role::kPrimarySpeed, "S1", "rpm", "Target of primary pulley speed"));
  EXPECT_FALSE(is_candidate(Role::kPrimarySpeed, "S1", "rpm",
                            "Counts how often the primary pulley has passed the sensor since the "
                            "last frame, for the speed in another message"));
  EXPECT_FALSE(is_candidate(Role::kPrimarySpeed, "PrimarySpeed", "rpm", "Checksum"));
}

TEST(Roles, AreNeverWhatIsCountedCheckedLimitedOrSteered) {
  using daemon::Role;
  for (const char* name : {"PrimarySpeedSoll", "PrimaerdrehzahlGrenze", "PrimSpdValid",
                           "PrimSpdCks", "PrimSpdZaehler", "ConsigneRegimePrimaire",
                           "PrimaerdrehzahlGueltig", "MokuhyoPuraimariKaiten", "PrimSpdDisplay"}) {
    EXPECT_FALSE(is_candidate(Role::kPrimarySpeed, name, "rpm")) << name;
  }
  EXPECT_FALSE(is_candidate(Role::kEngineTorque, "LenkradMoment_Eng", "Nm"));
  EXPECT_FALSE(is_candidate(Role::kEngineTorque, "DI_torqueMotor", "Nm")) << "an electric one";
  EXPECT_FALSE(is_candidate(Role::kAcceleratorPedal, "Throttle_position", "%")) << "a valve";
  EXPECT_FALSE(is_candidate(Role::kPrimarySpeed, "PrimarySpeed", "rpm", "", 7));
  // Values with names are stages.
  EXPECT_FALSE(is_candidate(Role::kPrimarySpeed, "PrimarySpeed", "rpm", "", 8,
                            R"(0 "a" 1 "b" 2 "c" 3 "d" 4 "e")"));
  EXPECT_TRUE(is_candidate(Role::kPrimarySpeed, "PrimarySpeed", "rpm", "", 16,
                           R"(65535 "SNA" 65534 "Error")"));
}

// A flag as an enumeration: the value is chosen by its name, and the proposal loads as it is.
// Names that files of real cars have, each with the words of a role and none of its measurement.
TEST(Roles, AreNeverWhatIsAskedForLimitedLostOrSomethingElses) {
  using daemon::Role;
  struct Case {
    Role role;
    const char* message;
    const char* signal;
    const char* unit;
    int bits;
  };
  const Case cases[] = {
      {Role::kEngineSpeed, "EMS_H2", "R_NEngIdlTgC", "rpm", 16},
      {Role::kEngineSpeed, "Debug", "OilPumpMotorSpeed", "rpm", 16},
      {Role::kEngineSpeed, "EngineData", "EngAout_N_RqMxPrtct", "rpm", 16},
      {Role::kEngineSpeed, "EngineData", "EngineSpeed", "rpm", 7},
      {Role::kEngineTorque, "EngineData", "TrnAin_Tq_MxSpcPdlEngN", "Nm", 16},
      {Role::kEngineTorque, "EngineData", "EngGoutLss_Tq_Est", "Nm", 16},
      {Role::kEngineTorque, "Engine_Information", "EngTrqDrRqdExtRng", "Nm", 16},
      {Role::kEngineTorque, "EngineData", "EngAcsyArcPmp_Tq_Actl", "Nm", 16},
      {Role::kBrakePressed, "ES_Brake", "Cruise_Brake_Active", "", 1},
      {Role::kVehicleSpeed, "Telematics", "EnhSvVehTopSpdLim", "km/h", 12},
      {Role::kVehicleSpeed, "SteeringCmd", "VehicleSpeed", "km/h", 12},
      {Role::kVehicleSpeed, "Map", "UI_gpsVehicleSpeed", "km/h", 12},
      {Role::kBrakePressed, "Mode_Switch_Status", "FwdClnMtgnBrkReqAct", "", 1},
      {Role::kBrakePressed, "LvCommand", "BrakeLightEnable", "", 1},
      {Role::kBrakePressed, "BrakePedal", "BrakeLevel", "", 8},
      {Role::kLockupClosed, "Sys_Shift_Lock", "HghVltgPropState", "", 1},
      {Role::kLockupClosed, "Hvac", "RSELockOnOff", "", 1},
      {Role::kLockupClosed, "Body", "UI_autoRollWindowsOnLockEnable", "", 1},
      {Role::kPrimarySpeed, "TCU", "InputSpeedCounter", "rpm", 16},
  };
  for (const Case& each : cases) {
    const std::string dbc = std::string("VERSION \"\"\nBO_ 256 ") + each.message + ": 8 X\n SG_ " +
                            each.signal + " : 0|" + std::to_string(each.bits) +
                            "@1+ (1,0) [0|1] \"" + each.unit + "\" X\n";
    EXPECT_TRUE(cli::guess_role(each.role, {can::parse_dbc(dbc).database}).empty())
        << each.message << '.' << each.signal;
  }
  // The converter's own words are enough.
  for (const char* name : {"TCC_State", "LockUpState", "LU_On", "TorqueConverterLockState"}) {
    const std::string dbc = std::string("VERSION \"\"\nBO_ 256 TCU: 8 X\n SG_ ") + name +
                            " : 0|1@1+ (1,0) [0|1] \"\" X\n";
    EXPECT_EQ(cli::guess_role(Role::kLockupClosed, {can::parse_dbc(dbc).database}).size(), 1U)
        << name;
  }
}

TEST(Init, AFlagWithNamedValuesSaysWhenItIsTrue) {
  const auto proposed = [](const std::string& values, int bits = 3) {
    const test::Workplace place;
    std::string dbc = kCar;
    const std::string one = "LockUpEngaged : 8|1@1+ (1,0) [0|1]";
    dbc.replace(dbc.find(one), one.size(),
                "LockUpEngaged : 40|" + std::to_string(bits) + "@1+ (1,0) [0|" +
                    std::to_string((1 << bits) - 1) + "]");
    place.write("car.dbc", dbc + "VAL_ 258 LockUpEngaged " + values + " ;\n");
    const std::string config = place.path("car.toml");
    EXPECT_EQ(test::beltgrip({"init", place.path("car.dbc"), "--out", config}).status, 0);
    std::string text = place.read("car.toml");
    EXPECT_EQ(text.find("\nlockup_closed "), std::string::npos) << "nobody has looked at it yet";
    const std::size_t at = text.find("\n# lockup_closed ");
    EXPECT_NE(at, std::string::npos) << text;
    if (at == std::string::npos) return std::string();
    const std::string line = text.substr(at + 3, text.find('\n', at + 1) - at - 3);
    EXPECT_NE(line.find(" bit"), std::string::npos) << line;
    const std::size_t when = line.find("true_when = ");
    if (line.find("true_when = \"...\"") != std::string::npos) return std::string();
    // As it is once somebody has taken it.
    text.erase(at + 1, 2);
    place.write("car.toml", text);
    const daemon::ConfigResult loaded = daemon::load_config(config);
    EXPECT_TRUE(loaded.config.has_value())
        << values << ": " << (loaded.errors.empty() ? "" : loaded.errors[0].text);
    return when == std::string::npos ? "plain"
                                     : line.substr(when + 12, line.find(" }") - when - 12);
  };
  EXPECT_EQ(proposed(R"(0 "Open" 1 "Slipping" 2 "Locked" 3 "SNA")"), "\"Locked\"");
  EXPECT_EQ(proposed(R"(0 "TCC_OPEN" 1 "TCC_PARTLY_CLOSED" 2 "TCC_CLOSED")"), "\"TCC_CLOSED\"");
  EXPECT_EQ(proposed(R"(0 "Unlocked" 1 "NotLocked" 5 "LockUpActive" 7 "Error, locked")"),
            "\"LockUpActive\"");
  EXPECT_EQ(proposed(R"(0 "Off" 1 "Slip" 4 "On")"), "\"On\"");
  EXPECT_EQ(proposed(R"(0 "A" 1 "B" 2 "C")"), "1");
  EXPECT_EQ(proposed(R"(0 "Inactive" 1 "Active" 3 "SNA")", 2), "\"Active\"");
  // Two values, the other way round.
  EXPECT_EQ(proposed(R"(0 "Locked" 1 "Open")", 1), "\"Locked\"");
  EXPECT_EQ(proposed(R"(0 "Open" 1 "Closed")", 1), "plain");
  EXPECT_EQ(proposed(R"(0 "say \o/" 1 "x")", 1), "plain");
  // No name tells, and no value is 1.
  EXPECT_EQ(proposed(R"(0 "A" 2 "C")"), "");
}

// A comment for each, with a place where the number is found; replay lists what stays a comment.
TEST(Init, WhatIsAssumedStandsThereToFillIn) {
  test::Workplace place;
  place.write("car.dbc", kCar);
  const auto made = test::beltgrip({"init", place.path("car.dbc")});
  ASSERT_EQ(made.status, 0) << made.err;
  for (const char* key :
       {"primary_radius_overdrive_m", "primary_radius_low_m", "secondary_piston_area_m2",
        "secondary_spring_force_N", "secondary_centrifugal_N_s2", "primary_inertia_kg_m2",
        "primary_speed = { bias_rad_s", "secondary_speed = { bias_rad_s",
        "secondary_pressure = { bias_Pa", "engine_torque = { bias_Nm"}) {
    const std::size_t at = made.out.find(std::string("\n# ") + key);
    ASSERT_NE(at, std::string::npos) << key << "\n" << made.out;
    const std::size_t next = made.out.find('\n', at + 1);
    EXPECT_TRUE(std::string_view(made.out).substr(next + 1).starts_with("#   found: ")) << key;
  }
}

// The commands of the README on the simulated car, whose centrifugal term nobody knows: what is not
// stated must not make a result that is surely wrong.
TEST(Init, OnTheSimulatedCarTheTruthIsInTheInterval) {
  test::Workplace place;
  ASSERT_EQ(
      test::beltgrip({"simulate", "--scenario", "coast-overdrive", "--out-dir", place.path("d")})
          .status,
      0);
  const std::string log = place.path("d/trace.log"), config = place.path("d/mine.toml");
  // A drive whose request ends where friction falls, whatever the area makes of its force.
  ASSERT_EQ(test::beltgrip({"simulate", "--scenario", "worn-belt", "--out-dir", place.path("worn")})
                .status,
            0);
  ASSERT_EQ(test::beltgrip({"init", place.path("d/vehicle.dbc"), "--out", config}).status, 0);
  ASSERT_EQ(
      test::beltgrip({"calibrate", log, "--config", config, "--out", place.path("d/keys.toml")})
          .status,
      0);
  const std::string proposed = place.read("d/mine.toml");
  // What calibrate finds on longer drives; a right area and spring; a spring and an area that are
  // not the car's.
  struct Case {
    const char* variator;
    bool has_value;
  };
  for (const Case& each :
       {Case{"", true}, Case{"primary_inertia_kg_m2 = 0.18\n", true},
        Case{"primary_inertia_kg_m2 = 0.18\nsecondary_piston_area_m2 = 0.0113\n"
             "secondary_spring_force_N = 500.0\nprimary_radius_overdrive_m = 0.0784\n",
             true},
        Case{"secondary_spring_force_N = 800.0\n", true},
        Case{"primary_inertia_kg_m2 = 0.18\nsecondary_piston_area_m2 = 0.113\n", false}}) {
    place.write("d/mine.toml", proposed + "\n[variator]\n" + each.variator);
    const auto replayed =
        test::beltgrip({"replay", each.has_value ? log : place.path("worn/trace.log"), "--config",
                        config, "--json", "-"});
    ASSERT_EQ(replayed.status, 0) << replayed.err;
    const auto experiment = nlohmann::json::parse(replayed.out.substr(0, replayed.out.find('\n')));
    EXPECT_FALSE(experiment.at("assumed").empty());
    EXPECT_EQ(experiment.at("outcome"), each.has_value ? "completed" : "inconclusive")
        << each.variator << replayed.out;
    if (!each.has_value) {
      EXPECT_NE(experiment.at("reason").get<std::string>().find("piston area"), std::string::npos)
          << replayed.out;
      continue;
    }
    EXPECT_LE(experiment.at("mu_max_ci95")[0], 0.105) << each.variator << replayed.out;
    EXPECT_GE(experiment.at("mu_max_ci95")[1], 0.105) << each.variator << replayed.out;
  }
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
  ASSERT_EQ(result.status, 65) << result.err;
  EXPECT_EQ(test::lines(result.err), 1) << result.err;
  EXPECT_NE(result.err.find("small.dbc: found no signal for primary_speed, secondary_pressure, "
                            "engine_torque; expected one for each"),
            std::string::npos)
      << result.err;
  EXPECT_NE(result.out.find("\n# primary_speed      = { signal = \"M.PrimarySpeed\", unit = "),
            std::string::npos)
      << result.out;
  EXPECT_NE(result.out.find("\nsecondary_speed    = \"M.SecondarySpeed\""), std::string::npos);
  EXPECT_NE(result.out.find("\n# secondary_pressure = \"Message.Signal\"   # NOT FOUND"),
            std::string::npos);
  EXPECT_NE(result.out.find("\n# engine_torque      = \"Message.Signal\"   # NOT FOUND"),
            std::string::npos);

  // What control = "command" needs stands there too, with where it is found.
  for (const char* role : {"oil_temperature", "vehicle_speed", "accelerator_pedal", "brake_pressed",
                           "lockup_closed", "experiment_permitted"}) {
    const std::size_t at = result.out.find(std::string("\n# ") + role);
    ASSERT_NE(at, std::string::npos) << role;
    EXPECT_NE(result.out.find("control = \"command\" needs it", at), std::string::npos);
    const std::size_t next = result.out.find('\n', at + 1);
    EXPECT_TRUE(std::string_view(result.out).substr(next + 1).starts_with("#   found: ")) << role;
  }

  for (const char* name : {"", "a b", "can0123456789abcdef", "inproc:"}) {
    const auto refused = test::beltgrip({"init", place.path("small.dbc"), "--interface", name});
    EXPECT_EQ(refused.status, 64) << name;
    EXPECT_EQ(refused.err, "beltgrip: init: --interface: found \"" + std::string(name) +
                               "\", expected an interface of 1 to 15 characters, or inproc:NAME\n");
  }
  EXPECT_EQ(test::beltgrip({"init", place.path("none.dbc")}).status, 66);
  place.write("empty.dbc", "VERSION \"\"\n");
  EXPECT_EQ(test::beltgrip({"init", place.path("empty.dbc")}).status, 65);
}

// Two speeds by name; the log says which one lives.
TEST(Init, TheValuesOfALogDecide) {
  test::Workplace place;
  place.write("car.dbc",
              "VERSION \"\"\nBO_ 256 A: 8 X\n SG_ PrimarySpeed : 0|16@1+ (1,0) [0|9000] \"rpm\" X\n"
              " SG_ SecondarySpeed : 16|16@1+ (1,0) [0|9000] \"rpm\" X\n"
              " SG_ SecPressure : 32|16@1+ (1,0) [0|9000] \"kPa\" X\n"
              " SG_ EngTorque : 48|16@1- (1,0) [-500|500] \"Nm\" X\n"
              "BO_ 257 B: 8 X\n SG_ PrimSpd : 0|16@1+ (1,0) [0|9000] \"rpm\" X\n"
              " SG_ LockUpState : 16|1@1+ (1,0) [0|1] \"\" X\n");
  std::string log;
  for (int i = 0; i < 20; ++i) {
    char line[96];
    // Little endian: 1500 rpm that stands still, secondary 3000, 1000 kPa, 50 Nm, each on the move.
    std::snprintf(line, sizeof line, "(%d.000000) can0 100#DC05%02X0B%02X03%02X00\n", i, 0xB0 + i,
                  0xE0 + i % 8, 0x30 + i % 5);
    log += line;
    std::snprintf(line, sizeof line, "(%d.500000) can0 101#%02X05%02X\n", i, 0xD0 + i % 7, i / 10);
    log += line;
  }
  place.write("drive.log", log);
  const auto by_name = test::beltgrip({"init", place.path("car.dbc")});
  EXPECT_EQ(by_name.status, 0) << by_name.err;
  EXPECT_NE(by_name.out.find("\nprimary_speed      = \"A.PrimarySpeed\"   # guessed, rpm\n"
                             "#   or \"B.PrimSpd\", rpm\n"),
            std::string::npos)
      << by_name.out;
  const auto by_values =
      test::beltgrip({"init", place.path("car.dbc"), "--log", place.path("drive.log")});
  EXPECT_EQ(by_values.status, 0) << by_values.err;
  EXPECT_NE(
      by_values.out.find("\nprimary_speed      = \"B.PrimSpd\"   # guessed, rpm, 1488 .. 1494 "
                         "rpm in the log\n#   or \"A.PrimarySpeed\", rpm, stands still at 1500 "
                         ".. 1500 rpm in the log\n"),
      std::string::npos)
      << by_values.out;
  EXPECT_NE(
      by_values.out.find("\n# lockup_closed      = \"B.LockUpState\"   # guessed, 1 bit, in the "
                         "log not 0 for 50 %, 1 changes: uncomment where that is right\n"),
      std::string::npos)
      << by_values.out;
  // A log of another car: nothing lives, and no line stands.
  place.write("other.log", "(1.000000) can0 7FF#00\n");
  const auto other =
      test::beltgrip({"init", place.path("car.dbc"), "--log", place.path("other.log")});
  EXPECT_EQ(other.status, 65);
  EXPECT_NE(
      other.out.find("\n# primary_speed      = \"A.PrimarySpeed\"   # guessed, rpm, not in the "
                     "log\n"),
      std::string::npos)
      << other.out;
  EXPECT_EQ(test::beltgrip({"init", place.path("car.dbc"), "--log", place.path("none.log")}).status,
            66);
  place.write("empty.log", "");
  EXPECT_EQ(
      test::beltgrip({"init", place.path("car.dbc"), "--log", place.path("empty.log")}).status, 65);
}

// Every line that would stand without a comment, of every file of the corpus, is in the list of
// those that were judged by hand (init_corpus.txt: file, role, signal) and found to be right.
TEST(Corpus, NoLineThatStandsIsWrong) {
  const char* folder = std::getenv("BELTGRIP_CORPUS");
  if (folder == nullptr) GTEST_SKIP() << "BELTGRIP_CORPUS is not set: no DBC file was proposed for";
  std::set<std::string> right, found;
  std::ifstream list(BELTGRIP_SOURCE_DIR "/tests/tools/cli/init_corpus.txt");
  for (std::string line; std::getline(list, line);) {
    if (!line.empty() && line[0] != '#') right.insert(line);
  }
  ASSERT_GE(right.size(), 50U);
  std::set<std::string> files, with_candidates;
  for (const auto& each :
       std::filesystem::directory_iterator(std::filesystem::path(folder) / "dbc")) {
    if (each.path().extension() != ".dbc") continue;
    std::ifstream in(each.path(), std::ios::binary);
    std::ostringstream text;
    text << in.rdbuf();
    const std::vector<can::Database> databases = {can::parse_dbc(text.str()).database};
    files.insert(each.path().filename());
    for (std::size_t i = 0; i < daemon::kRoleCount; ++i) {
      const auto role = static_cast<daemon::Role>(i);
      const auto candidates = cli::guess_role(role, databases);
      if (candidates.empty()) continue;
      with_candidates.insert(each.path().filename());
      if (!candidates[0].has_unit || daemon::role_dimension(role) == can::Dimension::kNone)
        continue;
      found.insert(each.path().filename().string() + " " + std::string(daemon::role_name(role)) +
                   " " + candidates[0].message->name + "." + candidates[0].signal->name);
    }
  }
  EXPECT_EQ(found, right);
  RecordProperty("files", static_cast<int>(files.size()));
  RecordProperty("files_with_candidates", static_cast<int>(with_candidates.size()));
  RecordProperty("lines", static_cast<int>(found.size()));
  EXPECT_GE(with_candidates.size(), 30U);
}

}  // namespace
}  // namespace beltgrip
