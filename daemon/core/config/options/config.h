// The configuration as an immutable value, bound to its DBC files: every role knows its message,
// codec and unit. Loading reads files and may allocate: start-up and tools only.
#pragma once

#include <array>
#include <bitset>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "can_dbc/dbc/model.h"
#include "can_dbc/dbc/signal_codec.h"
#include "can_dbc/text/unit_text.h"
#include "can_dbc/uds/uds.h"
#include "daemon/core/base/own_identifiers.h"
#include "estimator/physics/assumed_constants.h"
#include "estimator/physics/learned_term.h"
#include "estimator/physics/machine_effects.h"
#include "estimator/physics/parameters.h"

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

// Where a signal lives that no frame broadcasts: in the answer of one ECU to ReadDataByIdentifier
// (0x22), or to ReadDataByLocalIdentifier (0x21), whose identifiers have one byte.
struct UdsSource {
  can::CanId request, response;
  std::uint8_t service = can::kReadByIdentifier;
  std::uint16_t identifier = 0;
  // Of data behind the identifier; known: it may be asked for together with others. 0: not known.
  std::uint16_t bytes = 0;
  can::SignalDef signal{};  // in the data after the identifier; start bit as in a DBC
};

// One role bound to one signal of one message, or of one diagnostic answer (then codec is that of
// the data after the identifier, and there is neither message nor multiplexer nor range): SI value
// = factor * (scale * signal + offset) + shift.
struct RoleBinding {
  Role role{};
  std::uint8_t bus = 0;  // 1: the further one
  std::optional<UdsSource> uds;
  std::string message_name;
  std::string signal_name;
  can::CanId id;
  // J1939 and NMEA 2000: the source addresses whose frames of this parameter group are this
  // message, all but those that the DBC files give to another. None: the full identifier counts.
  std::bitset<256> sources;
  std::uint32_t message_length = 0;  // bytes, as in the DBC
  bool message_fd = false;
  can::SignalCodec codec;
  std::vector<MuxCondition> mux;        // all must hold (a selector may be multiplexed itself)
  double minimum = 0.0, maximum = 0.0;  // physical range of the DBC; equal: not given
  std::vector<std::int64_t> true_when;  // a flag that is 1 at these raw values; empty: 0 or 1
  double factor = 1.0, shift = 0.0;     // physical value of the signal -> SI
  // As the user said it: role = scale * signal + offset, in unit (empty: a flag).
  std::string unit;
  double scale = 1.0, offset = 0.0;
  // From the configuration, or the DBC's cycle time unless the signal is multiplexed.
  std::optional<double> period_ms;
  double delay_ms =
      0.0;  // a frame tells what was so long before its stamp; < 0: relative to others
};

// How the frames of a message are protected.
struct CounterProtection {
  can::SignalCodec codec;
  std::uint32_t maximum = 15;  // then comes 0
};
// CRC-8 as in AUTOSAR E2E profile 1 (can_dbc/frame/e2e.h), over data id and all other bytes.
struct CrcProtection {
  std::size_t byte = 0;
  std::uint16_t data_id = 0;
};
struct MessageProtection {
  can::CanId id;
  std::optional<CounterProtection> counter;
  std::optional<CrcProtection> crc;
};

enum class Trigger : std::uint8_t { kCoastDown, kSteady, kSignal, kAlways };
enum class Diagnostics : std::uint8_t { kListen, kPoll };

// What an experiment in the vehicle needs before it begins and keeps to while it lasts. SI, degrees
// Celsius.
struct ExperimentSettings {
  double torque_min_Nm = 10.0;  // magnitude of the torque on the belt
  double torque_max_Nm = 100.0;
  double primary_speed_min_rad_s = 105.0;
  double oil_temperature_min_degC = 40.0;
  double friction_expected = 0.11;  // mu_max that must be in reach
  // The steepest fall of mu behind the peak that the first request of a belt must survive.
  double fall_max_per_percent = 8e-3;
  double secondary_pressure_floor_Pa = 100e3;
  double actuator_dead_time_s = 0.06;
  double actuator_lag_s = 0.15;
  double cooldown_s = 60.0;
  double cooldown_m = 1000.0;
};

struct FurtherBus {
  std::string name;  // [bus.NAME]
  std::string interface;
  std::vector<std::string> dbc;  // of its messages; empty: those of [bus]
};

// A table of signals that is read instead of frames, by tools alone: its columns as messages.
struct TableSource {
  can::Database columns;
  double rate_Hz = 0.0;  // rows a second where no column tells the time
};

// Of a role that is read out of a table: the table has that column.
inline bool has_column(const RoleBinding& binding) { return !binding.message_name.empty(); }

// Of a sensor that the configuration says nothing of, while it does of others.
struct AssumedAccuracy {
  Role role = Role::kPrimarySpeed;
  std::string key;     // "sensors.secondary_pressure.bias_Pa"
  double value = 0.0;  // in its unit
};

struct Config {
  std::string interface = "vcan0";
  std::vector<std::string> dbc;
  std::optional<FurtherBus> further_bus;
  Diagnostics diagnostics = Diagnostics::kListen;
  FrameIdentifiers identifiers;
  std::vector<RoleBinding> roles;  // sorted by role, each at most once
  std::vector<MessageProtection> protections;
  estimator::VariatorParameters variator;
  estimator::SensorAccuracies sensors;
  // What nobody stated and a result rests on: constants of the variator, in `variator` at their
  // defaults; and every such key by its name, "variator.KEY" or "sensors.ROLE.KEY".
  estimator::ConstantSet assumed_constants;
  std::vector<std::string> assumed;
  // Some of it decides what mu_max is: a constant, or the accuracy of torque or pressure.
  bool friction_is_assumed = false;
  estimator::EstimatorSettings estimator;
  std::string model;                                   // path as in the file; empty: none
  std::optional<estimator::MachineEffects> corrected;  // what the model says to take out of inputs
  std::vector<estimator::LearnedTerm> learned;         // the same, what has no name
  Trigger trigger = Trigger::kCoastDown;
  Control control = Control::kObserve;
  ExperimentSettings experiment;
  std::vector<std::string> files;  // that were read for it: itself, DBC files, model
  std::shared_ptr<const TableSource> table;
  std::string state_dir;  // path as in the file; empty: $STATE_DIRECTORY, or nothing is kept
};

// Every key with default, unit, range and help: the commented default file.
std::string default_config_text();

}  // namespace beltgrip::daemon
