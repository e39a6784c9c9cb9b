#include "tests/statistics/campaign/campaign_run.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <nlohmann/json.hpp>

#include "daemon/core/input/stop_cause.h"
#include "daemon/core/publish/names.h"
#include "tools/sim/vehicle_scenario.h"

namespace beltgrip::test {

namespace {

using sim::FaultKind;

// Promise G1. Where the disturbance alone slips the belt: no more than that and kAlone.
constexpr double kSlip_share = 0.10;
constexpr double kSlipSpeed_m_s = 0.8;
constexpr double kEnergy_J = 100.0;
constexpr double kAlone = 0.002;
constexpr double kAfter_s = sim::RequestTruth::kAfter_s;
// Promise G4: the end of a request is on the bus so long after its reason could be seen.
constexpr double kWire_s = 0.010;

std::string text(double value) {
  char out[40];
  std::snprintf(out, sizeof out, "%.4g", value);
  return out;
}

// What is known of the sensors: the spread that vehicle_text() draws, and what it draws beside them
// that reads like a sensor's error (accessories, friction of the piston).
daemon::Config configuration(const CampaignCase& given) {
  // The daemon knows the shipped vehicle, not the one that was drawn.
  sim::VehicleScenario nominal = sim::shipped_vehicle_scenario(given.base).scenario;
  // How often a signal comes its user can see.
  nominal.sensors.pressure_period_s = given.scenario.sensors.pressure_period_s;
  std::map<std::string, std::string> settings;
  if (given.base == "cruise-drive-torque") settings["trigger"] = "\"steady\"";
  daemon::Config config = vehicle_config(nominal, settings);
  config.sensors.torque = {1.9, 0.02};
  config.sensors.secondary_pressure = {7e3, 0.006};
  return config;
}

bool beyond_limits(const sim::RequestTruth& request, bool has_peak) {
  // Without a peak there is no macro slip whose energy could be counted.
  return request.slip_max_share > kSlip_share || request.slip_speed_max_m_s > kSlipSpeed_m_s ||
         (has_peak && request.macro_energy_J > kEnergy_J);
}

// The run again, but the controller ends the request one cycle before its belt passes the peak.
void judge_at_once(const CampaignCase& given, const sim::RequestTruth& broken,
                   CampaignVerdict& verdict) {
  sim::VehicleScenario scenario = given.scenario;
  sim::FaultStep end;
  end.kind = FaultKind::kTcuWithdraws;
  end.at_s = broken.peak_passed_s - scenario.tcu.cycle_s;
  end.for_s = scenario.duration_s;
  scenario.faults.push_back(end);
  for (const sim::RequestTruth& request :
       run_closed(scenario, configuration(given), given.seed).requests) {
    if (request.begin_s != broken.begin_s) continue;
    verdict.at_once_slip_percent = 100.0 * request.slip_max_share;
    verdict.at_once_energy_J = request.macro_energy_J;
    verdict.broken_at_once = beyond_limits(request, verdict.has_peak);
  }
}

// Did the daemon ask for it? Another node's request that begins when the daemon's own has ended, or
// before it, is answered by the controller (CLAMP_CONTRACT.md), not by the daemon.
bool asked_by_daemon(const LoopRun& run, const sim::RequestTruth& request) {
  constexpr double kSame_s = 0.1;  // from the daemon's frame to the controller's obeying
  return std::any_of(run.results.begin(), run.results.end(), [&](const auto& each) {
    return request.begin_s < static_cast<double>(each.end.ns()) * 1e-9 + kSame_s &&
           request.end_s > static_cast<double>(each.start.ns()) * 1e-9;
  });
}

// Friction that falls within a request is shown, but none of the catalogue's faults: X2 has it fall
// between experiments.
bool promised(const CampaignCase& given, const sim::RequestTruth& request) {
  const sim::BeltParameters& belt = given.scenario.belt;
  const bool falls = belt.wear_step > 0.0 && belt.wear_at_s >= request.begin_s &&
                     belt.wear_at_s <= request.end_s + kAfter_s;
  return given.guaranteed && !falls;
}

void judge_slip(const CampaignCase& given, const LoopRun& run, CampaignVerdict& verdict) {
  bool beyond = run.stalls > 0;
  const sim::RequestTruth* broken = nullptr;
  for (const sim::RequestTruth& request : run.requests) {
    if (!asked_by_daemon(run, request)) continue;
    verdict.slip_max_percent = std::max(verdict.slip_max_percent, 100.0 * request.slip_max_share);
    verdict.slip_speed_max_m_s = std::max(verdict.slip_speed_max_m_s, request.slip_speed_max_m_s);
    verdict.slip_stop_percent =
        std::max(verdict.slip_stop_percent, 100.0 * request.slip_at_end_share);
    verdict.energy_J = std::max(verdict.energy_J, request.macro_energy_J);
    beyond = beyond || beyond_limits(request, true);
  }
  if (!beyond) return;
  const LoopRun alone = run_alone(given.scenario, given.seed);
  double worst = 0.0;
  for (const sim::RequestTruth& request : run.requests) {
    const double end_s = request.end_s + kAfter_s;
    const double alone_slip_share = alone.slip_max_share(request.begin_s, end_s);
    worst = std::max(worst, alone_slip_share);
    if (!asked_by_daemon(run, request)) continue;
    if (!promised(given, request) || request.slip_max_share <= alone_slip_share + kAlone) continue;
    if (beyond_limits(request, verdict.has_peak)) broken = &request;
    if (request.slip_max_share > kSlip_share) {
      verdict.violations.push_back("G1: slip " + text(100.0 * request.slip_max_share) +
                                   " %, alone " + text(100.0 * alone_slip_share) + " %");
    }
    if (request.slip_speed_max_m_s >
        std::max(kSlipSpeed_m_s, alone.slip_speed_max(request.begin_s, end_s))) {
      verdict.violations.push_back("G1: slip speed " + text(request.slip_speed_max_m_s) + " m/s");
    }
    if (verdict.has_peak && request.macro_energy_J > kEnergy_J) {
      verdict.violations.push_back("G1: energy " + text(request.macro_energy_J) + " J");
    }
  }
  verdict.alone_slip_percent = 100.0 * worst;
  if (run.stalls > alone.stalls && verdict.guaranteed) {
    verdict.violations.push_back("G1: the engine stalled");
  }
  if (broken != nullptr) judge_at_once(given, *broken, verdict);
}

void judge_results(const LoopRun& run, CampaignVerdict& verdict) {
  constexpr double kSame_s = 0.1;  // from the daemon's decision to the controller's obeying
  for (const daemon::ExperimentResult& result : run.results) {
    CampaignVerdict::Experiment out;
    const bool refused =
        result.end == result.start && result.outcome == daemon::Outcome::kInconclusive;
    out.outcome = refused ? "Refused" : daemon::outcome_name(result.outcome);
    out.stop_reason = daemon::stop_reason_name(result.stop_reason);
    out.cause = daemon::cause_text(result.stop_reason, result.cause);
    const double start_s = static_cast<double>(result.start.ns()) * 1e-9;
    out.begin_s = start_s;
    out.end_s = static_cast<double>(result.end.ns()) * 1e-9;
    for (const sim::RequestTruth& request : run.requests) {
      if (result.outcome != daemon::Outcome::kCompleted ||
          std::abs(request.begin_s - start_s) > kSame_s) {
        continue;
      }
      out.mu_error_percent = 100.0 * (result.peak.mu_max / request.mu_max - 1.0);
      out.covered =
          result.peak.ci95_low <= request.mu_max && request.mu_max <= result.peak.ci95_high;
    }
    verdict.experiments.push_back(out);
  }
}

void judge_reactions(const CampaignCase& given, const LoopRun& run, CampaignVerdict& verdict) {
  verdict.reactions = run.reactions;
  const bool deaf = std::any_of(
      given.scenario.faults.begin(), given.scenario.faults.end(), [](const sim::FaultStep& fault) {
        return fault.kind == FaultKind::kBusOff || fault.kind == FaultKind::kBusDown ||
               fault.kind == FaultKind::kSendFull || fault.kind == FaultKind::kSendLost;
      });
  if (deaf) return;
  for (const Reaction& reaction : run.reactions) {
    if (reaction.wire_s - reaction.since_s > kWire_s || reaction.wire_s < 0.0) {
      verdict.violations.push_back("G4: on the bus " + text(reaction.wire_s - reaction.since_s) +
                                   " s after: " + reaction.what);
    }
  }
}

}  // namespace

CampaignVerdict run_case(const CampaignCase& given) {
  const daemon::Config config = configuration(given);
  const LoopRun run = run_closed(given.scenario, config, given.seed);
  CampaignVerdict verdict;
  verdict.seed = given.seed;
  verdict.base = given.base;
  verdict.faults = given.faults;
  verdict.guaranteed = given.guaranteed && std::all_of(run.requests.begin(), run.requests.end(),
                                                       [&given](const sim::RequestTruth& each) {
                                                         return promised(given, each);
                                                       });
  verdict.fall_per_percent = given.scenario.belt.overdrive.fall_per_percent;
  verdict.requests = static_cast<int>(run.requests.size());
  verdict.has_peak = given.scenario.belt.overdrive.shape != sim::CurveShape::kSaturating;
  for (const auto& [which, how] : run.broken) verdict.violations.push_back(which + ": " + how);
  if (run.finite_until_s >= 0.0) {
    verdict.violations.push_back("no number at " + text(run.finite_until_s) + " s");
  }
  judge_slip(given, run, verdict);
  judge_results(run, verdict);
  judge_reactions(given, run, verdict);
  if (given.faults.empty() && config.trigger == daemon::Trigger::kCoastDown) {
    verdict.reach =
        reach_of(given.scenario,
                 {config.experiment.secondary_pressure_floor_Pa,
                  config.estimator.ramp_rate_max_N_per_s, config.experiment.fall_max_per_percent},
                 given.seed);
  }
  return verdict;
}

std::string to_json(const CampaignVerdict& v) {
  const auto rounded = [](double value) { return std::round(value * 1e5) * 1e-5; };
  nlohmann::ordered_json out{{"seed", v.seed},
                             {"base", v.base},
                             {"faults", v.faults},
                             {"guaranteed", v.guaranteed},
                             {"fall", v.fall_per_percent},
                             {"requests", v.requests},
                             {"slip_max_percent", rounded(v.slip_max_percent)},
                             {"slip_stop_percent", rounded(v.slip_stop_percent)},
                             {"slip_speed_max_m_s", rounded(v.slip_speed_max_m_s)},
                             {"energy_J", rounded(v.energy_J)},
                             {"has_peak", v.has_peak},
                             {"violations", v.violations}};
  if (v.alone_slip_percent) out["alone_slip_percent"] = rounded(*v.alone_slip_percent);
  if (v.at_once_slip_percent) {
    out["at_once"] = {{"slip_percent", rounded(*v.at_once_slip_percent)},
                      {"energy_J", rounded(*v.at_once_energy_J)},
                      {"broken", v.broken_at_once}};
  }
  if (v.reach) {
    out["reach"] = {{"wall", wall_name(v.reach->wall)},
                    {"from_s", rounded(v.reach->from_s)},
                    {"to_s", rounded(v.reach->to_s)},
                    {"peak_slip_percent", rounded(v.reach->peak_slip_percent)},
                    {"noise", kNoiseBandNames.at(static_cast<std::size_t>(v.reach->noise))},
                    {"slip_noise_percent", rounded(v.reach->slip_noise_percent)}};
  }
  out["experiments"] = nlohmann::ordered_json::array();
  for (const CampaignVerdict::Experiment& each : v.experiments) {
    nlohmann::ordered_json row{{"outcome", each.outcome},
                               {"stop_reason", each.stop_reason},
                               {"cause", each.cause},
                               {"from_s", rounded(each.begin_s)},
                               {"to_s", rounded(each.end_s)}};
    if (each.mu_error_percent) {
      row["mu_error_percent"] = rounded(*each.mu_error_percent);
      row["covered"] = each.covered;
    }
    out["experiments"].push_back(row);
  }
  out["reactions"] = nlohmann::ordered_json::array();
  for (const Reaction& each : v.reactions) {
    nlohmann::ordered_json row{{"to", each.what},
                               {"decided_s", rounded(each.decided_s - each.since_s)}};
    if (each.wire_s >= 0.0) row["wire_s"] = rounded(each.wire_s - each.since_s);
    out["reactions"].push_back(row);
  }
  return out.dump();
}

}  // namespace beltgrip::test
