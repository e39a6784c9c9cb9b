#include "tools/cli/recorded_log.h"

#include <filesystem>
#include <memory>
#include <system_error>
#include <utility>

#include "daemon/core/publish/own_frames.h"
#include "tools/cli/replay_run.h"
#include "tools/monitor/own_frame_view.h"
#include "tools/ports/log_timeline.h"

namespace beltgrip::cli {

namespace {

using daemon::MonoTime;
using daemon::State;

// The contract: a receiver that hears no valid request for so long is back at its own force.
constexpr daemon::Duration kSilence = 50 * daemon::kMillisecond;
// Chosen: an evaluation takes less, so a status that comes later is about something else.
constexpr daemon::Duration kStatusWithin = 5 * daemon::kSecond;

class Reader {
 public:
  explicit Reader(const daemon::Config& config) : decoder_(config.identifiers) {}

  void on_frame(MonoTime t, const can::CanFrame& frame) {
    const std::optional<monitor::OwnFrameView> view = decoder_.decode(frame);
    if (!view || view->check == can::e2e::CheckStatus::kWrongCrc) return;
    if (view->message->name == "BeltGripClamp") {
      on_clamp(t, *view);
    } else if (view->message->name == "BeltGripStatus") {
      on_status(t, *view);
    }
  }
  void pass(MonoTime t) {
    if (standing_ && t - newest().course.back().t > kSilence) {
      end(newest().course.back().t + kSilence);
    }
  }
  std::optional<RecordedLog> take() {
    if (!seen_) return std::nullopt;
    return std::move(log_);
  }

 private:
  daemon::RecordedRequest& newest() { return log_.requests.back(); }

  void on_clamp(MonoTime t, const monitor::OwnFrameView& view) {
    seen_ = true;
    if (view.value("RequestActive") < 0.5) {
      may_begin_ = true;
      if (standing_) end(t);
      return;
    }
    if (!view.good()) return;
    if (!standing_ && !may_begin_) {
      if (!std::exchange(cut_, true)) ++log_.cut;
      return;
    }
    if (!standing_) {
      log_.requests.emplace_back();
      newest().begin = t;
      standing_ = true;
      told_ = may_begin_ = cut_ = false;
    }
    newest().course.push_back({t, view.value("SecondaryForce")});
  }

  // The first that tells of the time after the request and its evaluation.
  void on_status(MonoTime t, const monitor::OwnFrameView& view) {
    if (log_.requests.empty() || told_) return;
    const auto state = static_cast<State>(view.value("State"));
    if (state == State::kRamping || state == State::kEvaluating) return;
    // It may leave before the first frame that no longer asks, not before the last that does.
    if (t - newest().course.back().t > kStatusWithin) return;
    told_ = true;
    newest().outcome = static_cast<daemon::Outcome>(view.value("Outcome"));
    newest().reason = static_cast<estimator::StopReason>(view.value("StopReason"));
  }

  void end(MonoTime t) {
    newest().end = t;
    standing_ = false;
  }

  monitor::OwnFrameDecoder decoder_;
  RecordedLog log_;
  bool seen_ = false;
  bool may_begin_ = false;  // an inactive frame came since the last request
  bool standing_ = false;
  bool told_ = false;  // the newest request's reason
  bool cut_ = false;   // one is passing whose beginning was not seen
};

bool can_be_read_twice(const std::vector<std::string>& paths) {
  for (const std::string& path : paths) {
    std::error_code none;
    if (!std::filesystem::is_regular_file(path, none)) return false;
  }
  return true;
}

}  // namespace

std::optional<RecordedLog> recorded_requests(const std::vector<std::string>& paths,
                                             const std::string& interface,
                                             const daemon::Config& config) {
  if (config.table || !can_be_read_twice(paths)) return std::nullopt;
  const auto timeline =
      open_timeline(paths, interface, {}, further_interface(config),
                    {{.id = {config.identifiers.clamp, false}, .bus = 0, .every = false},
                     {.id = {config.identifiers.status, false}, .bus = 0, .every = false}});
  Reader reader(config);
  can::StampedFrame frame;
  while (timeline->next(frame)) {
    reader.pass(MonoTime::of_ns(frame.t_ns));
    if (frame.bus == 0) reader.on_frame(MonoTime::of_ns(frame.t_ns), frame.frame);
  }
  return reader.take();
}

}  // namespace beltgrip::cli
