// The promises that hold in every sample, whatever happens, as one checker for closed loops, replay
// and fuzzing: what the pipeline reports against the frames that really left. Layout and protection
// of the frames are written out here anew. Numbers I1 to I14 as in the catalogue of promises.
#pragma once

#include <cstdint>
#include <deque>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "daemon/core/config.h"
#include "daemon/core/event.h"
#include "daemon/core/loop.h"

namespace beltgrip::test {

class Invariants final : public daemon::SampleSink {
 public:
  explicit Invariants(const daemon::Config& config);

  // Each sample's report also goes to the daemon's own event sink; what that says is held against
  // the reports (I9). Frames of result and state are held against the reports (I13).
  // A frame that left, before the report of its sample.
  void on_sent(const can::CanFrame& frame);
  // One that the bus did not take: what was said does not show in the frames.
  void on_unsent();
  void on_report(const daemon::SampleReport& report) noexcept override;
  // What was broken, at most one line of each kind.
  const std::map<std::string, std::string>& problems() const { return problems_; }

 private:
  void broken(const std::string& which, const std::string& how);
  void check_report(const daemon::SampleReport& now);
  void check_request(const daemon::SampleReport& now);
  void check_frames(const daemon::SampleReport& now);
  void check_clamp(const can::CanFrame& frame, const daemon::SampleReport& now);
  void check_events(const daemon::SampleReport& now);
  void check_estimate(const can::CanFrame& frame, const daemon::SampleReport& now);
  void check_status(const can::CanFrame& frame, const daemon::SampleReport& now);

  daemon::Config config_;
  daemon::SampleReport before_;
  bool any_ = false;
  std::vector<can::CanFrame> frames_;
  std::map<std::uint32_t, unsigned> counters_;
  daemon::MonoTime request_begun_ = 0;
  daemon::MonoTime request_ended_ = 0;
  bool asked_ = false;
  bool unsent_ = false;   // since the last report
  int inactive_due_ = 0;  // frames still owed after a request
  daemon::MonoTime last_clamp_ = 0;
  daemon::EventRing ring_;
  daemon::EventSink events_{ring_};
  daemon::LineBudget budget_;
  std::deque<daemon::MonoTime> lines_;   // of the log, within the last second
  std::optional<unsigned> results_ = 0;  // that changed what is published; none: not seen
  std::map<std::string, std::string> problems_;
};

}  // namespace beltgrip::test
