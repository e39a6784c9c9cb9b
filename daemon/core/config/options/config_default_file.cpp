// The commented default file, out of the tables of options.
#include <cmath>

#include "can_dbc/text/number_text.h"
#include "daemon/core/config/options/config_options.h"
#include "daemon/core/config/options/config_uds.h"

namespace beltgrip::daemon {

namespace {

using Kind = OptionRow::Kind;

// A TOML number needs a point or an exponent.
std::string toml_text(double value) {
  std::string text = rounded_text(value, 12);
  if (text.find_first_of(".e") == std::string::npos) text += ".0";
  return text;
}

void add_comment(std::string& out, std::string_view text) {
  while (!text.empty()) {
    const std::size_t end = std::min(text.find('\n'), text.size());
    out += "# " + std::string(text.substr(0, end)) + "\n";
    text.remove_prefix(std::min(end + 1, text.size()));
  }
}

template <typename Target>
std::string default_value(const OptionOf<Target>& option, Target& defaults) {
  if (!option.shown.empty()) return std::string(option.shown);
  switch (option.kind) {
    case Kind::kNumber:
      return toml_text(option.number(defaults) / option.factor);
    case Kind::kInteger: {
      const auto value = static_cast<std::uint32_t>(option.get_integer(defaults));
      return option.is_hexadecimal ? "0x" + hex_text(value) : std::to_string(value);
    }
    case Kind::kText:
      return in_quotes(option.text(defaults));
    case Kind::kChoice:
      return in_quotes(option.choices[option.get_choice(defaults)]);
    case Kind::kFlag:
      return option.get_choice(defaults) != 0 ? "true" : "false";
    case Kind::kPaths:
      return "[]";
    default:
      return "{ ... }";
  }
}

std::string range_text(const OptionRow& option) {
  switch (option.kind) {
    case Kind::kNumber:
      if (std::isinf(option.maximum)) return {};
      return (option.unit.empty() ? "" : std::string(option.unit) + ", ") +
             toml_text(option.minimum) + " to " + toml_text(option.maximum);
    case Kind::kInteger: {
      const auto text = [&](double value) {
        const auto integer = static_cast<std::uint32_t>(value);
        return option.is_hexadecimal ? "0x" + hex_text(integer) : std::to_string(integer);
      };
      return (option.unit.empty() ? "" : std::string(option.unit) + ", ") + text(option.minimum) +
             " to " + text(option.maximum);
    }
    case Kind::kChoice: {
      std::string text;
      for (const std::string_view each : option.choices) {
        text += (text.empty() ? "" : " | ") + in_quotes(each);
      }
      return text;
    }
    case Kind::kFlag:
      return "true | false";
    default:
      return {};
  }
}

// Every key of a table within a section: what it is if it is left out, or an example of what it
// may be; then the meaning, and the range.
template <typename Rows, typename Target>
void add_keys(std::string& out, const Rows& options, Target defaults) {
  for (const OptionOf<Target>& option : options) {
    out += "#   " + std::string(option.key) + " = " + default_value(option, defaults) + "\n";
    const std::string range = range_text(option);
    std::string text;
    add_comment(text, option.help);
    if (!range.empty()) add_comment(text, "(" + range + ")");
    for (std::size_t at = 0; at < text.size();) {
      const std::size_t end = text.find('\n', at) + 1;
      out += "#     " + text.substr(at + 2, end - at - 2);
      at = end;
    }
  }
}

// { a = 1, b = 2 }
template <typename Rows, typename Target>
std::string table_value(const Rows& options, Target defaults) {
  std::string text;
  for (const OptionOf<Target>& option : options) {
    text += (text.empty() ? "{ " : ", ") + std::string(option.key) + " = " +
            default_value(option, defaults);
  }
  return text + " }";
}

void add_further_bus(std::string& out) {
  add_comment(out,
              "A further bus, where roles live that say bus = \"NAME\"; BeltGrip's own frames stay "
              "on the first.");
  out += "#   [bus.NAME]\n";
  add_keys(out, further_bus_options(), FurtherBus{});
}

void add_signals(std::string& out) {
  add_comment(
      out,
      "role = \"Message.Signal\" | \"0x123.Signal\" | \"0x12345678x.Signal\" (29 bit)\n"
      "or a table of these keys, role = { signal = \"...\", unit = \"...\" }; role = scale * "
      "signal + offset, in\nunit. A key that is left out is as shown, if its text does not "
      "say otherwise.");
  add_keys(out, role_options(), RoleText{});
  add_comment(out, "uds = { ... } has these keys; the first five are required:");
  add_keys(out, uds_options(), usual_uds());
  for (std::size_t i = 0; i < kRoleCount; ++i) {
    const Role role = static_cast<Role>(i);
    out += "\n";
    add_comment(out, role_help(role));
    const auto dimension = role_dimension(role);
    if (dimension != can::Dimension::kNone) {
      add_comment(out, "(" + std::string(can::dimension_name(dimension)) + ")");
    }
    out += "# " + std::string(role_name(role)) + " = \"\"\n";
  }
}

void add_protection(std::string& out) {
  add_comment(
      out,
      "Counter and CRC of messages of [bus], message by message. A frame whose counter "
      "stands still or\njumps by more than three, or whose CRC is wrong, is not used; after "
      "a jump, and after three bad ones\nof eight, none is until five in a row are good.");
  add_keys(out, protection_options(), ProtectionText{});
  out += "# \"Message\" = " + table_value(protection_options(), ProtectionText{}) + "\n";
}

void add_sensors(std::string& out) {
  add_comment(out,
              "What is known of accuracy, 1 sigma of an error that stays, role by role; widens the "
              "interval of\nmu_max. A role or a key of it that is left out is assumed to be as in "
              "other cars (the values shown of\nspeeds, secondary pressure and torque), reported "
              "as assumed, and MinClampForce rests on the lower end\nof mu_max; 0.0 is exact. "
              "gain is relative, 0.0 to 1.0.");
  for (std::size_t i = 0; i < kRoleCount; ++i) {
    const Role role = static_cast<Role>(i);
    const auto options = sensor_options(role_dimension(role));
    if (options.empty()) continue;
    const std::optional<estimator::Sensor> sensor = sensor_of(role);
    const estimator::ChannelAccuracy shown =
        sensor ? estimator::typical_accuracy(*sensor).accuracy : estimator::ChannelAccuracy{};
    out += "# " + std::string(role_name(role)) + " = " +
           table_value(options, SensorText{shown.bias, shown.gain}) + "  # bias " +
           toml_text(options.front().minimum) + " to " + toml_text(options.front().maximum) + "\n";
  }
}

void add_options(std::string& out, std::string_view section) {
  Config defaults;
  bool first = true;
  for (const Option& option : option_table()) {
    if (option.section != section) continue;
    if (!first) out += "\n";
    first = false;
    add_comment(out, option.help);
    const std::string assumed = assumption_text(option);
    if (!assumed.empty()) add_comment(out, "Left out: assumed, " + assumed + ".");
    const std::string range = range_text(option);
    if (!range.empty()) add_comment(out, "(" + range + ")");
    out += "# " + std::string(option.key) + " = ";
    // The only table among them.
    out += (option.kind == Kind::kTable ? table_value(identifier_options(), defaults.identifiers)
                                        : default_value(option, defaults)) +
           "\n";
    if (option.kind == Kind::kTable) add_keys(out, identifier_options(), defaults.identifiers);
  }
}

}  // namespace

std::string assumption_text(const Option& option) {
  for (const estimator::Assumption& each : estimator::assumptions()) {
    if (option.section != "variator" || option.key != each.key) continue;
    return toml_text(each.least) + " to " + toml_text(each.most) + ' ' + std::string(each.unit) +
           (each.logarithmic ? ", even in the logarithm" : "");
  }
  return {};
}

std::string default_config_text() {
  std::string out;
  add_comment(out,
              "Configuration of BeltGrip: every key with its default, commented out, its unit and "
              "range.\nGenerated by beltgripd --print-default-config. Paths are relative to this "
              "file.");
  for (const std::string_view section : section_names()) {
    out += "\n[" + std::string(section) + "]\n";
    if (section == "signals") add_signals(out);
    if (section == "protection") add_protection(out);
    if (section == "sensors") add_sensors(out);
    add_options(out, section);
    if (section == "bus") add_further_bus(out += "\n");
  }
  return out;
}

}  // namespace beltgrip::daemon
