#include "daemon/core/experiment/stop_of.h"

#include <cmath>
#include <limits>

#include "estimator/physics/units.h"

namespace beltgrip::daemon {

using estimator::kPercent;
using estimator::StopReason;

Stop stop_of(SafetyVerdict verdict, double figure, double limit) noexcept {
  const auto percent = [&](const char* what) {
    return StopCause{
        .what = what, .figure = kPercent * figure, .limit = kPercent * limit, .unit = "%"};
  };
  const auto in = [&](const char* what, const char* unit) {
    return StopCause{.what = what, .figure = figure, .limit = limit, .unit = unit};
  };
  switch (verdict) {
    case SafetyVerdict::kSlip:
      return {StopReason::kSlip, percent("slip since the start")};
    case SafetyVerdict::kSlipSpeed:
      return {StopReason::kSlip, in("slip speed", "m/s")};
    case SafetyVerdict::kSlipRate:
      return {StopReason::kSlipRate,
              {.what = "slip grows by",
               .figure = kPercent * figure,
               .limit = kPercent * limit,
               .unit = "%/s"}};
    case SafetyVerdict::kPower:
      return {StopReason::kSlipEnergy, in("slip power for 0.6 s", "W")};
    case SafetyVerdict::kSpeed: {
      StopCause cause = in("falls to", "rad/s");
      cause.role = Role::kPrimarySpeed;
      return {StopReason::kEngineSpeed, cause};
    }
    case SafetyVerdict::kSecondary: {
      StopCause cause = in("stands still or turns back", "rad/s");
      cause.role = Role::kSecondarySpeed;
      return {StopReason::kInputs, cause};
    }
    case SafetyVerdict::kEngine: {
      StopCause cause = percent("leaves the primary speed by");
      cause.role = Role::kEngineSpeed;
      return {StopReason::kEngineSpeed, cause};
    }
    case SafetyVerdict::kDuration:
      return {StopReason::kTime, {.what = "the request stands for too long"}};
    case SafetyVerdict::kFloor:
      return {StopReason::kForceFloor, in("request below its floor", "N")};
    case SafetyVerdict::kStart:
      return {StopReason::kInputs, in("a request begins below the force that acts", "N")};
    case SafetyVerdict::kPause:
      return {StopReason::kInputs, {.what = "a request too soon after the last"}};
    case SafetyVerdict::kRise:
    case SafetyVerdict::kRate:
      return {StopReason::kInputs, {.what = "the request itself rises or falls too fast"}};
    default:
      return {StopReason::kInputs, {}};
  }
}

namespace {

StopCause no_crossing(const Obstacle& obstacle) noexcept {
  constexpr double kNoNumber = std::numeric_limits<double>::quiet_NaN();
  switch (obstacle.wall) {
    case CrossingWall::kSlip:
      return {.what = "the slip speed allows a peak at",
              .figure = kPercent * obstacle.figure,
              .limit = kPercent * obstacle.limit,
              .unit = "%"};
    case CrossingWall::kEnergy:
      return {.what = "a crossing costs",
              .figure = obstacle.figure,
              .limit = obstacle.limit,
              .unit = "J"};
    default:
      // Which fall is survived is told a little later than that this one is not.
      const bool told = std::isfinite(obstacle.figure);
      return {.what = told ? "a belt is caught to a fall behind its peak of"
                           : "no belt is caught at a fall behind its peak of",
              .figure = (told ? obstacle.figure : obstacle.limit) / kPercent,
              .limit = told ? obstacle.limit / kPercent : kNoNumber,
              .unit = "per % of slip",
              .further = "the own force is",
              .further_figure = obstacle.needed,
              .further_unit = "times the peak's"};
  }
}

}  // namespace

Stop stop_of(std::uint32_t inhibits, const Obstacle& obstacle) noexcept {
  const auto has = [inhibits](Inhibit which) { return (inhibits & inhibit_bit(which)) != 0; };
  const auto numbered = [&obstacle](const char* what, const char* unit) {
    return StopCause{
        .what = what, .figure = obstacle.figure, .limit = obstacle.limit, .unit = unit};
  };
  if (has(Inhibit::kUnreachable)) {
    StopCause cause = numbered("the force floor lies above the peak's force", "N");
    cause.further = "in reach where the primary turns below";
    cause.further_figure = obstacle.needed;
    cause.further_unit = "rad/s";
    return {StopReason::kForceFloor, cause};
  }
  if (has(Inhibit::kGrip)) {
    return {StopReason::kSlip,
            numbered("friction has fallen: slip under the own force has grown by", "%")};
  }
  if (has(Inhibit::kQuiet)) {
    return {StopReason::kInputs,
            {.what = "moves too seldom to show that it stands still, and so does engine_speed",
             .role = Role::kPrimarySpeed}};
  }
  if (has(Inhibit::kForce)) {
    return {StopReason::kTime, {.what = "the controller's own force did not come to rest"}};
  }
  if (has(Inhibit::kRamp)) {
    return {StopReason::kRoom, no_crossing(obstacle)};
  }
  StopCause cause = numbered("the ramp would last for", "s");
  cause.further = "in time at";
  cause.further_figure = obstacle.needed;
  cause.further_unit = "N/s";
  return {StopReason::kTime, cause};
}

Stop stop_of(const estimator::CurveEstimate& curve) noexcept {
  const auto because = [&](const StopCause& cause) { return Stop{curve.stop, cause}; };
  switch (curve.stop) {
    case StopReason::kSlope:
      return because({.what = "friction no longer rises with slip: slope",
                      .figure = curve.friction_slope,
                      .unit = "1/%"});
    case StopReason::kSlip:
    case StopReason::kSlipRate:
      return because(
          {.what = "slip runs away, at", .figure = curve.sigma_star_percent, .unit = "%"});
    case StopReason::kInputs:
      return because({.what = "an input stands still, or reads what no belt does: mu*",
                      .figure = curve.mu_star});
    case StopReason::kTorque:
      return because({.what = "torque near zero or of the other sign",
                      .figure = curve.torque_p_Nm,
                      .unit = "Nm"});
    case StopReason::kRatio:
      return because({.what = "slip that no end stop explains",
                      .figure = curve.sigma_star_percent,
                      .unit = "%"});
    default:
      return because({});
  }
}

}  // namespace beltgrip::daemon
