#include "daemon/core/config/config_options.h"

#include <charconv>
#include <cmath>
#include <numbers>

namespace beltgrip::daemon {

namespace {

using Kind = Option::Kind;

constexpr double kDegree = std::numbers::pi / 180.0;

constexpr std::string_view kMethods[] = {"robust", "paper"};
constexpr std::string_view kTriggers[] = {"coast_down", "steady", "signal", "always"};
constexpr std::string_view kControls[] = {"observe", "command"};
constexpr std::string_view kRatios[] = {"overdrive", "low", "either"};
constexpr std::string_view kDiagnostics[] = {"listen", "poll"};
constexpr std::string_view kStops[] = {"peak", "confidence"};

Option number(std::string_view section, std::string_view key, std::string_view unit, double minimum,
              double maximum, double& (*field)(Config&), std::string_view help,
              double factor = 1.0) {
  return {.section = section,
          .key = key,
          .kind = Kind::kNumber,
          .unit = unit,
          .minimum = minimum,
          .maximum = maximum,
          .factor = factor,
          .choices = {},
          .help = help,
          .number = field};
}

// The row of a choice among an enumeration's values, which `field` names.
template <auto Section, auto Field>
Option choice(std::string_view section, std::string_view key,
              std::span<const std::string_view> choices, std::string_view help) {
  using Enum = std::remove_reference_t<decltype(std::declval<Config>().*Section.*Field)>;
  return {.section = section,
          .key = key,
          .kind = Kind::kChoice,
          .unit = {},
          .choices = choices,
          .help = help,
          .get_choice =
              [](const Config& config) { return static_cast<std::size_t>(config.*Section.*Field); },
          .set_choice = [](Config& config,
                           std::size_t index) { config.*Section.*Field = Enum(index); }};
}
template <auto Field>
Option choice(std::string_view section, std::string_view key,
              std::span<const std::string_view> choices, std::string_view help) {
  using Enum = std::remove_reference_t<decltype(std::declval<Config>().*Field)>;
  return {
      .section = section,
      .key = key,
      .kind = Kind::kChoice,
      .unit = {},
      .choices = choices,
      .help = help,
      .get_choice = [](const Config& config) { return static_cast<std::size_t>(config.*Field); },
      .set_choice = [](Config& config, std::size_t index) { config.*Field = Enum(index); }};
}

const Option kOptions[] = {
    {.section = "bus",
     .key = "interface",
     .kind = Kind::kText,
     .unit = {},
     .choices = {},
     .help = "CAN interface, or inproc:NAME for the embedded bus of one process.",
     .text = [](Config& c) -> std::string& { return c.interface; }},
    {.section = "bus",
     .key = "dbc",
     .kind = Kind::kTexts,
     .unit = {},
     .choices = {},
     .help = "DBC files of the vehicle, relative to this file. Required. An identifier may be in\n"
             "one of them only."},
    {.section = "bus",
     .key = "identifiers",
     .kind = Kind::kIdentifiers,
     .unit = {},
     .minimum = 0,
     .maximum = can::kStandardIdMax,
     .choices = {},
     .help = "Identifiers of the frames that BeltGrip publishes, 11 bit, all different. Their data "
             "ids\n(protection) stay those of the default."},
    choice<&Config::diagnostics>(
        "bus", "diagnostics", kDiagnostics,
        "Roles with { uds = ... }: \"listen\" waits for the answers that another tester asks for "
        "and sends\nnothing; \"poll\" asks itself, each identifier every period_ms, one request "
        "at a time to an ECU, less\noften when it is refused or not answered, and not within 5 s "
        "of another tester's request."),

    number(
        "variator", "half_wedge_angle_deg", "degrees", 1.0, 45.0,
        [](Config& c) -> double& { return c.variator.half_wedge_angle_rad; },
        "Half wedge angle of the pulleys.", kDegree),
    number(
        "variator", "ratio_low", "", 0.1, 10.0,
        [](Config& c) -> double& { return c.variator.ratio_low; },
        "Secondary speed / primary speed at the low end stop, without slip."),
    number(
        "variator", "ratio_overdrive", "", 0.1, 10.0,
        [](Config& c) -> double& { return c.variator.ratio_overdrive; },
        "The same at the overdrive end stop; greater than ratio_low."),
    number(
        "variator", "primary_radius_overdrive_m", "m", 0.005, 1.0,
        [](Config& c) -> double& { return c.variator.primary_radius_overdrive_m; },
        "Running radius of the belt on the primary pulley at the overdrive end stop."),
    number(
        "variator", "primary_radius_low_m", "m", 0.005, 1.0,
        [](Config& c) -> double& { return c.variator.primary_radius_low_m; },
        "The same at the low end stop; smaller than primary_radius_overdrive_m."),
    number(
        "variator", "secondary_piston_area_m2", "m2", 1e-4, 1.0,
        [](Config& c) -> double& { return c.variator.secondary_piston_area_m2; },
        "Area of the secondary clamping cylinder."),
    number(
        "variator", "secondary_spring_force_N", "N", 0.0, 50e3,
        [](Config& c) -> double& { return c.variator.secondary_spring_force_N; },
        "Spring force on the secondary pulley."),
    number(
        "variator", "secondary_centrifugal_N_s2", "N s2", 0.0, 1.0,
        [](Config& c) -> double& { return c.variator.secondary_centrifugal_N_s2; },
        "Centrifugal oil force per square of the secondary speed; 0 where it is cancelled."),
    number(
        "variator", "primary_inertia_kg_m2", "kg m2", 0.0, 10.0,
        [](Config& c) -> double& { return c.variator.primary_inertia_kg_m2; },
        "Inertia between engine_torque and the belt: belt torque = engine_torque - this * primary\n"
        "acceleration. Not applied to primary_torque."),
    number(
        "variator", "safety_factor", "", 1.0, 10.0,
        [](Config& c) -> double& { return c.variator.safety_factor; }, "Margin of MinClampForce."),

    choice<&Config::estimator, &estimator::EstimatorSettings::method>(
        "estimator", "method", kMethods,
        "How friction slope, stop and mu_max are estimated; \"paper\" is van Berkel et al. 2011."),
    {.section = "estimator",
     .key = "model",
     .kind = Kind::kText,
     .unit = {},
     .choices = {},
     .help =
         "Model file (beltgrip diagnose --model-out): its [variator] wins over this file's, and\n"
         "what it says of torque, clamp force, geometry and delays is taken out of the inputs.\n"
         "A channel that it says comes late makes all others, and every decision, wait.",
     .text = [](Config& c) -> std::string& { return c.model; }},
    number(
        "estimator", "sample_rate_hz", "Hz", 100.0, 1000.0,
        [](Config& c) -> double& { return c.estimator.sample_rate_hz; },
        "Rate of the estimator and of its decisions."),
    number(
        "estimator", "lowpass_hz", "Hz", 0.1, 100.0,
        [](Config& c) -> double& { return c.estimator.lowpass_hz; },
        "Low-pass on all inputs, method \"paper\"; below half the sample rate."),
    number(
        "estimator", "window_s", "s", 0.05, 10.0,
        [](Config& c) -> double& { return c.estimator.window_s; },
        "Window T of the slip variance, method \"paper\"."),
    number(
        "estimator", "slope_variance", "1/percent2", 1e-12, 1e6,
        [](Config& c) -> double& { return c.estimator.slope_variance; },
        "q_k per sample at 200 Hz, method \"paper\"."),
    number(
        "estimator", "offset_variance", "", 1e-12, 1e6,
        [](Config& c) -> double& { return c.estimator.offset_variance; },
        "q_mu0 per sample at 200 Hz, method \"paper\"."),
    number(
        "estimator", "excitation_threshold", "percent2", 1e-9, 1e3,
        [](Config& c) -> double& { return c.estimator.excitation_threshold; },
        "c_v, slip variance that counts as excitation, method \"paper\"."),
    number(
        "estimator", "stop_slope", "1/percent", -1.0, 0.0,
        [](Config& c) -> double& { return c.estimator.stop_slope; },
        "c_k, friction slope that means macro slip, method \"paper\"; below peak_slope."),
    number(
        "estimator", "peak_slope", "1/percent", 0.0, 1.0,
        [](Config& c) -> double& { return c.estimator.peak_slope; },
        "c_m, slope magnitude that counts as the peak, method \"paper\"."),

    choice<&Config::trigger>(
        "experiment", "trigger", kTriggers,
        "When an experiment runs: \"coast_down\" in overrun with the foot off the pedal, "
        "\"steady\" under a\nsteady drive torque, each while everything below holds; \"signal\" "
        "while experiment_active is 1;\n\"always\" from the first to the last sample."),
    choice<&Config::control>(
        "experiment", "control", kControls,
        "\"observe\" never sends a clamp request. \"command\" asks the transmission controller to "
        "lower the\nclamping force; it needs trigger \"coast_down\" or \"steady\", "
        "variator.primary_inertia_kg_m2, and\nthe roles experiment_permitted, accelerator_pedal, "
        "brake_pressed, lockup_closed, oil_temperature\nand vehicle_speed."),
    choice<&Config::estimator, &estimator::EstimatorSettings::ratio>(
        "experiment", "ratio", kRatios, "The end stop at which slip is defined."),
    choice<&Config::estimator, &estimator::EstimatorSettings::stop_rule>(
        "experiment", "stop", kStops,
        "What ends an experiment: \"peak\" once the traction curve has been seen to turn down; "
        "\"confidence\"\nas soon as what it has shown tells mu_max to confidence_width, which may "
        "be "
        "before the peak\n(method \"robust\")."),
    number(
        "experiment", "confidence_width", "", 0.005, 1.0,
        [](Config& c) -> double& { return c.estimator.confidence_width; },
        "With stop = \"confidence\": width of the 95 % interval of mu_max, as a share of mu_max,\n"
        "that is narrow enough."),
    number(
        "experiment", "ramp_rate_max_N_per_s", "N/s", 1.0, 10e3,
        [](Config& c) -> double& { return c.estimator.ramp_rate_max_N_per_s; },
        "The fastest ramp of the clamping force that is used or to be expected. The rate used is\n"
        "the fastest up to this whose worst-case reaction stays inside the slip limits."),
    number(
        "experiment", "torque_min_Nm", "Nm", 3.0, 50.0,
        [](Config& c) -> double& { return c.experiment.torque_min_Nm; },
        "Least magnitude of the torque on the belt, triggers \"coast_down\" and \"steady\"."),
    number(
        "experiment", "torque_max_Nm", "Nm", 51.0, 1000.0,
        [](Config& c) -> double& { return c.experiment.torque_max_Nm; }, "And the largest."),
    number(
        "experiment", "primary_speed_min_rad_s", "rad/s", 20.0, 1000.0,
        [](Config& c) -> double& { return c.experiment.primary_speed_min_rad_s; },
        "Least speed of the primary pulley, the same triggers."),
    number(
        "experiment", "oil_temperature_min_degC", "degC", -40.0, 150.0,
        [](Config& c) -> double& { return c.experiment.oil_temperature_min_degC; },
        "Least temperature of the oil, the same triggers, where the role is there."),
    number(
        "experiment", "friction_expected", "", 0.01, 1.0,
        [](Config& c) -> double& { return c.experiment.friction_expected; },
        "The mu_max that must be in reach before a request: the highest to be expected of the "
        "belt."),
    number(
        "experiment", "secondary_pressure_floor_Pa", "Pa", 0.0, 5e6,
        [](Config& c) -> double& { return c.experiment.secondary_pressure_floor_Pa; },
        "Secondary pressure below which no request goes."),
    number(
        "experiment", "actuator_dead_time_s", "s", 0.0, 1.0,
        [](Config& c) -> double& { return c.experiment.actuator_dead_time_s; },
        "Dead time of the clamping pressure, at the longest."),
    number(
        "experiment", "actuator_lag_s", "s", 0.001, 2.0,
        [](Config& c) -> double& { return c.experiment.actuator_lag_s; },
        "First-order lag of the clamping pressure, at the longest."),
    number(
        "experiment", "cooldown_s", "s", 1.0, 86400.0,
        [](Config& c) -> double& { return c.experiment.cooldown_s; },
        "Time from the start of the daemon or the end of a request to the next request."),
    number(
        "experiment", "cooldown_m", "m", 0.0, 1e6,
        [](Config& c) -> double& { return c.experiment.cooldown_m; },
        "Distance likewise; both must have passed."),

    {.section = "daemon",
     .key = "state_dir",
     .kind = Kind::kText,
     .unit = {},
     .choices = {},
     .help = "Folder of what outlives the daemon: history.db, every experiment with its result. "
             "Empty: the\nfolder that systemd gives (StateDirectory, as $STATE_DIRECTORY); where "
             "there is none, nothing is\nkept and MinClampForce rests on the last result alone.",
     .text = [](Config& c) -> std::string& { return c.state_dir; }},
};

constexpr std::string_view kSections[] = {"bus",      "signals",   "protection", "sensors",
                                          "variator", "estimator", "experiment", "daemon"};

constexpr std::array<std::string_view, kRoleCount> kRoleHelp{
    "Speed of the primary pulley. Required.",
    "Speed of the secondary pulley. Required.",
    "Pressure in the secondary clamping cylinder. Required.",
    "Torque of the engine at the primary shaft, + = drive. Required unless primary_torque is "
    "there.",
    "Torque at the primary pulley where a sensor measures it; taken instead of engine_torque.",
    "Torque at the secondary pulley.",
    "Pressure in the primary cylinder.",
    "Commanded secondary pressure.",
    "Speed of the engine.",
    "Temperature of the oil.",
    "Speed of the vehicle.",
    "Position of the accelerator pedal.",
    "1 while the brake is pressed.",
    "1 while the lock-up clutch is closed.",
    "1 while the transmission controller permits an experiment.",
    "1 while an experiment runs. Required with trigger = \"signal\"."};

constexpr IdentifierKey kIdentifierKeys[] = {{"estimate", &FrameIdentifiers::estimate},
                                             {"slip", &FrameIdentifiers::slip},
                                             {"clamp", &FrameIdentifiers::clamp},
                                             {"status", &FrameIdentifiers::status}};

std::string number_text(double value) {
  std::array<char, 32> digits;
  const auto end = std::to_chars(digits.data(), digits.data() + digits.size(), value,
                                 std::chars_format::general, 12)
                       .ptr;
  std::string text(digits.data(), end);
  // A TOML number needs a point or an exponent; an exponent of two digits reads better as one.
  if (text.find_first_of(".e") == std::string::npos) text += ".0";
  return text;
}

std::string hex_text(std::uint32_t value) {
  std::array<char, 16> digits;
  const auto end = std::to_chars(digits.data(), digits.data() + digits.size(), value, 16).ptr;
  std::string text(digits.data(), end);
  for (char& c : text) c = static_cast<char>(c >= 'a' ? c - 'a' + 'A' : c);
  return "0x" + text;
}

void add_comment(std::string& out, std::string_view text) {
  while (!text.empty()) {
    const std::size_t end = std::min(text.find('\n'), text.size());
    out += "# " + std::string(text.substr(0, end)) + "\n";
    text.remove_prefix(std::min(end + 1, text.size()));
  }
}

std::string default_value(const Option& option, Config& defaults) {
  switch (option.kind) {
    case Kind::kNumber:
      return number_text(option.number(defaults) / option.factor);
    case Kind::kText:
      return '"' + option.text(defaults) + '"';
    case Kind::kChoice:
      return '"' + std::string(option.choices[option.get_choice(defaults)]) + '"';
    case Kind::kTexts:
      return "[]";
    case Kind::kIdentifiers:
      break;
  }
  std::string text = "{ ";
  for (const IdentifierKey& each : kIdentifierKeys) {
    if (text.size() > 2) text += ", ";
    text += std::string(each.key) + " = " + hex_text(defaults.identifiers.*each.field);
  }
  return text + " }";
}

std::string range_text(const Option& option) {
  switch (option.kind) {
    case Kind::kNumber:
      return (option.unit.empty() ? "" : std::string(option.unit) + ", ") +
             number_text(option.minimum) + " to " + number_text(option.maximum);
    case Kind::kChoice: {
      std::string text;
      for (const std::string_view each : option.choices) {
        text += (text.empty() ? "\"" : " | \"") + std::string(each) + '"';
      }
      return text;
    }
    case Kind::kIdentifiers:
      return hex_text(static_cast<std::uint32_t>(option.minimum)) + " to " +
             hex_text(static_cast<std::uint32_t>(option.maximum));
    default:
      return {};
  }
}

void add_further_bus(std::string& out) {
  add_comment(out,
              "A further bus, where roles live that say bus = \"NAME\"; BeltGrip's own frames stay "
              "on the first.\n"
              "  [bus.NAME]\n"
              "  interface = \"can1\"\n"
              "  dbc = [\"other.dbc\"]     where its messages are not in the files of [bus]");
}

void add_signals(std::string& out) {
  add_comment(
      out,
      "role = \"Message.Signal\" | \"0x123.Signal\" | \"0x12345678x.Signal\" (29 bit)\n"
      "or { signal = \"...\", unit = \"...\", scale = 1.0, offset = 0.0, period_ms = ...,\n"
      "delay_ms = 0.0, bus = \"NAME\" }: role = scale * signal + offset, in unit. Unit and period "
      "are the DBC's\n"
      "where they are not given (flags have none: they are 0 or 1, or { signal = \"...\", "
      "true_when = \"Locked\" },\n"
      "text or numbers of the value table, several in [ ]); the period of a multiplexed signal is "
      "learned. delay_ms, -50.0 to "
      "200.0: how much later than the others its "
      "values come;\n"
      "what a frame tells is taken for so much older (beltgrip calibrate measures it). Samples "
      "wait "
      "for it up\n"
      "to 50 ms in all; the slope of what comes later is followed.\n"
      "Or from diagnostics (UDS ReadDataByIdentifier over ISO-TP):\n"
      "{ uds = { request = 0x7E1, response = 0x7E9, did = 0x1101, start = 7, length = 16, "
      "byte_order = \"big\",\n"
      "scale = 1.0, offset = 0.0, signed = false }, unit = \"kPa\", period_ms = 50 }: start "
      "counts the bits of\n"
      "the data after the identifier as a DBC does (big: of the highest bit; 7 is the highest of "
      "the first\n"
      "byte). Identifiers above 0x7FF are 29 bit.\n"
      "Units: rpm, 1/min, rad/s, bar, kPa, MPa, Pa, Nm, degC, K, km/h, m/s, %, N, kN, m, mm.");
  for (std::size_t i = 0; i < kRoleCount; ++i) {
    const Role role = static_cast<Role>(i);
    out += "\n";
    add_comment(out, kRoleHelp[i]);
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
      "stands still or\njumps by more than three, or whose CRC is wrong, is not used; after a "
      "jump, and after three bad ones\nof eight, none is until five in a row are good. "
      "counter is a signal of up to 8 bits, counting to\ncounter_max (default: all bits one). "
      "crc is a signal of one byte: CRC-8 as in AUTOSAR E2E profile 1\n(polynomial 0x1D) over "
      "the low and the high byte of data_id and all other bytes of the frame.");
  out +=
      "# \"Message\" = { counter = \"Signal\", counter_max = 14, crc = \"Signal\", data_id = "
      "0x123 }\n";
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
    const std::string_view key = bias_key(role_dimension(role));
    if (key.empty()) continue;
    const std::optional<estimator::Sensor> sensor = sensor_of(role);
    const estimator::ChannelAccuracy shown =
        sensor ? estimator::typical_accuracy(*sensor).accuracy : estimator::ChannelAccuracy{};
    out += "# " + std::string(role_name(role)) + " = { " + std::string(key) + " = " +
           number_text(shown.bias) + ", gain = " + number_text(shown.gain) + " }  # bias 0.0 to " +
           number_text(bias_maximum(role_dimension(role))) + "\n";
  }
}

}  // namespace

