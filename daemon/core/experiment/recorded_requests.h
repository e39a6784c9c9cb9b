// The clamp requests that a log has, for a replay that follows them instead of deciding anew when
// to ask. They are known before the replay begins and are never frames that come in. What follows
// them asks for nothing itself: no clamp frame leaves. Tools only.
#pragma once

#include <cstddef>
#include <optional>
#include <vector>

#include "daemon/core/base/mono_time.h"
#include "daemon/core/experiment/experiment.h"
#include "estimator/method/slip_curve_estimator.h"

namespace beltgrip::daemon {

struct RecordedRequest {
  struct Force {
    MonoTime t = MonoTime::origin();
    double force_N = 0.0;
  };
  MonoTime begin = MonoTime::origin();  // stamp of the first frame that asks
  std::optional<MonoTime> end;  // of the first that does not, or when silence ends it; none: the
                                // log ends before
  // As the status behind it says; none: it says nothing.
  std::optional<Outcome> outcome;
  estimator::StopReason reason = estimator::StopReason::kNone;
  std::vector<Force> course;  // what was asked, in order; not empty
};

class RecordedRequests {
 public:
  // In order of time.
  explicit RecordedRequests(std::vector<RecordedRequest> requests);

  // Times do not decrease.
  void step(MonoTime t) noexcept;
  // At the time of the last step; nullptr: none stands.
  const RecordedRequest* standing() const noexcept;
  // It has stood for so short a time that an experiment may still begin with it.
  bool begins() const noexcept;
  // One stands or comes soon: what else there is must be over.
  bool near() const noexcept;
  // Between the frames as a line; 0: none stands.
  double force_N() const noexcept;

 private:
  std::vector<RecordedRequest> requests_;
  MonoTime t_;
  std::size_t next_ = 0;   // the first that has not ended
  std::size_t point_ = 0;  // of its course: the first that lies ahead
};

}  // namespace beltgrip::daemon
