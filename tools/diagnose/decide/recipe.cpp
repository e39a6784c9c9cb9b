#include "tools/diagnose/decide/recipe.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <span>
#include <vector>

#include "can_dbc/text/number_text.h"
#include "tools/diagnose/infer/conditions.h"

namespace beltgrip::diagnose {
namespace {

// What rigs and cars reach without harm.
constexpr std::array kSpeeds_rad_s{80.0, 105.0, 130.0, 160.0, 200.0, 240.0};
constexpr std::array kTorques_Nm{15.0, 30.0, 50.0, 75.0, 100.0};
constexpr std::array kTorquesLow_Nm{12.0, 22.0, 35.0, 50.0};
constexpr std::array kOil_C{40.0, 55.0, 70.0, 85.0, 100.0};
// Chosen, of the scenario that is proposed; no verdict depends on them, nor were others tried.
constexpr double kUsualOil_C = 80.0;
constexpr double kStartShare = 1.9;  // of the clamp force at which the belt slips
constexpr double kRampShare = 0.04;  // of the start, per second
constexpr double kFaster = 4.0;      // the other rate
constexpr double kLength_s = 60.0;
constexpr double kAboveSpring_N = 300.0;

struct Ramp {
  bool low = false;
  double speed_rad_s = 0.0, torque_Nm = 0.0, oil_C = kUsualOil_C, ramp_share = kRampShare;
};

std::string number(double value) { return rounded_text(value, 5); }

// Farthest, by ratio or by difference, from all that was done.
double farthest(std::span<const double> levels, const std::vector<double>& done, bool by_ratio) {
  const auto place = [&](double value) {
    return by_ratio ? std::log(std::max(value, 1.0)) : value;
  };
  double best = levels.front(), most = -1.0;
  for (const double level : levels) {
    double nearest = 1e9;
    for (const double each : done) {
      nearest = std::min(nearest, std::abs(place(level) - place(each)));
    }
    if (nearest > most) {
      most = nearest;
      best = level;
    }
  }
  return best;
}

std::vector<Conditions> done_so_far(const Campaign& campaign) {
  std::vector<Conditions> out;
  for (const ExperimentData& run : campaign.runs) {
    if (run.valid_count > 0) out.push_back(conditions_of(run));
  }
  return out;
}

Ramp like(const Conditions& done) {
  Ramp out;
  out.low = done.stop == kLowStop;
  out.speed_rad_s = std::round(done.speed_rad_s);
  out.torque_Nm = std::max(5.0, std::round(std::abs(done.torque_Nm)));
  if (done.oil_C) out.oil_C = std::round(*done.oil_C);
  return out;
}

void vary(Ramp& ramp, Varied varied, const std::vector<Conditions>& done) {
  const auto all = [&](auto&& value) {
    std::vector<double> out;
    out.reserve(done.size());
    for (const Conditions& each : done) out.push_back(value(each));
    return out;
  };
  switch (varied) {
    case Varied::kRepeat:
      break;
    case Varied::kSpeed:
      ramp.speed_rad_s =
          farthest(kSpeeds_rad_s, all([](const auto& d) { return d.speed_rad_s; }), true);
      break;
    case Varied::kTorque: {
      const std::span<const double> levels =
          ramp.low ? std::span<const double>(kTorquesLow_Nm) : std::span<const double>(kTorques_Nm);
      ramp.torque_Nm =
          farthest(levels, all([](const auto& d) { return std::abs(d.torque_Nm); }), true);
      break;
    }
    case Varied::kOil:
      ramp.oil_C =
          farthest(kOil_C, all([](const auto& d) { return d.oil_C.value_or(kUsualOil_C); }), false);
      break;
    case Varied::kRate:
      ramp.ramp_share *= kFaster;
      break;
    case Varied::kEndStop:
      ramp.low = !ramp.low;
      if (ramp.low) ramp.torque_Nm = std::min(ramp.torque_Nm, kTorquesLow_Nm.back());
      break;
  }
}

}  // namespace

Varied varied_by(std::string_view depends_on) {
  const auto has = [&](std::string_view word) { return depends_on.find(word) != depends_on.npos; };
  if (has("rate") || has("direction")) return Varied::kRate;
  if (has("oil_temperature")) return Varied::kOil;
  if (has("speed") || has("acceleration") || has("angle")) return Varied::kSpeed;
  if (has("torque") || has("pressure") || has("nothing")) return Varied::kTorque;
  if (has("ratio")) return Varied::kEndStop;
  return Varied::kRepeat;
}

Recipe recipe(const Campaign& campaign, const ModelState& state, Varied varied,
              const std::string& why) {
  const std::vector<Conditions> done = done_so_far(campaign);
  Ramp ramp;
  if (!done.empty()) ramp = like(done.front());
  vary(ramp, varied, done);
  const estimator::VariatorParameters& v = campaign.variator;
  const double radius_m = ramp.low ? v.primary_radius_low_m : v.primary_radius_overdrive_m;
  const double slips_N = ramp.torque_Nm * std::cos(v.half_wedge_angle_rad) /
                         (2.0 * radius_m * std::exp(state.nuisance[kLnMuMax]));
  const double start_N =
      std::round(std::max(kStartShare * slips_N, v.secondary_spring_force_N + kAboveSpring_N));
  const double ramp_N_s = std::round(ramp.ramp_share * start_N);
  const std::string stop = ramp.low ? "low" : "overdrive";
  Recipe out;
  out.text = why + ": " + stop + " end stop, " + number(ramp.speed_rad_s) + " rad/s, " +
             number(ramp.torque_Nm) + " Nm, oil at " + number(ramp.oil_C) +
             " degC; lower the clamp force from " + number(start_N) + " N by " + number(ramp_N_s) +
             " N/s until the belt slips by 3 %, raise it again, go on for " + number(kLength_s) +
             " s";
  out.scenario = "# " + why + "\nname = \"next\"\n\n[variator]\nratio = " +
                 number(ramp.low ? v.ratio_low : v.ratio_overdrive) +
                 "\nsecondary_piston_area_m2 = " + number(v.secondary_piston_area_m2) +
                 "\nsecondary_spring_force_N = " + number(v.secondary_spring_force_N) +
                 "\n\n[driveline]\nprimary_speed_rad_s = " + number(ramp.speed_rad_s) +
                 "\nprimary_torque_Nm = " + number(ramp.torque_Nm) +
                 "\n\n[clamp]\nstart_force_N = " + number(start_N) +
                 "\nhold_s = 3\nramp_N_per_s = " + number(ramp_N_s) +
                 "\n\n[operator]\nslip_percent = 3\nreaction_s = 0.1\nrestore_N_per_s = 400"
                 "\n\n[run]\nduration_s = " +
                 number(kLength_s) + "\ncycles = 2\noil_degC = " + number(ramp.oil_C) + "\n";
  return out;
}

}  // namespace beltgrip::diagnose