std::span<const Option> option_table() { return kOptions; }
std::span<const std::string_view> section_names() { return kSections; }
std::span<const IdentifierKey> identifier_keys() { return kIdentifierKeys; }
std::string_view role_help(Role role) { return kRoleHelp[static_cast<std::size_t>(role)]; }

std::string assumption_text(const Option& option) {
  for (const estimator::Assumption& each : estimator::assumptions()) {
    if (option.section != "variator" || option.key != each.key) continue;
    return number_text(each.least) + " to " + number_text(each.most) + ' ' +
           std::string(each.unit) + (each.logarithmic ? ", even in the logarithm" : "");
  }
  return {};
}

std::optional<estimator::Sensor> sensor_of(Role role) {
  using estimator::Sensor;
  switch (role) {
    case Role::kPrimarySpeed:
    case Role::kSecondarySpeed:
      return Sensor::kSpeed;
    case Role::kSecondaryPressure:
      return Sensor::kPressure;
    case Role::kEngineTorque:
      return Sensor::kEngineTorque;
    case Role::kPrimaryTorque:
      return Sensor::kMeasuredTorque;
    default:
      return std::nullopt;
  }
}

std::string_view bias_key(can::Dimension dimension) {
  switch (dimension) {
    case can::Dimension::kAngularSpeed:
      return "bias_rad_s";
    case can::Dimension::kPressure:
      return "bias_Pa";
    case can::Dimension::kTorque:
      return "bias_Nm";
    case can::Dimension::kTemperature:
      return "bias_K";
    case can::Dimension::kSpeed:
      return "bias_m_s";
    default:
      return {};
  }
}

