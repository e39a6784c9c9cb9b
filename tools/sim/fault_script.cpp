#include "tools/sim/fault_script.h"

#include <limits>
#include <utility>

namespace beltgrip::sim {

const std::vector<FaultKindRow>& fault_kinds() {
  static const std::vector<FaultKindRow> rows{
      {FaultKind::kAccelerator, "accelerator"},
      {FaultKind::kBrake, "brake"},
      {FaultKind::kAbs, "abs"},
      {FaultKind::kPothole, "pothole"},
      {FaultKind::kTorqueStep, "torque_step"},
      {FaultKind::kShift, "shift"},
      {FaultKind::kLockupOpen, "lockup_open"},
      {FaultKind::kOilTemperature, "oil_temperature"},
      {FaultKind::kTcuIgnores, "tcu_ignores"},
      {FaultKind::kTcuDelays, "tcu_delays"},
      {FaultKind::kTcuUndershoots, "tcu_undershoots"},
      {FaultKind::kTcuQuantises, "tcu_quantises"},
      {FaultKind::kTcuLatches, "tcu_latches"},
      {FaultKind::kTcuWithdraws, "tcu_withdraws"},
      {FaultKind::kHydraulicLag, "hydraulic_lag"},
      {FaultKind::kSignalFrozen, "signal_frozen", FaultChannel::kSignal},
      {FaultKind::kSignalValue, "signal_value", FaultChannel::kSignal},
      {FaultKind::kSignalBias, "signal_bias", FaultChannel::kSignal},
      {FaultKind::kSignalGain, "signal_gain", FaultChannel::kSignal},
      {FaultKind::kSignalRamp, "signal_ramp", FaultChannel::kSignal},
      {FaultKind::kSignalNoise, "signal_noise", FaultChannel::kSignal},
      {FaultKind::kSignalSpike, "signal_spike", FaultChannel::kSignal},
      {FaultKind::kSignalDelay, "signal_delay", FaultChannel::kSignal},
      {FaultKind::kSignalNotAvailable, "signal_not_available", FaultChannel::kSignal},
      {FaultKind::kSignalResolution, "signal_resolution", FaultChannel::kSignal},
      {FaultKind::kSignalsSwapped, "signals_swapped"},
      {FaultKind::kFrameSilent, "frame_silent", FaultChannel::kMessage},
      {FaultKind::kFrameLoss, "frame_loss", FaultChannel::kMessage},
      {FaultKind::kFrameBitFlips, "frame_bit_flips", FaultChannel::kMessage},
      {FaultKind::kFrameTruncated, "frame_truncated", FaultChannel::kMessage},
      {FaultKind::kFrameDelay, "frame_delay", FaultChannel::kMessage},
      {FaultKind::kFrameJitter, "frame_jitter", FaultChannel::kMessage},
      {FaultKind::kFrameRepeat, "frame_repeat", FaultChannel::kMessage},
      {FaultKind::kFrameDouble, "frame_double", FaultChannel::kMessage},
      {FaultKind::kFrameOld, "frame_old", FaultChannel::kMessage},
      {FaultKind::kFrameSlow, "frame_slow", FaultChannel::kMessage},
      {FaultKind::kFrameInserted, "frame_inserted", FaultChannel::kMessage},
      {FaultKind::kCounterFrozen, "counter_frozen", FaultChannel::kMessage},
      {FaultKind::kFrameStranger, "frame_stranger", FaultChannel::kMessage},
      {FaultKind::kBusOff, "bus_off"},
      {FaultKind::kBusPassive, "bus_passive"},
      {FaultKind::kBusDown, "bus_down"},
      {FaultKind::kSendFull, "send_full"},
      {FaultKind::kSendLost, "send_lost"},
      {FaultKind::kEchoLost, "echo_lost"},
      {FaultKind::kForeignFrames, "foreign_frames"},
      {FaultKind::kFrameFlood, "frame_flood"},
      {FaultKind::kStampBack, "stamp_back"},
      {FaultKind::kLoopLate, "loop_late"},
      {FaultKind::kDaemonDies, "daemon_dies"},
  };
  return rows;
}

FaultScript::FaultScript(std::vector<FaultStep> steps) : steps_(std::move(steps)) {
  for (std::size_t i = 0; i < steps_.size(); ++i) {
    of_kind_[static_cast<std::size_t>(steps_[i].kind)].push_back(i);
  }
}

void FaultScript::request_began(double t_s) {
  if (request_s_ < 0.0) request_s_ = t_s;
}

double FaultScript::start_s(const FaultStep& step) const {
  if (!step.after_request) return step.at_s;
  return request_s_ < 0.0 ? std::numeric_limits<double>::infinity() : request_s_ + step.at_s;
}

const FaultStep* FaultScript::find(const std::vector<std::size_t>& steps, double t_s,
                                   std::string_view channel) const {
  for (const std::size_t i : steps) {
    const FaultStep& step = steps_[i];
    if (!step.channel.empty() && step.channel != channel) continue;
    const double since_s = t_s - start_s(step);
    if (since_s >= 0.0 && since_s < step.for_s) return &step;
  }
  return nullptr;
}

}  // namespace beltgrip::sim
