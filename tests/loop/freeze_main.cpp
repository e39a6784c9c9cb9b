// Freezes of inputs over the whole request, and false alarms without one: `freeze --help`.
#include <cstdio>

#include "daemon/command_line/command_line.h"
#include "tests/loop/closed_loop.h"
#include "tests/loop/freeze.h"
#include "tools/sim/vehicle_scenario.h"

namespace {

std::string joined(const std::vector<std::string>& names) {
  std::string out;
  for (const std::string& name : names) out += (out.empty() ? "" : "+") + name;
  return out;
}

}  // namespace

int main(int argc, char** argv) {
  using namespace beltgrip;
  command_line::Program app{"Inputs that stand still within a request, and false alarms without"};
  std::string base = "coast-overdrive", only;
  std::vector<std::string> settings;
  bool coarse = false, engine = false, steady = false, all = false;
  int healthy = 0;
  std::uint64_t seed = 1;
  double step_s = 0.25, near_s = 0.05, creep_per_s = 0.0;
  app.add_option("--base", base);
  app.add_option("--set", settings);
  app.add_flag("--coarse", coarse);
  app.add_flag("--engine-speed", engine);
  app.add_flag("--steady", steady);
  app.add_option("--only", only, "these inputs alone: PrimarySpeed+EngineSpeed");
  app.add_flag("--all", all, "print every run");
  app.add_option("--healthy", healthy, "count false alarms in so many experiments instead");
  app.add_option("--seed", seed);
  app.add_option("--step", step_s);
  app.add_option("--near", near_s);
  app.add_option("--creep", creep_per_s, "instead of standing still, SI units per second");
  switch (app.parse(argc, argv)) {
    case command_line::Parsed::kGoOn:
      break;
    case command_line::Parsed::kShown:
      return 0;
    case command_line::Parsed::kWrong:
      std::fprintf(stderr, "%s\n", app.error().c_str());
      return 64;
  }
  std::vector<sim::ScenarioLayer> layers;
  for (const std::string& setting : settings) layers.push_back(sim::setting_layer(setting));
  sim::VehicleScenarioResult read = sim::shipped_vehicle_scenario(base.c_str(), layers);
  for (const auto& error : read.errors) std::printf("%s\n", error.c_str());
  sim::VehicleScenario scenario = read.scenario;
  if (scenario.driver.steps.size() > 1 && healthy == 0) scenario.driver.steps[1].at_s = 0.3;
  if (coarse) test::make_coarse(scenario);
  std::map<std::string, std::string> keys;
  if (steady) keys["trigger"] = "\"steady\"";
  if (healthy > 0) {
    int asked = 0, alarms = 0;
    for (int i = 0; i < healthy; ++i) {
      const test::FreezeBench bench(scenario, keys, engine, seed + static_cast<std::uint64_t>(i));
      asked += bench.asked() ? 1 : 0;
      if (bench.false_alarm().empty()) continue;
      ++alarms;
      std::printf("seed %llu: %s\n",
                  static_cast<unsigned long long>(seed) + static_cast<unsigned>(i),
                  bench.false_alarm().c_str());
    }
    std::printf("%d runs, %d with a request, %d false alarms\n", healthy, asked, alarms);
    return alarms > 0 ? 1 : 0;
  }
  const test::FreezeBench bench(scenario, keys, engine, seed);
  std::printf("ramp %.2f s, %s\n", bench.ramp_s(),
              bench.false_alarm().empty() ? "no false alarm" : bench.false_alarm().c_str());
  for (const std::vector<std::string>& inputs : test::frozen_inputs()) {
    if (!only.empty() && joined(inputs) != only) continue;
    double slip_share = 0.0, speed = 0.0, energy = 0.0, lasted = 0.0, at = 0.0;
    int runs = 0, named = 0;
    for (double at_s = 0.1; at_s < bench.ramp_s() + 0.1;
         at_s += at_s < bench.ramp_s() - 0.8 ? step_s : near_s) {
      const test::FreezeRun run = bench.run({inputs, at_s, creep_per_s});
      ++runs;
      named += run.named ? 1 : 0;
      if (run.slip_max_share > slip_share) {
        slip_share = run.slip_max_share;
        at = at_s;
      }
      speed = std::max(speed, run.slip_speed_max_m_s);
      energy = std::max(energy, run.energy_J);
      lasted = std::max(lasted, run.lasted_s);
      for (const auto& [which, how] : run.broken) {
        std::printf("  broken %s: %s (at %.2f)\n", which.c_str(), how.c_str(), at_s);
      }
      if (all) {
        std::printf("  %.2f s: slip %.2f %%, %.0f J, lasted %.3f s, named %d, %s\n", at_s,
                    100.0 * run.slip_max_share, run.energy_J, run.lasted_s, run.named,
                    run.reason.c_str());
      }
    }
    std::printf(
        "%-34s %3d runs, named %3d, slip %.2f %% (at %.2f s), %.3f m/s, %.1f J, lasted %.2f s\n",
        joined(inputs).c_str(), runs, named, 100.0 * slip_share, at, speed, energy, lasted);
  }
  return 0;
}
