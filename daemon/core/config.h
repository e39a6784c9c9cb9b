// The configuration as an immutable value, bound to its DBC files: every role knows its message,
// codec and unit. Loading reads files and may allocate: start-up and tools only.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "can_dbc/signal_codec.h"
#include "can_dbc/unit_text.h"
#include "estimator/parameters.h"

namespace beltgrip::daemon {

enum class Role : std::uint8_t {
  kPrimarySpeed,
  kSecondarySpeed,
  kSecondaryPressure,
  kEngineTorque,
  kPrimaryTorque,
  kSecondaryTorque,
  kPrimaryPressure,
  kSecondaryPressureCommand,
  kEngineSpeed,
  kOilTemperature,
  kVehicleSpeed,
  kAcceleratorPedal,
  kBrakePressed,
  kLockupClosed,
  kExperimentPermitted,
  kExperimentActive
};
inline constexpr std::size_t kRoleCount = 16;
std::string_view role_name(Role role);  // "primary_speed", as in the configuration
can::Dimension role_dimension(Role role);

// A multiplexed signal is in the frame when the selector's raw value lies in one of the ranges.
struct MuxCondition {
  can::SignalCodec selector;
  std::vector<std::pair<std::uint64_t, std::uint64_t>> ranges;  // inclusive
};

// One role bound to one signal of one message: SI value = factor * (scale * signal + offset) +
// shift.
struct RoleBinding {
  Role role{};
  std::string message_name;
  std::string signal_name;
  can::CanId id;
  std::uint32_t message_length = 0;  // bytes, as in the DBC
  bool message_fd = false;
  can::SignalCodec codec;
  std::vector<MuxCondition> mux;        // all must hold (a selector may be multiplexed itself)
  double minimum = 0.0, maximum = 0.0;  // physical range of the DBC; equal: not given
  double factor = 1.0, shift = 0.0;     // physical value of the signal -> SI
  std::optional<double> period_ms;      // from the DBC's cycle time or the configuration
};

enum class Trigger : std::uint8_t { kCoastDown, kSteady, kSignal, kAlways };
enum class Control : std::uint8_t { kObserve, kCommand };

// What an experiment in the vehicle needs before it begins and keeps to while it lasts. SI, degrees
// Celsius.
struct ExperimentSettings {
  double torque_min_Nm = 10.0;  // magnitude of the torque on the belt
  double torque_max_Nm = 100.0;
  double primary_speed_min_rad_s = 105.0;
  double oil_temperature_min_degC = 40.0;
  double friction_expected = 0.11;  // mu_max that must be in reach
  double secondary_pressure_floor_Pa = 100e3;
  double actuator_dead_time_s = 0.06;
  double actuator_lag_s = 0.15;
  double cooldown_s = 60.0;
  double cooldown_m = 1000.0;
};

struct FrameIdentifiers {  // standard 11 bit
  std::uint32_t estimate = 0x6A0, slip = 0x6A1, clamp = 0x6A2, status = 0x6A3;
};

struct Config {
  std::string interface = "vcan0";
  std::vector<std::string> dbc;
  FrameIdentifiers identifiers;
  std::vector<RoleBinding> roles;  // sorted by role, each at most once
  estimator::VariatorParameters variator;
  estimator::SensorAccuracies sensors;
  estimator::EstimatorSettings estimator;
  std::string model;  // path as in the file; empty: none
  Trigger trigger = Trigger::kCoastDown;
  Control control = Control::kObserve;
  ExperimentSettings experiment;
};

struct ConfigError {
  int exit_code = 78;  // 66 a file is missing or unreadable, 65 a DBC without a readable message,
                       // 78 everything else
  std::string text;    // "FILE:LINE: key: found ..., expected ..."
};

struct ConfigResult {
  std::optional<Config> config;       // set when errors is empty
  std::vector<ConfigError> errors;    // all of them
  std::vector<std::string> warnings;  // problems of the DBC files and the like, one line each

  int exit_code() const { return errors.empty() ? 0 : errors.front().exit_code; }
};

// How much of it is wanted: for the daemon, for reading logs, or (without [signals] and DBC files)
// for tables whose columns are named by role.
enum class ConfigScope { kAll, kSignals, kVariator };
ConfigResult load_config(const std::string& path, ConfigScope scope = ConfigScope::kAll);
// Every key with default, unit, range and help: the commented default file.
std::string default_config_text();

}  // namespace beltgrip::daemon
