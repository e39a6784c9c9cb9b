// The other car on vcan0, in real time, beside a beltgripd.
#pragma once

#include <chrono>
#include <memory>
#include <string>

#include "tests/support/process.h"
#include "tests/system/vcan/other_vehicle/ride.h"
#include "tests/system/vcan/vcan_fixture.h"

namespace beltgrip::other {

class Drive final : public Ride {
 public:
  // On the vcan0 of this thread's network namespace; DBC and configuration go into the folder.
  Drive(const std::string& folder, const Kind& kind, std::size_t seed);

  void start_daemon();
  test::Process& daemon() { return *daemon_; }
  std::string daemon_log();  // what it has said

 private:
  void exchange() override;
  void put(canid_t id, const Bytes& frame) override { bus_.send(id, frame); }

  std::string folder_;
  test::BusSocket bus_;
  std::unique_ptr<test::Process> daemon_;
  std::chrono::steady_clock::time_point start_;
};

}  // namespace beltgrip::other
