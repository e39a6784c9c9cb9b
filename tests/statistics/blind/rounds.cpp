#include "tests/statistics/blind/rounds.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <stdexcept>

#include "tools/diagnose/infer/engine.h"
#include "tools/diagnose/run/diagnose.h"

namespace beltgrip::blind {
namespace {

constexpr int kRuns = 10;
constexpr double kOtherSpeed = 80.0, kOtherSpeedMost = 240.0;

double value_of(const std::string& scenario, const std::string& key) {
  const std::size_t at = scenario.find("\n" + key + " = ");
  if (at == std::string::npos) throw std::runtime_error("no " + key + " in: " + scenario);
  return std::strtod(scenario.c_str() + at + key.size() + 4, nullptr);
}

estimator::VariatorParameters told(const Trial& trial) {
  estimator::VariatorParameters out;
  out.primary_inertia_kg_m2 = trial.machine.primary_inertia_kg_m2;
  return out;
}

// By the linear fit of the machine alone to the first data.
double sigmas_of(const Trial& trial) {
  const estimator::VariatorParameters variator = told(trial);
  std::vector<diagnose::ExperimentData> runs;
  for (const std::string& text : record(trial).csv) {
    runs.push_back(diagnose::prepare(diagnose::parse_csv(text, "run.csv"), variator));
  }
  diagnose::Engine engine(
      diagnose::make_campaign(std::move(runs), diagnose::nominal_model(variator)));
  engine.fit_machine();
  engine.update_noise();
  const Planted& planted = trial.planted.front();
  double out = 0.0;
  for (const diagnose::Score& score : engine.screen()) {
    const diagnose::Slot& slot = engine.campaign().slots[static_cast<std::size_t>(score.slot)];
    if (slot.row->id != planted.effect || slot.role != planted.role) continue;
    const auto size = planted.parameters.find(std::string(slot.row->parameter));
    if (size == planted.parameters.end() || score.sigma <= 0.0) continue;
    out = std::max(out, std::abs(size->second) / score.sigma);
  }
  return out;
}

// Ten ramps as a rig's owner makes them who does not know what is asked: all the same, or one thing
// at three levels.
std::vector<PlannedRun> narrow_plan(Random& random) {
  constexpr std::array kSpeeds_rad_s{90.0, 105.0, 150.0};
  constexpr std::array kTorques_Nm{30.0, 50.0, 75.0};
  std::vector<PlannedRun> out = paper_plan(kRuns);
  const int what = random.below(3);
  for (std::size_t i = 0; i < out.size(); ++i) {
    if (what == 1) out[i].speed_rad_s = kSpeeds_rad_s[i % kSpeeds_rad_s.size()];
    if (what == 2) out[i].torque_Nm = kTorques_Nm[i % kTorques_Nm.size()];
  }
  return out;
}

// Two names of one equation: no experiment of ramps tells them apart.
bool is_same_equation(const std::string& a, const std::string& b) {
  constexpr std::array<std::array<const char*, 2>, 4> kPairs{{{"hydraulic_lag", "channel_skew"},
                                                              {"torque_delay", "channel_skew"},
                                                              {"torque_bias", "torque_loss"},
                                                              {"pressure_offset", "spring_force"}}};
  return a == b || std::any_of(kPairs.begin(), kPairs.end(), [&](const auto& pair) {
           return (a == pair[0] && b == pair[1]) || (a == pair[1] && b == pair[0]);
         });
}

PlannedRun drawn(Random& random) {
  constexpr std::array kLowTorques_Nm{12.0, 22.0, 35.0, 50.0};
  constexpr std::array kTorques_Nm{15.0, 30.0, 50.0, 75.0, 100.0};
  PlannedRun out;
  out.low = random.uniform() < 0.5;
  out.speed_rad_s = random.uniform(kOtherSpeed, kOtherSpeedMost);
  out.torque_Nm = out.low ? kLowTorques_Nm[static_cast<std::size_t>(random.below(4))]
                          : kTorques_Nm[static_cast<std::size_t>(random.below(5))];
  out.temperature_C = random.uniform(40.0, 100.0);
  out.ramp_N_s = random.uniform() < 0.5 ? 100.0 : 400.0;
  return out;
}

}  // namespace

PlannedRun run_of(const std::string& scenario) {
  PlannedRun out;
  out.low = value_of(scenario, "ratio") < 1.0;
  out.speed_rad_s = value_of(scenario, "primary_speed_rad_s");
  out.torque_Nm = value_of(scenario, "primary_torque_Nm");
  out.temperature_C = value_of(scenario, "oil_degC");
  out.ramp_N_s = value_of(scenario, "ramp_N_per_s");
  out.duration_s = value_of(scenario, "duration_s");
  return out;
}

Trial draw_open_trial(std::uint64_t number) {
  Random random(number * 2654435761ULL + 4711ULL);
  Trial out;
  out.seed = number;
  out.machine = draw_machine(random);
  out.plan = narrow_plan(random);
  const double size = random.log_uniform(1.0, 5.0);
  const std::vector<Plantable>& all = plantables();
  const auto which = static_cast<std::size_t>(random.below(static_cast<int>(all.size())));
  out.planted.push_back(draw_effect(random, all[which], size));
  return out;
}

Round diagnosed(const Trial& trial) {
  diagnose::Request request;
  request.model = diagnose::nominal_model(told(trial));
  int count = 0;
  for (const std::string& text : record(trial).csv) {
    request.experiments.push_back(
        diagnose::parse_csv(text, "run" + std::to_string(++count) + ".csv"));
  }
  const diagnose::Diagnosis d = diagnose::diagnose(std::move(request)).diagnosis;
  const std::string& truth = trial.planted.front().effect;
  Round out;
  if (d.next_experiment) {
    out.next = d.next_experiment->scenario;
    out.next_why = d.next_experiment->text;
  }
  bool is_named = false, is_in_class = false, has_others = false;
  // What was learned under no name may always stand in a name's place.
  const auto is_other = [&](const std::string& alias) {
    return !alias.starts_with("learned ") && !is_same_equation(truth, alias);
  };
  for (const diagnose::Finding& each : d.findings) {
    const bool is_it = is_same_equation(truth, each.effect);
    is_named |= is_it;
    out.answer += (out.answer.empty() ? "" : " + ") + each.effect;
    for (const std::string& alias : each.aliases) {
      if (is_other(alias)) out.answer += "/" + alias;
    }
    is_in_class |= std::find(each.aliases.begin(), each.aliases.end(), truth) != each.aliases.end();
    has_others |= !is_it || std::any_of(each.aliases.begin(), each.aliases.end(), is_other);
  }
  const bool is_told_unseen =
      std::any_of(d.not_identifiable.begin(), d.not_identifiable.end(),
                  [&](const diagnose::NotIdentifiable& each) { return each.effect == truth; });
  out.standing = is_named && !has_others   ? Standing::kAlone
                 : is_named || is_in_class ? Standing::kInClass
                 : !d.findings.empty()     ? Standing::kWrong
                 : is_told_unseen          ? Standing::kUnseen
                                           : Standing::kSilent;
  return out;
}

RoundsOfTrial play(std::uint64_t number, int rounds) {
  RoundsOfTrial out;
  out.number = number;
  out.trial = draw_open_trial(number);
  out.first = diagnosed(out.trial);
  const bool is_open =
      out.first.standing == Standing::kInClass || out.first.standing == Standing::kUnseen;
  if (!is_open) return out;
  out.sigmas = sigmas_of(out.trial);
  Trial follows = out.trial;
  std::string next = out.first.next;
  for (int round = 0; round < rounds && !next.empty(); ++round) {
    follows.plan.push_back(run_of(next));
    out.followed.push_back(diagnosed(follows));
    if (out.followed.back().standing == Standing::kAlone) break;
    next = out.followed.back().next;
  }
  Random random(number + 77ULL);
  Trial draws = out.trial;
  for (int round = 0; round < rounds; ++round) {
    draws.plan.push_back(drawn(random));
    out.random.push_back(diagnosed(draws));
    if (out.random.back().standing == Standing::kAlone) break;
  }
  return out;
}

}  // namespace beltgrip::blind
