#include "tests/system/vcan/other_vehicle/ride.h"

#include <cmath>
#include <numbers>

namespace beltgrip::other {
namespace {

constexpr long kStepsPerTick = 4;   // of Car::kStep_s in a tick
constexpr long kTicksPerCycle = 5;  // 10 ms
constexpr double kRpm = 30.0 / std::numbers::pi;
// Noise of the sensors, one standard deviation, and the road's unevenness: torque with the memory
// of a wheel.
constexpr double kSpeedNoise_rpm = 0.25, kTorqueNoise_Nm = 0.3;
constexpr double kRoad_Nm = 0.6, kRoadMemory = 0.98;
constexpr double kBrake_Nm = 220.0;  // at the secondary, 3 m/s2

}  // namespace

Ride::Ride(const Kind& kind, std::size_t seed)
    : pedal_percent(100.0 * (kind.torque_Nm - kDragTorque_Nm) / kTorquePerPedal_Nm),
      car_(kind.torque_Nm, own_force_N(kind.torque_Nm), kind.traction_share),
      random_(seed) {}

double Ride::slip_percent() const { return std::abs(car_.belt().slip_percent); }

bool Ride::until(const std::function<bool()>& done, double limit_s) {
  const double end_s = t_s() + limit_s;
  while (!done()) {
    if (t_s() >= end_s) return false;
    tick();
  }
  return true;
}

void Ride::drive_on(double duration_s) {
  until([] { return false; }, duration_s);
}

void Ride::tick() {
  ++ticks_;
  exchange();
  car_.road_Nm = kRoadMemory * car_.road_Nm +
                 noisy(0.0, kRoad_Nm * std::sqrt(1.0 - kRoadMemory * kRoadMemory));
  car_.torque_demand_Nm = kDragTorque_Nm + kTorquePerPedal_Nm * pedal_percent / 100.0;
  car_.brake_Nm = brake ? kBrake_Nm : 0.0;
  if (ticks_ % kTicksPerCycle == 0) {
    controller_.permits = !brake && !refuses && car_.primary_rad_s() > 85.0;
    controller_.judge_torque(t_s(), car_.torque_demand_Nm, car_.engine_Nm());
    car_.clamp_command_N = controller_.command_N(t_s(), car_.secondary_rad_s());
    send_all();
  }
  for (long i = 0; i < kStepsPerTick; ++i) {
    car_.step();
    account_.step(car_.belt());
  }
}

void Ride::hear(canid_t id, const Bytes& frame) {
  account_.frame(t_s(), id, frame, car_.belt(), car_.secondary_rad_s());
  if (id == kClampId) controller_.hear(t_s(), frame);
}

double Ride::noisy(double value, double deviation) {
  return value + std::normal_distribution(0.0, deviation)(random_);
}

double Ride::pressure_read_kPa() {
  if (t_s() < pressure_read_s_ + pressure_period_s - 0.5 * kTick_s) return pressure_read_kPa_;
  pressure_read_s_ = t_s();
  const double read_kPa =
      (1.0 + pressure_gain) * noisy(car_.pressure_Pa() / 1000.0, pressure_noise_kPa) +
      pressure_offset_kPa;
  pressure_read_kPa_ = pressure_step_kPa * std::round(read_kPa / pressure_step_kPa);
  return pressure_read_kPa_;
}

void Ride::send(MessageIndex which, const std::vector<double>& values) {
  const Message& message = messages()[which];
  std::vector<double>& told = sent_.at(which);
  told.resize(values.size());
  for (std::size_t i = 0; i < values.size(); ++i) {
    if (!frozen.contains(message.fields[i].name)) told[i] = values[i];
  }
  int& counter = counters_.at(which);
  counter = (counter + 1) % 15;
  if (!lost.contains(which)) put(message.id, encode(message, counter, told));
}

void Ride::send_all() {
  send(kShafts, {noisy(car_.primary_rad_s() * kRpm, kSpeedNoise_rpm),
                 noisy(car_.secondary_rad_s() * kRpm, kSpeedNoise_rpm)});
  send(kHydraulics, {pressure_read_kPa(), 82.0, 2.0, controller_.permits ? 1.0 : 0.0});
  send(kMotor, {noisy(car_.engine_Nm(), kTorqueNoise_Nm),
                noisy(car_.primary_rad_s() * kRpm, kSpeedNoise_rpm), pedal_percent});
  if (ticks_ % (2 * kTicksPerCycle) == 0) {
    send(kChassis, {car_.vehicle_m_s() * 3.6, brake ? 1.0 : 0.0});
  }
}

}  // namespace beltgrip::other
