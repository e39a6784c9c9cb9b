#include "tools/sim/bus.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string_view>

#include "can_dbc/text/unit_text.h"
#include "tools/sim/learned_conditions.h"

namespace beltgrip::sim {

namespace {

constexpr std::string_view kCounterSuffix = "Counter", kCrcSuffix = "Crc";

// Every signal that a rig or a car can have on its bus. Which ones it has, its DBC says.
struct ChannelRow {
  std::string_view signal;  // name in the DBC
  double (*value)(const Signals&);
  ChannelError SensorParameters::*error = nullptr;
  bool noise_only = false;  // of that error
};
const ChannelRow kChannels[] = {
    {"EngineSpeed", [](const Signals& s) { return s.omega_e_rad_s; },
     &SensorParameters::engine_speed},
    {"EngineTorque", [](const Signals& s) { return s.torque_e_Nm; }, &SensorParameters::torque},
    {"AcceleratorPedal", [](const Signals& s) { return s.accelerator; }},
    {"PrimarySpeed", [](const Signals& s) { return s.omega_p_rad_s; },
     &SensorParameters::primary_speed},
    {"SecondarySpeed", [](const Signals& s) { return s.omega_s_rad_s; },
     &SensorParameters::secondary_speed},
    {"PrimaryTorque", [](const Signals& s) { return s.torque_p_Nm; }, &SensorParameters::torque},
    // A second flange of the same kind, with errors of its own.
    {"SecondaryTorque", [](const Signals& s) { return s.torque_s_Nm; }, &SensorParameters::torque,
     true},
    {"SecondaryPressure", [](const Signals& s) { return s.secondary_pressure_Pa; },
     &SensorParameters::pressure},
    {"PrimaryPressure", [](const Signals& s) { return s.primary_pressure_Pa; },
     &SensorParameters::pressure},
    {"SecondaryPressureCommand", [](const Signals& s) { return s.secondary_pressure_command_Pa; }},
    {"OilTemperature", [](const Signals& s) { return s.oil_degC; }, &SensorParameters::temperature},
    {"LockupClosed", [](const Signals& s) { return s.lockup_closed; }},
    {"ExperimentPermitted", [](const Signals& s) { return s.experiment_permitted; }},
    {"VehicleSpeed", [](const Signals& s) { return s.speed_m_s; }},
    {"BrakePressed", [](const Signals& s) { return s.brake_pressed; }},
    {"ExperimentActive", [](const Signals& s) { return s.mode == RigMode::kLowering ? 1.0 : 0.0; }},
    {"RigMode", [](const Signals& s) { return static_cast<double>(s.mode); }},
};

bool carries(const can::MessageDef& message, std::string_view name) {
  return std::any_of(message.signals.begin(), message.signals.end(),
                     [&](const can::SignalDef& signal) { return signal.name == name; });
}

bool carries(const can::Database& dbc, std::string_view name) {
  return std::any_of(dbc.messages.begin(), dbc.messages.end(),
                     [&](const can::MessageDef& message) { return carries(message, name); });
}

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

Bus::Bus(const can::Database& dbc, const BusStyle& style, const World& world, std::uint64_t seed)
    : style_(style),
      jitter_(seed, "frame jitter"),
      frame_random_(seed, "frame faults"),
      step_s_(world.step_s),
      frame_delay_s_(world.sensors.frame_delay_s),
      frame_jitter_s_(world.sensors.frame_jitter_s) {
  learned_ = world.learned;
  SensorParameters sensors = world.sensors;
  sensors.add(world.effects);
  add_channels(sensors, seed);
  Random phase(seed, "frame phase");
  for (const can::MessageDef& definition : dbc.messages) {
    add_message(definition, world, phase);
  }
  past_.resize(longest_delay(world.faults) + 1);
}

void Bus::add_channels(const SensorParameters& sensors, std::uint64_t seed) {
  for (const ChannelRow& row : kChannels) {
    Channel channel{std::string(row.signal),
                    row.value,
                    {},
                    0.0,
                    nullptr,
                    row.error == &SensorParameters::torque && !row.noise_only,
                    Random(seed, row.signal)};
    if (row.noise_only) {
      channel.error.noise = (sensors.*row.error).noise;
    } else if (row.error != nullptr) {
      channel.error = sensors.*row.error;
    }
    channel.error.delay_s += sensors.lag_s;
    if (row.signal == "PrimarySpeed") {
      channel.ripple = sensors.primary_ripple;
      channel.angle = &Signals::angle_p_rad;
      speeds_.first = channels_.size();
    } else if (row.signal == "SecondarySpeed") {
      channel.ripple = sensors.secondary_ripple;
      channel.angle = &Signals::angle_s_rad;
      speeds_.second = channels_.size();
    }
    channels_.push_back(std::move(channel));
  }
}

void Bus::add_message(const can::MessageDef& definition, const World& world, Random& phase) {
  Message message;
  message.id = definition.id;
  message.name = definition.name;
  message.length = static_cast<std::uint8_t>(definition.length);
  const bool slow =
      world.sensors.pressure_period_s > 0.0 && carries(definition, "SecondaryPressure");
  message.period_ns = slow ? std::llround(world.sensors.pressure_period_s * 1e9)
                           : std::llround(definition.cycle_ms.value_or(0.0) * 1e6);
  if (message.period_ns <= 0) throw std::logic_error(definition.name + " has no cycle time");
  message.next_ns =
      style_.neighbours
          ? static_cast<std::int64_t>(messages_.size()) * std::llround(world.step_s * 1e9)
          : static_cast<std::int64_t>(phase.uniform() * static_cast<double>(message.period_ns));
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
      throw std::logic_error(signal.name + " is not a signal of the simulation");
    }
    message.signals.push_back({can::SignalCodec(signal),
                               static_cast<std::size_t>(row - std::begin(kChannels)),
                               1.0 / unit->factor, unit->offset});
  }
  messages_.push_back(std::move(message));
}

