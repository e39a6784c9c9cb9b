// The tables of options: every key of the configuration, one row each (option.h). Who adds a key
// adds its row here, its place in the struct that the section is read into, and its use. Start-up
// and tools only.
#pragma once

#include <optional>
#include <span>
#include <string>
#include <string_view>

#include "can_dbc/uds/iso_tp.h"
#include "daemon/core/config/options/config.h"
#include "daemon/core/config/options/option.h"
#include "estimator/physics/assumed_constants.h"

namespace beltgrip::daemon {

std::span<const std::string_view> section_names();  // in the order of the file

// [bus], [variator], [estimator], [experiment], [daemon]
using Option = OptionOf<Config>;
std::span<const Option> option_table();

// [bus.NAME] and bus.identifiers
std::span<const OptionOf<FurtherBus>> further_bus_options();
std::span<const OptionOf<FrameIdentifiers>> identifier_options();

// signals.ROLE = { ... }
struct RoleText {
  std::string signal;
  std::string column;
  std::optional<UdsSource> uds;
  std::string unit;
  double scale = 1.0, offset = 0.0;
  std::optional<double> period_ms;
  double delay_ms = 0.0;
  std::string bus;
};
std::span<const OptionOf<RoleText>> role_options();
// signals.ROLE.uds = { ... }
inline constexpr std::size_t kUdsDataMax = can::kIsoTpMax - 3;  // after service and identifier
std::span<const OptionOf<UdsSource>> uds_options();

// protection.MESSAGE = { ... }, what it says without the DBC
struct ProtectionText {
  std::uint16_t data_id = 0;
};
std::span<const OptionOf<ProtectionText>> protection_options();

// sensors.ROLE = { ... }
struct SensorText {
  std::optional<double> bias, gain;
};
// The bias and the gain of what measures it; empty: no accuracy is known.
std::span<const OptionOf<SensorText>> sensor_options(can::Dimension dimension);
inline std::string_view bias_key(can::Dimension dimension) {  // "bias_Pa"
  const auto options = sensor_options(dimension);
  return options.empty() ? std::string_view() : options.front().key;
}

std::string_view role_help(Role role);
// The kind of sensor whose accuracy a result rests on; none of other roles.
std::optional<estimator::Sensor> sensor_of(Role role);
// What is assumed of a key of [variator] that is left out; empty: nothing.
std::string assumption_text(const Option& option);

// Chosen: the period of a sample; an ECU answers in 5 to 50 ms.
inline constexpr double kPollPeriodMinimum_ms = 10.0;

}  // namespace beltgrip::daemon
