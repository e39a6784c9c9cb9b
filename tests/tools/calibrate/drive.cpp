#include "tests/tools/calibrate/drive.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <deque>
#include <random>
#include <vector>

namespace beltgrip::test {

namespace {

using daemon::Role;

constexpr double kStep_s = 1e-3;
constexpr double kKeyOn_s = 6.0;
constexpr double kGap_s = 4.0;  // the log has a hole while the car moves off
constexpr double kArea_m2 = 0.0113, kSpring_N = 500.0, kCosWedge = 0.98162718;

double stepped(double value, double step) {
  return step > 0.0 ? step * std::round(value / step) : value;
}

// What was `delay` ago, of a value that comes every kStep_s.
class Delayed {
 public:
  explicit Delayed(double delay_s)
      : steps_(static_cast<std::size_t>(std::lround(delay_s / kStep_s))) {}
  double step(double value) {
    values_.push_back(value);
    if (values_.size() > steps_ + 1) values_.pop_front();
    return values_.front();
  }

 private:
  std::size_t steps_;
  std::deque<double> values_;
};

double primary_radius_m(double ratio) {
  const double share = std::log(ratio / 0.405) / std::log(2.25 / 0.405);
  return 0.0324 + share * (0.0784 - 0.0324);
}

}  // namespace

diagnose::SignalTable drive(const DriveTruth& truth, const DriveKind& kind, std::uint64_t seed) {
  std::mt19937_64 random(seed);
  std::normal_distribution<double> normal;
  std::uniform_real_distribution<double> uniform;
  diagnose::SignalTable table;
  table.name = "drive";
  const auto put = [&](Role role, double t_s, double value) {
    table[role].t_s.push_back(t_s);
    table[role].value.push_back(value);
  };
  const auto put_pressure = [&](double t_s, double pressure_Pa) {
    const double read = pressure_Pa + truth.pressure_zero_Pa + 300.0 * normal(random);
    put(Role::kSecondaryPressure, t_s,
        stepped(kind.pressure_clipped ? std::max(read, 0.0) : read, kind.pressure_step_Pa));
  };
  double begin_s = 0.0;
  if (kind.key_on) {
    for (double t = 0.0; t < kKeyOn_s; t += 0.01) {
      for (const Role role :
           {Role::kPrimarySpeed, Role::kSecondarySpeed, Role::kEngineSpeed, Role::kEngineTorque}) {
        put(role, t, 0.0);
      }
      put_pressure(t + 0.003, 0.0);
    }
    begin_s = kKeyOn_s + kGap_s;
  }

  double omega_s = 50.0, ratio = truth.ratio_low, torque = 0.0, filtered = 0.0;
  const double highest = kind.reaches_overdrive ? 330.0 : 140.0;
  double target = highest, next_lift_s = 3.0, lift_until_s = 0.0, wander = 0.0, clamp_factor = 1.0,
         last = 0.0;
  Delayed reported(truth.torque_delay_s), later(truth.secondary_delay_s);
  const int steps = static_cast<int>(kind.duration_s / kStep_s);
  for (int i = 0; i < steps; ++i) {
    const double t = i * kStep_s;
    // Driver: to a speed and back, with lifts of the foot.
    if (omega_s > target - 3.0 && target > 60.0) target = 48.0;
    if (omega_s < 51.0 && target < 60.0) target = highest;
    const bool up = target > 60.0;
    double wanted = up ? 95.0 : -32.0;
    if (kind.lifts && t > next_lift_s) {
      lift_until_s = t + 1.2 + uniform(random);
      next_lift_s = lift_until_s + 2.5 + 2.0 * uniform(random);
    }
    if (up && t < lift_until_s) wanted = -32.0;
    if (!up && t < lift_until_s) wanted = 20.0;
    torque += std::clamp(wanted - torque, -kind.torque_rate_Nm_s * kStep_s,
                         kind.torque_rate_Nm_s * kStep_s);
    filtered += (torque - filtered) * kStep_s / kind.engine_lag_s;
    const double brake_Nm = up ? 0.0 : 45.0 + 10.0 * std::sin(0.3 * t);

    // Ratio: fast engine when accelerating from low speed, slow engine otherwise.
    const double engine_rad_s = up && omega_s < 110.0 ? 260.0 : 115.0;
    wander += (-0.2 * wander * kStep_s + 0.02 * std::sqrt(kStep_s) * normal(random));
    double aim = std::clamp(omega_s / engine_rad_s, truth.ratio_low, truth.ratio_overdrive);
    if (!kind.rests_at_stops) {
      aim = std::clamp(aim, 1.03 * truth.ratio_low, 0.97 * truth.ratio_overdrive) *
            std::exp(std::clamp(wander, -0.03, 0.03));
    }
    const double change = std::clamp(std::log(aim / ratio), -0.5 * kStep_s, 0.5 * kStep_s);
    ratio *= std::exp(change);

    clamp_factor +=
        (1.0 - clamp_factor) * kStep_s / 5.0 + 0.1 * std::sqrt(kStep_s) * normal(random);
    const double radius = primary_radius_m(ratio);
    const double load_force_N = std::clamp(clamp_factor, 0.8, 1.6) * (std::abs(filtered) + 45.0) *
                                kCosWedge / (2.0 * radius * 0.09);
    const double force_N = kind.one_force ? 7e3 + 1e3 * std::sin(0.1 * t) : load_force_N;
    const double traction = filtered * kCosWedge / (2.0 * radius * force_N);
    const double grown =
        truth.mu_max > 0.0
            ? truth.mu_max * std::atanh(std::clamp(traction / truth.mu_max, -0.99, 0.99))
            : traction;
    const double slipping =
        (1.0 - truth.deformation_per_kN * force_N * 1e-3) * (1.0 - truth.creep * grown);
    const double measured = ratio * slipping;  // omega_s / omega_p

    // T = J omega_p' + r (M omega_s' + load), omega_p = omega_s / measured
    const double measured_rate = i == 0 ? 0.0 : (measured - last) / kStep_s;
    last = measured;
    const double load_Nm = 8.0 + 1.1e-4 * omega_s * omega_s + brake_Nm;
    const double rate =
        (filtered + truth.inertia_kg_m2 * omega_s * measured_rate / (measured * measured) -
         ratio * load_Nm) /
        (truth.inertia_kg_m2 / measured + ratio * truth.vehicle_kg_m2);
    omega_s = std::max(omega_s + rate * kStep_s, 30.0);

    const double said = reported.step(filtered);
    const double secondary = later.step(omega_s);
    const double at = begin_s + t;
    if (i % 10 == 0) {
      const double omega_p = omega_s / measured;
      put(Role::kPrimarySpeed, at,
          stepped(omega_p + kind.speed_noise_rad_s * normal(random), kind.speed_step_rad_s));
      put(Role::kSecondarySpeed, at,
          stepped(secondary + kind.speed_noise_rad_s * normal(random), kind.speed_step_rad_s));
      put(Role::kEngineSpeed, at, stepped(omega_p, kind.speed_step_rad_s));
    }
    if (i % 10 == 4)
      put(Role::kEngineTorque, at, stepped(said + 0.3 * normal(random), kind.torque_step_Nm));
    if (i % 20 == 7) put_pressure(at, (force_N - kSpring_N) / kArea_m2);
  }
  return table;
}

const char* const kDriveDbc = R"(VERSION ""
BU_: V
BO_ 256 Speeds: 8 V
 SG_ Primary : 0|16@1+ (0.02,0) [0|1300] "rad/s" V
 SG_ Secondary : 16|16@1+ (0.02,0) [0|1300] "rad/s" V
 SG_ Engine : 32|16@1+ (0.02,0) [0|1300] "rad/s" V
BO_ 257 Pressure: 4 V
 SG_ Secondary : 0|32@1- (0.01,0) [-500000|5000000] "Pa" V
BO_ 258 Torque: 4 V
 SG_ Engine : 0|16@1- (0.1,0) [-3000|3000] "Nm" V
BA_DEF_ BO_ "GenMsgCycleTime" INT 0 65535;
BA_DEF_DEF_ "GenMsgCycleTime" 0;
BA_ "GenMsgCycleTime" BO_ 256 10;
BA_ "GenMsgCycleTime" BO_ 257 20;
BA_ "GenMsgCycleTime" BO_ 258 10;
)";

