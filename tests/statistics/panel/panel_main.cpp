// beltgrip_panel: draws virtual variators, runs both methods over their traces and prints one table
// with the bounds beside it.
#include <cstdio>
#include <cstdlib>
#include <cstring>

#include "drawing.h"
#include "panel_bands.h"
#include "panel_figures.h"
#include "wear_run.h"

using namespace beltgrip::panel;

namespace {

int usage() {
  std::fputs(
      "usage: beltgrip_panel [--traces N] [--first SEED] [--threads N] [--paper-rig] [--biased]\n"
      "                      [--robust-only] [--confidence WIDTH] [--csv FILE]\n"
      "                      [--disturbed friction|ratio|torque|rattle] [--wear]\n",
      stderr);
  return 64;
}

void print_wear(std::uint64_t first, int belts, int threads) {
  std::puts(
      "| noise | drop | belts | experiments with a value | scatter, median | judged | found |\n"
      "|---|---|---|---|---|---|---|");
  for (int i = 0; i < kNoiseClasses; ++i) {
    for (const double drop : {0.03, 0.0}) {
      const auto noise = static_cast<NoiseClass>(i);
      const WearRates r = wear_rates(first, belts, noise, drop, threads);
      std::printf("| %s | %.0f %% | %d | %.1f %% | %.2f %% | %d | %.1f %% |\n", noise_name(noise),
                  100.0 * drop, r.belts, r.values, r.scatter, r.judged,
                  100.0 * r.found / (r.judged > 0 ? r.judged : 1));
    }
  }
}

}  // namespace

int main(int argc, char** argv) {
  int count = 1000, threads = 2;
  std::uint64_t first = 1;
  const char* csv = nullptr;
  bool paper_rig = false, wear = false;
  JudgeOptions options;
  for (int i = 1; i < argc; ++i) {
    const auto is = [&](const char* name) { return std::strcmp(argv[i], name) == 0; };
    const char* value = i + 1 < argc ? argv[i + 1] : nullptr;
    if (is("--paper-rig")) {
      paper_rig = true;
    } else if (is("--wear")) {
      wear = true;
    } else if (is("--biased")) {
      options.biased = true;
    } else if (is("--robust-only")) {
      options.paper = false;
    } else if (value == nullptr) {
      return usage();
    } else {
      ++i;
      if (std::strcmp(argv[i - 1], "--traces") == 0) {
        count = std::atoi(value);
      } else if (std::strcmp(argv[i - 1], "--first") == 0) {
        first = std::strtoull(value, nullptr, 10);
      } else if (std::strcmp(argv[i - 1], "--threads") == 0) {
        threads = std::atoi(value);
      } else if (std::strcmp(argv[i - 1], "--confidence") == 0) {
        options.confidence_width = std::atof(value);
      } else if (std::strcmp(argv[i - 1], "--disturbed") == 0) {
        for (int k = 1; k < kDisturbances; ++k) {
          const auto each = static_cast<Disturbance>(k);
          if (std::strcmp(value, disturbance_name(each)) == 0) options.disturbance = each;
        }
        if (options.disturbance == Disturbance::kNone) return usage();
      } else if (std::strcmp(argv[i - 1], "--csv") == 0) {
        csv = value;
      } else {
        return usage();
      }
    }
  }
  if (count < 1 || threads < 1) return usage();
  if (wear) {
    print_wear(first, count, threads);
    return 0;
  }
  const auto draw = [paper_rig](std::uint64_t seed) {
    return paper_rig ? paper_scenario(seed, seed % 2 == 0 ? 0.105 : 0.100) : draw_scenario(seed);
  };
  const auto traces = judge_many(draw, first, count, threads, options);
  if (options.disturbance != Disturbance::kNone) {
    print_disturbed(stdout, traces);
    return 0;
  }
  print_table(stdout, traces, options.paper);
  print_bands(stdout, traces);
  print_stops_by_speed(stdout, traces);
  if (options.confidence_width > 0.0) {
    print_confidence(stdout, traces);
  } else {
    print_forecasts(stdout, traces);
  }
  if (csv != nullptr && !write_csv(csv, traces, options.paper)) {
    std::fprintf(stderr, "beltgrip_panel: cannot write %s\n", csv);
    return 73;
  }
  return 0;
}
