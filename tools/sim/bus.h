// The signals of a simulated rig or car as CAN frames: those that its DBC has, each message with
// its own period, phase and jitter; sensors with noise, bias, gain, resolution, delay and tooth
// ripple; faults of signals and frames. Simulation only.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "can_dbc/dbc/model.h"
#include "can_dbc/dbc/signal_codec.h"
#include "can_dbc/frame/can_frame.h"
#include "tools/sim/random.h"
#include "tools/sim/simulation.h"

namespace beltgrip::sim {

// A rig is one cyclic program; a car has a control unit for each message.
struct BusStyle {
  bool neighbours;          // each message measures one step after the one above it in the DBC
  bool whole_microseconds;  // stamps, as logs have them
  bool rests_before;        // before the run the signals were as at its begin; else zero
};
inline constexpr BusStyle kRigBus{true, true, true};
inline constexpr BusStyle kVehicleBus{false, false, false};

class Bus {
 public:
  Bus(const can::Database& dbc, const BusStyle& style, const World& world, std::uint64_t seed);

  // Appends the frames whose measurements fall into the present instant. Stamps are later than that
  // and not in order. Called for each step of the simulation.
  void sample(const Simulation& simulation, std::vector<can::StampedFrame>& out);

 private:
  static constexpr std::size_t kFramesKept = 128;
  struct Channel {
    std::string name;
    double (*value)(const Signals&) = nullptr;
    ChannelError error;
    double ripple = 0.0;
    double Signals::*angle = nullptr;
    bool is_torque = false;  // of the driving shaft
    Random random;
    double sent = 0.0;  // last value before faults
    double frozen = 0.0;
    bool is_frozen = false;
  };
  struct Signal {
    can::SignalCodec codec;
    std::size_t channel = 0;
    double to_unit_factor = 1.0;  // SI -> physical value of the DBC
    double to_unit_shift = 0.0;
  };
  struct Message {
    can::CanId id;
    std::string name;
    std::uint8_t length = 0;
    std::int64_t period_ns = 0;
    std::int64_t next_ns = 0;
    std::uint8_t counter = 0;
    std::vector<Signal> signals;
    can::SignalCodec counter_codec;
    bool has_counter = false;
    std::optional<std::size_t> crc_byte;
    can::CanFrame last;
    std::array<can::CanFrame, kFramesKept> past;  // as they were before frame faults
    std::size_t sent = 0;
  };

  void add_channels(const SensorParameters& sensors, std::uint64_t seed);
  void add_message(const can::MessageDef& definition, const World& world, Random& phase);
  // Steps that the slowest sensor looks back, with the worst fault.
  std::size_t longest_delay(const std::vector<FaultStep>& faults) const;
  std::size_t steps(double delay_s) const;
  // A sensor's value, with the faults of its signal.
  double measure(Channel& channel, const FaultScript& faults, double t_s);
  const Signals& before(double delay_s) const;
  void fill(Message& message, const FaultScript& faults, double t_s, can::CanFrame& frame);
  void emit(Message& message, const FaultScript& faults, std::int64_t now_ns, double t_s,
            std::vector<can::StampedFrame>& out);
  // Of the frame as a whole: false where it is not sent at all.
  bool spoil(Message& message, const FaultScript& faults, double t_s, can::CanFrame& frame,
             double& late_s);

  BusStyle style_;
  std::vector<Signals> past_;  // a ring of steps, for delays
  std::size_t now_ = 0;
  bool begun_ = false;
  std::vector<Channel> channels_;
  std::vector<estimator::LearnedTerm> learned_;
  std::pair<std::size_t, std::size_t> speeds_;  // channels of primary and secondary speed
  std::vector<Message> messages_;
  Random jitter_;
  Random frame_random_;
  double step_s_;
  double frame_delay_s_;
  double frame_jitter_s_;
};

// What a fault of a signal, or of a message, can act on.
std::vector<std::string> signal_names(const can::Database& dbc);
std::vector<std::string> message_names(const can::Database& dbc);

}  // namespace beltgrip::sim
