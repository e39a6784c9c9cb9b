#include "tests/system/vcan/other_vehicle/drive.h"

#include <algorithm>
#include <cmath>
#include <fstream>
#include <numbers>

namespace beltgrip::other {
namespace {

using Clock = std::chrono::steady_clock;
constexpr long kStepsPerTick = 4;   // of Car::kStep_s in a tick
constexpr long kTicksPerCycle = 5;  // 10 ms
constexpr double kRpm = 30.0 / std::numbers::pi;
// Noise of the sensors, one standard deviation, and the road's unevenness: torque with the memory
// of a wheel.
constexpr double kSpeedNoise_rpm = 0.25, kTorqueNoise_Nm = 0.3, kPressureNoise_kPa = 3.0;
constexpr double kRoad_Nm = 0.6, kRoadMemory = 0.98;
constexpr double kBrake_Nm = 220.0;  // at the secondary, 3 m/s2

}  // namespace

Drive::Drive(const std::string& folder, const Kind& kind, std::size_t seed)
    : pedal_percent(100.0 * (kind.torque_Nm - kDragTorque_Nm) / kTorquePerPedal_Nm),
      folder_(folder),
      bus_("vcan0"),
      car_(kind.torque_Nm, own_force_N(kind.torque_Nm), kind.traction_share),
      start_(Clock::now()),
      random_(seed) {
  std::ofstream(folder_ + "/other.dbc") << dbc_text();
  std::ofstream(folder_ + "/other.toml")
      << configuration_text(kind.torque_Nm < 0.0 ? "coast_down" : "steady");
}

void Drive::start_daemon() {
  daemon_.reset();
  account_.another_daemon();
  daemon_ = std::make_unique<test::Process>(
      std::vector<std::string>{BELTGRIP_BIN_DIR "/beltgripd", "--config", folder_ + "/other.toml"});
}

std::string Drive::daemon_log() {
  daemon_->wait(test::Milliseconds{0});
  return daemon_->err();
}

double Drive::slip_percent() const { return std::abs(car_.belt().slip_percent); }

bool Drive::until(const std::function<bool()>& done, double limit_s) {
  const double end_s = t_s() + limit_s;
  while (!done()) {
    if (t_s() >= end_s) return false;
    tick();
  }
  return true;
}

void Drive::drive_on(double duration_s) {
  until([] { return false; }, duration_s);
}

void Drive::tick() {
  ++ticks_;
  const auto due = start_ + std::chrono::microseconds(ticks_ * 2000);
  for (;;) {
    const auto left = std::chrono::ceil<test::Milliseconds>(due - Clock::now());
    const std::optional<test::SeenFrame> seen = bus_.receive(std::max(left, test::Milliseconds{0}));
    if (seen) hear(*seen);
    if (!seen && Clock::now() >= due) break;
  }
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

void Drive::hear(const test::SeenFrame& seen) {
  const Bytes frame(seen.frame.data, seen.frame.data + seen.frame.len);
  account_.frame(t_s(), seen.frame.can_id, frame, car_.belt(), car_.secondary_rad_s());
  if (seen.frame.can_id == kClampId) controller_.hear(t_s(), frame);
}

double Drive::noisy(double value, double deviation) {
  return value + std::normal_distribution(0.0, deviation)(random_);
}

void Drive::send(MessageIndex which, const std::vector<double>& values) {
  const Message& message = messages()[which];
  std::vector<double>& told = sent_.at(which);
  told.resize(values.size());
  for (std::size_t i = 0; i < values.size(); ++i) {
    if (!frozen.contains(message.fields[i].name)) told[i] = values[i];
  }
  int& counter = counters_.at(which);
  counter = (counter + 1) % 15;
  if (!lost.contains(which)) bus_.send(message.id, encode(message, counter, told));
}

void Drive::send_all() {
  send(kShafts, {noisy(car_.primary_rad_s() * kRpm, kSpeedNoise_rpm),
                 noisy(car_.secondary_rad_s() * kRpm, kSpeedNoise_rpm)});
  send(kHydraulics, {noisy(car_.pressure_Pa() / 1000.0, kPressureNoise_kPa), 82.0, 2.0,
                     controller_.permits ? 1.0 : 0.0});
  send(kMotor, {noisy(car_.engine_Nm(), kTorqueNoise_Nm),
                noisy(car_.primary_rad_s() * kRpm, kSpeedNoise_rpm), pedal_percent});
  if (ticks_ % (2 * kTicksPerCycle) == 0) {
    send(kChassis, {car_.vehicle_m_s() * 3.6, brake ? 1.0 : 0.0});
  }
}

}  // namespace beltgrip::other
