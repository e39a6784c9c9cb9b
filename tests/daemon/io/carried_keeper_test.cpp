// What was carried without slip is kept over drives: by configuration, whole, and never silently
// lost.
#include "daemon/io/carried_keeper.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <sstream>
#include <string>
#include <vector>

#include "tests/daemon/test_vehicle.h"

namespace beltgrip::daemon {
namespace {

namespace fs = std::filesystem;

struct Said {
  std::vector<std::string> warnings, lines;
  CarriedKeeper::Say say() {
    return [this](bool warning, const std::string& line) {
      (warning ? warnings : lines).push_back(line);
    };
  }
};

CarriedWindow window_of(double mu_star) {
  CarriedWindow window;
  window.mu_star_held = window.mu_star = mu_star;
  window.clamp_force_N = 5000.0;
  window.torque_Nm = 64.0;
  window.omega_p_rad_s = 200.0;
  window.omega_s_rad_s = 450.0;
  return window;
}

std::string content(const std::string& path) {
  std::ostringstream text;
  text << std::ifstream(path).rdbuf();
  return text.str();
}

TEST(CarriedKeeper, GoesOnFromDriveToDrive) {
  const test::TemporaryDirectory folder;
  Said said;
  for (int drive = 1; drive <= 3; ++drive) {
    CarriedKeeper keeper(folder.path(), Config{}, said.say());
    keeper.take(window_of(drive == 2 ? 0.09 : 0.08), 100.0 * drive);
  }
  CarriedKeeper keeper(folder.path(), Config{}, said.say());
  const CarriedBound& bound = keeper.bounds()[0];
  EXPECT_DOUBLE_EQ(bound.mu_star, 0.09);
  EXPECT_DOUBLE_EQ(bound.time_s, 200.0);
  EXPECT_DOUBLE_EQ(bound.held_s, 6.0);
  EXPECT_TRUE(std::isnan(bound.oil_degC)) << "not known, in the file too";
  ASSERT_EQ(said.lines.size(), 2U) << "the third was no news";
  EXPECT_EQ(said.lines[1].substr(0, 39), "drive, overdrive: mu_max is at least 0.");
  EXPECT_NE(said.lines[1].find("no value"), std::string::npos) << said.lines[1];
  EXPECT_TRUE(said.warnings.empty());
}

TEST(CarriedKeeper, ConfigurationsAreKeptApart) {
  const test::TemporaryDirectory folder;
  Said said;
  Config other;
  other.variator.secondary_piston_area_m2 = 0.012;
  {
    CarriedKeeper keeper(folder.path(), Config{}, said.say());
    keeper.take(window_of(0.08), 100.0);
    keeper.change(other);
    EXPECT_FALSE(keeper.bounds()[0].known());
    keeper.take(window_of(0.07), 200.0);
    keeper.change(Config{});
    EXPECT_DOUBLE_EQ(keeper.bounds()[0].mu_star, 0.08);
  }
  const auto newest = read_carried(folder.path(), "");
  ASSERT_TRUE(newest) << newest.error();
  EXPECT_DOUBLE_EQ((*newest)[0].mu_star, 0.07);
  CarriedKeeper again(folder.path(), other, said.say());
  EXPECT_DOUBLE_EQ(again.bounds()[0].mu_star, 0.07);
}

TEST(CarriedKeeper, ADamagedFileIsSetAsideAndSaidSo) {
  for (const std::string broken :
       {"", "{", "[]", "{\"version\": 2, \"configurations\": {}}", "{\"version\": 1}"}) {
    const test::TemporaryDirectory folder;
    const std::string path = folder.write(kCarriedFile, broken);
    Said said;
    {
      CarriedKeeper keeper(folder.path(), Config{}, said.say());
      EXPECT_FALSE(keeper.bounds()[0].known());
      keeper.take(window_of(0.08), 100.0);
    }
    ASSERT_EQ(said.warnings.size(), 1U) << broken;
    EXPECT_EQ(content(path + ".bad"), broken);
    EXPECT_DOUBLE_EQ(CarriedKeeper(folder.path(), Config{}, said.say()).bounds()[0].mu_star, 0.08);
  }
}

TEST(CarriedKeeper, WritesOnceAMinuteAndAtTheEnd) {
  const test::TemporaryDirectory folder;
  const std::string path = folder.path() + "/" + kCarriedFile;
  Said said;
  {
    CarriedKeeper keeper(folder.path(), Config{}, said.say());
    keeper.turn(1000.0);
    EXPECT_FALSE(fs::exists(path)) << "there is nothing to be written";
    keeper.take(window_of(0.08), 1000.0);
    keeper.turn(1000.0);
    ASSERT_TRUE(fs::exists(path));
    const std::string before = content(path);
    keeper.take(window_of(0.09), 1010.0);
    keeper.turn(1010.0);
    EXPECT_EQ(content(path), before);
    keeper.turn(1061.0);
    EXPECT_NE(content(path), before);
    keeper.take(window_of(0.1), 1063.0);
  }
  EXPECT_NE(content(path).find("0.1,"), std::string::npos);
}

TEST(CarriedKeeper, AFolderThatCannotBeWrittenIsSaidOnce) {
  const test::TemporaryDirectory folder;
  const std::string file = folder.write("no_folder", "x");
  Said said;
  CarriedKeeper keeper(file + "/state", Config{}, said.say());
  keeper.take(window_of(0.08), 1000.0);
  keeper.turn(1000.0);
  keeper.turn(1061.0);
  EXPECT_EQ(said.warnings.size(), 1U);
  EXPECT_TRUE(keeper.bounds()[0].known());
}

TEST(CarriedKeeper, JsonSaysNothingOfWhatIsNotKnown) {
  CarriedBounds bounds{};
  EXPECT_EQ(carried_json(bounds).dump(), "[]");
  bounds[3].refused_mu_star = 0.4;
  const auto json = carried_json(bounds);
  EXPECT_EQ(json.at(0).at("direction"), "overrun");
  EXPECT_EQ(json.at(0).at("ratio"), "low");
  EXPECT_TRUE(json.at(0).at("mu_max_lower_bound").is_null());
  EXPECT_TRUE(json.at(0).at("reserve_share").is_null());
  EXPECT_DOUBLE_EQ(json.at(0).at("impossible_mu_star").get<double>(), 0.4);
}

}  // namespace
}  // namespace beltgrip::daemon
