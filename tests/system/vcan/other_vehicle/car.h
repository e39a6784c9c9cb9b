// The truth: belt, hydraulics, engine and road, written from the published facts alone. Nothing of
// BeltGrip is included here or in the files beside it; what they say of the belt is their own.
#pragma once

#include <array>
#include <cstddef>

namespace beltgrip::other {

// All chosen within the ranges of production variators, none equal to a default of BeltGrip.
inline constexpr double kHalfWedge_deg = 11.0;
inline constexpr double kRatioOverdrive = 2.31;
inline constexpr double kPrimaryRadius_m = 0.0765;  // at the overdrive stop, where the car drives
inline constexpr double kPistonArea_m2 = 0.0105;
inline constexpr double kSpring_N = 620.0;
inline constexpr double kCentrifugal_N_s2 = 3.0e-3;
inline constexpr double kPrimaryInertia_kg_m2 = 0.21;
inline constexpr double kDragTorque_Nm = -36.0;      // engine of 2.2 l without fuel
inline constexpr double kTorquePerPedal_Nm = 220.0;  // between no and full pedal
inline constexpr double kCruise_rad_s = 140.0;       // of the primary: 65 km/h

// Traction over slip in percent: a rise that saturates less a weakening that comes later. It falls
// by 3.1e-3 per percent behind its peak at most.
double traction(double slip_percent);
// Where it is greatest, and how great: found by search in `traction` itself.
double peak_slip_percent();
double peak_traction();

// Clamping force at this pressure, and the pressure for a force.
double clamp_N(double pressure_Pa, double secondary_rad_s);
double pressure_Pa(double clamp_N, double secondary_rad_s);

struct Belt {
  double clamp_N = 0.0;
  double slip_percent = 0.0;  // of the slower side's speed; + = the primary is faster
  double slip_m_s = 0.0;
  double force_N = 0.0;  // traction, + = the primary drives
};

class Car {
 public:
  // At rest in all but its speed: this torque, this clamping force; a belt that has this share of
  // the traction.
  Car(double torque_Nm, double clamp_N, double traction_share);

  // One step of kStep_s by Runge and Kutta's fourth order.
  void step();
  static constexpr double kStep_s = 0.5e-3;

  // From outside.
  double clamp_command_N = 0.0;
  double torque_demand_Nm = 0.0;
  double brake_Nm = 0.0;  // at the secondary
  double road_Nm = 0.0;   // unevenness
  double late_s = 0.0;    // valves that obey late
  double primary_rad_s() const { return state_[kPrimary]; }
  double secondary_rad_s() const { return state_[kSecondary]; }
  double pressure_Pa() const { return state_[kPressure]; }
  double engine_Nm() const { return state_[kEngine]; }
  double vehicle_m_s() const;
  Belt belt() const { return belt_of(state_); }
  double mu_max() const { return traction_share_ * peak_traction(); }

 private:
  enum { kPrimary, kSecondary, kPilot, kPressure, kEngine, kStates };
  using State = std::array<double, kStates>;

  Belt belt_of(const State& state) const;
  State slope(const State& state, double command_Pa) const;

  State state_{};
  double traction_share_;
  double slope_load_Nm_ = 0.0;  // downhill, so that the car keeps its speed
  // Commands on their way through the valve.
  std::array<double, 2048> commands_Pa_{};
  std::size_t steps_ = 0;
};

}  // namespace beltgrip::other
