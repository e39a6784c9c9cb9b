// The car, its controller and its engine control on vcan0, in real time, beside a beltgripd.
#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <random>
#include <set>
#include <string>
#include <vector>

#include "tests/support/process.h"
#include "tests/system/vcan/other_vehicle/account.h"
#include "tests/system/vcan/other_vehicle/car.h"
#include "tests/system/vcan/other_vehicle/controller.h"
#include "tests/system/vcan/other_vehicle/frames.h"

namespace beltgrip::other {

struct Kind {
  double torque_Nm = kDragTorque_Nm;  // with the foot off the pedal; more is drive
  double traction_share = 1.0;
};

class Drive {
 public:
  // On the vcan0 of this thread's network namespace; DBC and configuration go into the folder.
  Drive(const std::string& folder, const Kind& kind, std::size_t seed);

  void start_daemon();
  test::Process& daemon() { return *daemon_; }
  std::string daemon_log();  // what it has said
  // Drives until `done` says so, asked after each tick; false after `limit_s`.
  bool until(const std::function<bool()>& done, double limit_s);
  void drive_on(double duration_s);

  double t_s() const { return static_cast<double>(ticks_) * kTick_s; }
  double slip_percent() const;  // its magnitude
  double mu_max() const { return car_.mu_max(); }
  Account& account() { return account_; }
  const Account& account() const { return account_; }
  Controller& controller() { return controller_; }
  Car& car() { return car_; }

  // What the driver and the faults do.
  double pedal_percent = 0.0;
  bool brake = false;
  bool refuses = false;  // the controller withdraws its permission
  std::set<MessageIndex> lost;
  std::set<std::string> frozen;  // fields that keep their value while their frames go on

 private:
  static constexpr double kTick_s = 0.002;

  void tick();
  void hear(const test::SeenFrame& seen);
  void send(MessageIndex which, const std::vector<double>& values);
  void send_all();
  double noisy(double value, double deviation);

  std::string folder_;
  test::BusSocket bus_;
  std::unique_ptr<test::Process> daemon_;
  Car car_;
  Controller controller_;
  Account account_;
  std::chrono::steady_clock::time_point start_;
  long ticks_ = 0;
  std::array<int, kMessages> counters_{};
  std::array<std::vector<double>, kMessages> sent_;
  std::mt19937_64 random_;
};

}  // namespace beltgrip::other