// Whole steps; what is a multiple of the step but for its rounding counts as one.
std::size_t Bus::steps(double delay_s) const {
  constexpr double kRounding = 1e-6, kMost = 2e5;
  return static_cast<std::size_t>(std::clamp(delay_s / step_s_ + kRounding, 0.0, kMost));
}

std::size_t Bus::longest_delay(const std::vector<FaultStep>& faults) const {
  double sensor_s = 0.0, fault_s = 0.0;
  for (const Channel& channel : channels_) sensor_s = std::max(sensor_s, channel.error.delay_s);
  for (const FaultStep& fault : faults) {
    if (fault.kind == FaultKind::kSignalDelay) fault_s = std::max(fault_s, fault.size);
  }
  return steps(sensor_s + fault_s);
}

const Signals& Bus::before(double delay_s) const {
  return past_[(now_ + past_.size() - std::min(steps(delay_s), past_.size() - 1)) % past_.size()];
}

double Bus::measure(Channel& channel, const FaultScript& faults, double t_s) {
  const auto active = [&](FaultKind kind) { return faults.active(kind, t_s, channel.name); };
  double delay_s = channel.error.delay_s;
  if (const FaultStep* fault = active(FaultKind::kSignalDelay)) delay_s += fault->size;
  const Signals& then = before(delay_s);
  double value = channel.value(then) * (1.0 + channel.error.gain);
  if (channel.is_torque) {
    value *= 1.0 + learned_at(learned_, estimator::LearnedPoint::kTorqueGain, conditions(then));
  }
  if (channel.ripple != 0.0) value *= 1.0 + channel.ripple * std::sin(then.*channel.angle);
  value += channel.error.bias;
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

void Bus::fill(Message& message, const FaultScript& faults, double t_s, can::CanFrame& frame) {
  frame.id = message.id;
  frame.length = message.length;
  const std::span<std::uint8_t> payload(frame.data.data(), message.length);
  const bool swapped = faults.active(FaultKind::kSignalsSwapped, t_s, message.name) != nullptr;
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
    if (faults.active(FaultKind::kCounterFrozen, t_s, message.name) == nullptr) {
      message.counter = static_cast<std::uint8_t>((message.counter + 1) & 15);
    }
  }
  if (message.crc_byte) protect(frame, *message.crc_byte);
}

