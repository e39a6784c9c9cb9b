// What each number of tools/diagnose/decide/thresholds.h decides: a fixed set of recordings of the
// generator, answered with each number a fifth smaller and a fifth larger. tests/vary runs it.
//   constants_panel [--write FILE]   the table; into FILE, behind its heading
// The sources that decide are compiled anew here, with numbers that can be moved.
#include <array>
#include <string>
#include <vector>

#include "tests/statistics/blind/generator.h"
#include "tests/statistics/varied_numbers.h"
#include "tools/diagnose/data/signal_table.h"
#include "tools/diagnose/decide/thresholds.h"
#include "tools/diagnose/model/model_file.h"
#include "tools/diagnose/run/diagnose.h"

namespace beltgrip::blind {
namespace {

// As short as an answer is still to be had from: hundreds are.
constexpr int kRuns = 8;
constexpr double kDuration_s = 45.0;

const test::VariedNumber kNumbers[] = {
#include "varied_constants.inc"
};

struct Planned {
  std::uint64_t seed;
  const char* planted;  // nullptr: nothing; x_...: a cause outside the table
  double size;          // in usual sizes
};
constexpr Planned kPlanned[] = {
    {8101, nullptr, 0.0},
    {8102, nullptr, 0.0},
    {8103, nullptr, 0.0},
    {8104, nullptr, 0.0},
    {8111, "friction_temperature.per_K", 0.5},
    {8112, "torque_gain.gain", 0.5},
    {8113, "wear.step", 0.5},
    {8114, "hydraulic_lag.time_constant_s", 1.0},
    {8121, "x_friction_speed_bump", 1.0},
    {8122, "x_friction_hidden", 1.0},
    {8124, "x_friction_between", 1.0},
    {8125, "x_force_ripple", 0.5},
    {8126, "x_gain_temperature", 1.0},
    {8127, "x_belt_passage", 0.5},
};

enum Part { kHealthy, kNamed, kFlagged, kParts };

struct Case {
  Part part = kHealthy;
  std::string effect;
  diagnose::Request request;
};

std::vector<Case> cases() {
  std::vector<Case> out;
  for (const Planned& planned : kPlanned) {
    Case each;
    Trial trial;
    trial.seed = planned.seed;
    Random random(trial.seed);
    trial.machine = draw_machine(random);
    trial.plan = draw_plan(random, trial.machine.setting, kRuns);
    for (PlannedRun& run : trial.plan) run.duration_s = kDuration_s;
    const std::string name = planned.planted == nullptr ? "" : planned.planted;
    if (name.starts_with("x_")) {
      each.part = kFlagged;
      trial.planted.push_back(draw_outside(random, name, planned.size));
    }
    for (const Plantable& what : plantables()) {
      if (what.effect + "." + what.parameter != name) continue;
      each.part = kNamed;
      each.effect = what.effect;
      trial.planted.push_back(draw_effect(random, what, planned.size));
    }
    estimator::VariatorParameters variator;
    variator.primary_inertia_kg_m2 = trial.machine.primary_inertia_kg_m2;
    each.request.model = diagnose::nominal_model(variator);
    for (const std::string& text : record(trial).csv) {
      each.request.experiments.push_back(diagnose::parse_csv(text, "run.csv"));
    }
    out.push_back(std::move(each));
  }
  return out;
}

bool is_right(const Case& each) {
  const diagnose::Diagnosis answer = diagnose::diagnose(each.request).diagnosis;
  switch (each.part) {
    case kHealthy:
      return answer.verdict == diagnose::Verdict::kNothingWrong;
    case kNamed:
      return !answer.findings.empty() && answer.findings.front().effect == each.effect;
    case kFlagged:
    case kParts:
      break;
  }
  return answer.unexplained.has_value() || !answer.learned.empty();
}

using Counts = std::array<int, kParts>;

Counts right(const std::vector<Case>& all) {
  Counts out{};
  for (const Case& each : all) out[each.part] += is_right(each) ? 1 : 0;
  return out;
}

std::string text_of(const Counts& counts) {
  std::string out;
  for (const int each : counts) out += (out.empty() ? "" : " / ") + std::to_string(each);
  return out;
}

}  // namespace
}  // namespace beltgrip::blind

int main(int argc, char** argv) {
  using namespace beltgrip::blind;
  const std::vector<Case> all = cases();
  Counts of{};
  for (const Case& each : all) ++of[each.part];
  const std::string introduction =
      "Of " + std::to_string(of[kHealthy]) +
      " healthy recordings of the generator called so / of " + std::to_string(of[kNamed]) +
      " effects named first / of " + std::to_string(of[kFlagged]) +
      " causes outside the table flagged; as it is: " + text_of(right(all)) + ".";
  return beltgrip::test::write_varied(argc, argv, "## What the deciding numbers decide\n",
                                      introduction, kNumbers,
                                      [&all] { return text_of(right(all)); });
}
