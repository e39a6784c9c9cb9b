// How a request is to bring the belt over its peak, as arming finds it and the request keeps to it.
#pragma once

#include "daemon/core/experiment/reachability.h"

namespace beltgrip::daemon {

struct RequestPlan {
  Crossing crossing;
  double mu_expected = 0.0;  // of the peak, at the most
  double mu_least = 0.0;     // and at the least
  double primary_radius_m = 0.0;
};

}  // namespace beltgrip::daemon
