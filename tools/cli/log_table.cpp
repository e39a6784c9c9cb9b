#include "tools/cli/log_table.h"

#include <malloc.h>

#include <memory>
#include <optional>

#include "daemon/core/input/input_monitor.h"
#include "tools/cli/failure.h"
#include "tools/cli/log_trouble.h"
#include "tools/cli/replay_run.h"

namespace beltgrip::cli {

namespace {
constexpr std::uint64_t kFramesPerWord = 1024;
}  // namespace

diagnose::SignalTable read_log(const std::string& path, const daemon::Config& config, bool as_read,
                               const std::function<void(double, double)>& on_read) {
  const auto timeline = open_timeline({path}, "", config);
  daemon::InputMonitor inputs(config);
  if (as_read) {
    for (const daemon::Role role : {daemon::Role::kEngineTorque, daemon::Role::kPrimarySpeed,
                                    daemon::Role::kSecondarySpeed}) {
      inputs.take_spikes(role);
    }
  }
  daemon::FaultSet faults;
  diagnose::SignalTable table;
  table.name = path;
  std::optional<std::int64_t> first_ns;
  std::uint64_t bad = 0, frames = 0;
  can::StampedFrame frame;
  while (timeline->next(frame)) {
    if (!first_ns) first_ns = frame.t_ns;
    if (on_read && ++frames % kFramesPerWord == 0) {
      on_read(static_cast<double>(frame.t_ns - *first_ns) * 1e-9, timeline->share_read());
    }
    daemon::RxFrame received{daemon::MonoTime::of_ns(frame.t_ns), frame.frame};
    received.bus = frame.bus;
    const daemon::FrameUse use = inputs.on_frame(received, faults);
    if (use == daemon::FrameUse::kBad) ++bad;
    if (use != daemon::FrameUse::kTaken) continue;
    for (const daemon::RoleBinding& binding : config.roles) {
      const daemon::SignalHistory& history = inputs.history(binding.role);
      if (history.empty()) continue;
      diagnose::Channel& channel = table[binding.role];
      const double t_s =
          static_cast<double>((history.newest() - inputs.delay(binding.role)).ns() - *first_ns) *
          1e-9;
      if (!channel.empty() && t_s <= channel.t_s.back()) continue;
      channel.t_s.push_back(t_s);
      channel.value.push_back(history.newest_value());
    }
  }
  const can::LogStats stats = timeline->stats();
  const auto note = [&](std::uint64_t count, const char* what) {
    if (count > 0) table.notes.push_back(path + ": " + std::to_string(count) + " " + what);
  };
  if (!first_ns) {
    throw Failure{kBadInput, no_frame_text(path, stats)};
  }
  if (stats.lines_bad > 0) table.notes.push_back(path + ": " + unreadable_with_first(stats));
  note(bad, "frames whose length or kind is not the DBC's, ignored");
  if (const std::uint64_t left_out = timeline->counters().frames_bad; left_out > 0) {
    table.notes.push_back(path + ": " + left_out_text(left_out));
  }
  note(timeline->counters().clock_steps, "steps of the log's clock, taken out");
  for (diagnose::Channel& each : table.channels) {
    each.t_s.shrink_to_fit();
    each.value.shrink_to_fit();
  }
  // What the columns have grown out of lies between them, and the next log's would come on top.
  malloc_trim(0);
  diagnose::close_gaps(table);
  return table;
}

}  // namespace beltgrip::cli
