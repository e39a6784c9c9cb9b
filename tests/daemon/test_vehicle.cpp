#include "tests/daemon/test_vehicle.h"
#include "daemon/core/config/load/load_config.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <numbers>
#include <random>

namespace beltgrip::test {

const char* const kVehicleDbc = R"(VERSION ""

NS_ :

BS_:

BU_: TCU ECU

BO_ 256 Speeds: 8 TCU
 SG_ PrimarySpeed : 0|16@1+ (0.125,0) [0|8000] "rpm" ECU
 SG_ SecondarySpeed : 16|16@1+ (0.125,0) [0|8000] "rpm" ECU

BO_ 257 Pressure: 4 TCU
 SG_ SecondaryPressure : 7|16@0+ (0.001,0) [0|60] "bar" ECU

BO_ 2452903544 Torque: 8 ECU
 SG_ EngineTorque : 8|16@1- (0.1,0) [-500|500] "Nm" TCU

BO_ 259 Flags: 2 TCU
 SG_ ExperimentActive : 0|2@1+ (1,0) [0|3] "" ECU
 SG_ Permitted : 2|1@1+ (1,0) [0|1] "" ECU

BA_DEF_ BO_ "GenMsgCycleTime" INT 0 65535;
BA_DEF_DEF_ "GenMsgCycleTime" 0;
BA_ "GenMsgCycleTime" BO_ 256 10;
BA_ "GenMsgCycleTime" BO_ 257 20;
BA_ "GenMsgCycleTime" BO_ 2452903544 10;
BA_ "GenMsgCycleTime" BO_ 259 50;
)";

const char* const kVehicleToml = R"([bus]
interface = "inproc:test"
dbc = ["vehicle.dbc"]
[signals]
primary_speed = "Speeds.PrimarySpeed"
secondary_speed = "Speeds.SecondarySpeed"
secondary_pressure = "Pressure.SecondaryPressure"
engine_torque = "0x12345678x.EngineTorque"
experiment_active = "Flags.ExperimentActive"
[experiment]
trigger = "always"
)";

namespace {

constexpr double kRpm = std::numbers::pi / 30.0;
constexpr double kRatio = 2.25;
constexpr double kPrimary_rad_s = 105.0;
const double kCos = std::cos(11.0 * std::numbers::pi / 180.0);

can::CanFrame frame_of(std::uint32_t id, bool extended, std::uint8_t length) {
  can::CanFrame frame;
  frame.id = {id, extended};
  frame.length = length;
  return frame;
}

void put16(can::CanFrame& frame, std::size_t low, std::size_t high, double raw) {
  const auto bits = static_cast<std::uint16_t>(static_cast<std::int32_t>(std::lround(raw)));
  frame.data[low] = static_cast<std::uint8_t>(bits & 0xFFU);
  frame.data[high] = static_cast<std::uint8_t>(bits >> 8);
}

}  // namespace

TemporaryDirectory::TemporaryDirectory() {
  std::string pattern = (std::filesystem::temp_directory_path() / "beltgrip.XXXXXX").string();
  if (mkdtemp(pattern.data()) == nullptr) std::abort();
  path_ = pattern;
}
TemporaryDirectory::~TemporaryDirectory() {
  std::error_code error;
  std::filesystem::remove_all(path_, error);
}
std::string TemporaryDirectory::write(const std::string& name, const std::string& content) const {
  const std::string path = path_ + "/" + name;
  std::ofstream(path, std::ios::binary) << content;
  return path;
}

std::string signalled_toml() {
  std::string toml = kVehicleToml;
  return toml.replace(toml.find("\"always\""), 8, "\"signal\"");
}

std::string two_bus_toml() {
  std::string toml = signalled_toml();
  const std::string role = "\"Pressure.SecondaryPressure\"";
  toml.replace(toml.find(role), role.size(),
               "{ uds = { request = 0x7E1, response = 0x7E9, did = 0x1101, start = 7, length = "
               "16, scale = 0.001 }, unit = \"bar\", period_ms = 20, bus = \"diag\" }");
  toml.replace(toml.find("inproc:test"), 11, "can0");
  return toml.insert(toml.find("[signals]"),
                     "diagnostics = \"poll\"\n[bus.diag]\ninterface = \"can1\"\n");
}

std::string stated(std::string toml) {
  const auto state = [&](const std::string& section, const std::string& key,
                         const std::string& value) {
    const std::string header = "[" + section + "]\n";
    if (toml.find(header) == std::string::npos) toml += header;
    const std::size_t begin = toml.find(header) + header.size();
    const std::size_t end = std::min(toml.find("\n[", begin), toml.size());
    const std::string body = "\n" + toml.substr(begin, end - begin);
    if (body.find("\n" + key + " =") == std::string::npos) {
      toml.insert(begin, key + " = " + value + "\n");
    }
  };
  state("sensors", "primary_speed", "{ bias_rad_s = 0, gain = 0 }");
  state("sensors", "secondary_speed", "{ bias_rad_s = 0, gain = 0 }");
  state("sensors", "secondary_pressure", "{ bias_Pa = 0, gain = 0 }");
  state("sensors", "engine_torque", "{ bias_Nm = 0, gain = 0 }");
  state("variator", "primary_radius_overdrive_m", "0.0784");
  state("variator", "primary_radius_low_m", "0.0324");
  state("variator", "secondary_piston_area_m2", "0.0113");
  state("variator", "secondary_spring_force_N", "500");
  state("variator", "secondary_centrifugal_N_s2", "0");
  state("variator", "primary_inertia_kg_m2", "0");
  return toml;
}

