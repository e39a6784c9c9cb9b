// What is watched, as one: the frames of a bus or a log, and with a configuration the daemon's
// pipeline beside them. Frames and time in, a View out. Tools only.
#pragma once

#include <memory>
#include <optional>
#include <string>

#include "tools/monitor/bus_model.h"
#include "tools/monitor/shadow.h"
#include "tools/monitor/view.h"

namespace beltgrip::monitor {

class Session {
 public:
  // A log that has no frames of BeltGrip shows what the pipeline would send; a bus never does.
  enum class Source { kBus, kLog };
  Session(Source source, const daemon::FrameIdentifiers& identifiers,
          const std::optional<daemon::Config>& config);

  void on_frame(const daemon::RxFrame& frame);
  void on_link(daemon::BusState state);
  bool is_own(const can::CanFrame& frame) const { return bus_.is_own(frame); }
  // Nothing more comes before this instant.
  void advance(daemon::MonoTime now);
  void show(View& view, daemon::MonoTime now) const;

 private:
  bool computes() const { return source_ == Source::kLog && !recorded_; }

  Source source_;
  BusModel bus_;
  std::unique_ptr<BusModel> here_;  // of what the pipeline would send
  std::unique_ptr<Shadow> shadow_;
  daemon::BusState link_ = daemon::BusState::kActive;
  bool recorded_ = false;  // frames of BeltGrip have come
};

}  // namespace beltgrip::monitor
