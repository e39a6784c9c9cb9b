// beltgrip monitor on a bus: it listens to every frame and sends none.
#include <algorithm>
#include <array>
#include <chrono>
#include <limits>
#include <memory>
#include <optional>

#include "daemon/io/can_link.h"
#include "tools/cli/bus.h"
#include "tools/cli/monitor.h"
#include "tools/cli/monitor_screen.h"
#include "tools/cli/stop_signals.h"
#include "tools/monitor/change_lines.h"
#include "tools/monitor/session.h"
#include "tools/sim/configuration.h"
#include "tools/text/terminal.h"

namespace beltgrip::cli {

namespace {

using daemon::Duration;
using daemon::MonoTime;

constexpr Duration kTurn = 50 * daemon::kMillisecond;
constexpr Duration kBetweenViews = 100 * daemon::kMillisecond;
// BeltGripStatus comes every second.
constexpr Duration kWholePicture = 1100 * daemon::kMillisecond;

std::int64_t wall_now() {
  return std::chrono::duration_cast<std::chrono::nanoseconds>(
             std::chrono::system_clock::now().time_since_epoch())
      .count();
}

// Frames as they come, and the turns between them.
class Listener {
 public:
  explicit Listener(const MonitorRequest& request)
      : whole_(request.config.value_or(daemon::Config{})) {
    whole_.interface = request.source;
    port_ = open_buses_whole(whole_, stop_descriptor());
    begin_ = port_->now();
    if (request.duration_s > 0.0) end_ = begin_ + Duration::of_s(request.duration_s);
  }

  // on_frame(frame) for each, on_turn(now) after at most kTurn; ends when stopped, at the end of
  // the time, or where on_turn returns false.
  void listen(const auto& on_frame, const auto& on_turn) {
    while (port_->now() < end_) {
      const daemon::Wake wake = port_->wait_until(std::min(end_, port_->now() + kTurn));
      if (wake == daemon::Wake::kClosed) return;
      wall_offset_ = wall_now() - port_->now().ns();
      const std::size_t count = wake == daemon::Wake::kFrames ? port_->receive(frames_) : 0;
      for (std::size_t i = 0; i < count; ++i) on_frame(frames_[i]);
      if (!on_turn(port_->now())) return;
    }
  }
  MonoTime begin() const { return begin_; }
  std::int64_t wall(MonoTime t) const { return t.ns() + wall_offset_; }
  daemon::BusState state() { return port_->bus_state(); }

 private:
  daemon::Config whole_;
  std::unique_ptr<daemon::Port> port_;
  MonoTime begin_;
  MonoTime end_ = MonoTime::max();
  std::int64_t wall_offset_ = 0;
  std::array<daemon::RxFrame, 64> frames_;
};

// The session and its View, with what only a bus has.
class BusSession {
 public:
  BusSession(const MonitorRequest& request, Listener& listener)
      : listener_(listener),
        session_(monitor::Session::Source::kBus, request.identifiers(), request.config) {
    view_.source = request.source;
    if (const auto link = daemon::read_can_link(request.source)) {
      view_.traffic.bitrate = link->bitrate;
    }
  }
  void take(const daemon::RxFrame& frame) { session_.on_frame(frame); }
  void turn(MonoTime now) {
    session_.on_link(listener_.state());
    session_.advance(now);
  }
  bool is_own(const can::CanFrame& frame) const { return session_.is_own(frame); }
  const monitor::View& view(MonoTime t) {
    view_.listening_s = static_cast<double>((t - listener_.begin()).ns()) * 1e-9;
    session_.show(view_, t);
    view_.wall_ns = listener_.wall(t);
    return view_;
  }

 private:
  Listener& listener_;
  monitor::Session session_;
  monitor::View view_;
};

void print_changes(Listener& listener, BusSession& session) {
  monitor::ChangeLines changes;
  const auto say = [&](MonoTime t) {
    const std::string lines = changes.update(session.view(t));
    if (lines.empty()) return;
    text::print(stdout, lines);
    std::fflush(stdout);
  };
  MonoTime next{};
  listener.listen(
      [&](const daemon::RxFrame& frame) {
        session.take(frame);
        if (session.is_own(frame.frame)) say(frame.t);
      },
      [&](MonoTime now) {
        session.turn(now);
        if (now < next) return true;
        say(now);
        next = now + kBetweenViews;
        return true;
      });
}

void print_once(const MonitorRequest& request, Listener& listener, BusSession& session) {
  MonoTime now = listener.begin();
  const auto whole = [&] {
    const monitor::View& view = session.view(now);
    if (monitor::is_silent(view)) return true;
    return view.heard_s >= static_cast<double>(kWholePicture.ns()) * 1e-9;
  };
  listener.listen([&](const daemon::RxFrame& frame) { session.take(frame); },
                  [&](MonoTime t) {
                    session.turn(now = t);
                    return !whole();
                  });
  const monitor::View& view = session.view(now);
  print_view(view, request.json);
  if (!view.silence_s) {
    throw Failure{kUnavailable,
                  request.source + ": no frame of BeltGrip for 3 s: is beltgripd running?"};
  }
}

void show_screen(Listener& listener, BusSession& session) {
  MonitorScreen screen;
  bool held = false;
  MonoTime next{};
  listener.listen([&](const daemon::RxFrame& frame) { session.take(frame); },
                  [&](MonoTime now) {
                    session.turn(now);
                    while (const auto key = screen.key()) {
                      if (*key == monitor::Key::kQuit) return false;
                      if (*key == monitor::Key::kPause) held = !held;
                      next = now;
                    }
                    if (now < next) return true;
                    next = now + kBetweenViews;
                    if (!held) screen.keep(session.view(now));
                    screen.draw(held);
                    return true;
                  });
}

// Time shown: of the day, or the clock of the truth, which begins with the rig's first frame.
void list_frames(const MonitorRequest& request, Listener& listener) {
  FrameLister lister(request);
  std::optional<MonoTime> origin;
  const MonoTime begin = listener.begin();
  if (!request.truth) origin = begin;
  const can::Database& rig = sim::rig_database();
  listener.listen(
      [&](const daemon::RxFrame& frame) {
        if (!origin && rig.find_message(frame.frame.id) != nullptr) {
          origin = frame.t - Duration::of_ns(request.truth->first_frame_ns);
        }
        if (!origin) return;
        const bool of_day = request.output == MonitorOutput::kFrames && !request.truth;
        lister.on_frame(of_day ? listener.wall(frame.t) : (frame.t - *origin).ns(), frame.frame);
      },
      [](MonoTime) { return true; });
  lister.end();
}

}  // namespace

void monitor_bus(const MonitorRequest& request) {
  Listener listener(request);
  if (request.output == MonitorOutput::kFrames || request.output == MonitorOutput::kTable) {
    return list_frames(request, listener);
  }
  BusSession session(request, listener);
  switch (request.output) {
    case MonitorOutput::kOnce:
      return print_once(request, listener, session);
    case MonitorOutput::kScreen:
      return show_screen(listener, session);
    default:
      return print_changes(listener, session);
  }
}

}  // namespace beltgrip::cli
