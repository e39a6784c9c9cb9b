#include "daemon/core/config/options/config_options.h"

#include <array>
#include <numbers>

#include "daemon/core/base/named.h"
#include "daemon/core/config/options/config_bus.h"
#include "daemon/core/config/options/config_uds.h"

namespace beltgrip::daemon {

namespace {

using estimator::EstimatorSettings;
using estimator::Method;
using estimator::PeakSamples;
using estimator::RatioChoice;
using estimator::Reopening;
using estimator::StopRule;
using estimator::VariatorParameters;
using namespace option_row;

constexpr double kDegree = std::numbers::pi / 180.0;
constexpr double kEndless = OptionRow::kEndless;

// The words of an enumeration, one for each value in its order; else it does not compile.
template <typename Enum, std::size_t kCount>
consteval std::array<std::string_view, kCount> words(const std::array<Named<Enum>, kCount>& rows) {
  if (!in_wire_order(rows)) throw "not in the order of the enumeration";
  std::array<std::string_view, kCount> out;
  for (std::size_t i = 0; i < kCount; ++i) out[i] = rows[i].name;
  return out;
}

constexpr auto kMethods =
    words<Method, 2>({{{Method::kRobust, "robust"}, {Method::kPaper, "paper"}}});
constexpr auto kTriggers = words<Trigger, 4>({{{Trigger::kCoastDown, "coast_down"},
                                               {Trigger::kSteady, "steady"},
                                               {Trigger::kSignal, "signal"},
                                               {Trigger::kAlways, "always"}}});
constexpr auto kControls =
    words<Control, 2>({{{Control::kObserve, "observe"}, {Control::kCommand, "command"}}});
constexpr auto kRatios = words<RatioChoice, 3>({{{RatioChoice::kOverdrive, "overdrive"},
                                                 {RatioChoice::kLow, "low"},
                                                 {RatioChoice::kEither, "either"}}});
constexpr auto kDiagnostics =
    words<Diagnostics, 2>({{{Diagnostics::kListen, "listen"}, {Diagnostics::kPoll, "poll"}}});
constexpr auto kStops =
    words<StopRule, 2>({{{StopRule::kPeak, "peak"}, {StopRule::kConfidence, "confidence"}}});
constexpr auto kReopenings = words<Reopening, 3>({{{Reopening::kHeldSlope, "held_slope"},
                                                   {Reopening::kInitialSlope, "initial_slope"},
                                                   {Reopening::kPaused, "paused"}}});
constexpr auto kPeakSamples =
    words<PeakSamples, 2>({{{PeakSamples::kAll, "all"}, {PeakSamples::kLast, "last"}}});
constexpr auto kByteOrders = words<can::ByteOrder, 2>(
    {{{can::ByteOrder::kLittle, "little"}, {can::ByteOrder::kBig, "big"}}});
constexpr std::string_view kPathsExpected = "an array of paths: [\"vehicle.dbc\"]";

// Sections that are read into the Config itself.
constexpr Option kOptions[] = {
    text<&Config::interface>("bus", "interface",
                             "CAN interface, or inproc:NAME for the embedded bus of one process."),
    paths<&Config::dbc>(
        "bus", "dbc",
        "DBC files of the vehicle, relative to this file. Required. An identifier may be in\n"
        "one of them only.")
        .expecting(kPathsExpected),
    table<Config>(
        "bus", "identifiers", &read_identifiers,
        "Identifiers of the frames that BeltGrip publishes, 11 bit, all different. Their data "
        "ids\n(protection) stay those of the default."),
    choice<&Config::diagnostics>(
        "bus", "diagnostics", kDiagnostics,
        "Roles with { uds = ... }: \"listen\" waits for the answers that another tester asks for "
        "and sends\nnothing; \"poll\" asks itself, each identifier every period_ms, one request "
        "at a time to an ECU, less\noften when it is refused or not answered, and not within 5 s "
        "of another tester's request."),

    number<&Config::variator, &VariatorParameters::half_wedge_angle_rad>(
        "variator", "half_wedge_angle_deg", "degrees", 1.0, 45.0,
        "Half wedge angle of the pulleys.", kDegree),
    number<&Config::variator, &VariatorParameters::ratio_low>(
        "variator", "ratio_low", "", 0.1, 10.0,
        "Secondary speed / primary speed at the low end stop, without slip."),
    number<&Config::variator, &VariatorParameters::ratio_overdrive>(
        "variator", "ratio_overdrive", "", 0.1, 10.0,
        "The same at the overdrive end stop; greater than ratio_low."),
    number<&Config::variator, &VariatorParameters::primary_radius_overdrive_m>(
        "variator", "primary_radius_overdrive_m", "m", 0.005, 1.0,
        "Running radius of the belt on the primary pulley at the overdrive end stop."),
    number<&Config::variator, &VariatorParameters::primary_radius_low_m>(
        "variator", "primary_radius_low_m", "m", 0.005, 1.0,
        "The same at the low end stop; smaller than primary_radius_overdrive_m."),
    number<&Config::variator, &VariatorParameters::secondary_piston_area_m2>(
        "variator", "secondary_piston_area_m2", "m2", 1e-4, 1.0,
        "Area of the secondary clamping cylinder."),
    number<&Config::variator, &VariatorParameters::secondary_spring_force_N>(
        "variator", "secondary_spring_force_N", "N", 0.0, 50e3,
        "Spring force on the secondary pulley."),
    number<&Config::variator, &VariatorParameters::secondary_centrifugal_N_s2>(
        "variator", "secondary_centrifugal_N_s2", "N s2", 0.0, 1.0,
        "Centrifugal oil force per square of the secondary speed; 0 where it is cancelled."),
    number<&Config::variator, &VariatorParameters::primary_inertia_kg_m2>(
        "variator", "primary_inertia_kg_m2", "kg m2", 0.0, 10.0,
        "Inertia between engine_torque and the belt: belt torque = engine_torque - this * primary\n"
        "acceleration. Not applied to primary_torque."),
    number<&Config::variator, &VariatorParameters::safety_factor>(
        "variator", "safety_factor", "", 1.0, 10.0, "Margin of MinClampForce."),
    number<&Config::variator, &VariatorParameters::torque_reserve_Nm>(
        "variator", "torque_reserve_Nm", "Nm", 0.0, 500.0,
        "Torque that MinClampForce holds beyond the present one: for what comes faster than the "
        "hydraulics.\nbeltgrip report shows the reserve that costs least."),

    choice<&Config::estimator, &EstimatorSettings::method>(
        "estimator", "method", kMethods,
        "How friction slope, stop and mu_max are estimated; \"paper\" is van Berkel et al. 2011."),
    text<&Config::model>(
        "estimator", "model",
        "Model file (beltgrip diagnose --model-out): its [variator] wins over this file's, and\n"
        "what it says of torque, clamp force, geometry and delays is taken out of the inputs.\n"
        "A channel that it says comes late makes all others, and every decision, wait.")
        .path(),
    number<&Config::estimator, &EstimatorSettings::sample_rate_hz>(
        "estimator", "sample_rate_hz", "Hz", 100.0, 1000.0,
        "Rate of the estimator and of its decisions."),
    number<&Config::estimator, &EstimatorSettings::lowpass_hz>(
        "estimator", "lowpass_hz", "Hz", 0.1, 100.0,
        "Low-pass on all inputs, method \"paper\"; below half the sample rate."),
    number<&Config::estimator, &EstimatorSettings::window_s>(
        "estimator", "window_s", "s", 0.05, 10.0,
        "Window T of the slip variance, method \"paper\"."),
    number<&Config::estimator, &EstimatorSettings::slope_variance>(
        "estimator", "slope_variance", "1/percent2", 1e-12, 1e6,
        "q_k per sample at 200 Hz, method \"paper\"."),
    number<&Config::estimator, &EstimatorSettings::offset_variance>(
        "estimator", "offset_variance", "", 1e-12, 1e6,
        "q_mu0 per sample at 200 Hz, method \"paper\"."),
    number<&Config::estimator, &EstimatorSettings::excitation_threshold>(
        "estimator", "excitation_threshold", "percent2", 1e-9, 1e3,
        "c_v, slip variance that counts as excitation, method \"paper\"."),
    number<&Config::estimator, &EstimatorSettings::stop_slope>(
        "estimator", "stop_slope", "1/percent", -1.0, 0.0,
        "c_k, friction slope that means macro slip, method \"paper\"; below peak_slope."),
    number<&Config::estimator, &EstimatorSettings::peak_slope>(
        "estimator", "peak_slope", "1/percent", 0.0, 1.0,
        "c_m, slope magnitude that counts as the peak, method \"paper\"."),
    number<&Config::estimator, &EstimatorSettings::initial_slope>(
        "estimator", "initial_slope", "1/percent", -1.0, 1.0,
        "k(0), method \"paper\"; its text leaves it open, as it does the next three."),
    number<&Config::estimator, &EstimatorSettings::initial_variance>(
        "estimator", "initial_variance", "", 1e-12, 1e6,
        "P(0) is this times the identity, method \"paper\"."),
    choice<&Config::estimator, &EstimatorSettings::reopening>(
        "estimator", "reopening", kReopenings,
        "When slip is excited again, method \"paper\": \"held_slope\" k is held, mu_0 has "
        "followed the\nmeasurement, P is P(0); \"initial_slope\" as at the first time; \"paused\" "
        "as when it ended."),
    choice<&Config::estimator, &EstimatorSettings::peak_samples>(
        "estimator", "peak_samples", kPeakSamples,
        "mu_max is the mean over \"all\" samples near the peak, or over the \"last\" unbroken "
        "run of\nthem, method \"paper\"."),
    number<&Config::estimator, &EstimatorSettings::value_width>(
        "estimator", "value_width", "", 0.005, 0.5,
        "Share of mu_max that half of its 95 % interval by noise may be for a value; wider, the\n"
        "result is a lower bound. Method \"robust\"."),

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
    choice<&Config::estimator, &EstimatorSettings::ratio>("experiment", "ratio", kRatios,
                                                          "The end stop at which slip is defined."),
    choice<&Config::estimator, &EstimatorSettings::stop_rule>(
        "experiment", "stop", kStops,
        "What ends an experiment: \"peak\" once the traction curve has been seen to turn down; "
        "\"confidence\"\nas soon as what it has shown tells mu_max to confidence_width, which may "
        "be "
        "before the peak\n(method \"robust\")."),
    number<&Config::estimator, &EstimatorSettings::confidence_width>(
        "experiment", "confidence_width", "", 0.005, 1.0,
        "With stop = \"confidence\": width of the 95 % interval of mu_max, as a share of mu_max,\n"
        "that is narrow enough; half of its part by noise is within estimator.value_width as "
        "well."),
    number<&Config::estimator, &EstimatorSettings::ramp_rate_max_N_per_s>(
        "experiment", "ramp_rate_max_N_per_s", "N/s", 1.0, 10e3,
        "The fastest ramp of the clamping force that is used or to be expected: far from the peak\n"
        "it is used, near the peak the ramp holds the rate of slip."),
    number<&Config::experiment, &ExperimentSettings::fall_max_per_percent>(
        "experiment", "fall_max_per_percent", "", 1e-4, 0.05,
        "The steepest fall of friction behind its peak, of mu for each percent of slip, that the\n"
        "first request of a belt must survive; later ones go by the fall that was seen."),
    number<&Config::experiment, &ExperimentSettings::torque_min_Nm>(
        "experiment", "torque_min_Nm", "Nm", 3.0, 50.0,
        "Least magnitude of the torque on the belt, triggers \"coast_down\" and \"steady\"."),
    number<&Config::experiment, &ExperimentSettings::torque_max_Nm>(
        "experiment", "torque_max_Nm", "Nm", 51.0, 1000.0,
        "And the largest, with control \"command\"."),
    number<&Config::experiment, &ExperimentSettings::primary_speed_min_rad_s>(
        "experiment", "primary_speed_min_rad_s", "rad/s", 20.0, 1000.0,
        "Least speed of the primary pulley, the same triggers; with control \"observe\" half of "
        "it."),
    number<&Config::experiment, &ExperimentSettings::oil_temperature_min_degC>(
        "experiment", "oil_temperature_min_degC", "degC", -40.0, 150.0,
        "Least temperature of the oil, the same triggers, where the role is there."),
    number<&Config::experiment, &ExperimentSettings::friction_expected>(
        "experiment", "friction_expected", "", 0.01, 1.0,
        "The mu_max that must be in reach before a request: the highest to be expected of the "
        "belt."),
    number<&Config::experiment, &ExperimentSettings::secondary_pressure_floor_Pa>(
        "experiment", "secondary_pressure_floor_Pa", "Pa", 0.0, 5e6,
        "Secondary pressure below which no request goes."),
    number<&Config::experiment, &ExperimentSettings::actuator_dead_time_s>(
        "experiment", "actuator_dead_time_s", "s", 0.0, 1.0,
        "Dead time of the clamping pressure, at the longest."),
    number<&Config::experiment, &ExperimentSettings::actuator_lag_s>(
        "experiment", "actuator_lag_s", "s", 0.001, 2.0,
        "First-order lag of the clamping pressure, at the longest."),
    number<&Config::experiment, &ExperimentSettings::cooldown_s>(
        "experiment", "cooldown_s", "s", 1.0, 86400.0,
        "Time from the start of the daemon or the end of a request to the next request."),
    number<&Config::experiment, &ExperimentSettings::cooldown_m>(
        "experiment", "cooldown_m", "m", 0.0, 1e6, "Distance likewise; both must have passed."),

    text<&Config::state_dir>(
        "daemon", "state_dir",
        "Folder of what outlives the daemon: history.db, every experiment with its result. "
        "Empty: the\nfolder that systemd gives (StateDirectory, as $STATE_DIRECTORY); where "
        "there is none, nothing is\nkept and MinClampForce rests on the last result alone.")
        .path(),
};

constexpr OptionOf<FurtherBus> kFurtherBusOptions[] = {
    text<&FurtherBus::interface>("bus.NAME", "interface", "CAN interface. Required.")
        .showing("\"can1\"")
        .required(),
    paths<&FurtherBus::dbc>("bus.NAME", "dbc",
                            "DBC files of its messages, where they are not in the files of [bus].")
        .expecting(kPathsExpected)
        .showing("[\"other.dbc\"]"),
};

constexpr OptionOf<FrameIdentifiers> kIdentifierOptions[] = {
    integer<&FrameIdentifiers::estimate>("bus.identifiers", "estimate", "", 0, can::kStandardIdMax,
                                         "Of BeltGripEstimate.")
        .hexadecimal(),
    integer<&FrameIdentifiers::slip>("bus.identifiers", "slip", "", 0, can::kStandardIdMax,
                                     "Of BeltGripSlip.")
        .hexadecimal(),
    integer<&FrameIdentifiers::clamp>("bus.identifiers", "clamp", "", 0, can::kStandardIdMax,
                                      "Of BeltGripClamp.")
        .hexadecimal(),
    integer<&FrameIdentifiers::status>("bus.identifiers", "status", "", 0, can::kStandardIdMax,
                                       "Of BeltGripStatus.")
        .hexadecimal(),
};

constexpr OptionOf<RoleText> kRoleOptions[] = {
    text<&RoleText::signal>(
        "signals.ROLE", "signal",
        "The message, or its identifier, and the signal, as above. Either this or uds.")
        .expecting("text \"Message.Signal\"")
        .showing("\"Message.Signal\""),
    table<RoleText>("signals.ROLE", "uds", &read_role_uds,
                    "The signal comes from diagnostics (UDS ReadDataByIdentifier over ISO-TP); it "
                    "has the keys\n"
                    "further below.")
        .showing("{ ... }"),
    text<&RoleText::column>(
        "signals.ROLE", "column",
        "The column of a table of signals (.csv) that check, calibrate and replay read instead of\n"
        "frames. Left out: one that is called like the role, or like the signal.")
        .expecting("text \"name of the column\"")
        .showing("\"Primary Rev Speed\""),
    text<&RoleText::unit>(
        "signals.ROLE", "unit",
        "Left out: that of the DBC. A flag has none.\n"
        "Units: rpm, 1/min, rad/s, bar, kPa, MPa, Pa, Nm, degC, K, km/h, m/s, %, N, kN, m, mm.")
        .expecting("text such as \"rpm\"")
        .showing("\"rpm\""),
    number<&RoleText::scale>("signals.ROLE", "scale", "", -kEndless, kEndless,
                             "Not 0; beside signal only.")
        .nonzero(),
    number<&RoleText::offset>("signals.ROLE", "offset", "", -kEndless, kEndless,
                              "In unit; beside signal only."),
    other<RoleText>("signals.ROLE", "true_when",
                    "A flag is 1 at this text or number of the signal's value table, several in [ "
                    "]. Left out:\n"
                    "the signal is 0 or 1. Not beside scale and offset.")
        .showing("\"Locked\""),
    number<&RoleText::period_ms>("signals.ROLE", "period_ms", "ms", 0.5, 10'000.0,
                                 "Time from a value to the next. Left out: the cycle time of the "
                                 "DBC; that of a multiplexed\n"
                                 "signal is learned.")
        .showing("10.0"),
    number<&RoleText::delay_ms>(
        "signals.ROLE", "delay_ms", "ms", -50.0, 200.0,
        "How much later than the others its values come; what a frame tells is taken for so much\n"
        "older (beltgrip calibrate measures it). Samples wait for it up to 50 ms in all; the slope "
        "of\n"
        "what comes later is followed."),
    text<&RoleText::bus>("signals.ROLE", "bus",
                         "The further bus that the signal is on. Left out: [bus].")
        .expecting("the name of a bus in quotes")
        .showing("\"NAME\""),
};

constexpr std::string_view kIdentifierExpected =
    "an identifier: up to 0x7FF is 11 bit, up to 0x1FFFFFFF is 29 bit";

constexpr OptionOf<UdsSource> kUdsOptions[] = {
    integer<&UdsSource::request>("signals.ROLE.uds", "request", "", 0, can::kExtendedIdMax,
                                 "Identifier of the request. Above 0x7FF it is 29 bit.")
        .hexadecimal()
        .expecting(kIdentifierExpected)
        .showing("0x7E1")
        .required(),
    integer<&UdsSource::response>("signals.ROLE.uds", "response", "", 0, can::kExtendedIdMax,
                                  "Identifier of the answer, likewise.")
        .hexadecimal()
        .expecting(kIdentifierExpected)
        .showing("0x7E9")
        .required(),
    integer<&UdsSource::identifier>("signals.ROLE.uds", "did", "", 0, 0xFFFF, "Data identifier.")
        .hexadecimal()
        .showing("0x1101")
        .required(),
    integer<&UdsSource::signal, &can::SignalDef::start_bit>(
        "signals.ROLE.uds", "start", "", 0, kUdsDataMax * 8.0 - 1.0,
        "First bit, counted in the data after the identifier as in a DBC; big: the highest bit of "
        "the\n"
        "signal, 7 is the highest of the first byte.")
        .expecting("a bit of the data after the identifier, numbered as in a DBC: 7 is the highest "
                   "of the first byte")
        .showing("7")
        .required(),
    integer<&UdsSource::signal, &can::SignalDef::length>("signals.ROLE.uds", "length", "bits", 1,
                                                         64, "Length of the signal.")
        .showing("16")
        .required(),
    choice<&UdsSource::signal, &can::SignalDef::byte_order>(
        "signals.ROLE.uds", "byte_order", kByteOrders,
        "\"big\": the byte with the highest bits comes first (Motorola);\n\"little\": that with "
        "the "
        "lowest (Intel).")
        .expecting("\"big\" or \"little\""),
    number<&UdsSource::signal, &can::SignalDef::scale>("signals.ROLE.uds", "scale", "", -kEndless,
                                                       kEndless, "Not 0.")
        .nonzero(),
    number<&UdsSource::signal, &can::SignalDef::offset>("signals.ROLE.uds", "offset", "", -kEndless,
                                                        kEndless,
                                                        "role = scale * signal + offset, in unit."),
    flag<&UdsSource::signal, &can::SignalDef::type>(
        "signals.ROLE.uds", "signed", "The signal may be negative (two's complement)."),
    integer<&UdsSource::service>("signals.ROLE.uds", "service", "", can::kReadByLocalIdentifier,
                                 can::kReadByIdentifier,
                                 "0x22: by identifier (UDS); 0x21: by local identifier of one byte "
                                 "(KWP2000).")
        .hexadecimal(),
    integer<&UdsSource::bytes>("signals.ROLE.uds", "bytes", "", 0, kUdsDataMax,
                               "Data bytes of the identifier. Given, the poll asks for it together "
                               "with others of its\n"
                               "ECU that have it too, up to three (0x22) or six (0x21) in one "
                               "request; an ECU that\n"
                               "refuses that is asked for one at a time. 0: not known."),
};

constexpr OptionOf<ProtectionText> kProtectionOptions[] = {
    other<ProtectionText>("protection.MESSAGE", "counter",
                          "A signal of up to 8 bits that counts the frames.")
        .showing("\"Signal\""),
    other<ProtectionText>(
        "protection.MESSAGE", "counter_max",
        "What it counts to; then comes 0. From 1 to what its bits hold. Left out: all bits one.")
        .showing("14"),
    other<ProtectionText>("protection.MESSAGE", "crc",
                          "A signal of one byte: CRC-8 as in AUTOSAR E2E profile 1 (polynomial "
                          "0x1D) over the low and the\n"
                          "high byte of data_id and all other bytes of the frame.")
        .showing("\"Signal\""),
    integer<&ProtectionText::data_id>("protection.MESSAGE", "data_id", "", 0, 0xFFFF,
                                      "Required with crc.")
        .showing("0x123"),
};

using SensorOptions = std::array<OptionOf<SensorText>, 2>;
constexpr SensorOptions sensor(std::string_view bias, std::string_view unit, double maximum) {
  return {
      number<&SensorText::bias>("sensors.ROLE", bias, unit, 0.0, maximum, "Of the value."),
      number<&SensorText::gain>("sensors.ROLE", "gain", "", 0.0, 1.0, "Relative to the value.")};
}
// By what a role measures; of what is not here no accuracy is known.
constexpr struct {
  can::Dimension dimension;
  SensorOptions options;
} kSensors[] = {
    {can::Dimension::kAngularSpeed, sensor("bias_rad_s", "rad/s", 100.0)},
    {can::Dimension::kPressure, sensor("bias_Pa", "Pa", 10e6)},
    {can::Dimension::kTorque, sensor("bias_Nm", "Nm", 1000.0)},
    {can::Dimension::kTemperature, sensor("bias_K", "K", 100.0)},
    {can::Dimension::kSpeed, sensor("bias_m_s", "m/s", 100.0)},
};

constexpr std::string_view kSections[] = {"bus",      "signals",   "protection", "sensors",
                                          "variator", "estimator", "experiment", "daemon"};

}  // namespace

std::span<const std::string_view> section_names() { return kSections; }
std::span<const Option> option_table() { return kOptions; }
std::span<const OptionOf<FurtherBus>> further_bus_options() { return kFurtherBusOptions; }
std::span<const OptionOf<FrameIdentifiers>> identifier_options() { return kIdentifierOptions; }
std::span<const OptionOf<RoleText>> role_options() { return kRoleOptions; }
std::span<const OptionOf<UdsSource>> uds_options() { return kUdsOptions; }
std::span<const OptionOf<ProtectionText>> protection_options() { return kProtectionOptions; }

std::span<const OptionOf<SensorText>> sensor_options(can::Dimension dimension) {
  for (const auto& each : kSensors) {
    if (each.dimension == dimension) return each.options;
  }
  return {};
}

}  // namespace beltgrip::daemon
