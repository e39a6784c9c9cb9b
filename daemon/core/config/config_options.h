// The option table: key, type, unit, default, range and help of every plain key of the
// configuration in one row. Reading, range errors and the commented default file all come from it.
// The sections [signals] and [sensors], whose keys are roles, have their own rows here. Start-up
// and tools only.
#pragma once

#include <optional>
#include <span>
#include <string>
#include <string_view>

#include "daemon/core/config/config.h"
#include "estimator/physics/assumed_constants.h"

namespace beltgrip::daemon {

struct Option {
  enum class Kind { kNumber, kText, kChoice, kTexts, kIdentifiers };

  std::string_view section;
  std::string_view key;
  Kind kind;
  std::string_view unit;  // for the help; the key carries it as well
  double minimum = 0.0, maximum = 0.0;
  double factor = 1.0;                        // value in the Config = value in the file * factor
  std::span<const std::string_view> choices;  // kChoice, in the order of the enumeration
  std::string_view help;                      // lines separated by '\n'
  double& (*number)(Config&) = nullptr;
  std::string& (*text)(Config&) = nullptr;
  std::size_t (*get_choice)(const Config&) = nullptr;
  void (*set_choice)(Config&, std::size_t) = nullptr;
};

std::span<const Option> option_table();
std::span<const std::string_view> section_names();  // in the order of the file

// [signals] and [sensors]
std::string_view role_help(Role role);
// What is assumed of a key of [variator] that is left out; empty: nothing.
std::string assumption_text(const Option& option);
// The kind of sensor whose accuracy a result rests on; none of other roles.
std::optional<estimator::Sensor> sensor_of(Role role);
std::string_view bias_key(can::Dimension dimension);  // "bias_Pa"; empty: no accuracy is known
double bias_maximum(can::Dimension dimension);
inline constexpr double kGainMaximum = 1.0;

struct IdentifierKey {
  std::string_view key;
  std::uint32_t FrameIdentifiers::*field;
};
std::span<const IdentifierKey> identifier_keys();

inline constexpr double kPeriodMinimum_ms = 0.5, kPeriodMaximum_ms = 10'000.0;
inline constexpr double kDelayMinimum_ms = -50.0, kDelayMaximum_ms = 200.0;
inline constexpr double kPollPeriodMinimum_ms = 10.0;

}  // namespace beltgrip::daemon
