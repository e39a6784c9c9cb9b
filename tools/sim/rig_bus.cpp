#include "tools/sim/rig_bus.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string_view>

#include "can_dbc/text/unit_text.h"

namespace beltgrip::sim {

namespace {

struct ChannelRow {
  std::string_view signal;  // name in the DBC
  double (*value)(const RigSignals&);
  double Scenario::*noise;
  double Scenario::*bias;
};

const ChannelRow kChannels[] = {
    {"PrimarySpeed", [](const RigSignals& s) { return s.omega_p_rad_s; },
     &Scenario::primary_speed_noise_rad_s, nullptr},
    {"SecondarySpeed", [](const RigSignals& s) { return s.omega_s_rad_s; },
     &Scenario::secondary_speed_noise_rad_s, nullptr},
    {"PrimaryTorque", [](const RigSignals& s) { return s.torque_p_Nm; }, &Scenario::torque_noise_Nm,
     &Scenario::torque_bias_Nm},
    {"SecondaryTorque", [](const RigSignals& s) { return s.torque_s_Nm; },
     &Scenario::torque_noise_Nm, nullptr},
    {"SecondaryPressure", [](const RigSignals& s) { return s.pressure_Pa; },
     &Scenario::pressure_noise_Pa, &Scenario::pressure_bias_Pa},
    {"SecondaryPressureCommand", [](const RigSignals& s) { return s.pressure_command_Pa; }, nullptr,
     nullptr},
    {"OilTemperature", [](const RigSignals& s) { return s.oil_degC; }, nullptr, nullptr},
    {"ExperimentActive",
     [](const RigSignals& s) { return s.mode == RigMode::kLowering ? 1.0 : 0.0; }, nullptr,
     nullptr},
    {"RigMode", [](const RigSignals& s) { return static_cast<double>(s.mode); }, nullptr, nullptr},
};
constexpr std::string_view kCounterSuffix = "Counter";

}  // namespace

RigBus::RigBus(const can::Database& dbc, const Scenario& scenario, std::uint64_t seed)
    : jitter_(seed, "frame jitter"),
      delay_ns_(std::llround(scenario.frame_delay_s * 1e9)),
      jitter_ns_(scenario.frame_jitter_s * 1e9) {
  const std::int64_t step_ns = std::llround(scenario.step_s * 1e9);
  for (const ChannelRow& row : kChannels) {
    channels_.push_back({row.value, row.noise ? scenario.*row.noise : 0.0,
                         row.bias ? scenario.*row.bias : 0.0, Random(seed, row.signal)});
  }
  add_errors(scenario.effects, scenario.step_s);
  for (const can::MessageDef& definition : dbc.messages) {
    Message message;
    message.id = definition.id;
    message.length = static_cast<std::uint8_t>(definition.length);
    message.period_ns = std::llround(definition.cycle_ms.value_or(0.0) * 1e6);
    // Neighbours in the file measure one step after each other, as a cyclic program does.
    message.next_ns = static_cast<std::int64_t>(messages_.size()) * step_ns;
    if (message.period_ns <= 0) throw std::logic_error(definition.name + " has no cycle time");
    for (const can::SignalDef& signal : definition.signals) {
      if (signal.name.ends_with(kCounterSuffix)) {
        message.counter_codec = can::SignalCodec(signal);
        message.has_counter = true;
        continue;
      }
      const auto row = std::find_if(std::begin(kChannels), std::end(kChannels),
                                    [&](const ChannelRow& r) { return r.signal == signal.name; });
      const auto unit = signal.unit.empty() ? can::Unit{} : can::parse_unit(signal.unit);
      if (row == std::end(kChannels) || !unit) {
        throw std::logic_error(signal.name + " is not a signal of the rig");
      }
      message.signals.push_back({can::SignalCodec(signal),
                                 static_cast<std::size_t>(row - std::begin(kChannels)),
                                 1.0 / unit->factor, unit->offset});
    }
    messages_.push_back(std::move(message));
  }
}

// What a model file says of the measuring chain. A channel that leads makes all others lag.
void RigBus::add_errors(const estimator::MachineEffects& effects, double step_s) {
  const double lead_s =
      std::max({0.0, -effects.primary_speed_delay_s, -effects.secondary_speed_delay_s,
                -effects.torque_delay_s, -effects.pressure_delay_s});
  std::size_t longest = 0;
  for (std::size_t i = 0; i < channels_.size(); ++i) {
    Channel& channel = channels_[i];
    const std::string_view name = kChannels[i].signal;
    double delay_s = lead_s;
    if (name == "PrimarySpeed") {
      channel.gain = effects.primary_speed_scale;
      channel.ripple = effects.primary_ripple;
      channel.angle = &RigSignals::angle_p_rad;
      delay_s += effects.primary_speed_delay_s;
    } else if (name == "SecondarySpeed") {
      channel.gain = effects.secondary_speed_scale;
      channel.ripple = effects.secondary_ripple;
      channel.angle = &RigSignals::angle_s_rad;
      delay_s += effects.secondary_speed_delay_s;
    } else if (name == "PrimaryTorque") {
      channel.gain = effects.torque_gain;
      channel.bias += effects.torque_bias_Nm;
      delay_s += effects.torque_delay_s;
    } else if (name == "SecondaryPressure") {
      channel.gain = effects.pressure_gain;
      channel.bias += effects.pressure_offset_Pa;
      delay_s += effects.pressure_delay_s;
    }
    channel.delay_steps = static_cast<std::size_t>(std::lround(delay_s / step_s));
    longest = std::max(longest, channel.delay_steps);
  }
  past_.resize(longest + 1);
}

double RigBus::measure(Channel& channel) const {
  const RigSignals& then =
      past_[(now_ + past_.size() - std::min(channel.delay_steps, past_.size() - 1)) % past_.size()];
  double value = channel.value(then) * (1.0 + channel.gain);
  if (channel.ripple != 0.0) value *= 1.0 + channel.ripple * std::sin(then.*channel.angle);
  return value + channel.bias +
         (channel.noise > 0.0 ? channel.noise * channel.random.normal() : 0.0);
}

void RigBus::sample(std::int64_t now_ns, std::int64_t step_ns, const RigSignals& signals,
                    std::vector<can::StampedFrame>& out) {
  const auto first = static_cast<std::ptrdiff_t>(out.size());
  if (now_ns == 0) std::fill(past_.begin(), past_.end(), signals);
  now_ = (now_ + 1) % past_.size();
  past_[now_] = signals;
  for (Message& message : messages_) {
    if (message.next_ns >= now_ns + step_ns) continue;
    message.next_ns += message.period_ns;
    can::StampedFrame stamped;
    // Whole microseconds, as logs have them.
    stamped.t_ns = now_ns + delay_ns_ + static_cast<std::int64_t>(jitter_ns_ * jitter_.uniform());
    stamped.t_ns -= stamped.t_ns % 1000;
    stamped.frame.id = message.id;
    stamped.frame.length = message.length;
    const std::span<std::uint8_t> payload(stamped.frame.data.data(), message.length);
    for (const Signal& signal : message.signals) {
      Channel& channel = channels_[signal.channel];
      const double value = measure(channel);
      signal.codec.encode(payload, (value - signal.to_unit_shift) * signal.to_unit_factor);
    }
    if (message.has_counter) {
      message.counter_codec.insert(payload, message.counter);
      message.counter = static_cast<std::uint8_t>((message.counter + 1) & 15);
    }
    out.push_back(stamped);
  }
  std::stable_sort(
      out.begin() + first, out.end(),
      [](const can::StampedFrame& a, const can::StampedFrame& b) { return a.t_ns < b.t_ns; });
}

}  // namespace beltgrip::sim
