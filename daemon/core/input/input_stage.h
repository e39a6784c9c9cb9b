// First stage of a sample: frames in, one sample and what is known of its inputs out. Real-time
// thread.
#pragma once

#include <cstdint>
#include <optional>

#include "daemon/core/base/faults.h"
#include "daemon/core/base/outbox.h"
#include "daemon/core/config/options/config.h"
#include "daemon/core/input/bus_watch.h"
#include "daemon/core/input/input_monitor.h"
#include "daemon/core/input/sampler.h"
#include "estimator/physics/learned_effects.h"

namespace beltgrip::daemon {

Duration sample_period(const Config& config) noexcept;

class InputStage {
 public:
  // config outlives it.
  explicit InputStage(const Config& config);

  // Both of a bus that exists.
  void on_error_frame(const RxFrame& frame) noexcept { buses_.on_error_frame(frame); }
  FrameUse on_frame(const RxFrame& frame, FaultSet& faults) noexcept;
  void on_link(std::uint8_t bus, BusState state) noexcept { buses_.on_link(bus, state); }
  // Samples before the next one were not taken at all.
  void on_samples_lost() noexcept { next_samples_lost_ = true; }
  void on_send_failed(const can::CanFrame& frame, std::uint8_t bus, MonoTime t) noexcept {
    monitor_.diagnostics().on_send_failed(frame, bus, t);
  }

  // The sample at t. watch: how the inputs should move; may_settle: the sampler's delay may change.
  const estimator::VariatorSample& step(MonoTime t, const InputMonitor::Watch& watch,
                                        bool may_settle, FaultSet& faults) noexcept;
  // What a later stage has shown.
  void stands_still(Role role) noexcept { monitor_.stands_still(role); }
  // Adds the requests for diagnostics that are due.
  void poll(MonoTime t, Outbox& outbox) noexcept;

  const InputMonitor& channels() const noexcept { return monitor_; }
  const BusWatch& buses() const noexcept { return buses_; }
  const estimator::VariatorSample& sample() const noexcept { return sampler_.newest(); }
  // What else is known of the machine: what a learned function depends on beside the sample.
  estimator::LearnedConditions learned_conditions() const noexcept;
  bool samples_lost() const noexcept { return samples_lost_; }  // before this one
  // A required channel is lost, or samples are.
  bool any_lost() const noexcept { return samples_lost_ || monitor_.any_lost(); }
  bool lockup_closed() const noexcept;  // as far as a role says
  // Nothing, where no channel is lost and no sample: the caller may know more.
  Stop lost(MonoTime t) const noexcept;
  // Every input comes, but for as long as makes one stale no sample could be made of them: a
  // primary speed at zero, say.
  bool starved(MonoTime t) const noexcept;
  Stop starved_for(MonoTime t) const noexcept;
  // Inputs that come and go would open and close the way to an experiment many times a second: once
  // lost, they count again when they have held.
  bool usable_again(MonoTime t) const noexcept;
  // Which of the signals beside the sample is not there.
  Stop missing_condition() const noexcept;
  // How long the slowest of those inputs may be silent whose silence could hide that a request must
  // end. Oil and vehicle speed change nothing within it, and slip that runs away shows in the
  // speeds while the pressure is silent.
  Duration slowest_stale() const noexcept;

  void go_on_from(const InputStage& before) noexcept { buses_.go_on_from(before.buses_); }

 private:
  InputMonitor monitor_;
  Sampler sampler_;
  BusWatch buses_;
  Duration sample_period_;
  bool next_samples_lost_ = false;
  bool samples_lost_ = false;
  MonoTime last_usable_;                   // sample
  std::optional<MonoTime> last_unusable_;  // sample, after a usable one
  bool was_usable_ = false;                // a sample
};

}  // namespace beltgrip::daemon
