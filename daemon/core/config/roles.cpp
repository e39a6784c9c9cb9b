#include "daemon/core/config/config.h"

namespace beltgrip::daemon {

namespace {
struct RoleRow {
  std::string_view name;
  can::Dimension dimension;
};
constexpr std::array<RoleRow, kRoleCount> kRoles{{
    {"primary_speed", can::Dimension::kAngularSpeed},
    {"secondary_speed", can::Dimension::kAngularSpeed},
    {"secondary_pressure", can::Dimension::kPressure},
    {"engine_torque", can::Dimension::kTorque},
    {"primary_torque", can::Dimension::kTorque},
    {"secondary_torque", can::Dimension::kTorque},
    {"primary_pressure", can::Dimension::kPressure},
    {"secondary_pressure_command", can::Dimension::kPressure},
    {"engine_speed", can::Dimension::kAngularSpeed},
    {"oil_temperature", can::Dimension::kTemperature},
    {"vehicle_speed", can::Dimension::kSpeed},
    {"accelerator_pedal", can::Dimension::kShare},
    {"brake_pressed", can::Dimension::kNone},
    {"lockup_closed", can::Dimension::kNone},
    {"experiment_permitted", can::Dimension::kNone},
    {"experiment_active", can::Dimension::kNone},
}};
}  // namespace

std::string_view role_name(Role role) { return kRoles[static_cast<std::size_t>(role)].name; }
can::Dimension role_dimension(Role role) {
  return kRoles[static_cast<std::size_t>(role)].dimension;
}

}  // namespace beltgrip::daemon
