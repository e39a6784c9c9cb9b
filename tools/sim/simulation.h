// A run in virtual time, of a rig or of a car: its clock in integer nanoseconds, the true values of
// what sensors measure, and the faults that act. Simulation only.
#pragma once

#include <cmath>
#include <cstdint>
#include <numbers>

#include "tools/sim/fault_script.h"
#include "tools/sim/world.h"

namespace beltgrip::sim {

enum class RigMode : std::uint8_t {
  kHold,
  kLowering,
  kRestoring,
  kRest
};  // wire values of RigMode

// True values of what is measured, SI. What a plant does not have stays zero.
struct Signals {
  double omega_p_rad_s = 0.0;
  double omega_s_rad_s = 0.0;
  double angle_p_rad = 0.0;  // of the shafts
  double angle_s_rad = 0.0;
  double secondary_pressure_Pa = 0.0;
  double secondary_pressure_command_Pa = 0.0;
  double oil_degC = 0.0;
  // Of a car.
  double omega_e_rad_s = 0.0;
  double torque_e_Nm = 0.0;  // as the engine's controller knows it
  double accelerator = 0.0;
  double primary_pressure_Pa = 0.0;
  double speed_m_s = 0.0;
  double brake_pressed = 0.0;
  double lockup_closed = 0.0;
  double experiment_permitted = 0.0;
  // Of a rig.
  double torque_p_Nm = 0.0;  // flange between drive machine and primary pulley
  double torque_s_Nm = 0.0;  // flange between secondary pulley and load machine
  RigMode mode = RigMode::kHold;
};

class Simulation {
 public:
  virtual void step() = 0;
  virtual bool finished() const = 0;
  // False once the plant's state has become infinite or not a number: the run is void.
  virtual bool finite() const = 0;

  std::int64_t now_ns() const { return now_ns_; }
  std::int64_t step_ns() const { return step_ns_; }
  const Signals& signals() const { return signals_; }
  const FaultScript& faults() const { return faults_; }

 protected:
  explicit Simulation(const World& world)
      : faults_(world.faults),
        step_ns_(std::llround(world.step_s * 1e9)),
        step_s_(static_cast<double>(step_ns_) * 1e-9) {}
  ~Simulation() = default;

  double seconds() const { return static_cast<double>(now_ns_) * 1e-9; }
  // The shafts' speeds after a step, and how far they have turned in it.
  void turn(double omega_p_rad_s, double omega_s_rad_s) {
    const auto turned = [this](double angle_rad, double omega_rad_s) {
      constexpr double kTurn_rad = 2.0 * std::numbers::pi;
      const double next_rad = angle_rad + omega_rad_s * step_s_;
      return std::abs(next_rad) < kTurn_rad ? next_rad : std::fmod(next_rad, kTurn_rad);
    };
    signals_.omega_p_rad_s = omega_p_rad_s;
    signals_.omega_s_rad_s = omega_s_rad_s;
    signals_.angle_p_rad = turned(signals_.angle_p_rad, omega_p_rad_s);
    signals_.angle_s_rad = turned(signals_.angle_s_rad, omega_s_rad_s);
  }

  FaultScript faults_;
  std::int64_t step_ns_;
  double step_s_;
  std::int64_t now_ns_ = 0;
  double slip_energy_kJ_ = 0.0;
  Signals signals_;
};

}  // namespace beltgrip::sim
