// What `beltgrip monitor` was asked for, and its two sources. Tools only.
#pragma once

#include <cstdio>
#include <optional>
#include <string>

#include "daemon/core/config/options/config.h"
#include "tools/cli/verdict.h"
#include "tools/monitor/own_frame_view.h"

namespace beltgrip::cli {

enum class MonitorOutput {
  kScreen,  // the live view
  kPlain,   // a line a change
  kOnce,    // one view, as text or JSON
  kFrames,  // a JSON line a frame
  kTable    // a row every half second and a change
};

struct MonitorRequest {
  std::string source;
  std::optional<daemon::Config> config;
  std::string interface;  // of a log
  MonitorOutput output = MonitorOutput::kScreen;
  bool json = false;
  double speed = 1.0;
  double from_s = 0.0;
  double duration_s = 0.0;  // 0: without end
  std::optional<Truth> truth;

  daemon::FrameIdentifiers identifiers() const {
    return config ? config->identifiers : daemon::FrameIdentifiers{};
  }
};

void monitor_bus(const MonitorRequest& request);
void monitor_log(const MonitorRequest& request);

// BeltGrip's frames one by one, for kFrames and kTable.
class FrameLister {
 public:
  explicit FrameLister(const MonitorRequest& request);
  // t_ns as shown.
  void on_frame(std::int64_t t_ns, const can::CanFrame& frame);
  void end() const;

 private:
  const MonitorRequest& request_;
  monitor::OwnFrameDecoder decoder_;
  monitor::BusTable table_{stdout};
  Verdict verdict_;
};

}  // namespace beltgrip::cli
