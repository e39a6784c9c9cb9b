// What is worth a line in the log, as plain data: found by comparing one sample's report with the
// one before, so that the report stays the single observable. Real-time thread; the helper thread
// makes text of it (text_of).
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "daemon/core/loop.h"
#include "daemon/core/pipeline.h"
#include "daemon/core/spsc_ring.h"

namespace beltgrip::daemon {

enum class EventId : std::uint8_t { kState, kStop, kResult, kFaultRaised, kFaultCleared };
enum class EventLevel : std::uint8_t { kInfo, kWarning };

struct Event {
  MonoTime t = 0;
  EventId id = EventId::kState;
  std::uint8_t from = 0;  // state
  std::uint8_t to = 0;    // state, fault, or outcome
  estimator::StopReason reason = estimator::StopReason::kNone;
  estimator::PeakKind kind = estimator::PeakKind::kNone;
  double first = 0.0;   // slip in percent at the stop; mu_max
  double second = 0.0;  // mu* at the stop; standard deviation of mu_max
};

EventLevel level_of(const Event& event);
std::string text_of(const Event& event);  // allocates: not on the real-time thread

std::string_view state_name(State state);  // as in BeltGripStatus
std::string_view outcome_name(Outcome outcome);
std::string_view stop_reason_name(estimator::StopReason reason);

using EventRing = SpscRing<Event, 256>;

// Puts the events between successive reports into a ring.
class EventSink final : public SampleSink {
 public:
  explicit EventSink(EventRing& ring) : ring_(ring) {}
  void on_report(const SampleReport& report) noexcept override;

 private:
  EventRing& ring_;
  State state_ = State::kInhibited;
  bool stop_ = false;
  std::uint32_t faults_ = 0;
};

}  // namespace beltgrip::daemon
