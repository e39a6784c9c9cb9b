// A vehicle for the daemon's tests: a DBC, a configuration, and the frames of an experiment in
// which the clamping force falls until the belt slips. Its truth is its own few lines, not the
// simulator's and not the estimator's.
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "can_dbc/frame/can_frame.h"
#include "daemon/core/config/options/config.h"

namespace beltgrip::test {

// A directory that is removed with its content.
class TemporaryDirectory {
 public:
  TemporaryDirectory();
  ~TemporaryDirectory();
  TemporaryDirectory(const TemporaryDirectory&) = delete;
  TemporaryDirectory& operator=(const TemporaryDirectory&) = delete;
  const std::string& path() const { return path_; }
  // Writes a file in it; returns its path.
  std::string write(const std::string& name, const std::string& content) const;

 private:
  std::string path_;
};

// Speeds in 0x100 (10 ms), pressure in 0x101 (20 ms), torque in 0x12345678x (10 ms), flags in 0x103
// (50 ms).
extern const char* const kVehicleDbc;
// [bus], [signals] and [experiment] for it; trigger "always".
extern const char* const kVehicleToml;

// The same with trigger "signal".
std::string signalled_toml();
// And with the pressure asked for by diagnostics on can1.
std::string two_bus_toml();

// With every key of [sensors] and [variator] that a result rests on, where it is not there: nothing
// is assumed.
std::string stated(std::string toml);

// The configuration, stated(), loaded from files as the daemon does; fails the test on any error.
daemon::Config vehicle_config(const std::string& toml = kVehicleToml,
                              const std::string& dbc = kVehicleDbc);

constexpr double kTrueMuMax = 0.105;

struct Drive {
  double duration_s = 12.0;
  double start_force_N = 4500.0;
  double ramp_N_per_s = 300.0;  // 0: no experiment, the force stays
  bool noise = true;
  bool overrun = false;  // the vehicle drives the engine
  std::int64_t start_ns = 1'000'000'000;
  std::uint32_t active_from_ms = 0, active_to_ms = 0;  // flag experiment_active
  std::uint64_t seed = 7;
  // The car itself, and what its sensors add.
  double piston_area_m2 = 0.0113, spring_force_N = 500.0, centrifugal_N_s2 = 0.0;
  double primary_radius_m = 0.0784;
  double mu_max = kTrueMuMax;
  double torque_bias_Nm = 0.0, torque_gain = 0.0, pressure_bias_Pa = 0.0, pressure_gain = 0.0;
};

// All frames of a drive, in order of time.
std::vector<can::StampedFrame> drive_frames(const Drive& drive);

// The same for two_bus_toml(): the pressure as answers on bus 1; beside them, on each bus, what
// must be taken from the other one only.
std::vector<can::StampedFrame> two_bus_frames(const Drive& drive);

can::CanFrame speeds_frame(double primary_rad_s, double secondary_rad_s);
can::CanFrame pressure_frame(double pressure_Pa);
can::CanFrame torque_frame(double torque_Nm);
can::CanFrame flags_frame(bool experiment_active);

}  // namespace beltgrip::test
