#include "tests/loop/guards/harm.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <functional>

#include "daemon/core/loop/loop.h"
#include "tests/loop/closed_loop.h"
#include "tools/sim/scenario_reader.h"
#include "tools/sim/vehicle_port.h"
#include "tools/sim/vehicle_scenario.h"

namespace beltgrip::test {

namespace {

constexpr std::uint32_t kClampIdentifier = 0x6A2;

std::string text(const char* what, double found, double most) {
  return std::string(what) + " " + std::to_string(found) + ", promised " + std::to_string(most);
}

// Calls judge for each active frame that follows an active one.
std::string in_a_request(
    const GuardedRun& run,
    const std::function<std::string(const ClampFrame& before, const ClampFrame& now)>& judge) {
  for (std::size_t i = 1; i < run.frames.size(); ++i) {
    const ClampFrame &before = run.frames[i - 1], &now = run.frames[i];
    if (before.force_N <= 0.0 || now.force_N <= 0.0) continue;
    if (std::string harm = judge(before, now); !harm.empty()) return harm;
  }
  return {};
}

// And for each that begins one, with the last active frame before it (none: t_s < 0).
std::string at_a_begin(
    const GuardedRun& run,
    const std::function<std::string(const ClampFrame& last, const ClampFrame& now)>& judge) {
  ClampFrame last;
  last.t_s = -1.0;
  bool active = false;
  for (const ClampFrame& now : run.frames) {
    if (now.force_N > 0.0 && !active) {
      if (std::string harm = judge(last, now); !harm.empty()) return harm;
    }
    active = now.force_N > 0.0;
    if (active) last = now;
  }
  return {};
}

// The contract: "The force asked for starts at the present force".
std::string begins_low(const GuardedRun& run) {
  constexpr double kShare = 0.7;  // of it: a belt held with the usual reserve slips below
  return at_a_begin(run, [](const ClampFrame&, const ClampFrame& now) {
    const double most = kShare * now.acting_N;
    return now.force_N < most ? text("a request begins at", now.force_N, most) : std::string();
  });
}

// "falls by at most ramp_rate_max_N_per_s", two frames with one lost between them.
std::string falls_fast(const GuardedRun& run) {
  constexpr double kRate_N_per_s = 600.0, kRounding_N = 2.0;
  return in_a_request(run, [](const ClampFrame& before, const ClampFrame& now) {
    const double fall_N = before.force_N - now.force_N;
    const double most = 1.7 * kRate_N_per_s * (now.t_s - before.t_s) + kRounding_N;
    return fall_N > most ? text("falls between two frames by", fall_N, most) : std::string();
  });
}

std::string rises(const GuardedRun& run) {
  return in_a_request(run, [](const ClampFrame& before, const ClampFrame& now) {
    return now.force_N > before.force_N ? text("rises to", now.force_N, before.force_N)
                                        : std::string();
  });
}

// "no request stands for longer than 15 s"; the gate adds ten frames.
std::string stands_long(const GuardedRun& run) {
  constexpr double kLongest_s = 15.2;
  double begun_s = -1.0;
  for (const ClampFrame& now : run.frames) {
    if (now.force_N <= 0.0) {
      begun_s = -1.0;
    } else if (begun_s < 0.0) {
      begun_s = now.t_s;
    } else if (now.t_s - begun_s > kLongest_s) {
      return text("a request stands for", now.t_s - begun_s, kLongest_s);
    }
  }
  return {};
}

std::string below_floor(const GuardedRun& run) {
  for (const ClampFrame& now : run.frames) {
    if (now.force_N > 0.0 && now.force_N < run.floor_N - 1.0) {
      return text("a request for", now.force_N, run.floor_N);
    }
  }
  return {};
}

// The floor moves with the speed of the secondary shaft, which the gate does not know.
std::string below_moving_floor(const GuardedRun& run) {
  constexpr double kRounding_N = 15.0;  // and the noise of that speed
  for (const ClampFrame& now : run.frames) {
    if (now.force_N > 0.0 && now.force_N < now.floor_N - kRounding_N) {
      return text("a request for", now.force_N, now.floor_N);
    }
  }
  return {};
}

// G1, while the request stands: how far the belt goes from there, the actuator says.
std::string slips(const GuardedRun& run) {
  constexpr double kMost = 0.10;
  double most = 0.0;
  for (const ClampFrame& now : run.frames) {
    if (now.force_N > 0.0) most = std::max(most, now.slip_share);
  }
  return most > kMost ? text("a request stands with slip of", most, kMost) : std::string();
}
std::string slips_fast(const GuardedRun& run) {
  constexpr double kMost_m_s = 0.8;
  double most_m_s = 0.0;
  for (const ClampFrame& now : run.frames) {
    if (now.force_N > 0.0) most_m_s = std::max(most_m_s, now.slip_speed_m_s);
  }
  return most_m_s > kMost_m_s ? text("a request stands with slip at", most_m_s, kMost_m_s)
                              : std::string();
}

std::string no_pause(const GuardedRun& run) {
  return at_a_begin(run, [&run](const ClampFrame& last, const ClampFrame& now) {
    const double pause_s = now.t_s - last.t_s;
    return last.t_s >= 0.0 && pause_s < run.cooldown_s
               ? text("a request begins after", pause_s, run.cooldown_s)
               : std::string();
  });
}

// "after enough inactive frames": a controller that has seen none refuses the request.
std::string no_inactive_frames(const GuardedRun& run) {
  int inactive = 5;
  for (const ClampFrame& now : run.frames) {
    if (now.force_N <= 0.0) {
      ++inactive;
    } else {
      if (inactive > 0 && inactive < 5) return "a request after " + std::to_string(inactive);
      inactive = 0;
    }
  }
  return {};
}

// An input is stale after 50 ms at the most here; two frames for the way out.
std::string believes_silence(const GuardedRun& run) {
  constexpr double kMost_s = 0.1;
  double last_s = 0.0;
  for (const ClampFrame& now : run.frames) {
    if (now.force_N > 0.0) last_s = std::max(last_s, now.t_s - run.silent_from_s);
  }
  return last_s > kMost_s ? text("a request stands after silence of", last_s, kMost_s)
                          : std::string();
}

}  // namespace

const std::vector<GuardCase>& guard_cases() {
  static const std::vector<GuardCase> cases{
      {"BeginsTooLow", {.start_share = 0.5}, {}, begins_low},
      {"FallsTooFast", {.fall_N_per_s = 3000.0}, {}, falls_fast},
      {"Rises", {.fall_N_per_s = -200.0}, {}, rises},
      // Not at its first force, where less slip is allowed than a drive of 15 s brings along.
      {"StandsTooLong", {.fall_N_per_s = 50.0}, {}, stands_long},
      {"FallsBelowTheFloor", {.fall_N_per_s = 590.0}, {"belt.mu_max=0.5"}, below_floor},
      {"FallsBelowTheMovingFloor",
       {.fall_N_per_s = 590.0},
       {"belt.mu_max=0.5"},
       below_moving_floor,
       Layer::kMonitor},
      {"BeginsAgainAtOnce",
       {.fall_N_per_s = 0.0, .stands_s = 1.0, .gap_s = 0.02},
       {},
       no_inactive_frames},
      {"BeginsAgainTooSoon",
       {.fall_N_per_s = 0.0, .stands_s = 1.0, .gap_s = 1.0},
       {},
       no_pause,
       Layer::kMonitor},
      {"SecondWithTheMemoryOfTheFirst",
       {.fall_N_per_s = 590.0, .stands_s = 5.0, .gap_s = 4.0, .remembers = true},
       {"belt.mu_max=0.5"},
       begins_low},
      {"SlipsBeyondThePeak", {.fall_N_per_s = 590.0}, {}, slips, Layer::kMonitor},
      // Its shafts turn so fast that slip speed comes before slip.
      {"SlipsFast",
       {.fall_N_per_s = 590.0},
       {"vehicle.final_drive=6.6"},
       slips_fast,
       Layer::kMonitor},
      {"BelievesSilence", {.fall_N_per_s = 0.0}, {}, believes_silence, Layer::kMonitor, 18.0},
  };
  return cases;
}

GuardedRun run_guarded(const GuardCase& which) {
  std::vector<sim::ScenarioLayer> layers;
  layers.reserve(which.settings.size());
  for (const std::string& setting : which.settings) layers.push_back(sim::setting_layer(setting));
  sim::VehicleScenarioResult read = sim::shipped_vehicle_scenario("cruise-drive-torque", layers);
  if (!read.errors.empty()) throw std::runtime_error(read.errors.front());
  sim::VehicleScenario scenario = read.scenario;
  GuardedRun run;
  run.silent_from_s = which.silent_from_s;
  if (which.silent_from_s > 0.0) {
    sim::FaultStep silence;
    silence.kind = sim::FaultKind::kFrameSilent;
    silence.at_s = which.silent_from_s;
    silence.for_s = 1000.0;
    scenario.faults.push_back(silence);
  }
  const daemon::Config config = vehicle_config(scenario);
  run.floor_N =
      config.variator.secondary_spring_force_N +
      config.variator.secondary_piston_area_m2 * config.experiment.secondary_pressure_floor_Pa;
  run.cooldown_s = config.experiment.cooldown_s;
  ClampFrame truth_now;
  sim::VehiclePort::Observers observers;
  observers.on_step = [&](const sim::VehicleSimulation& vehicle) {
    const sim::VehicleTruth& truth = vehicle.truth();
    truth_now.acting_N = truth.secondary_force_N;
    truth_now.slip_share = std::abs(truth.belt.slip_share);
    truth_now.slip_speed_m_s = truth.belt.slip_speed_m_s;
    const double omega_s_rad_s = vehicle.signals().omega_s_rad_s;
    truth_now.floor_N =
        run.floor_N + config.variator.secondary_centrifugal_N_s2 * omega_s_rad_s * omega_s_rad_s;
  };
  observers.on_sent = [&](std::int64_t t_ns, const can::CanFrame& frame) {
    if (frame.id.value != kClampIdentifier) return;
    const bool active = (frame.data[2] & 1U) != 0;
    const double force_N = frame.data[3] + 256.0 * frame.data[4];
    run.frames.push_back(truth_now);
    run.frames.back().t_s = static_cast<double>(t_ns) * 1e-9;
    run.frames.back().force_N = active ? force_N : 0.0;
  };
  sabotage() = which.sabotage;
  constexpr std::uint64_t kSeed = 1;
  sim::VehiclePort port(scenario, kSeed, observers);
  daemon::Pipeline pipeline(config);
  daemon::run_loop(port, pipeline, config.estimator.sample_rate_hz,
                   estimator::StopReason::kShutdown, nullptr);
  return run;
}

}  // namespace beltgrip::test
