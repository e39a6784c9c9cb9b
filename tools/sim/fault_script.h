// Timed faults as data: what goes wrong, when, for how long and how much. Plant faults act on the
// driver and the road, controller faults on the transmission controller, signal and frame faults on
// what is sent, bus faults on the daemon's port. Simulation only.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

namespace beltgrip::sim {

enum class FaultKind : std::uint8_t {
  // Driver and road (rows V12, V13, X13). size as named.
  kAccelerator,  // pedal to size (0..1)
  kBrake,        // size m/s^2
  kAbs,          // wheel-slip control: brake torque swings by size Nm at the secondary shaft, 8 Hz
  kPothole,      // size Nm at the secondary shaft
  kTorqueStep,   // engine torque changes by size Nm
  kShift,        // the controller wants another ratio: r_g target times size
  kLockupOpen,
  kOilTemperature,  // sensor reads size degC
  // Controller (rows X11, X12)
  kTcuIgnores,      // requests are not obeyed
  kTcuDelays,       // by size s
  kTcuUndershoots,  // force = size * wanted
  kTcuQuantises,    // to size N
  kTcuLatches,      // never lets go; own time-out broken
  kTcuWithdraws,    // experiment_permitted falls
  kHydraulicLag,    // lag and dead time times size
  // Signals (row V); channel names the role's signal
  kSignalFrozen,
  kSignalValue,         // reads size (SI)
  kSignalBias,          // plus size (SI)
  kSignalGain,          // times size
  kSignalRamp,          // plus size per second (SI)
  kSignalNoise,         // noise times size
  kSignalSpike,         // plus size (SI), for one frame
  kSignalDelay,         // by size s
  kSignalNotAvailable,  // all ones
  kSignalResolution,    // steps of size (SI)
  kSignalsSwapped,      // each shaft's speed in the other's place (V10)
  // Frames (rows E, B); channel names the message, "" = every message
  kFrameSilent,
  kFrameLoss,       // share size is lost
  kFrameBitFlips,   // share size has one bit flipped
  kFrameTruncated,  // one byte less
  kFrameDelay,      // by size s
  kFrameJitter,     // by up to size s
  kFrameRepeat,     // the last one again instead of a new one
  kFrameDouble,     // each twice
  kFrameOld,        // valid, but as it was size s before (E7)
  kFrameSlow,       // size periods apart
  kFrameInserted,   // as often again, with values, counter and CRC as they should be (E11)
  kCounterFrozen,   // the counter stands, the values move (E6)
  kFrameStranger,   // another message's payload under this identifier (E8)
  // Bus and port (row B); size as named
  kBusOff,
  kBusPassive,
  kBusDown,
  kSendFull,       // nothing can be sent
  kSendLost,       // sent frames vanish without echo
  kEchoLost,       // sent frames arrive, echoes do not
  kForeignFrames,  // another node sends BeltGripClamp requests of size N
  kFrameFlood,     // size frames of a foreign identifier within 10 ms (B10)
  kStampBack,      // receive stamps lie size s in the past (T2)
  kLoopLate,       // the daemon is not run for size s (T3, T4, B11)
  kDaemonDies      // the daemon is gone from here on (G5)
};

// What a fault's channel names; without one it acts on all of them.
enum class FaultChannel : std::uint8_t { kNone, kSignal, kMessage };

struct FaultKindRow {
  FaultKind kind;
  std::string_view name;  // in scenario files
  FaultChannel channel = FaultChannel::kNone;
};
const std::vector<FaultKindRow>& fault_kinds();

struct FaultStep {
  FaultKind kind{};
  std::string channel;
  double at_s = 0.0;
  bool after_request = false;  // at_s counts from the first request the controller obeys
  double for_s = 0.0;
  double size = 0.0;
};

// The script against the run: which steps act now.
class FaultScript {
 public:
  explicit FaultScript(std::vector<FaultStep> steps);
  void request_began(double t_s);
  // The step of that kind (and channel) acting at t_s, or null.
  const FaultStep* active(FaultKind kind, double t_s, std::string_view channel = {}) const {
    // Asked dozens of times a step, of kinds that hardly any script has.
    const std::vector<std::size_t>& steps = of_kind_[static_cast<std::size_t>(kind)];
    return steps.empty() ? nullptr : find(steps, t_s, channel);
  }
  // Time since that step began.
  double since_s(const FaultStep& step, double t_s) const { return t_s - start_s(step); }
  bool empty() const { return steps_.empty(); }

 private:
  double start_s(const FaultStep& step) const;
  const FaultStep* find(const std::vector<std::size_t>& steps, double t_s,
                        std::string_view channel) const;
  std::vector<FaultStep> steps_;
  // Their places, in the script's order.
  std::array<std::vector<std::size_t>, 1 + static_cast<std::size_t>(FaultKind::kDaemonDies)>
      of_kind_;
  double request_s_ = -1.0;
};

}  // namespace beltgrip::sim
