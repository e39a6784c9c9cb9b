// What the service manager hears: ready once the loop samples, a watchdog that is fed only while it
// goes on sampling, one line of state, and the stop (sd_notify). Without a service manager all of
// it is nothing. Helper thread only.
#pragma once

#include <cstdint>
#include <string>

#include "daemon/core/observe/observation.h"

namespace beltgrip::daemon {

// "Ramping, mu_max 0.1054 +- 0.0001, faults InputStale": state, last result, what is wrong.
std::string status_line(const Observation& observation);

class ServiceNotify {
 public:
  // Takes the watchdog's period from the environment.
  ServiceNotify();
  // The newest observation, nullptr before the first; a few times in each watchdog period.
  void turn(MonoTime now, const Observation* newest);
  // Around a reload: the manager's "reloading" lasts from one to the other. now: CLOCK_MONOTONIC.
  void reloading(MonoTime now);
  void reloaded();
  void stopping();

 private:
  Duration feed_period_;  // 0: no watchdog
  MonoTime feed_at_;
  std::uint64_t samples_fed_ = 0;
  bool ready_ = false;
  std::string status_;
};

}  // namespace beltgrip::daemon
