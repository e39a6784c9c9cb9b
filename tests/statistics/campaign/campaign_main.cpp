// campaign --seeds N [--from S] [--out FILE] [--jobs N] [--worst FOLDER] [--nothing-wrong]
//          [--noise lab|production|harsh]
// campaign --case FILE... | --show SEED | --silence | --soak HOURS [--from SEED]
//
// The first runs seeded cases, one line of JSON each into FILE; a second call goes on where the
// first ended. The summary goes to standard output; exit status 1 when a promise was broken.

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <fstream>
#include <iostream>
#include <mutex>
#include <optional>
#include <sstream>
#include <thread>

#include "daemon/command_line/command_line.h"
#include "tests/loop/silence.h"
#include "tests/statistics/campaign/campaign_run.h"
#include "tests/statistics/campaign/campaign_summary.h"
#include "tests/statistics/campaign/reach.h"
#include "tools/sim/vehicle_scenario.h"

namespace beltgrip::test {
namespace {

using nlohmann::json;

struct Options {
  std::uint64_t seeds = 500;
  std::uint64_t from = 1;
  unsigned jobs = 2;
  std::string out;
  std::vector<std::string> files;
  std::uint64_t show = 0;
  std::string worst;
  bool silence = false;
  double soak_h = 0.0;
  bool nothing_wrong = false;
  std::string noise;  // empty: as drawn
  std::optional<NoiseBand> band() const {
    const auto at = std::find(kNoiseBandNames.begin(), kNoiseBandNames.end(), noise);
    if (at == kNoiseBandNames.end()) return std::nullopt;
    return static_cast<NoiseBand>(at - kNoiseBandNames.begin());
  }
};

CampaignResults read_results(const std::string& path) {
  CampaignResults results;
  std::ifstream in(path);
  for (std::string line; std::getline(in, line);) {
    const json row = json::parse(line, nullptr, false);
    if (!row.is_discarded()) results[row["seed"]] = row;  // a line cut off by a kill is run again
  }
  return results;
}

std::string file_text(const CampaignCase& given) {
  return "# base " + given.base + " seed " + std::to_string(given.seed) + "\n" + given.toml;
}

int run_files(const std::vector<std::string>& files) {
  int broken = 0;
  for (const std::string& file : files) {
    std::ifstream in(file);
    std::ostringstream text;
    text << in.rdbuf();
    const CampaignVerdict verdict = run_case(read_case(text.str(), file));
    std::printf("%s %s\n", file.c_str(), to_json(verdict).c_str());
    broken += verdict.violations.empty() ? 0 : 1;
  }
  return broken > 0 ? 1 : 0;
}

// Promise G2, every 5 ms of the ramp.
int run_silence() {
  int broken = 0;
  for (const char* name : {"coast-overdrive", "worn-belt"}) {
    const sim::VehicleScenario scenario = sim::shipped_vehicle_scenario(name).scenario;
    const SilenceResult result = silence_over_the_ramp(scenario, 0.005, 0.005, 0.0);
    std::printf(
        "%s: %d runs, ramp of %.2f s; largest slip %.2f %%, %.2f m/s, energy beyond the peak %.0f "
        "J\n",
        name, result.runs, result.ramp_s, 100.0 * result.slip_max_share, result.slip_speed_max_m_s,
        result.energy_J);
    for (const auto& [which, how] : result.broken) {
      std::printf("broken: %s: %s\n", which.c_str(), how.c_str());
    }
    const bool inside = result.slip_max_share <= 0.10 && result.slip_speed_max_m_s <= 0.8 &&
                        result.energy_J <= 100.0;
    broken += !inside || !result.broken.empty() ? 1 : 0;
  }
  return broken > 0 ? 1 : 0;
}

// One drive over many hours with a fault in every coast-down: what was promised holds to its end,
// and after the last fault values come as at the beginning.
int run_soak(double hours, std::uint64_t seed) {
  const CampaignCase given = draw_soak(hours, seed);
  const CampaignVerdict verdict = run_case(given);
  const double quiet_from_s = 0.9 * given.scenario.duration_s;
  int values = 0, quiet = 0, quiet_values = 0;
  double worst_percent = 0.0;
  for (const CampaignVerdict::Experiment& each : verdict.experiments) {
    const bool late = each.begin_s > quiet_from_s;
    quiet += late ? 1 : 0;
    if (!each.mu_error_percent) continue;
    ++values;
    quiet_values += late ? 1 : 0;
    worst_percent = std::max(worst_percent, std::abs(*each.mu_error_percent));
  }
  for (const std::string& each : verdict.violations) std::printf("broken: %s\n", each.c_str());
  std::printf(
      "%.1f h of driving, %zu faults one after the other, %d requests, %d values, largest error "
      "%.1f %%; largest slip %.1f %%, %.2f m/s, %.0f J beyond the peak; after the last fault %d "
      "values of %d experiments; %zu promises broken\n",
      given.scenario.duration_s / 3600.0, given.faults.size(), verdict.requests, values,
      worst_percent, verdict.slip_max_percent, verdict.slip_speed_max_m_s, verdict.energy_J,
      quiet_values, quiet, verdict.violations.size());
  constexpr double kQuietLeast = 0.8;  // of the experiments of this belt, with nothing wrong
  const bool lives = quiet > 0 && quiet_values >= kQuietLeast * quiet;
  if (!lives) std::printf("broken: it does not come back to values\n");
  return verdict.violations.empty() && lives ? 0 : 1;
}

// Runs what is still open, by several threads.
void run_open(const Options& options, std::ostream& out, CampaignResults& results) {
  std::vector<std::uint64_t> open;
  for (std::uint64_t seed = options.from; seed < options.from + options.seeds; ++seed) {
    if (!results.contains(seed)) open.push_back(seed);
  }
  const auto begin = std::chrono::steady_clock::now();
  std::atomic<std::size_t> next{0};
  double virtual_s = 0.0;
  std::size_t run = 0;
  std::mutex mutex;
  {
    std::vector<std::jthread> workers;
    for (unsigned i = 0; i < options.jobs; ++i) {
      workers.emplace_back([&] {
        for (std::size_t k = next++; k < open.size(); k = next++) {
          const CampaignCase given = draw_case(open[k], options.band());
          if (options.nothing_wrong && !given.faults.empty()) continue;
          const std::string line = to_json(run_case(given));
          const std::lock_guard lock(mutex);
          results[open[k]] = json::parse(line);
          ++run;
          virtual_s += given.scenario.duration_s;
          out << line << std::endl;
        }
      });
    }
  }
  const double wall_s =
      std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  std::printf("%zu cases run now: %.0f s of driving in %.1f s, %u at a time\n", run, virtual_s,
              wall_s, options.jobs);
}

int run(const Options& options) {
  if (options.show != 0) {
    std::printf("%s", file_text(draw_case(options.show, options.band())).c_str());
    return 0;
  }
  if (!options.files.empty()) return run_files(options.files);
  if (options.silence) return run_silence();
  if (options.soak_h > 0.0) return run_soak(options.soak_h, options.from);
  CampaignResults results;
  std::ofstream out;
  if (!options.out.empty()) {
    results = read_results(options.out);
    out.open(options.out, std::ios::app);
    if (!out) {
      std::fprintf(stderr, "campaign: %s: cannot be written\n", options.out.c_str());
      return 73;
    }
  }
  std::erase_if(results, [&](const auto& row) {
    return row.first < options.from || row.first >= options.from + options.seeds;
  });
  run_open(options, out, results);
  if (!options.worst.empty()) {
    for (const std::uint64_t seed : worst_seeds(results, 10)) {
      std::ofstream(options.worst + "/seed_" + std::to_string(seed) + ".toml")
          << file_text(draw_case(seed, options.band()));
    }
  }
  return summarise(results) > 0 ? 1 : 0;
}

}  // namespace
}  // namespace beltgrip::test

