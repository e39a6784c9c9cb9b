// The embedded bus, inproc:NAME: several Ports of one process on one bus, no kernel CAN needed. In
// real time, or in virtual time: then one port's thread runs at a time and time passes only while
// all of them wait, so that a run is the same every time.
//
// A frame reaches every port at the instant it was sent, its sender as an echo. Frames wait in a
// ring of fixed size; what does not fit is dropped and counted, as a socket does. Ports lock a
// mutex: the embedded bus is for demonstration and tests, the vehicle's bus is SocketPort.
#pragma once

#include <condition_variable>
#include <limits>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "daemon/core/base/port.h"

namespace beltgrip::daemon {

class InprocBus : public std::enable_shared_from_this<InprocBus> {
 public:
  enum class Clock { kMonotonic, kVirtual };
  static constexpr MonoTime kNever = MonoTime::max();

  static std::shared_ptr<InprocBus> create(Clock clock);
  // The bus of that name in this process, on the monotonic clock; made on the first call.
  static std::shared_ptr<InprocBus> named(const std::string& name);
  ~InprocBus();

  // A port is used by one thread. Of two ports that are due at the same instant of virtual time the
  // one connected later runs first: connect the daemon before what feeds it, and a sample sees the
  // frames of its own instant, as it does in a replay.
  std::unique_ptr<Port> connect();
  // Ends the bus: each port takes what is waiting for it, then gets kClosed. Any thread.
  void close();

 private:
  class InprocPort;
  struct Slot;

  explicit InprocBus(Clock clock);
  MonoTime time_now() const;  // mutex held in virtual time
  void schedule();            // virtual time: hands the run to the next port, mutex held

  const Clock clock_;
  std::mutex mutex_;
  std::vector<std::unique_ptr<Slot>> slots_;  // by order of connection; gaps stay empty
  Slot* running_ = nullptr;                   // virtual time: whose thread runs
  MonoTime virtual_now_;
  bool closed_ = false;
};

}  // namespace beltgrip::daemon
