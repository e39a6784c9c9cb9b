#include "tools/cli/scenario_options.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <limits>
#include <string_view>

#include "daemon/core/config/toml/toml_bounds.h"
#include "tools/cli/failure.h"
#include "tools/sim/resources.h"
#include "tools/sim/vehicle_scenario.h"
#include "tools/text/json_writer.h"

namespace beltgrip::cli {

namespace {

constexpr std::string_view kSuffix = ".toml";

std::string shipped_names() {
  std::string names;
  for (const std::string_view name : sim::resource_names()) {
    if (!name.ends_with(kSuffix)) continue;
    names +=
        (names.empty() ? "" : ", ") + std::string(name.substr(0, name.size() - kSuffix.size()));
  }
  return names;
}

// Chosen: what a program that reads JSON keeps of an integer.
constexpr std::uint64_t kSeedMost = std::uint64_t{1} << 53;

// Before a parser sees it.
sim::ScenarioLayer bounded(sim::ScenarioLayer layer) {
  if (const auto beyond = daemon::beyond_bounds(layer.text)) {
    throw Failure{kConfiguration, layer.source + ":" + std::to_string(beyond->line) + ": found " +
                                      beyond->text + ", expected a scenario in TOML"};
  }
  return layer;
}

// "KEY=VALUE" of --set.
sim::ScenarioLayer setting_of(const std::string& setting) {
  bounded({"--set", setting});
  return sim::setting_layer(setting);
}

// Blank lines and comments alone, as where diagnose had no further experiment to ask for: the usual
// machine would be run in its place.
bool says_nothing(std::string_view text) {
  while (!text.empty()) {
    const std::size_t end = std::min(text.find('\n'), text.size() - 1);
    const std::string_view line = text.substr(0, end + 1);
    const std::size_t first = line.find_first_not_of(" \t\r\n");
    if (first != std::string_view::npos && line[first] != '#') return false;
    text.remove_prefix(end + 1);
  }
  return true;
}

sim::ScenarioLayer layer_of(const std::string& scenario) {
  if (const auto text = sim::resource(scenario + std::string(kSuffix))) {
    return {scenario + std::string(kSuffix), std::string(*text)};
  }
  std::ifstream file(scenario, std::ios::binary);
  file.peek();
  if (file.bad() || !file.is_open() || std::filesystem::is_directory(scenario)) {
    throw Failure{kNoInput, scenario + ": neither a readable file nor a shipped scenario (" +
                                shipped_names() + ")"};
  }
  file.clear();
  const std::string text{std::istreambuf_iterator<char>(file), {}};
  if (says_nothing(text)) {
    throw Failure{kConfiguration, scenario +
                                      ":1: found a file that sets nothing, expected a "
                                      "scenario, e.g. plant = \"vehicle\" and what differs"};
  }
  return bounded({scenario, text});
}

// The file and the settings of the command line on it.
std::vector<sim::ScenarioLayer> given_layers(const std::string& scenario,
                                             const std::vector<std::string>& settings) {
  std::vector<sim::ScenarioLayer> layers{layer_of(scenario)};
  for (const std::string& setting : settings) layers.push_back(setting_of(setting));
  return layers;
}

template <typename Scenario>
Scenario right(sim::ScenarioResult<Scenario> result) {
  if (!result.errors.empty()) {
    std::string text;
    for (const std::string& error : result.errors) text += (text.empty() ? "" : "\n") + error;
    throw Failure{kConfiguration, text};
  }
  return std::move(result.scenario);
}

}  // namespace

void ScenarioOptions::add_to(command_line::Command command) {
  command
      .add_option("--scenario", scenario,
                  "A shipped scenario (" + shipped_names() + ") or a TOML file")
      .type_name("NAME")
      .capture_default_str();
  command.add_option("--belt", belt, "The belt that is mounted")
      .type_name("BELT")
      .one_of({"new", "worn"});
  command.add_option("--seed", seed, "Seed of the sensor noise")
      .capture_default_str()
      .range(std::uint64_t{0}, kSeedMost);
  command.add_option("--start", start_s, "Leave out the first seconds")
      .type_name("SECONDS")
      .capture_default_str()
      .range(0.0, 1e6);
  command.add_option("--duration", duration_s, "Seconds from the start (default: to the end)")
      .type_name("SECONDS")
      .range(1e-3, 1e6);
  command.add_option("--set", settings, "A value of the scenario, e.g. clamp.ramp_N_per_s=100")
      .type_name("KEY=VALUE")
      .allow_extra_args(false);
}

sim::RigScenario ScenarioOptions::load() const {
  std::vector<sim::ScenarioLayer> layers = given_layers(scenario, settings);
  if (!belt.empty()) layers.push_back({"--belt " + belt, "belt = \"" + belt + "\""});
  return right(sim::parse_rig_scenario(layers));
}

bool ScenarioOptions::is_vehicle() const {
  return sim::is_vehicle_scenario(layer_of(scenario).text);
}

sim::VehicleScenario ScenarioOptions::load_vehicle() const {
  if (!belt.empty() || start_s > 0.0) {
    throw Failure{kUsage,
                  "--belt and --start are for the rig; a vehicle takes --set belt.mu_max=..."};
  }
  std::vector<sim::ScenarioLayer> layers = given_layers(scenario, settings);
  if (duration_s > 0.0) {
    layers.push_back(sim::setting_layer("run.duration_s=" + std::to_string(duration_s)));
  }
  return right(sim::parse_vehicle_scenario(layers));
}

double ScenarioOptions::end_s() const {
  return duration_s > 0.0 ? start_s + duration_s : std::numeric_limits<double>::infinity();
}

}  // namespace beltgrip::cli
