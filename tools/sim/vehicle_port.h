// The daemon's Port onto the virtual vehicle, in virtual time: time passes only in wait_until,
// where the vehicle is stepped; what is sent reaches the transmission controller after its time on
// the bus. Bus faults of the scenario act here. Deterministic by seed. Simulation only.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <vector>

#include "daemon/core/base/port.h"
#include "tools/sim/bus.h"
#include "tools/sim/vehicle_simulation.h"

namespace beltgrip::sim {

class VehiclePort final : public daemon::Port {
 public:
  // Each may be empty: after every step of the plant; for every frame that the daemon put on the
  // bus, with the instant; for every frame that it took from the bus.
  struct Observers {
    std::function<void(const VehicleSimulation&)> on_step;
    std::function<void(std::int64_t, const can::CanFrame&)> on_sent;
    std::function<void(const daemon::RxFrame&)> on_received;
    std::function<void()> on_unsent;  // a frame that the bus did not take
    std::function<bool()> ends;       // true: the drive ends here
  };
  VehiclePort(const VehicleScenario& scenario, std::uint64_t seed, Observers observers = {});

  daemon::MonoTime now() noexcept override { return daemon::MonoTime::of_ns(now_ns_); }
  daemon::Wake wait_until(daemon::MonoTime deadline) noexcept override;
  std::size_t receive(std::span<daemon::RxFrame> out) noexcept override;
  daemon::SendResult send(const can::CanFrame& frame) noexcept override;
  daemon::BusState bus_state() noexcept override;

  // By the script the daemon is gone: whatever it still says, nobody hears.
  bool ended() const { return observers_.ends && observers_.ends(); }
  bool daemon_is_dead() const { return active(FaultKind::kDaemonDies) != nullptr; }
  // Runs the rest without the daemon.
  void run_alone();
  const VehicleSimulation& vehicle() const { return vehicle_; }
  // The plant's state has left the numbers: the run ended there.
  bool finite() const { return vehicle_.finite(); }

 private:
  struct Arrival {
    std::int64_t t_ns;
    std::uint64_t order;
    daemon::RxFrame frame;
    bool operator>(const Arrival& other) const {
      return t_ns != other.t_ns ? t_ns > other.t_ns : order > other.order;
    }
  };
  // Steps the vehicle up to t_ns, or until a frame is there.
  void advance(std::int64_t t_ns, bool stop_at_frame);
  // What the controller reports when a bus fault begins, as error frames.
  void report_bus_errors(double t_s);
  void send_foreign(double size);
  void flood(double t_s);
  void arrive(std::int64_t t_ns, const can::CanFrame& frame, bool own);
  const FaultStep* active(FaultKind kind) const;

  VehicleSimulation vehicle_;
  Bus bus_;
  Observers observers_;
  Random transmission_;
  std::int64_t now_ns_ = 0;
  std::int64_t sent_until_ns_ = 0;
  std::int64_t next_foreign_ns_ = 0;
  std::uint8_t foreign_counter_ = 0;
  bool was_off_ = false;
  bool was_passive_ = false;
  bool was_flooded_ = false;
  std::uint64_t order_ = 0;
  std::vector<Arrival> arrivals_;  // a heap, earliest first
  std::vector<can::StampedFrame> fresh_;
};

}  // namespace beltgrip::sim
