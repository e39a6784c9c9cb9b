// What is worth a line in the log, as plain data: found by comparing one sample's report with the
// one before, so that the report stays the single observable. Real-time thread; the helper thread
// makes text of it (text_of).
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>

#include "daemon/core/base/spsc_ring.h"
#include "daemon/core/loop/loop.h"
#include "daemon/core/loop/pipeline.h"

namespace beltgrip::daemon {

enum class EventId : std::uint8_t { kState, kStop, kResult, kInhibit, kFaultRaised, kFaultCleared };
enum class EventLevel : std::uint8_t { kInfo, kWarning };

struct Event {
  MonoTime t = MonoTime::origin();
  EventId id = EventId::kState;
  std::uint8_t from = 0;  // state
  std::uint8_t to = 0;    // state, fault or inhibit
  estimator::StopReason reason = estimator::StopReason::kNone;
  double slip_percent = 0.0;     // at the stop
  double mu_star = 0.0;          // there
  StopCause cause = {};          // beside reason; of fault InputFrozen, the role
  ExperimentResult result = {};  // of kResult
  std::uint32_t identifier = 0;  // of fault ForeignSender
};

EventLevel level_of(const Event& event);
// figure: of an inhibit or a fault, where it is known. Allocates: not on the real-time thread.
std::string text_of(const Event& event, const std::string& figure = "");

using EventRing = SpscRing<Event, 256>;

// At most ten lines a second: of states, faults and inhibits kMost within any second, stops and
// results (two for each experiment) always; what was left out can be said in one line more.
class LineBudget {
 public:
  static constexpr std::size_t kMost = 7;
  bool take(const Event& event) noexcept;
  // Events left out since the last call; 0 within a second after it was more.
  unsigned left_out(MonoTime t) noexcept;

 private:
  std::array<MonoTime, kMost> taken_{};  // a ring
  std::size_t count_ = 0;
  unsigned left_out_ = 0;
  MonoTime said_;
};

// Puts the events between successive reports into a ring. Why no experiment begins is said where
// one precondition alone has been missing for kInhibitAfter, and not twice in a row.
class EventSink final : public SampleSink {
 public:
  static constexpr Duration kInhibitAfter = kSecond;

  explicit EventSink(EventRing& ring) : ring_(ring) {}
  void on_report(const SampleReport& report) noexcept override;

 private:
  void look_at_inhibits(const SampleReport& report) noexcept;

  EventRing& ring_;
  State state_ = State::kInhibited;
  bool stop_ = false;
  std::uint32_t faults_ = 0;
  std::uint32_t inhibits_ = 0;
  std::uint32_t inhibit_said_ = 0;
  MonoTime inhibits_since_;
};

}  // namespace beltgrip::daemon
