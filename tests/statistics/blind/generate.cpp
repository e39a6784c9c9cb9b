// Writes one recording of the generator as CSV files, a configuration and the truth.
//   generate DIRECTORY trial NUMBER                     that trial of the blind test
//   generate DIRECTORY open NUMBER                      that trial of `rounds`
//   generate DIRECTORY SEED [equal] [EFFECT.PARAMETER SIZE]...  SIZE in units of the usual size;
//                                                       equal: the same ramp twelve times
#include <charconv>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <string>

#include "tests/statistics/blind/blind_trial.h"
#include "tests/statistics/blind/generator.h"
#include "tests/statistics/blind/rounds.h"

int main(int argc, char** argv) {
  using namespace beltgrip::blind;
  if (argc < 3) {
    std::fprintf(
        stderr,
        "usage: generate DIRECTORY trial|open NUMBER | SEED [equal] [EFFECT.PARAMETER SIZE]...\n");
    return 64;
  }
  const std::filesystem::path directory = argv[1];
  std::filesystem::create_directories(directory);
  Trial trial;
  const auto number = [](const char* text) {
    double value = 0.0;
    std::from_chars(text, text + std::strlen(text), value);
    return value;
  };
  if (std::strcmp(argv[2], "trial") == 0 && argc == 4) {
    trial = draw_envelope(static_cast<std::uint64_t>(number(argv[3]))).trial;
  } else if (std::strcmp(argv[2], "open") == 0 && argc == 4) {
    trial = draw_open_trial(static_cast<std::uint64_t>(number(argv[3])));
  } else {
    trial.seed = static_cast<std::uint64_t>(number(argv[2]));
    Random random(trial.seed);
    trial.machine = draw_machine(random);
    const bool equal = argc > 3 && std::strcmp(argv[3], "equal") == 0;
    trial.plan = equal ? paper_plan(12) : draw_plan(random, trial.machine.setting, 12);
    for (int i = equal ? 4 : 3; i + 1 < argc; i += 2) {
      const std::string name = argv[i];
      for (const Plantable& each : plantables()) {
        if (each.effect + "." + each.parameter == name) {
          trial.planted.push_back(draw_effect(random, each, number(argv[i + 1])));
        }
      }
      for (const auto* causes : {&outside_causes(), &further_causes()}) {
        for (const std::string& each : *causes) {
          if (each != name) continue;
          trial.planted.push_back(draw_outside(random, each, number(argv[i + 1])));
        }
      }
    }
  }
  const Recording recording = record(trial);
  for (std::size_t i = 0; i < recording.csv.size(); ++i) {
    char name[32];
    std::snprintf(name, sizeof name, "run%02zu.csv", i + 1);
    std::ofstream(directory / name) << recording.csv[i];
  }
  std::ofstream config(directory / "config.toml");
  config << "[variator]\nprimary_inertia_kg_m2 = 0.18\n";
  std::ofstream truth(directory / "truth.txt");
  for (const Planted& each : trial.planted) {
    for (const auto& [key, value] : each.parameters) {
      truth << each.effect << "." << key << (each.role.empty() ? "" : "@" + each.role) << " = "
            << value << "\n";
    }
  }
  truth << "# setting " << static_cast<int>(trial.machine.setting) << " law "
        << static_cast<int>(trial.machine.law) << " mu_max " << trial.machine.mu_max << "\n";
  for (const PlannedRun& run : trial.plan) {
    truth << "# low " << run.low << " speed " << run.speed_rad_s << " torque " << run.torque_Nm
          << " temperature " << run.temperature_C << " ramp " << run.ramp_N_s << " profile "
          << static_cast<int>(run.profile) << "\n";
  }
  return 0;
}
