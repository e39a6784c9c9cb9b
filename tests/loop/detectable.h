// From what instant on the frames that reach the daemon show a reason to end a request (promise
// G4), judged from raw frames and the DBC alone: a driver, controller or oil that withdraws, an
// input that has been silent, that comes at a wrong rate or with wrong counters or CRCs, a bus that
// is off, a foreign sender, a request without confirmation. Clock: the vehicle's, seconds.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "can_dbc/dbc/signal_codec.h"
#include "daemon/core/base/port.h"
#include "daemon/core/config/options/config.h"

namespace beltgrip::test {

class Detectable {
 public:
  explicit Detectable(const daemon::Config& config);

  void on_received(const daemon::RxFrame& frame);
  void on_sent(double t_s, const can::CanFrame& frame);

  struct Reason {
    double since_s = 0.0;
    std::string what;
  };
  // The earliest reason that holds at t_s, if any.
  std::optional<Reason> at(double t_s) const;

 private:
  struct Signal {
    std::string name;
    can::CanId id;
    std::uint8_t length = 0;
    can::SignalCodec codec;
    double minimum = 0.0, maximum = 0.0;
    double stale_s = 0.0;
    bool flag = false;
    double below = 0.0, above = 0.0;  // a value beyond them is a reason
    double last_s = 1e9;              // the last good value; 1e9: none yet
    double since_s = 1e9;             // since when the value has been a reason
  };
  // What the frames of a message show of themselves: counter, CRC and rate.
  struct Message {
    can::CanId id;
    std::uint8_t length = 0;
    can::SignalCodec counter;
    std::size_t crc_byte = 0;
    double period_s = 0.0;
    int last = -1;           // counter
    std::vector<bool> good;  // the frames so far
    double invalid_s = 1e9;  // since when no value may be taken
    std::vector<double> times_s;
    double rate_s = 1e9;  // since when it comes too often or too seldom
  };
  // False: nothing may be taken from the frame.
  static bool admit(Message& message, double t_s, const can::CanFrame& frame);

  std::vector<Signal> signals_;
  std::vector<Message> messages_;
  double foreign_s_ = 1e9;
  double foreign_until_s_ = 0.0;
  double off_s_ = 1e9;
  double unconfirmed_s_ = 1e9;
};

}  // namespace beltgrip::test
