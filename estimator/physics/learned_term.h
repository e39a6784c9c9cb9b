// A cause without a name, as a diagnosis learned it: a function of one recorded variable that acts
// at one point of the machine or of its measuring chain. Any thread; takes no memory.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string_view>

namespace beltgrip::estimator {

// g is the value of the function.
enum class LearnedPoint : std::uint8_t {
  kTorque,      // T_measured = T_true + g, Nm; or a drag of that size before the belt
  kTorqueGain,  // T_measured = (1 + g) T_true
  kClampForce,  // F_true = F_model + g, N
  kRatio,       // r_g = r_g0 (1 + g)
  kFriction,    // mu = mu_nom (1 + g)
};
inline constexpr std::array<std::string_view, 5> kLearnedPoints{
    "torque", "torque_gain", "clamp_force", "ratio", "friction"};  // of files

// In the unit of the role: degC, rad/s, Pa, Nm.
enum class LearnedVariable : std::uint8_t {
  kOilTemperature,
  kPrimarySpeed,
  kPrimaryPressure,
  kSecondaryPressure,
  kTorque,
};
struct LearnedRole {
  std::string_view role;
  LearnedVariable variable;
};
inline constexpr std::array<LearnedRole, 6> kLearnedRoles{{
    {"oil_temperature", LearnedVariable::kOilTemperature},
    {"primary_speed", LearnedVariable::kPrimarySpeed},
    {"primary_pressure", LearnedVariable::kPrimaryPressure},
    {"secondary_pressure", LearnedVariable::kSecondaryPressure},
    {"primary_torque", LearnedVariable::kTorque},
    {"engine_torque", LearnedVariable::kTorque},
}};
constexpr std::optional<LearnedVariable> learned_variable(std::string_view role) {
  for (const LearnedRole& each : kLearnedRoles) {
    if (each.role == role) return each.variable;
  }
  return std::nullopt;
}

// Values at knots, straight in between; the box is from the first knot to the last.
struct LearnedTerm {
  static constexpr std::size_t kKnotsMax = 64;  // chosen: three times what diagnose writes

  // Of files, cut where it is longer; ends with a zero.
  using Name = std::array<char, 32>;

  LearnedPoint point = LearnedPoint::kFriction;
  LearnedVariable variable = LearnedVariable::kOilTemperature;
  std::size_t count = 0;                  // of knots, at least two where it is one at all
  std::array<double, kKnotsMax> knot{};   // rising
  std::array<double, kKnotsMax> value{};  // in the unit of the point
  Name name{};

  // Whether the variable lies where the function was learned; NaN does not.
  bool covers(double x) const noexcept {
    return count > 0 && x >= knot[0] && x <= knot[count - 1];  // false of NaN
  }
  // Beyond the box as at its edge; 0 without a knot or a number.
  double at(double x) const noexcept {
    if (count == 0 || std::isnan(x)) return 0.0;
    if (x <= knot[0]) return value[0];
    if (x >= knot[count - 1]) return value[count - 1];
    const auto* const behind = std::upper_bound(knot.data(), knot.data() + count, x);
    const auto i = static_cast<std::size_t>(behind - knot.data());
    const double share = (x - knot[i - 1]) / (knot[i] - knot[i - 1]);
    return value[i - 1] + share * (value[i] - value[i - 1]);
  }
};

}  // namespace beltgrip::estimator
