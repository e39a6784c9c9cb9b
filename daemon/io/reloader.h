// SIGHUP: reads the configuration again, judges it as at the start, and offers it to the real-time
// thread, which takes it between two samples once no experiment runs. Whatever is wrong with it is
// one line in the log, and the old one stays. Helper thread only.
#pragma once

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "daemon/core/loop/reload.h"
#include "daemon/io/bus_claim.h"

namespace beltgrip::daemon {

// The frames that a port has to hand over.
std::vector<WantedFrames> wanted_frames(const Config& config);

class Reloader {
 public:
  using Say = std::function<void(bool warning, const std::string& line)>;

  // claim: of the identifiers on the bus, null where none is needed.
  Reloader(std::string path, const Config& running, ReloadSlot& slot, BusClaim* claim, Say say);
  // True: it is offered now, or as soon as the one that has just been taken is in force. False:
  // refused, and said why.
  bool request();
  // True once one that was offered is in force; running() is it from then on.
  bool turn();
  bool waiting() const { return waiting_; }
  const Config& running() const { return running_; }

 private:
  void offer(std::unique_ptr<Reload> reload);

  std::string path_;
  Config running_;
  ReloadSlot& slot_;
  BusClaim* claim_;
  Say say_;
  bool waiting_ = false;          // one is offered or taken
  std::unique_ptr<Reload> next_;  // after the one that is taken
};

}  // namespace beltgrip::daemon
