// The helper thread: everything that may wait. Takes events out of the ring and logs them; where
// the bus is the embedded one, it also watches for the stop request. Never in the way of the
// real-time thread: if it hangs, the ring drops and counts.
#pragma once

#include <atomic>
#include <functional>
#include <thread>

#include "daemon/core/event.h"
#include "daemon/io/log_sink.h"

namespace beltgrip::daemon {

class Housekeeper {
 public:
  // stop_fd readable calls on_stop once, if there is one. The log is used by this thread alone from
  // here until stop().
  Housekeeper(EventRing& events, LogSink& log, int stop_fd, std::function<void()> on_stop);
  ~Housekeeper();
  // Takes what is left in the ring and ends the thread.
  void stop();

 private:
  void run();
  void drain();

  EventRing& events_;
  LogSink& log_;
  int stop_fd_;
  std::function<void()> on_stop_;
  std::uint64_t dropped_ = 0;
  std::atomic<bool> ending_{false};
  std::thread thread_;
};

}  // namespace beltgrip::daemon
