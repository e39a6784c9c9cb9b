#include "tests/loop/detectable.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>

#include "tools/sim/configuration.h"

namespace beltgrip::test {

namespace {

constexpr double kNever = 1e9;
constexpr double kStale_s = 0.05, kStalePeriods = 2.5;
constexpr double kConfirmation_s = 0.020;
constexpr double kForeign_s = 10.0;
constexpr double kRounding = 1e-6;
constexpr std::uint32_t kBusOff = 0x40, kRestarted = 0x100;
constexpr std::uint32_t kFirstOwn = 0x6A0, kLastOwn = 0x6A3, kClamp = 0x6A2;
constexpr double kAny = std::numeric_limits<double>::infinity();

struct Row {
  const char* name;
  bool flag;
  double below, above;  // in the DBC's unit
};

}  // namespace

namespace {

// Time from one frame of a message to the next, as the user said it, or the DBC.
double period_s(const daemon::Config& config, const can::MessageDef& message) {
  for (const daemon::RoleBinding& role : config.roles) {
    if (!role.uds && role.id == message.id && role.period_ms) return 1e-3 * *role.period_ms;
  }
  return 1e-3 * message.cycle_ms.value();
}

}  // namespace

Detectable::Detectable(const daemon::Config& config) {
  const bool coast = config.trigger == daemon::Trigger::kCoastDown;
  const Row rows[] = {
      {"PrimarySpeed", false, -kAny, kAny},
      {"SecondarySpeed", false, -kAny, kAny},
      {"SecondaryPressure", false, -kAny, kAny},
      {"EngineTorque", false, -kAny, kAny},
      {"AcceleratorPedal", false, -kAny, coast ? 5.0 : kAny},
      {"BrakePressed", true, -kAny, 0.5},
      {"LockupClosed", true, 0.5, kAny},
      {"ExperimentPermitted", true, 0.5, kAny},
      {"OilTemperature", false, config.experiment.oil_temperature_min_degC - 1.0, kAny}};
  for (const Row& row : rows) {
    for (const can::MessageDef& message : sim::vehicle_database().messages) {
      for (const can::SignalDef& signal : message.signals) {
        if (signal.name != row.name) continue;
        Signal out;
        out.name = row.name;
        out.id = message.id;
        out.length = static_cast<std::uint8_t>(message.length);
        out.codec = can::SignalCodec(signal);
        out.minimum = signal.usage->minimum;
        out.maximum = signal.usage->maximum;
        out.stale_s = std::max(kStale_s, kStalePeriods * period_s(config, message));
        out.flag = row.flag;
        out.below = row.below;
        out.above = row.above;
        signals_.push_back(out);
      }
    }
  }
  for (const can::MessageDef& definition : sim::vehicle_database().messages) {
    Message message;
    message.id = definition.id;
    message.length = static_cast<std::uint8_t>(definition.length);
    message.period_s = period_s(config, definition);
    for (const can::SignalDef& signal : definition.signals) {
      if (signal.name.ends_with("Counter")) message.counter = can::SignalCodec(signal);
      if (signal.name.ends_with("Crc")) message.crc_byte = signal.start_bit / 8;
    }
    messages_.push_back(message);
  }
  if (signals_.size() != std::size(rows)) throw std::logic_error("vehicle.dbc lacks a signal");
}

bool Detectable::admit(Message& message, double t_s, const can::CanFrame& frame) {
  // Sixteen intervals in less than 0.65 or more than 1.75 of their time; a pause begins anew.
  if (!message.times_s.empty() &&
      t_s - message.times_s.back() > std::max(kStale_s, kStalePeriods * message.period_s)) {
    message.times_s.clear();
    message.rate_s = kNever;
  }
  message.times_s.push_back(t_s);
  if (message.times_s.size() > 16) {
    const double took = t_s - message.times_s[message.times_s.size() - 17];
    const double share = took / (16.0 * message.period_s);
    const bool wrong = share < 0.65 - kRounding || share > 1.75 + kRounding;
    message.rate_s = wrong ? std::min(message.rate_s, t_s) : kNever;
  }
  unsigned crc = 0;
  const auto add = [&crc](unsigned byte) {
    crc ^= byte;
    for (int bit = 0; bit < 8; ++bit) crc = (crc & 0x80U) != 0 ? crc << 1 ^ 0x11DU : crc << 1;
  };
  add(frame.id.value & 0xFFU);
  add(frame.id.value >> 8);
  for (std::size_t i = 0; i < frame.length; ++i) {
    if (i != message.crc_byte) add(frame.data[i]);
  }
  bool good = crc == frame.data[message.crc_byte];
  if (good) {
    const int counter = static_cast<int>(message.counter.raw(frame.payload()));
    const int step = message.last < 0 ? 1 : (counter - message.last + 16) % 16;
    message.last = counter;
    good = step >= 1 && step <= 3;
    if (step > 3) message.invalid_s = std::min(message.invalid_s, t_s);
  }
  message.good.push_back(good);
  const std::size_t count = message.good.size();
  const auto good_of = [&](std::size_t last) {
    return std::count(message.good.end() - static_cast<std::ptrdiff_t>(std::min(last, count)),
                      message.good.end(), true);
  };
  const auto seen = static_cast<std::ptrdiff_t>(std::min<std::size_t>(8, count));
  if (seen - good_of(8) >= 3) message.invalid_s = std::min(message.invalid_s, t_s);
  if (message.invalid_s < kNever && count >= 5 && good_of(5) == 5) {
    message.invalid_s = kNever;
    message.good.assign(5, true);
  }
  return good && message.invalid_s == kNever;
}

void Detectable::on_received(const daemon::RxFrame& received) {
  const can::CanFrame& frame = received.frame;
  const double t_s = static_cast<double>(received.t.ns()) * 1e-9;
  if (frame.error) {
    if (frame.id.value == kBusOff) off_s_ = t_s;
    if (frame.id.value == kRestarted) off_s_ = kNever;
    return;
  }
  if (frame.id.value >= kFirstOwn && frame.id.value <= kLastOwn) {
    if (!received.own_echo) {
      // Forgotten after a while without another.
      if (t_s >= foreign_until_s_) foreign_s_ = t_s;
      foreign_until_s_ = t_s + kForeign_s;
    }
    if (received.own_echo && frame.id.value == kClamp) unconfirmed_s_ = kNever;
    return;
  }
  for (Message& message : messages_) {
    if (message.id != frame.id || frame.length != message.length) continue;
    if (!admit(message, t_s, frame)) return;
  }
  for (Signal& signal : signals_) {
    if (signal.id != frame.id || frame.length != signal.length) continue;
    const std::uint64_t raw = signal.codec.raw(frame.payload());
    const double value = signal.codec.physical(raw);
    const bool ranged = signal.minimum < signal.maximum;
    const bool good = ranged ? value >= signal.minimum - 1e-9 && value <= signal.maximum + 1e-9
                             : !signal.codec.is_all_ones(raw);
    if (!good || (signal.flag && value != 0.0 && value != 1.0)) continue;
    signal.last_s = t_s;
    const bool reason = value < signal.below || value > signal.above;
    signal.since_s = reason ? std::min(signal.since_s, t_s) : kNever;
  }
}

void Detectable::on_sent(double t_s, const can::CanFrame& frame) {
  if (frame.id.value == kClamp) unconfirmed_s_ = std::min(unconfirmed_s_, t_s);
}

std::optional<Detectable::Reason> Detectable::at(double t_s) const {
  std::optional<Reason> first;
  const auto offer = [&](double since_s, const std::string& what) {
    if (since_s <= t_s && (!first || since_s < first->since_s)) first = Reason{since_s, what};
  };
  if (t_s < foreign_until_s_) offer(foreign_s_, "foreign sender");
  offer(off_s_, "bus off");
  offer(unconfirmed_s_ + kConfirmation_s, "no confirmation");
  for (const Message& message : messages_) {
    offer(message.invalid_s, "counter or CRC");
    offer(message.rate_s, "rate");
  }
  for (const Signal& signal : signals_) {
    offer(signal.since_s, signal.name);
    if (signal.last_s < kNever) offer(signal.last_s + signal.stale_s, signal.name + " silent");
  }
  return first;
}

}  // namespace beltgrip::test
