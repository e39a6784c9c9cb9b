#include "tools/sim/vehicle_bus.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>
#include <numbers>
#include <stdexcept>

#include "can_dbc/dbc/parser.h"
#include "can_dbc/text/unit_text.h"
#include "estimator/physics/variator_geometry.h"
#include "tools/sim/resources.h"

namespace beltgrip::sim {

namespace {

constexpr std::string_view kCounterSuffix = "Counter", kCrcSuffix = "Crc";

struct ChannelRow {
  std::string_view signal;  // name in the DBC
  double (*value)(const VehicleSignals&);
  ChannelError SensorParameters::*error;
};
const ChannelRow kChannels[] = {
    {"EngineSpeed", [](const VehicleSignals& s) { return s.omega_e_rad_s; },
     &SensorParameters::engine_speed},
    {"EngineTorque", [](const VehicleSignals& s) { return s.torque_e_Nm; },
     &SensorParameters::torque},
    {"AcceleratorPedal", [](const VehicleSignals& s) { return s.accelerator; }, nullptr},
    {"PrimarySpeed", [](const VehicleSignals& s) { return s.omega_p_rad_s; },
     &SensorParameters::primary_speed},
    {"SecondarySpeed", [](const VehicleSignals& s) { return s.omega_s_rad_s; },
     &SensorParameters::secondary_speed},
    {"SecondaryPressure", [](const VehicleSignals& s) { return s.secondary_pressure_Pa; },
     &SensorParameters::pressure},
    {"PrimaryPressure", [](const VehicleSignals& s) { return s.primary_pressure_Pa; },
     &SensorParameters::pressure},
    {"SecondaryPressureCommand",
     [](const VehicleSignals& s) { return s.secondary_pressure_command_Pa; }, nullptr},
    {"OilTemperature", [](const VehicleSignals& s) { return s.oil_degC; },
     &SensorParameters::temperature},
    {"LockupClosed", [](const VehicleSignals& s) { return s.lockup_closed; }, nullptr},
    {"ExperimentPermitted", [](const VehicleSignals& s) { return s.experiment_permitted; },
     nullptr},
    {"VehicleSpeed", [](const VehicleSignals& s) { return s.speed_m_s; }, nullptr},
    {"BrakePressed", [](const VehicleSignals& s) { return s.brake_pressed; }, nullptr},
};

// CRC-8 of AUTOSAR E2E profile 1, bit by bit, over the identifier and all other bytes.
void protect(can::CanFrame& frame, std::size_t crc_byte) {
  unsigned crc = 0;
  const auto add = [&crc](unsigned byte) {
    crc ^= byte;
    for (int bit = 0; bit < 8; ++bit) crc = (crc & 0x80U) != 0 ? crc << 1 ^ 0x11DU : crc << 1;
  };
  add(frame.id.value & 0xFFU);
  add(frame.id.value >> 8);
  for (std::size_t i = 0; i < frame.length; ++i) {
    if (i != crc_byte) add(frame.data[i]);
  }
  frame.data[crc_byte] = static_cast<std::uint8_t>(crc);
}

}  // namespace

VehicleBus::VehicleBus(const can::Database& dbc, const VehicleScenario& scenario,
                       std::uint64_t seed)
    : past_(kPast),
      jitter_(seed, "frame jitter"),
      frame_random_(seed, "frame faults"),
      step_s_(scenario.step_s),
      delay_s_(scenario.sensors.frame_delay_s),
      jitter_s_(scenario.sensors.frame_jitter_s) {
  for (const ChannelRow& row : kChannels) {
    Channel channel{std::string(row.signal), row.value, {}, 0.0, nullptr, Random(seed, row.signal)};
    if (row.error != nullptr) channel.error = scenario.sensors.*row.error;
    if (row.signal == "PrimarySpeed") {
      channel.ripple = scenario.sensors.primary_ripple;
      channel.angle = [](const VehicleSignals& s) { return s.angle_p_rad; };
    } else if (row.signal == "SecondarySpeed") {
      channel.ripple = scenario.sensors.secondary_ripple;
      channel.angle = [](const VehicleSignals& s) { return s.angle_s_rad; };
    }
    if (row.signal == "PrimarySpeed") speeds_.first = channels_.size();
    if (row.signal == "SecondarySpeed") speeds_.second = channels_.size();
    channels_.push_back(std::move(channel));
  }
  Random phase(seed, "frame phase");
  for (const can::MessageDef& definition : dbc.messages) {
    Message message;
    message.id = definition.id;
    message.name = definition.name;
    message.length = static_cast<std::uint8_t>(definition.length);
    message.period_ns = std::llround(definition.cycle_ms.value_or(0.0) * 1e6);
    if (message.period_ns <= 0) throw std::logic_error(definition.name + " has no cycle time");
    message.next_ns =
        static_cast<std::int64_t>(phase.uniform() * static_cast<double>(message.period_ns));
    for (const can::SignalDef& signal : definition.signals) {
      if (signal.name.ends_with(kCounterSuffix)) {
        message.counter_codec = can::SignalCodec(signal);
        message.has_counter = true;
        continue;
      }
      if (signal.name.ends_with(kCrcSuffix)) {
        message.crc_byte = signal.start_bit / 8;
        continue;
      }
      const auto row = std::find_if(std::begin(kChannels), std::end(kChannels),
                                    [&](const ChannelRow& r) { return r.signal == signal.name; });
      const auto unit = signal.unit.empty() ? can::Unit{} : can::parse_unit(signal.unit);
      if (row == std::end(kChannels) || !unit) {
        throw std::logic_error(signal.name + " is not a signal of the vehicle");
      }
      message.signals.push_back({can::SignalCodec(signal),
                                 static_cast<std::size_t>(row - std::begin(kChannels)),
                                 1.0 / unit->factor, unit->offset});
    }
    messages_.push_back(std::move(message));
  }
}

double VehicleBus::measure(Channel& channel, const FaultScript& faults, double t_s) {
  const auto active = [&](FaultKind kind) { return faults.active(kind, t_s, channel.name); };
  double delay_s = channel.error.delay_s;
  if (const FaultStep* fault = active(FaultKind::kSignalDelay)) delay_s += fault->size;
  const auto delay = std::min(kPast - 1, static_cast<std::size_t>(delay_s / step_s_));
  const VehicleSignals& then = past_[(now_ + kPast - delay) % kPast];
  double value = channel.value(then) * (1.0 + channel.error.gain) + channel.error.bias;
  if (channel.ripple > 0.0) value *= 1.0 + channel.ripple * std::sin(channel.angle(then));
  // Drawn even where it is not used: a fault leaves the noise of the others as it is.
  double noise = channel.error.noise > 0.0 ? channel.error.noise * channel.random.normal() : 0.0;
  if (const FaultStep* fault = active(FaultKind::kSignalNoise)) noise *= fault->size;
  value += noise;
  if (const FaultStep* fault = active(FaultKind::kSignalGain)) value *= fault->size;
  if (const FaultStep* fault = active(FaultKind::kSignalBias)) value += fault->size;
  if (const FaultStep* fault = active(FaultKind::kSignalSpike)) value += fault->size;
  if (const FaultStep* fault = active(FaultKind::kSignalRamp)) {
    value += fault->size * faults.since_s(*fault, t_s);
  }
  if (const FaultStep* fault = active(FaultKind::kSignalValue)) value = fault->size;
  if (channel.name == "OilTemperature") {
    if (const FaultStep* fault = faults.active(FaultKind::kOilTemperature, t_s)) {
      value = fault->size;
    }
  }
  double resolution = channel.error.resolution;
  if (const FaultStep* fault = active(FaultKind::kSignalResolution)) resolution = fault->size;
  if (resolution > 0.0) value = resolution * std::round(value / resolution);
  if (active(FaultKind::kSignalFrozen) != nullptr) {
    if (!channel.is_frozen) channel.frozen = channel.sent;
    channel.is_frozen = true;
    return channel.frozen;
  }
  channel.is_frozen = false;
  channel.sent = value;
  return value;
}

void VehicleBus::emit(Message& message, const FaultScript& faults, std::int64_t now_ns, double t_s,
                      std::vector<can::StampedFrame>& out) {
  const auto active = [&](FaultKind kind) { return faults.active(kind, t_s, message.name); };
  can::StampedFrame stamped;
  stamped.frame.id = message.id;
  stamped.frame.length = message.length;
  const std::span<std::uint8_t> payload(stamped.frame.data.data(), message.length);
  const bool swapped = active(FaultKind::kSignalsSwapped) != nullptr;
  const auto channel_of = [&](const Signal& signal) {
    if (!swapped) return signal.channel;
    return signal.channel == speeds_.first    ? speeds_.second
           : signal.channel == speeds_.second ? speeds_.first
                                              : signal.channel;
  };
  for (const Signal& signal : message.signals) {
    Channel& channel = channels_[channel_of(signal)];
    const double value = measure(channel, faults, t_s);
    if (faults.active(FaultKind::kSignalNotAvailable, t_s, channel.name) != nullptr) {
      signal.codec.insert(payload, ~std::uint64_t{0});
    } else {
      signal.codec.encode(payload, (value - signal.to_unit_shift) * signal.to_unit_factor);
    }
  }
  if (message.has_counter) {
    message.counter_codec.insert(payload, message.counter);
    if (active(FaultKind::kCounterFrozen) == nullptr) {
      message.counter = static_cast<std::uint8_t>((message.counter + 1) & 15);
    }
  }
  if (message.crc_byte) protect(stamped.frame, *message.crc_byte);
  double delay_s = delay_s_ + jitter_s_ * jitter_.uniform();
  const double chance = frame_random_.uniform();
  const auto bit = static_cast<std::size_t>(frame_random_.uniform() * 8.0 * message.length);
  if (active(FaultKind::kFrameSilent) != nullptr) return;
  if (const FaultStep* fault = active(FaultKind::kFrameLoss); fault && chance < fault->size) return;
  if (const FaultStep* fault = active(FaultKind::kFrameBitFlips); fault && chance < fault->size) {
    payload[bit / 8] ^= static_cast<std::uint8_t>(1U << (bit % 8));
  }
  if (active(FaultKind::kFrameTruncated) != nullptr) {
    --stamped.frame.length;
    stamped.frame.data[stamped.frame.length] = 0;
  }
  if (active(FaultKind::kFrameRepeat) != nullptr) stamped.frame = message.last;
  message.past[message.sent++ % kFramesKept] = stamped.frame;
  if (const FaultStep* fault = active(FaultKind::kFrameOld)) {
    const auto wanted =
        static_cast<std::size_t>(fault->size * 1e9 / static_cast<double>(message.period_ns));
    const std::size_t back = std::min({wanted, message.sent - 1, kFramesKept - 1});
    stamped.frame = message.past[(message.sent - 1 - back) % kFramesKept];
  }
  if (active(FaultKind::kFrameStranger) != nullptr) {
    const Message& other = &message == &messages_.front() ? messages_.back() : messages_.front();
    stamped.frame.data = other.last.data;
  }
  if (const FaultStep* fault = active(FaultKind::kFrameDelay)) delay_s += fault->size;
  if (const FaultStep* fault = active(FaultKind::kFrameJitter)) delay_s += fault->size * chance;
  message.last = stamped.frame;
  stamped.t_ns = now_ns + std::llround(delay_s * 1e9);
  out.push_back(stamped);
  if (active(FaultKind::kFrameDouble) != nullptr) {
    stamped.t_ns += message.period_ns / 2;
    out.push_back(stamped);
  }
}

void VehicleBus::sample(const VehicleSimulation& vehicle, std::vector<can::StampedFrame>& out) {
  now_ = (now_ + 1) % kPast;
  past_[now_] = vehicle.signals();
  const std::int64_t now_ns = vehicle.now_ns();
  for (Message& message : messages_) {
    if (message.next_ns > now_ns) continue;
    const double t_s = static_cast<double>(now_ns) * 1e-9;
    double interval = 1.0;  // periods
    if (const FaultStep* fault =
            vehicle.faults().active(FaultKind::kFrameSlow, t_s, message.name)) {
      interval = fault->size;
    } else if (vehicle.faults().active(FaultKind::kFrameInserted, t_s, message.name) != nullptr) {
      interval = 0.5;
    }
    message.next_ns += std::llround(interval * static_cast<double>(message.period_ns));
    emit(message, vehicle.faults(), now_ns, t_s, out);
  }
}

const can::Database& vehicle_database() {
  static const can::Database database = can::parse_dbc(shipped("vehicle.dbc")).database;
  return database;
}

std::vector<std::string> vehicle_signal_names() {
  std::vector<std::string> names;
  for (const ChannelRow& row : kChannels) names.emplace_back(row.signal);
  return names;
}

std::vector<std::string> vehicle_message_names() {
  std::vector<std::string> names;
  for (const can::MessageDef& message : vehicle_database().messages) {
    names.push_back(message.name);
  }
  return names;
}

std::string vehicle_configuration(const VehicleScenario& scenario, std::string_view interface,
                                  std::string_view dbc_file) {
  const VariatorParameters& v = scenario.variator;
  const KnownOfVehicle& known = scenario.known;
  const auto radius = [&v](double ratio) {
    return estimator::running_radii(ratio, v.belt_length_m, v.centre_distance_m).primary_m;
  };
  char text[4096];
  std::snprintf(text, sizeof text,
                "# BeltGrip in the simulated vehicle (scenario %s).\n"
                "\n"
                "[bus]\n"
                "interface = \"%.*s\"\n"
                "dbc       = [\"%.*s\"]\n"
                "\n"
                "[signals]\n"
                "primary_speed        = \"TCU_Speed.PrimarySpeed\"\n"
                "secondary_speed      = \"TCU_Speed.SecondarySpeed\"\n"
                "secondary_pressure   = \"TCU_Pressure.SecondaryPressure\"\n"
                "engine_torque        = { signal = \"ECU_Engine.EngineTorque\", offset = %.6g }\n"
                "engine_speed         = \"ECU_Engine.EngineSpeed\"\n"
                "accelerator_pedal    = \"ECU_Engine.AcceleratorPedal\"\n"
                "oil_temperature      = \"TCU_State.OilTemperature\"\n"
                "lockup_closed        = \"TCU_State.LockupClosed\"\n"
                "experiment_permitted = \"TCU_State.ExperimentPermitted\"\n"
                "vehicle_speed        = \"ESP_Vehicle.VehicleSpeed\"\n"
                "brake_pressed        = \"ESP_Vehicle.BrakePressed\"\n"
                "\n"
                "[protection]\n"
                "ECU_Engine   = { counter = \"EngineCounter\", crc = \"EngineCrc\", data_id = "
                "0x110 }\n"
                "TCU_Speed    = { counter = \"SpeedCounter\", crc = \"SpeedCrc\", data_id = 0x120 "
                "}\n"
                "TCU_Pressure = { counter = \"PressureCounter\", crc = \"PressureCrc\", data_id = "
                "0x130 }\n"
                "TCU_State    = { counter = \"StateCounter\", crc = \"StateCrc\", data_id = 0x140 "
                "}\n"
                "ESP_Vehicle  = { counter = \"VehicleCounter\", crc = \"VehicleCrc\", data_id = "
                "0x210 }\n"
                "\n"
                "[sensors]\n"
                "primary_speed      = { bias_rad_s = 0, gain = 0 }\n"
                "secondary_speed    = { bias_rad_s = 0, gain = 0 }\n"
                "engine_torque      = { bias_Nm = %.6g, gain = %.6g }\n"
                "secondary_pressure = { bias_Pa = %.6g, gain = %.6g }\n"
                "\n"
                "[variator]\n"
                "half_wedge_angle_deg       = %.6g\n"
                "ratio_low                  = %.6g\n"
                "ratio_overdrive            = %.6g\n"
                "primary_radius_overdrive_m = %.5f\n"
                "primary_radius_low_m       = %.5f\n"
                "secondary_piston_area_m2   = %.6g\n"
                "secondary_spring_force_N   = %.6g\n"
                "secondary_centrifugal_N_s2 = %.6g\n"
                "primary_inertia_kg_m2      = %.6g\n"
                "\n"
                "[experiment]\n"
                "trigger = \"%s\"\n"
                "control = \"command\"\n"
                "ratio   = \"either\"\n"
                "secondary_pressure_floor_Pa = %.6g\n"
                "actuator_dead_time_s        = %.6g\n"
                "actuator_lag_s              = %.6g\n"
                "cooldown_s                  = %.6g\n"
                "cooldown_m                  = %.6g\n",
                scenario.name.c_str(), static_cast<int>(interface.size()), interface.data(),
                static_cast<int>(dbc_file.size()), dbc_file.data(), known.torque_offset_Nm,
                known.torque_bias_Nm, known.torque_gain, known.pressure_bias_Pa,
                known.pressure_gain, v.half_wedge_angle_rad * 180.0 / std::numbers::pi, v.ratio_low,
                v.ratio_overdrive, radius(v.ratio_overdrive), radius(v.ratio_low),
                v.secondary_piston_area_m2, v.secondary_spring_force_N,
                v.secondary_centrifugal_N_s2,
                scenario.engine.inertia_kg_m2 + v.primary_inertia_kg_m2,
                known.steady ? "steady" : "coast_down", scenario.hydraulics.pressure_floor_Pa,
                1.2 * scenario.hydraulics.dead_time_s, 1.2 * scenario.hydraulics.lag_s,
                known.cooldown_s, known.cooldown_m);
  return text;
}

}  // namespace beltgrip::sim
