// The vehicle's signals as CAN frames: each message with its own period, phase and jitter; sensors
// with noise, bias, gain, resolution, delay and tooth ripple; faults of signals and frames.
// Simulation only.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "can_dbc/dbc/model.h"
#include "can_dbc/dbc/signal_codec.h"
#include "can_dbc/frame/can_frame.h"
#include "tools/sim/random.h"
#include "tools/sim/vehicle_simulation.h"

namespace beltgrip::sim {

class VehicleBus {
 public:
  VehicleBus(const can::Database& dbc, const VehicleScenario& scenario, std::uint64_t seed);

  // Appends the frames whose measurements fall into the step that has just been made. Stamps are
  // later than now and not in order.
  void sample(const VehicleSimulation& vehicle, std::vector<can::StampedFrame>& out);

 private:
  static constexpr std::size_t kFramesKept = 128;
  struct Channel {
    std::string name;
    double (*value)(const VehicleSignals&) = nullptr;
    ChannelError error;
    double ripple = 0.0;
    double (*angle)(const VehicleSignals&) = nullptr;
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

  double measure(Channel& channel, const FaultScript& faults, double t_s);
  void emit(Message& message, const FaultScript& faults, std::int64_t now_ns, double t_s,
            std::vector<can::StampedFrame>& out);

  static constexpr std::size_t kPast = 4096;
  std::vector<VehicleSignals> past_;  // a ring of steps, for delays
  std::size_t now_ = 0;
  std::vector<Channel> channels_;
  std::pair<std::size_t, std::size_t> speeds_;  // channels of primary and secondary speed
  std::vector<Message> messages_;
  Random jitter_;
  Random frame_random_;
  double step_s_;
  double delay_s_;
  double jitter_s_;
};

// The vehicle's DBC, and the configuration of BeltGrip that fits the scenario.
const can::Database& vehicle_database();
// What a fault of a signal, or of a message, can act on.
std::vector<std::string> vehicle_signal_names();
std::vector<std::string> vehicle_message_names();
std::string vehicle_configuration(const VehicleScenario& scenario, std::string_view interface,
                                  std::string_view dbc_file);

}  // namespace beltgrip::sim
