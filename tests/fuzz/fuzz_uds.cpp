// Any frames of an ECU and of another tester, at any distances in time, into the inputs that poll:
// whatever comes, each frame that leaves passes the gate and is one that this file allows on its
// own terms, and no value is one that no answer held.
#include <array>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstdlib>

#include "daemon/core/config/options/config.h"
#include "daemon/core/guard/tx_gate.h"
#include "daemon/core/input/input_monitor.h"

namespace {

using namespace beltgrip;
using namespace beltgrip::daemon;

void require(bool condition, int line = __builtin_LINE()) {
  if (condition) return;
  std::fprintf(stderr, "fuzz_uds.cpp:%d\n", line);
  std::abort();
}

constexpr Duration kStep = 5 * kMillisecond;
constexpr Duration kPeriod = 50 * kMillisecond;

RoleBinding role_of(Role role, std::uint8_t bus, can::CanId request, can::CanId response,
                    std::uint16_t identifier, std::uint32_t start) {
  RoleBinding binding;
  binding.role = role;
  binding.bus = bus;
  binding.uds = UdsSource{.request = request, .response = response, .identifier = identifier};
  binding.id = response;
  can::SignalDef signal;
  signal.start_bit = start;
  signal.length = 16;
  signal.byte_order = can::ByteOrder::kBig;
  binding.codec = can::SignalCodec(signal);
  binding.period_ms = 50.0;
  return binding;
}

// Two identifiers of one ECU, one of them far into a long answer, and one on the further bus.
Config make_config() {
  Config config;
  config.diagnostics = Diagnostics::kPoll;
  config.further_bus = FurtherBus{"diag", "can1", {}};
  config.roles = {
      role_of(Role::kSecondaryPressure, 0, {0x7E1, false}, {0x7E9, false}, 0x1101, 7),
      role_of(Role::kPrimaryPressure, 0, {0x7E1, false}, {0x7E9, false}, 0x1102, 20 * 8 + 7),
      role_of(Role::kOilTemperature, 1, {0x18DA10F1, true}, {0x18DAF110, true}, 0x2000, 7)};
  return config;
}

PollLimits make_limits() {
  PollLimits limits;
  limits.requests[0] = {0, {0x7E1, false}, 0x1101, kPeriod};
  limits.requests[1] = {0, {0x7E1, false}, 0x1102, kPeriod};
  limits.requests[2] = {1, {0x18DA10F1, true}, 0x2000, kPeriod};
  limits.size = 3;
  return limits;
}

// What one ECU has been sent.
struct Counts {
  MonoTime request{-kSecond};
  MonoTime foreign{-10 * kSecond};
  std::array<MonoTime, 3> last{MonoTime{-kSecond}, MonoTime{-kSecond},
                               MonoTime{-kSecond}};  // by identifier
  bool flow = false;
};

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static const Config config = make_config();
  constexpr MonoTime kEnd{200 * kSecond};
  InputMonitor inputs(config);
  FaultSet faults;
  TxGate gate({}, Control::kObserve, {}, make_limits());
  std::array<bool, kBusMax> up{true, true};
  std::array<Counts, 2> seen;
  const auto byte = [&]() -> std::uint8_t {
    return size == 0 ? std::uint8_t{0} : (--size, *data++);
  };
  MonoTime now{}, next{};
  while (size > 0 && now < kEnd) {
    const std::uint8_t step = byte();
    now += step == 255 ? 3 * kSecond : step * kMillisecond / 4;
    for (; next <= now; next += kStep) {
      Outbox outbox;
      inputs.update(next, faults);
      inputs.diagnostics().step(next, up, outbox);
      for (std::size_t i = 0; i < outbox.size; ++i) {
        const can::CanFrame& frame = outbox.frames[i];
        const std::uint8_t bus = outbox.bus[i];
        require(gate.permits(frame, bus, next));
        require(frame.id == (bus == 0 ? can::CanId{0x7E1, false} : can::CanId{0x18DA10F1, true}));
        require(frame.length == 8 && !frame.fd && !frame.remote && !frame.error);
        Counts& ecu = seen[bus];
        require(next - ecu.foreign >= 5 * kSecond - kStep);
        if (frame.data[0] == 0x03) {
          require(frame.data[1] == 0x22);
          const unsigned identifier = frame.data[2] * 256U + frame.data[3];
          require(bus == 0 ? identifier == 0x1101 || identifier == 0x1102 : identifier == 0x2000);
          MonoTime& last = ecu.last[identifier & 3U];
          require(next - last >= kPeriod / 2);
          last = ecu.request = next;
          ecu.flow = false;
        } else {
          require((frame.data[0] == 0x30 || frame.data[0] == 0x32) && !ecu.flow);
          ecu.flow = true;
        }
      }
    }
    const std::uint8_t what = byte();
    if (what >= 252) {
      up[what & 1U] = what >= 254;
      continue;
    }
    RxFrame frame;
    frame.t = now;
    frame.bus = what & 1U;
    const bool foreign = (what & 0x0EU) == 0x0E;
    frame.frame.id = frame.bus == 0 ? can::CanId{foreign ? 0x7E1U : 0x7E9U, false}
                                    : can::CanId{foreign ? 0x18DA10F1U : 0x18DAF110U, true};
    if (foreign) seen[frame.bus].foreign = now;
    frame.frame.length = (what & 0x10U) != 0 ? byte() % 9 : 8;
    frame.frame.fd = (what & 0xE0U) == 0xE0;
    for (std::size_t i = 0; i < frame.frame.length; ++i) frame.frame.data[i] = byte();
    inputs.on_frame(frame, faults);
  }
  for (const Role role :
       {Role::kSecondaryPressure, Role::kPrimaryPressure, Role::kOilTemperature}) {
    const SignalHistory& history = inputs.history(role);
    if (history.empty()) continue;
    require(history.newest_value() >= 0.0 && history.newest_value() < 65535.0);
    require(history.newest() <= now && inputs.diagnostics().counters().answers > 0);
  }
  return 0;
}