double bias_maximum(can::Dimension dimension) {
  switch (dimension) {
    case can::Dimension::kPressure:
      return 10e6;
    case can::Dimension::kTorque:
      return 1000.0;
    default:
      return 100.0;
  }
}

std::string default_config_text() {
  std::string out;
  add_comment(out,
              "Configuration of BeltGrip: every key with its default, commented out, its unit and "
              "range.\nGenerated by beltgripd --print-default-config. Paths are relative to this "
              "file.");
  Config defaults;
  for (const std::string_view section : kSections) {
    out += "\n[" + std::string(section) + "]\n";
    if (section == "signals") add_signals(out);
    if (section == "protection") add_protection(out);
    if (section == "sensors") add_sensors(out);
    bool first = true;
    for (const Option& option : kOptions) {
      if (option.section != section) continue;
      if (!first) out += "\n";
      first = false;
      add_comment(out, option.help);
      const std::string assumed = assumption_text(option);
      if (!assumed.empty()) add_comment(out, "Left out: assumed, " + assumed + ".");
      const std::string range = range_text(option);
      if (!range.empty()) add_comment(out, "(" + range + ")");
      out += "# " + std::string(option.key) + " = " + default_value(option, defaults) + "\n";
    }
    if (section == "bus") add_further_bus(out += "\n");
  }
  return out;
}

}  // namespace beltgrip::daemon
