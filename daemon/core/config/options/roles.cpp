#include "daemon/core/config/options/config.h"
#include "daemon/core/config/options/config_options.h"

namespace beltgrip::daemon {

namespace {

using can::Dimension;
using estimator::Sensor;

struct RoleRow {
  Role role;
  std::string_view name;
  Dimension dimension;
  std::optional<Sensor> sensor;  // whose accuracy a result rests on
  std::string_view help;
};
constexpr std::array<RoleRow, kRoleCount> kRoles{{
    {Role::kPrimarySpeed, "primary_speed", Dimension::kAngularSpeed, Sensor::kSpeed,
     "Speed of the primary pulley. Required."},
    {Role::kSecondarySpeed, "secondary_speed", Dimension::kAngularSpeed, Sensor::kSpeed,
     "Speed of the secondary pulley. Required."},
    {Role::kSecondaryPressure, "secondary_pressure", Dimension::kPressure, Sensor::kPressure,
     "Pressure in the secondary clamping cylinder. Required."},
    {Role::kEngineTorque, "engine_torque", Dimension::kTorque, Sensor::kEngineTorque,
     "Torque of the engine at the primary shaft, + = drive. Required unless primary_torque is "
     "there."},
    {Role::kPrimaryTorque, "primary_torque", Dimension::kTorque, Sensor::kMeasuredTorque,
     "Torque at the primary pulley where a sensor measures it; taken instead of engine_torque."},
    {Role::kSecondaryTorque,
     "secondary_torque",
     Dimension::kTorque,
     {},
     "Torque at the secondary pulley."},
    {Role::kPrimaryPressure,
     "primary_pressure",
     Dimension::kPressure,
     {},
     "Pressure in the primary cylinder."},
    {Role::kSecondaryPressureCommand,
     "secondary_pressure_command",
     Dimension::kPressure,
     {},
     "Commanded secondary pressure."},
    {Role::kEngineSpeed, "engine_speed", Dimension::kAngularSpeed, {}, "Speed of the engine."},
    {Role::kOilTemperature,
     "oil_temperature",
     Dimension::kTemperature,
     {},
     "Temperature of the oil."},
    {Role::kVehicleSpeed, "vehicle_speed", Dimension::kSpeed, {}, "Speed of the vehicle."},
    {Role::kAcceleratorPedal,
     "accelerator_pedal",
     Dimension::kShare,
     {},
     "Position of the accelerator pedal."},
    {Role::kBrakePressed, "brake_pressed", Dimension::kNone, {}, "1 while the brake is pressed."},
    {Role::kLockupClosed,
     "lockup_closed",
     Dimension::kNone,
     {},
     "1 while the lock-up clutch is closed."},
    {Role::kExperimentPermitted,
     "experiment_permitted",
     Dimension::kNone,
     {},
     "1 while the transmission controller permits an experiment."},
    {Role::kExperimentActive,
     "experiment_active",
     Dimension::kNone,
     {},
     "1 while an experiment runs. Required with trigger = \"signal\"."},
}};

constexpr bool in_order() {
  for (std::size_t i = 0; i < kRoleCount; ++i) {
    if (static_cast<std::size_t>(kRoles[i].role) != i) return false;
  }
  return true;
}
static_assert(in_order());

const RoleRow& row_of(Role role) { return kRoles[static_cast<std::size_t>(role)]; }

}  // namespace

std::string_view role_name(Role role) { return row_of(role).name; }
can::Dimension role_dimension(Role role) { return row_of(role).dimension; }
std::string_view role_help(Role role) { return row_of(role).help; }
std::optional<estimator::Sensor> sensor_of(Role role) { return row_of(role).sensor; }

}  // namespace beltgrip::daemon
