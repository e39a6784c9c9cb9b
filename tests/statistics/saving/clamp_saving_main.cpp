// clamp_saving [--drives N] [--first SEED] [--reserve NM] [--slip-drives N]
//
// What MinClampForce saves over the controller's own law, by the pressure floor, as a table; and in
// how many drives with that law the belt slips beyond its peak, at the lowest floor.
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <vector>

#include "daemon/command_line/command_line.h"
#include "tests/statistics/saving/clamp_saving.h"
#include "tests/statistics/saving/drives.h"

namespace beltgrip::saving {
namespace {

constexpr double kFloors_MPa[] = {0.02, 0.1, 0.2, 0.3, 0.45};

struct Mean {
  double value = 0.0, deviation = 0.0;  // of the drives
};
Mean mean_of(const std::vector<double>& values) {
  Mean out;
  double squares = 0.0;
  for (const double each : values) out.value += each / static_cast<double>(values.size());
  for (const double each : values) squares += (each - out.value) * (each - out.value);
  if (values.size() > 1) {
    out.deviation = std::sqrt(squares / static_cast<double>(values.size() - 1));
  }
  return out;
}

void print_row(Cycle cycle, double floor_MPa, std::uint64_t first, std::uint64_t drives,
               const Law& law) {
  std::vector<double> force, belt, all, watts, top;
  for (std::uint64_t seed = first; seed < first + drives; ++seed) {
    const Paired pair = paired_drive(drive_scenario(cycle, 1e6 * floor_MPa, seed), seed, law);
    const auto less = [](double now, double own) { return 100.0 * (1.0 - now / own); };
    force.push_back(less(pair.min_clamp.force_N, pair.own.force_N));
    belt.push_back(less(pair.min_clamp.without_pump_W(), pair.own.without_pump_W()));
    all.push_back(less(pair.min_clamp.with_pump_W(), pair.own.with_pump_W()));
    watts.push_back(pair.own.with_pump_W() - pair.min_clamp.with_pump_W());
    top.push_back(100.0 * pair.min_clamp.at_top_s / pair.locked_s);
  }
  const Mean without = mean_of(belt), with = mean_of(all);
  std::printf(
      "| %s | %.2f MPa | %.1f %% | %.1f %% (sd %.1f) | %.1f %% (sd %.1f) | %.1f W | %.3f %% |\n",
      cycle_name(cycle), floor_MPa, mean_of(force).value, without.value, without.deviation,
      with.value, with.deviation, mean_of(watts).value, mean_of(top).value);
  std::fflush(stdout);
}

void print_slip(std::uint64_t first, std::uint64_t drives, const Law& law) {
  std::uint64_t slipping = 0;
  double longest_s = 0.0;
  for (std::uint64_t i = 0; i < drives; ++i) {
    const Cycle cycle = i % 2 == 0 ? Cycle::kCity : Cycle::kMixed;
    const double s =
        gross_slip_s(drive_scenario(cycle, 1e6 * kFloors_MPa[0], first + i), first + i, law);
    slipping += s > 0.0 ? 1 : 0;
    longest_s = std::max(longest_s, s);
  }
  std::printf(
      "gross slip in %llu of %llu drives with the law in place, at %.2f MPa; longest %.2f s\n",
      static_cast<unsigned long long>(slipping), static_cast<unsigned long long>(drives),
      kFloors_MPa[0], longest_s);
}

int run(std::uint64_t first, std::uint64_t drives, std::uint64_t slip_drives, const Law& law) {
  if (drives > 0) {
    std::printf(
        "safety_factor %g, torque_reserve_Nm %g, %llu drives a row\n\n"
        "| drive | pressure floor | less force | less loss, belt and slip | and the pump | saved | "
        "torque beyond the belt's |\n|---|---|---|---|---|---|---|\n",
        law.safety_factor, law.reserve_Nm, static_cast<unsigned long long>(drives));
  }
  for (const Cycle cycle : {Cycle::kCity, Cycle::kMixed}) {
    for (const double floor_MPa : kFloors_MPa) {
      if (drives > 0) print_row(cycle, floor_MPa, first, drives, law);
    }
  }
  if (slip_drives > 0) print_slip(first, slip_drives, law);
  return 0;
}

}  // namespace
}  // namespace beltgrip::saving

int main(int argc, char** argv) {
  std::uint64_t first = 1, drives = 4, slip_drives = 0;
  beltgrip::saving::Law law;
  beltgrip::command_line::Program app{"What MinClampForce saves over the controller's own law"};
  app.add_option("--drives", drives, "A row of the table").capture_default_str();
  app.add_option("--first", first, "The first seed").capture_default_str();
  app.add_option("--reserve", law.reserve_Nm, "torque_reserve_Nm").capture_default_str();
  app.add_option("--slip-drives", slip_drives, "With the law in place").capture_default_str();
  switch (app.parse(argc, argv)) {
    case beltgrip::command_line::Parsed::kGoOn:
      break;
    case beltgrip::command_line::Parsed::kShown:
      return 0;
    case beltgrip::command_line::Parsed::kWrong:
      std::fprintf(stderr, "%s\n", app.error().c_str());
      return 64;
  }
  return beltgrip::saving::run(first, drives, slip_drives, law);
}
