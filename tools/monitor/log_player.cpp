#include "tools/monitor/log_player.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace beltgrip::monitor {

LogPlayer::LogPlayer(Open open, Begin begin) : open_(std::move(open)), begin_(std::move(begin)) {
  begin_again();
}

void LogPlayer::begin_again() {
  log_ = open_();
  session_ = begin_();
  ended_at_.reset();
  has_next_ = log_->next(next_);
  if (has_next_) first_ = now_ = daemon::MonoTime::of_ns(next_.t_ns);
}

bool LogPlayer::step() {
  if (!has_next_) return false;
  now_ = std::max(now_, daemon::MonoTime::of_ns(next_.t_ns));
  session_->on_frame({now_, next_.frame, false, 0, next_.bus});
  has_next_ = log_->next(next_);
  if (!has_next_) ended_at_ = now_;
  return true;
}

void LogPlayer::play_to(double position_s) {
  const auto until = first_ + daemon::Duration::of_s(std::max(position_s, 0.0));
  if (until < now_) begin_again();
  while (has_next_ && next_.t_ns <= until.ns()) step();
  if (has_next_) now_ = std::max(now_, until);
  session_->advance(now_);
}

void LogPlayer::show(View& view) const {
  session_->show(view, now_);
  view.wall_ns = now_.ns();
  if (!view.playing) view.playing.emplace();
  view.playing->position_s = position_s();
  view.playing->ended = ended();
}

}  // namespace beltgrip::monitor
