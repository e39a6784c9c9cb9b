// SIGHUP: reads the configuration again, judges it as at the start, and offers it to the real-time
// thread, which takes it between two samples once no experiment runs. Whatever is wrong with it is
// one line in the log, and the old one stays. Helper thread only.
#pragma once

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "daemon/core/reload.h"

namespace beltgrip::daemon {

// The frames that a port has to hand over.
std::vector<WantedFrames> wanted_frames(const Config& config);

class Reloader {
 public:
  using Say = std::function<void(bool warning, const std::string& line)>;

  Reloader(std::string path, const Config& running, ReloadSlot& slot, Say say);
  // True: it is offered now. False: refused, and said why.
  bool request();
  // True once the one that was offered is in force; running() is it from then on.
  bool turn();
  bool waiting() const { return waiting_; }
  const Config& running() const { return running_; }

 private:
  std::string path_;
  Config running_;
  ReloadSlot& slot_;
  Say say_;
  bool waiting_ = false;
};

}  // namespace beltgrip::daemon
