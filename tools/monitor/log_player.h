// A log that is played into a session: forward to an instant, and back by beginning again. Tools
// only.
#pragma once

#include <functional>
#include <memory>
#include <optional>

#include "tools/monitor/session.h"
#include "tools/ports/log_timeline.h"

namespace beltgrip::monitor {

class LogPlayer {
 public:
  using Open = std::function<std::unique_ptr<ports::LogTimeline>()>;
  using Begin = std::function<std::unique_ptr<Session>()>;
  // open and begin are called again at each way back. The log must have a frame: empty() says.
  LogPlayer(Open open, Begin begin);

  bool empty() const { return !has_next_ && !ended_at_; }
  bool ended() const { return !has_next_; }
  double position_s() const { return static_cast<double>((now_ - first_).ns()) * 1e-9; }
  // Seconds since the first frame; not beyond the last.
  void play_to(double position_s);
  // The next frame and what belongs to its instant. False at the end.
  bool step();
  void show(View& view) const;
  const ports::LogTimeline& log() const { return *log_; }

 private:
  void begin_again();

  Open open_;
  Begin begin_;
  std::unique_ptr<ports::LogTimeline> log_;
  std::unique_ptr<Session> session_;
  can::StampedFrame next_;
  bool has_next_ = false;
  std::optional<daemon::MonoTime> ended_at_;
  daemon::MonoTime first_, now_;
};

}  // namespace beltgrip::monitor