int main(int argc, char** argv) {
  beltgrip::test::Options options;
  beltgrip::command_line::Program app{"The fault campaign: seeded faults against the closed loop"};
  app.add_option("--seeds", options.seeds, "How many").capture_default_str();
  app.add_option("--from", options.from, "The first").capture_default_str();
  app.add_option("--jobs", options.jobs, "Threads").capture_default_str();
  app.add_option("--out", options.out, "Results, one line each; goes on with what is there");
  app.add_option("--case", options.files, "Run kept cases");
  app.add_option("--show", options.show, "Print the case of a seed as a file");
  app.add_option("--worst", options.worst, "Folder for the ten worst cases, as files");
  app.add_flag("--nothing-wrong", options.nothing_wrong, "Leave out cases with a fault");
  app.add_option("--noise", options.noise, "Noise of slip of this class")
      .one_of({beltgrip::test::kNoiseBandNames.begin(), beltgrip::test::kNoiseBandNames.end()});
  app.add_option("--soak", options.soak_h, "Hours of one drive, a fault in every coast-down");
  app.add_flag("--silence", options.silence, "Silence at every 5 ms of a ramp");
  switch (app.parse(argc, argv)) {
    case beltgrip::command_line::Parsed::kGoOn:
      break;
    case beltgrip::command_line::Parsed::kShown:
      return 0;
    case beltgrip::command_line::Parsed::kWrong:
      std::fprintf(stderr, "%s\n", app.error().c_str());
      return 64;
  }
  try {
    return beltgrip::test::run(options);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "campaign: %s\n", error.what());
    return 70;
  }
}
