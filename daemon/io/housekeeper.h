// The helper thread: everything that may wait. Takes events out of the ring and logs them, and
// results and keeps them; where the bus is the embedded one, it also watches for the stop request;
// and takes its turn at what main gives it. Never in the way of the real-time thread: if it hangs,
// the ring drops and counts.
#pragma once

#include <atomic>
#include <functional>
#include <string>
#include <thread>

#include "daemon/core/loop/history_rings.h"
#include "daemon/core/observe/event.h"
#include "daemon/io/history_keeper.h"
#include "daemon/io/log_sink.h"

namespace beltgrip::daemon {

class Housekeeper {
 public:
  // figure: what stands beside an event in the log. stop_fd readable calls on_stop once, if there
  // is one; on_turn is called every kTurn_ms. Log and history (which may be absent) are used by
  // this thread alone from here until stop().
  static constexpr int kTurn_ms = 20;
  Housekeeper(EventRing& events, HistoryRings& rings, HistoryKeeper* history, LogSink& log,
              std::function<std::string(const Event&)> figure, int stop_fd,
              std::function<void()> on_stop, std::function<void()> on_turn);
  ~Housekeeper();
  // Takes what is left in the ring and ends the thread.
  void stop();

 private:
  void run();
  void drain();
  void keep_history();

  EventRing& events_;
  LineBudget lines_;
  HistoryRings& rings_;
  HistoryKeeper* history_;
  LogSink& log_;
  std::function<std::string(const Event&)> figure_;
  int stop_fd_;
  std::function<void()> on_stop_;
  std::function<void()> on_turn_;
  std::uint64_t dropped_ = 0;
  std::atomic<bool> ending_{false};
  std::thread thread_;
};

}  // namespace beltgrip::daemon
