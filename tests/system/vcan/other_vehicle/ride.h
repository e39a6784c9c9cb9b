// The car, its controller and its engine control on a bus, tick by tick. Whose bus and whose clock
// it is, who drives on says: drive.h beside a beltgripd in real time, virtual_drive.h beside the
// daemon's pipeline in virtual time.
#pragma once

#include <array>
#include <functional>
#include <random>
#include <set>
#include <string>
#include <vector>

#include "tests/system/vcan/other_vehicle/account.h"
#include "tests/system/vcan/other_vehicle/car.h"
#include "tests/system/vcan/other_vehicle/controller.h"
#include "tests/system/vcan/other_vehicle/frames.h"

namespace beltgrip::other {

struct Kind {
  double torque_Nm = kDragTorque_Nm;  // with the foot off the pedal; more is drive
  double traction_share = 1.0;
};

class Ride {
 public:
  Ride(const Kind& kind, std::size_t seed);
  virtual ~Ride() = default;
  Ride(const Ride&) = delete;
  Ride& operator=(const Ride&) = delete;

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
  // The pressure's sensor: one standard deviation, steps and period of its values, and by how much
  // more than the controller it reads.
  double pressure_noise_kPa = 3.0, pressure_step_kPa = 0.2, pressure_period_s = 0.010;
  double pressure_offset_kPa = 0.0, pressure_gain = 0.0;

 protected:
  static constexpr double kTick_s = 0.002;

  // Whatever has come until the tick is due, to hear(); then this car's own tick.
  virtual void exchange() = 0;
  virtual void put(canid_t id, const Bytes& frame) = 0;
  void hear(canid_t id, const Bytes& frame);
  long ticks() const { return ticks_; }

 private:
  void tick();
  void send(MessageIndex which, const std::vector<double>& values);
  void send_all();
  double noisy(double value, double deviation);
  double pressure_read_kPa();

  Car car_;
  Controller controller_;
  Account account_;
  long ticks_ = 0;
  std::array<int, kMessages> counters_{};
  std::array<std::vector<double>, kMessages> sent_;
  double pressure_read_kPa_ = 0.0, pressure_read_s_ = -1.0;
  std::mt19937_64 random_;
};

}  // namespace beltgrip::other
