// Last stage of a sample: what is to be published in, frames that may leave out. The publisher
// makes them, the transmit gate has the last word. It is told values and knows no report. Real-time
// thread.
#pragma once

#include <cstdint>

#include "daemon/core/base/faults.h"
#include "daemon/core/base/outbox.h"
#include "daemon/core/base/port.h"
#include "daemon/core/config/options/config.h"
#include "daemon/core/guard/tx_gate.h"
#include "daemon/core/publish/publisher.h"

namespace beltgrip::daemon {

class OutputStage {
 public:
  OutputStage(const Config& config, Duration sample_period);

  // A frame that is no input: an echo of ours, or a foreign sender with one of our identifiers.
  void on_frame(const RxFrame& frame, FaultSet& faults) noexcept;
  // A frame that was lost with its bus is never confirmed. Inactive frames tell whether the bus is
  // back, and the receiver that the request is over. Outside an experiment.
  void ask_again(MonoTime t, const FaultSet& faults) noexcept;
  // Before a request: a controller that has seen no inactive frame refuses it.
  void announce() noexcept { publisher_.repeat_inactive(); }

  // What is due at t; collect_all: everything, before the end. Others may add to it.
  Outbox& collect(MonoTime t, const Publication& publication) noexcept {
    wanted_.size = 0;
    publisher_.collect(t, publication, wanted_);
    return wanted_;
  }
  void collect_all(MonoTime t, const Publication& publication) noexcept {
    wanted_.size = 0;
    publisher_.collect_all(t, publication, wanted_);
  }
  // Hands on what the gate permits of it. acting_force_N: of the clamp, from signals; 0: not known.
  void pass(MonoTime t, double acting_force_N, Outbox& outbox, FaultSet& faults) noexcept;

  // Nobody has confirmed what was asked: it may not be on the bus at all.
  bool unconfirmed(MonoTime t) const noexcept;
  bool inactive_sent() const noexcept { return publisher_.inactive_sent(); }
  std::uint32_t foreign_identifier() const noexcept { return foreign_identifier_; }
  std::uint64_t refused() const noexcept { return refused_before_ + gate_.refused(); }
  bool is_clamp(const can::CanFrame& frame, std::uint8_t bus) const noexcept {
    return bus == 0 && frame.id.value == identifiers_.clamp;
  }
  void go_on_from(const OutputStage& before) noexcept;

 private:
  FrameIdentifiers identifiers_;
  Publisher publisher_;
  TxGate gate_;
  Outbox wanted_;                         // kept: to make one anew costs a thousand instructions
  std::uint64_t refused_before_ = 0;      // under the configurations before this one
  bool clamp_unconfirmed_ = false;        // a clamp frame waits for its echo
  MonoTime clamp_sent_;                   // the first that waits
  std::uint32_t foreign_identifier_ = 0;  // the last one that a foreign sender used
};

}  // namespace beltgrip::daemon