const char* const kDriveToml = R"([bus]
dbc = ["drive.dbc"]
[signals]
primary_speed = "Speeds.Primary"
secondary_speed = "Speeds.Secondary"
engine_speed = "Speeds.Engine"
secondary_pressure = "Pressure.Secondary"
engine_torque = "Torque.Engine"
[experiment]
trigger = "always"
)";

std::string drive_log(const diagnose::SignalTable& table) {
  struct Line {
    double t_s;
    std::string frame;
  };
  std::vector<Line> all;
  const auto hex = [](std::uint64_t value, int bytes) {
    std::string out;
    for (int i = 0; i < bytes; ++i) {
      std::array<char, 3> pair;
      std::snprintf(pair.data(), pair.size(), "%02X",
                    static_cast<unsigned>(value >> (8 * i) & 0xFF));
      out += pair.data();
    }
    return out;
  };
  const auto raw = [](double value, double scale) {
    return static_cast<std::uint64_t>(std::llround(value / scale));
  };
  const auto& p = table[Role::kPrimarySpeed];
  for (std::size_t i = 0; i < p.t_s.size(); ++i) {
    all.push_back({p.t_s[i], "100#" + hex(raw(p.value[i], 0.02), 2) +
                                 hex(raw(table[Role::kSecondarySpeed].value[i], 0.02), 2) +
                                 hex(raw(table[Role::kEngineSpeed].value[i], 0.02), 2) + "0000"});
  }
  const auto& pressure = table[Role::kSecondaryPressure];
  for (std::size_t i = 0; i < pressure.t_s.size(); ++i) {
    all.push_back({pressure.t_s[i], "101#" + hex(raw(pressure.value[i], 0.01), 4)});
  }
  const auto& torque = table[Role::kEngineTorque];
  for (std::size_t i = 0; i < torque.t_s.size(); ++i) {
    all.push_back({torque.t_s[i], "102#" + hex(raw(torque.value[i], 0.1), 2) + "0000"});
  }
  std::stable_sort(all.begin(), all.end(),
                   [](const Line& a, const Line& b) { return a.t_s < b.t_s; });
  std::string out;
  for (const Line& each : all) {
    std::array<char, 64> stamp;
    std::snprintf(stamp.data(), stamp.size(), "(%.6f) can0 ", 1.7e9 + each.t_s);
    out += stamp.data() + each.frame + '\n';
  }
  return out;
}

}  // namespace beltgrip::test
