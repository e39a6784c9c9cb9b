// The promises that hold in every sample, whatever happens, as one checker for closed loops, replay
// and fuzzing: what the pipeline reports against the frames that really left. Layout and protection
// of the frames are written out here anew. Numbers I1 to I14 as in the catalogue of promises. I15:
// MinClampForce never rests on more friction than the last value of its direction and end stop, or
// than the belt carried there as it slipped since without giving a value; of what the history says
// only where that differs by no more than noise.
#pragma once

#include <cstdint>
#include <deque>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "daemon/core/config/options/config.h"
#include "daemon/core/loop/loop.h"
#include "daemon/core/observe/event.h"

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
  // What the pipeline has been told after a report.
  void on_learned(const estimator::LearnedFriction& learned) { learned_ = learned; }
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
  void follow_friction(const daemon::SampleReport& now);
  double friction_allowed(const daemon::SampleReport& now) const;
  void check_min_clamp(const can::CanFrame& frame, const daemon::SampleReport& now);
  void check_status(const can::CanFrame& frame, const daemon::SampleReport& now);

  daemon::Config config_;
  daemon::SampleReport before_;
  bool any_ = false;
  std::vector<can::CanFrame> frames_;
  std::map<std::uint32_t, unsigned> counters_;
  daemon::MonoTime request_begun_{};
  daemon::MonoTime request_ended_{};
  bool asked_ = false;
  bool unsent_ = false;      // since the last report
  int inactive_due_ = 0;     // frames still owed after a request
  int inactive_before_ = 0;  // frames in a row, each within 100 ms of the one before
  daemon::MonoTime last_clamp_{};
  daemon::EventRing ring_;
  daemon::EventSink events_{ring_};
  daemon::LineBudget budget_;
  std::deque<daemon::MonoTime> lines_;   // of the log, within the last second
  std::optional<unsigned> results_ = 0;  // that changed what is published; none: not seen
  struct Friction {
    double mu_max = 0.0;  // of the last value
    double low = 0.0;     // its lower end
    double relative_noise = 0.0;
    double share = 1.0;  // of it that the belt carried as it slipped since
  };
  std::map<std::pair<estimator::Direction, estimator::EndStop>, Friction> values_;
  estimator::LearnedFriction learned_;
  double carried_ = 0.0;  // largest mu* of the experiment under way
  std::map<std::string, std::string> problems_;
};

}  // namespace beltgrip::test
