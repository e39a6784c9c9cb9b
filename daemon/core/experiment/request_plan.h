// How a request is to bring the belt over its peak, as arming finds it and the request keeps to it.
#pragma once

#include "daemon/core/experiment/reachability.h"

namespace beltgrip::daemon {

struct RequestPlan {
  Crossing crossing;
  RampPoint point;  // where it is to cross
  Reaction reaction;
};

}  // namespace beltgrip::daemon
