#include "tools/sim/rig_source.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "tools/sim/configuration.h"

namespace beltgrip::sim {

RigSource::RigSource(const RigScenario& scenario, std::uint64_t seed, double start_s, double end_s)
    : seed_(seed),
      simulation_(scenario),
      bus_(rig_database(scenario), kRigBus, scenario, seed),
      start_ns_(std::llround(start_s * 1e9)),
      end_ns_(end_s < 9e9 ? std::llround(end_s * 1e9) : std::numeric_limits<std::int64_t>::max()) {}

bool RigSource::next(can::StampedFrame& frame) {
  for (;;) {
    while (taken_ == waiting_.size()) {
      if (simulation_.finished() || simulation_.now_ns() >= end_ns_) return false;
      waiting_.clear();
      taken_ = 0;
      bus_.sample(simulation_, waiting_);
      std::stable_sort(
          waiting_.begin(), waiting_.end(),
          [](const can::StampedFrame& a, const can::StampedFrame& b) { return a.t_ns < b.t_ns; });
      simulation_.step();
      if (!simulation_.finite()) {
        throw NonFiniteState{seed_, static_cast<double>(simulation_.now_ns()) * 1e-9};
      }
    }
    frame = waiting_[taken_++];
    if (frame.t_ns >= start_ns_) return true;
  }
}

}  // namespace beltgrip::sim
