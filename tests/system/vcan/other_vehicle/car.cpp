#include "tests/system/vcan/other_vehicle/car.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace beltgrip::other {
namespace {

constexpr double kRise = 0.113, kRiseSlip_percent = 0.65;
constexpr double kWeakening = 0.040, kWeakeningSlip_percent = 6.0;
constexpr double kDeformation_per_N = 1.2e-6;  // of the ratio: 0.5 % at 4 kN
constexpr double kVehicleInertia_kg_m2 = 4.0;  // seen at the secondary
constexpr double kFinalDrive = 5.4, kWheel_m = 0.30;
constexpr double kDrag_Nm_s2 = 6.0e-5;  // air, at the secondary
constexpr double kEngineLag_s = 0.12;
// Two stages where BeltGrip is configured for one; both and the dead time lie within what it is
// told.
constexpr double kDeadTime_s = 0.030, kPilotLag_s = 0.020, kCylinderLag_s = 0.090;

double wedge() { return std::cos(kHalfWedge_deg * std::numbers::pi / 180.0); }

}  // namespace

double traction(double slip_percent) {
  const double s = std::abs(slip_percent);
  const double mu = kRise * (1.0 - std::exp(-s / kRiseSlip_percent)) -
                    kWeakening * (1.0 - std::exp(-s / kWeakeningSlip_percent));
  return std::copysign(mu, slip_percent);
}

double peak_slip_percent() {
  double low = 0.0, high = 10.0;
  while (high - low > 1e-9) {
    const double third = (high - low) / 3.0;
    if (traction(low + third) < traction(high - third)) {
      low += third;
    } else {
      high -= third;
    }
  }
  return low;
}

double peak_traction() { return traction(peak_slip_percent()); }

double clamp_N(double pressure_Pa, double secondary_rad_s) {
  return kPistonArea_m2 * pressure_Pa + kSpring_N +
         kCentrifugal_N_s2 * secondary_rad_s * secondary_rad_s;
}

double pressure_Pa(double clamp_N, double secondary_rad_s) {
  const double rest = clamp_N - kSpring_N - kCentrifugal_N_s2 * secondary_rad_s * secondary_rad_s;
  return std::clamp(rest / kPistonArea_m2, 20e3, 5e6);
}

Car::Car(double torque_Nm, double clamp_N, double traction_share)
    : clamp_command_N(clamp_N), torque_demand_Nm(torque_Nm), traction_share_(traction_share) {
  state_[kPrimary] = kCruise_rad_s;
  state_[kSecondary] = kCruise_rad_s * kRatioOverdrive;
  state_[kEngine] = torque_Nm;
  const double pressure = other::pressure_Pa(clamp_N, state_[kSecondary]);
  state_[kPilot] = state_[kPressure] = pressure;
  commands_Pa_.fill(pressure);
  const double drag = kDrag_Nm_s2 * state_[kSecondary] * state_[kSecondary];
  slope_load_Nm_ = torque_Nm / kRatioOverdrive - drag;
}

double Car::vehicle_m_s() const { return state_[kSecondary] / kFinalDrive * kWheel_m; }

Belt Car::belt_of(const State& state) const {
  Belt belt;
  belt.clamp_N = other::clamp_N(state[kPressure], state[kSecondary]);
  const double ratio = kRatioOverdrive * (1.0 - kDeformation_per_N * belt.clamp_N);
  const double primary_m_s = state[kPrimary] * kPrimaryRadius_m;
  const double secondary_m_s = state[kSecondary] * kPrimaryRadius_m / ratio;
  belt.slip_m_s = primary_m_s - secondary_m_s;
  belt.slip_percent = 100.0 * belt.slip_m_s / std::max(1.0, std::min(primary_m_s, secondary_m_s));
  belt.force_N = 2.0 * traction_share_ * traction(belt.slip_percent) * belt.clamp_N / wedge();
  return belt;
}

Car::State Car::slope(const State& state, double command_Pa) const {
  const Belt belt = belt_of(state);
  State d{};
  d[kPrimary] = (state[kEngine] - belt.force_N * kPrimaryRadius_m) / kPrimaryInertia_kg_m2;
  const double load = slope_load_Nm_ + kDrag_Nm_s2 * state[kSecondary] * state[kSecondary];
  d[kSecondary] = (belt.force_N * kPrimaryRadius_m / kRatioOverdrive - load - brake_Nm - road_Nm) /
                  kVehicleInertia_kg_m2;
  d[kPilot] = (command_Pa - state[kPilot]) / kPilotLag_s;
  d[kPressure] = (state[kPilot] - state[kPressure]) / kCylinderLag_s;
  d[kEngine] = (torque_demand_Nm - state[kEngine]) / kEngineLag_s;
  return d;
}

void Car::step() {
  const std::size_t size = commands_Pa_.size();
  commands_Pa_[steps_ % size] = other::pressure_Pa(clamp_command_N, state_[kSecondary]);
  const auto way = static_cast<std::size_t>(std::lround((kDeadTime_s + late_s) / kStep_s));
  const double command_Pa = commands_Pa_[(steps_ + size - way) % size];
  ++steps_;

  const auto beside = [&](const State& by, double share) {
    State moved = state_;
    for (std::size_t i = 0; i < moved.size(); ++i) moved[i] += share * kStep_s * by[i];
    return moved;
  };
  const State a = slope(state_, command_Pa);
  const State b = slope(beside(a, 0.5), command_Pa);
  const State c = slope(beside(b, 0.5), command_Pa);
  const State d = slope(beside(c, 1.0), command_Pa);
  for (std::size_t i = 0; i < state_.size(); ++i) {
    state_[i] += kStep_s / 6.0 * (a[i] + 2.0 * b[i] + 2.0 * c[i] + d[i]);
  }
}

}  // namespace beltgrip::other
