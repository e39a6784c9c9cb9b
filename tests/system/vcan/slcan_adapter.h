// A CAN controller that a test steers: a serial-line adapter (LAWICEL protocol) on a
// pseudo-terminal, which the kernel's slcan driver makes an interface of, with bit rate and error
// states. The test is the adapter and everything beyond it on the bus. Needs root of a kernel with
// slcan.
#pragma once

#include <atomic>
#include <chrono>
#include <condition_variable>
#include <functional>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

namespace beltgrip::test {

class SlcanAdapter {
 public:
  SlcanAdapter();
  ~SlcanAdapter();  // the interface vanishes, as an unplugged adapter's does
  SlcanAdapter(const SlcanAdapter&) = delete;
  SlcanAdapter& operator=(const SlcanAdapter&) = delete;

  const std::string& interface() const { return interface_; }
  // One line of the protocol to the driver: "t1108..." a frame from the bus, "sb256000" bus-off.
  void say(const std::string& line);
  // While stuck, nothing that the driver sends is taken.
  void stick(bool stuck) { stuck_ = stuck; }
  // Two nodes of one bus: what the driver sends here arrives at `other`, and the other way round.
  static void join(SlcanAdapter& one, SlcanAdapter& other);
  // While cut off, this node neither hears nor is heard.
  void cut_off(bool off) { cut_off_ = off; }
  // True once `done` holds for the lines that came from the driver since the last forget().
  bool wait(const std::function<bool(const std::vector<std::string>&)>& done,
            std::chrono::milliseconds limit);
  void forget();

 private:
  void pump();
  void pass_on(const std::string& line);

  int master_ = -1, slave_ = -1;
  std::string interface_;
  std::atomic<bool> stuck_{false}, ending_{false}, cut_off_{false};
  std::atomic<SlcanAdapter*> other_{nullptr};
  std::mutex mutex_;
  std::condition_variable came_;
  std::vector<std::string> lines_;
  std::thread thread_;
};

}  // namespace beltgrip::test
