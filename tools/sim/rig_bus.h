// The rig's signals as CAN frames: each message with its own period and phase, sensors with noise
// and the DBC's resolution, a counter, and the delay to the end of the frame. Simulation only.
#pragma once

#include <cstdint>
#include <vector>

#include "can_dbc/dbc/model.h"
#include "can_dbc/dbc/signal_codec.h"
#include "can_dbc/frame/can_frame.h"
#include "tools/sim/random.h"
#include "tools/sim/rig_simulation.h"
#include "tools/sim/scenario.h"

namespace beltgrip::sim {

class RigBus {
 public:
  RigBus(const can::Database& dbc, const Scenario& scenario, std::uint64_t seed);

  // Appends the frames whose measurements fall into this instant, in order of their stamps. Called
  // for each step of the simulation.
  void sample(std::int64_t now_ns, std::int64_t step_ns, const RigSignals& signals,
              std::vector<can::StampedFrame>& out);

 private:
  struct Signal {
    can::SignalCodec codec;
    std::size_t channel = 0;
    double to_unit_factor = 1.0;  // SI -> physical value of the DBC
    double to_unit_shift = 0.0;
  };
  struct Message {
    can::CanId id;
    std::uint8_t length = 0;
    std::int64_t period_ns = 0;
    std::int64_t next_ns = 0;
    std::uint8_t counter = 0;
    std::vector<Signal> signals;
    can::SignalCodec counter_codec;
    bool has_counter = false;
  };
  struct Channel {
    double (*value)(const RigSignals&) = nullptr;
    double noise = 0.0;
    double bias = 0.0;
    Random random;
    double gain = 0.0;
    std::size_t delay_steps = 0;
    double ripple = 0.0;
    double RigSignals::*angle = nullptr;
  };

  void add_errors(const estimator::MachineEffects& effects, double step_s);
  double measure(Channel& channel) const;

  std::vector<RigSignals> past_;  // a ring of steps, for delays
  std::size_t now_ = 0;
  std::vector<Channel> channels_;
  std::vector<Message> messages_;
  Random jitter_;
  std::int64_t delay_ns_;
  double jitter_ns_;
};

}  // namespace beltgrip::sim