bool Bus::spoil(Message& message, const FaultScript& faults, double t_s, can::CanFrame& frame,
                double& late_s) {
  const auto active = [&](FaultKind kind) { return faults.active(kind, t_s, message.name); };
  // Drawn for each frame: which one a fault meets does not depend on the other faults.
  const double chance = frame_random_.uniform();
  const auto bit = static_cast<std::size_t>(frame_random_.uniform() * 8.0 * message.length);
  if (active(FaultKind::kFrameSilent) != nullptr) return false;
  if (const FaultStep* fault = active(FaultKind::kFrameLoss); fault && chance < fault->size) {
    return false;
  }
  if (const FaultStep* fault = active(FaultKind::kFrameBitFlips); fault && chance < fault->size) {
    frame.data[bit / 8] ^= static_cast<std::uint8_t>(1U << (bit % 8));
  }
  if (active(FaultKind::kFrameTruncated) != nullptr) {
    --frame.length;
    frame.data[frame.length] = 0;
  }
  if (active(FaultKind::kFrameRepeat) != nullptr) frame = message.last;
  message.past[message.sent++ % kFramesKept] = frame;
  if (const FaultStep* fault = active(FaultKind::kFrameOld)) {
    const auto wanted =
        static_cast<std::size_t>(fault->size * 1e9 / static_cast<double>(message.period_ns));
    const std::size_t back = std::min({wanted, message.sent - 1, kFramesKept - 1});
    frame = message.past[(message.sent - 1 - back) % kFramesKept];
  }
  if (active(FaultKind::kFrameStranger) != nullptr) {
    const Message& other = &message == &messages_.front() ? messages_.back() : messages_.front();
    frame.data = other.last.data;
  }
  if (const FaultStep* fault = active(FaultKind::kFrameDelay)) late_s += fault->size;
  if (const FaultStep* fault = active(FaultKind::kFrameJitter)) late_s += fault->size * chance;
  message.last = frame;
  return true;
}

void Bus::emit(Message& message, const FaultScript& faults, std::int64_t now_ns, double t_s,
               std::vector<can::StampedFrame>& out) {
  can::StampedFrame stamped;
  fill(message, faults, t_s, stamped.frame);
  double late_s = frame_delay_s_ + frame_jitter_s_ * jitter_.uniform();
  if (!faults.empty() && !spoil(message, faults, t_s, stamped.frame, late_s)) return;
  if (style_.whole_microseconds) {
    stamped.t_ns = now_ns + static_cast<std::int64_t>(late_s * 1e9);
    stamped.t_ns -= stamped.t_ns % 1000;
  } else {
    stamped.t_ns = now_ns + std::llround(late_s * 1e9);
  }
  out.push_back(stamped);
  if (faults.active(FaultKind::kFrameDouble, t_s, message.name) != nullptr) {
    stamped.t_ns += message.period_ns / 2;
    out.push_back(stamped);
  }
}

void Bus::sample(const Simulation& simulation, std::vector<can::StampedFrame>& out) {
  if (!begun_ && style_.rests_before) std::fill(past_.begin(), past_.end(), simulation.signals());
  begun_ = true;
  now_ = (now_ + 1) % past_.size();
  past_[now_] = simulation.signals();
  const std::int64_t now_ns = simulation.now_ns();
  const double t_s = static_cast<double>(now_ns) * 1e-9;
  for (Message& message : messages_) {
    if (message.next_ns > now_ns) continue;
    double interval = 1.0;  // periods
    if (const FaultStep* fault =
            simulation.faults().active(FaultKind::kFrameSlow, t_s, message.name)) {
      interval = fault->size;
    } else if (simulation.faults().active(FaultKind::kFrameInserted, t_s, message.name) !=
               nullptr) {
      interval = 0.5;
    }
    message.next_ns += std::llround(interval * static_cast<double>(message.period_ns));
    emit(message, simulation.faults(), now_ns, t_s, out);
  }
}

std::vector<std::string> signal_names(const can::Database& dbc) {
  std::vector<std::string> names;
  for (const ChannelRow& row : kChannels) {
    if (carries(dbc, row.signal)) names.emplace_back(row.signal);
  }
  return names;
}

std::vector<std::string> message_names(const can::Database& dbc) {
  std::vector<std::string> names;
  names.reserve(dbc.messages.size());
  for (const can::MessageDef& message : dbc.messages) names.push_back(message.name);
  return names;
}

}  // namespace beltgrip::sim
