// beltgrip monitor of a log: at its own pace on a terminal, else as fast as the machine can.
#include <poll.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <memory>

#include "tools/cli/log_trouble.h"
#include "tools/cli/monitor.h"
#include "tools/cli/monitor_screen.h"
#include "tools/cli/replay_run.h"
#include "tools/cli/stop_signals.h"
#include "tools/monitor/change_lines.h"
#include "tools/monitor/log_player.h"
#include "tools/text/terminal.h"

namespace beltgrip::cli {

namespace {

constexpr double kLine_s = 0.01;  // of the log, between two looks for changes
constexpr double kStep_s = 0.1, kSeek_s = 10.0, kFarSeek_s = 60.0;
constexpr double kFaster = 2.0, kSpeedLeast = 1.0 / 64.0, kSpeedMost = 1024.0;
constexpr double kWithoutEnd_s = 1e9;
constexpr int kTurn_ms = 50;

std::unique_ptr<ports::LogTimeline> open_log(const MonitorRequest& request) {
  std::vector<std::unique_ptr<can::LogReader>> readers;
  try {
    readers.push_back(can::LogReader::open(request.source));
  } catch (const can::LogOpenError& error) {
    throw Failure{kNoInput, error.text};
  }
  ports::FrameSelection selection;
  selection.interface = request.interface;
  if (request.config) selection.further_interface = further_interface(*request.config);
  return std::make_unique<ports::LogTimeline>(std::move(readers), std::move(selection));
}

[[noreturn]] void fail_without_frames(const MonitorRequest& request,
                                      const ports::LogTimeline& log) {
  throw Failure{kBadInput, no_frame_text(request.source, log.stats())};
}

double end_of(const MonitorRequest& request) {
  return request.duration_s > 0.0 ? request.from_s + request.duration_s : kWithoutEnd_s;
}

void print_changes(const MonitorRequest& request, monitor::LogPlayer& player, monitor::View& view) {
  monitor::ChangeLines changes;
  player.play_to(request.from_s);
  const double end_s = end_of(request);
  for (;;) {
    player.show(view);
    text::print(stdout, changes.update(view));
    if (player.ended() || player.position_s() >= end_s || stop_asked()) return;
    player.play_to(std::min(end_s, player.position_s() + kLine_s));
  }
}

void print_once(const MonitorRequest& request, monitor::LogPlayer& player, monitor::View& view) {
  const bool at = request.from_s > 0.0 && request.duration_s == 0.0;
  player.play_to(at ? request.from_s : end_of(request));
  player.show(view);
  print_view(view, request.json);
}

// Where the log stands, by the clock and the keys.
class Pace {
 public:
  Pace(const MonitorRequest& request, monitor::LogPlayer& player, monitor::Playing& playing)
      : player_(player), playing_(playing), end_s_(end_of(request)) {
    playing_.speed = request.speed;
    player_.play_to(request.from_s);
  }
  // False: quit.
  bool take(monitor::Key key) {
    using monitor::Key;
    const double at_s = player_.position_s();
    if (key == Key::kQuit) return false;
    if (key == Key::kPause) playing_.paused = !playing_.paused;
    if (key == Key::kStep) {
      playing_.paused = true;
      seek(at_s + kStep_s);
    }
    if (key == Key::kBack) seek(at_s - kSeek_s);
    if (key == Key::kOn) seek(at_s + kSeek_s);
    if (key == Key::kFarBack) seek(at_s - kFarSeek_s);
    if (key == Key::kFarOn) seek(at_s + kFarSeek_s);
    if (key == Key::kBegin) seek(0.0);
    if (key == Key::kFaster) playing_.speed = std::min(kSpeedMost, playing_.speed * kFaster);
    if (key == Key::kSlower) playing_.speed = std::max(kSpeedLeast, playing_.speed / kFaster);
    return true;
  }
  void go_on(double passed_s) {
    if (!playing_.paused) seek(player_.position_s() + passed_s * playing_.speed);
  }

 private:
  void seek(double position_s) {
    player_.play_to(std::clamp(position_s, 0.0, end_s_));
    playing_.duration_over = position_s >= end_s_;
  }

  monitor::LogPlayer& player_;
  monitor::Playing& playing_;
  double end_s_;
};

void wait_for_key() {
  std::array<pollfd, 2> waited{pollfd{.fd = STDIN_FILENO, .events = POLLIN, .revents = 0},
                               pollfd{.fd = stop_descriptor(), .events = POLLIN, .revents = 0}};
  poll(waited.data(), waited.size(), kTurn_ms);
}

void show_screen(const MonitorRequest& request, monitor::LogPlayer& player, monitor::View& view,
                 monitor::Playing& playing) {
  using Clock = std::chrono::steady_clock;
  MonitorScreen screen;
  Pace pace(request, player, playing);
  auto before = Clock::now();
  while (!stop_asked()) {
    player.show(view);
    screen.keep(view);
    screen.draw();
    wait_for_key();
    const auto now = Clock::now();
    pace.go_on(std::chrono::duration<double>(now - before).count());
    before = now;
    while (const auto key = screen.key()) {
      if (!pace.take(*key)) return;
    }
  }
}

void list_frames(const MonitorRequest& request) {
  const auto log = open_log(request);
  FrameLister lister(request);
  can::StampedFrame frame;
  std::int64_t first_ns = 0;
  const double end_s = end_of(request);
  while (log->next(frame)) {
    if (log->counters().frames == 1) first_ns = frame.t_ns;
    const double at_s = static_cast<double>(frame.t_ns - first_ns) * 1e-9;
    if (at_s > end_s) break;
    if (at_s >= request.from_s && frame.bus == 0) lister.on_frame(frame.t_ns, frame.frame);
  }
  if (log->counters().frames == 0) fail_without_frames(request, *log);
  lister.end();
}

}  // namespace

void monitor_log(const MonitorRequest& request) {
  end_streams_when_stopped({request.source});
  if (request.output == MonitorOutput::kScreen && request.source == "-") {
    throw Failure{kUsage,
                  "monitor: found standard input for the view, expected a file, or --plain"};
  }
  if (request.output == MonitorOutput::kFrames || request.output == MonitorOutput::kTable) {
    return list_frames(request);
  }
  monitor::LogPlayer player([&] { return open_log(request); },
                            [&] {
                              return std::make_unique<monitor::Session>(
                                  monitor::Session::Source::kLog, request.identifiers(),
                                  request.config);
                            });
  if (player.empty()) fail_without_frames(request, player.log());
  monitor::View view;
  view.source = request.source.substr(request.source.rfind('/') + 1);
  monitor::Playing& playing = view.playing.emplace();
  switch (request.output) {
    case MonitorOutput::kOnce:
      return print_once(request, player, view);
    case MonitorOutput::kScreen:
      return show_screen(request, player, view, playing);
    default:
      return print_changes(request, player, view);
  }
}

}  // namespace beltgrip::cli