daemon::Config vehicle_config(const std::string& toml, const std::string& dbc) {
  TemporaryDirectory directory;
  directory.write("vehicle.dbc", dbc);
  const daemon::ConfigResult result =
      daemon::load_config(directory.write("beltgripd.toml", stated(toml)));
  for (const auto& error : result.errors) ADD_FAILURE() << error.text;
  for (const auto& warning : result.warnings) ADD_FAILURE() << warning;
  return result.config.value();
}

can::CanFrame speeds_frame(double primary_rad_s, double secondary_rad_s) {
  can::CanFrame frame = frame_of(0x100, false, 8);
  put16(frame, 0, 1, primary_rad_s / kRpm / 0.125);
  put16(frame, 2, 3, secondary_rad_s / kRpm / 0.125);
  return frame;
}
can::CanFrame pressure_frame(double pressure_Pa) {
  can::CanFrame frame = frame_of(0x101, false, 4);
  put16(frame, 1, 0, pressure_Pa / 1e5 / 0.001);
  return frame;
}
can::CanFrame torque_frame(double torque_Nm) {
  can::CanFrame frame = frame_of(0x12345678, true, 8);
  put16(frame, 1, 2, torque_Nm / 0.1);
  return frame;
}
can::CanFrame flags_frame(bool experiment_active) {
  can::CanFrame frame = frame_of(0x103, false, 2);
  frame.data[0] = experiment_active ? 1 : 0;
  return frame;
}

std::vector<can::StampedFrame> drive_frames(const Drive& drive) {
  constexpr double kStep_s = 0.001;
  constexpr double kTorque_Nm = 50.0;
  std::mt19937_64 random(drive.seed);
  std::normal_distribution<double> normal;
  const auto noisy = [&](double value, double deviation) {
    return drive.noise ? value + deviation * normal(random) : value;
  };
  std::vector<can::StampedFrame> frames;
  const auto add = [&](std::int64_t t, const can::CanFrame& frame) {
    frames.push_back({t, frame});
  };
  double force_N = drive.start_force_N;
  double slip_share = 0.0;
  const double sign = drive.overrun ? -1.0 : 1.0;
  const auto steps = static_cast<int>(drive.duration_s / kStep_s);
  for (int step = 0; step < steps; ++step) {
    // Without pressure, spring and turning oil still clamp.
    const double omega_s = kPrimary_rad_s * kRatio * (1.0 - sign * slip_share);
    const double oil_N = drive.centrifugal_N_s2 * omega_s * omega_s;
    const double least_N = std::max(1000.0, drive.spring_force_N + oil_N);
    force_N = std::max(force_N - drive.ramp_N_per_s * kStep_s, least_N);
    const double radius_m = drive.primary_radius_m;
    const double needed = kTorque_Nm * kCos / (2.0 * radius_m * force_N);
    // Below the peak the belt carries the torque with the slip that this takes; beyond it slips
    // faster and faster, and the friction falls a little.
    double mu = needed;
    if (needed < drive.mu_max && slip_share <= 0.02) {
      slip_share = 0.02 * std::atanh(needed / drive.mu_max * std::tanh(2.2)) / 2.2;
    } else {
      slip_share = std::min(slip_share + 0.05 * kStep_s, 0.15);
      mu = drive.mu_max - 0.15 * std::max(slip_share - 0.02, 0.0);
    }
    const double torque = mu * 2.0 * radius_m * force_N / kCos;
    const std::int64_t t = drive.start_ns + std::int64_t{step} * 1'000'000;
    if (step % 10 == 0) {
      const double ratio = kRatio * (1.0 - sign * slip_share);
      add(t, speeds_frame(noisy(kPrimary_rad_s, 0.02), noisy(kPrimary_rad_s * ratio, 0.04)));
    }
    if (step % 10 == 3)
      add(t + 200'000, torque_frame(noisy(
                           sign * torque * (1.0 + drive.torque_gain) + drive.torque_bias_Nm, 0.1)));
    if (step % 20 == 5) {
      add(t + 400'000, pressure_frame(noisy((1.0 + drive.pressure_gain) *
                                                    (force_N - drive.spring_force_N - oil_N) /
                                                    drive.piston_area_m2 +
                                                drive.pressure_bias_Pa,
                                            500.0)));
    }
    if (step % 50 == 7) {
      const auto now = static_cast<std::uint32_t>(step);
      add(t, flags_frame(now >= drive.active_from_ms && now < drive.active_to_ms));
    }
  }
  std::stable_sort(frames.begin(), frames.end(),
                   [](const auto& a, const auto& b) { return a.t_ns < b.t_ns; });
  return frames;
}

std::vector<can::StampedFrame> two_bus_frames(const Drive& drive) {
  std::vector<can::StampedFrame> all;
  for (const can::StampedFrame& each : drive_frames(drive)) {
    if (each.frame.id != can::CanId{0x101, false}) {
      all.push_back(each);
      continue;
    }
    can::StampedFrame answer{each.t_ns, frame_of(0x7E9, false, 8), 1};
    const std::array<std::uint8_t, 8> data{
        0x05, 0x62, 0x11, 0x01, each.frame.data[0], each.frame.data[1], 0xCC, 0xCC};
    std::copy(data.begin(), data.end(), answer.frame.data.begin());
    can::StampedFrame stranger = answer;
    stranger.bus = 0;
    stranger.frame.data[4] = 0x7F;
    all.insert(all.end(), {stranger, answer, {each.t_ns, speeds_frame(0.0, 0.0), 1}});
  }
  return all;
}

}  // namespace beltgrip::test
