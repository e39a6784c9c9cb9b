// Between the real-time thread and the history that the helper thread keeps: results go out, what
// all experiments together say comes back. Two rings, wait-free; a full one drops.
#pragma once

#include "daemon/core/base/spsc_ring.h"
#include "daemon/core/experiment/experiment.h"
#include "estimator/belt/belt_history.h"

namespace beltgrip::daemon {

using ResultRing = SpscRing<ExperimentResult, 16>;
using LearnedRing = SpscRing<estimator::LearnedFriction, 4>;

struct HistoryRings {
  ResultRing results;   // to the helper thread
  LearnedRing learned;  // and back
};

}  // namespace beltgrip::daemon
