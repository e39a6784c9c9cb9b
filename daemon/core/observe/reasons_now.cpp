#include "daemon/core/observe/reasons_now.h"

#include <cmath>

#include "can_dbc/text/format.h"
#include "daemon/core/input/stop_cause.h"
#include "estimator/physics/units.h"

namespace beltgrip::daemon {

using estimator::ReadingVerdict;
using estimator::verdict_text;

namespace {

// Roles that a test of their verdict takes, each followed by that verdict where it is asked for.
std::string roles_with(const Signals& signals, auto&& takes, bool says_verdict) {
  std::string text;
  for (std::size_t i = 0; i < kRoleCount; ++i) {
    const ReadingVerdict verdict = signals[i].status.verdict;
    if (!takes(verdict)) continue;
    text += (text.empty() ? "" : ", ") + std::string(role_name(static_cast<Role>(i)));
    if (says_verdict) text += " " + std::string(verdict_text(verdict));
  }
  return text;
}

std::string fault_names(std::uint32_t bits) {
  std::string text;
  for (std::size_t i = 0; i < kFaultCount; ++i) {
    if ((bits >> i & 1U) != 0) text += (text.empty() ? "" : ", ") + std::string(kFaults[i].name);
  }
  return text;
}

// The inhibit that SampleReport.obstacle is of: the first of these that stands.
bool is_of_obstacle(Inhibit inhibit, std::uint32_t inhibits) {
  for (const Inhibit each : {Inhibit::kUnreachable, Inhibit::kGrip, Inhibit::kQuiet,
                             Inhibit::kForce, Inhibit::kRamp, Inhibit::kTime}) {
    if ((inhibits & inhibit_bit(each)) != 0) return each == inhibit;
  }
  return false;
}

// Every signal is there, and yet the belt cannot be read: what that rests on.
std::string belt_unread(const Config& config, const Signals& signals) {
  const auto of = [&](Role role) { return signals[static_cast<std::size_t>(role)]; };
  const Role torque =
      config.estimator.torque_is_engine ? Role::kEngineTorque : Role::kPrimaryTorque;
  const double primary_rad_s = of(Role::kPrimarySpeed).value;
  std::string text = format("torque %.3g Nm", of(torque).value);
  if (primary_rad_s > 0.0) {
    text += format(", ratio %.3f, end stops %.4g and %.4g",
                   of(Role::kSecondarySpeed).value / primary_rad_s, config.variator.ratio_low,
                   config.variator.ratio_overdrive);
  }
  return text;
}

}  // namespace

Signals signals_of(const Pipeline& pipeline) {
  Signals signals;
  for (std::size_t i = 0; i < kRoleCount; ++i) {
    signals[i] = pipeline.signal(static_cast<Role>(i));
  }
  return signals;
}

std::string figure_of(Inhibit inhibit, const Config& config, const SampleReport& report,
                      const Signals& signals) {
  const auto of = [&](Role role) { return signals[static_cast<std::size_t>(role)]; };
  const ExperimentSettings limits = begins_within(config);
  switch (inhibit) {
    case Inhibit::kInputs: {
      const std::string lost = roles_with(signals, estimator::is_doubtful, true);
      return lost.empty() ? belt_unread(config, signals) : lost;
    }
    case Inhibit::kFault:
      return fault_names(report.faults);
    case Inhibit::kPedal:
      if (!of(Role::kAcceleratorPedal).seen) return "";
      return format("%.3g %%, limit %.3g %%",
                    estimator::kPercent * of(Role::kAcceleratorPedal).value,
                    estimator::kPercent * Arming::kPedalReleased);
    case Inhibit::kSpeed:
      return format("%.4g rad/s, limit %.4g rad/s", report.sample.omega_p_rad_s,
                    limits.primary_speed_min_rad_s);
    case Inhibit::kOil:
      if (!std::isfinite(report.oil_degC)) return "";
      return format("%.3g degC, limit %.3g degC", report.oil_degC, limits.oil_temperature_min_degC);
    case Inhibit::kTorque:
      return format("%.3g Nm, limits %.3g and %.3g Nm %s", report.curve.torque_p_Nm,
                    limits.torque_min_Nm, limits.torque_max_Nm,
                    config.trigger == Trigger::kCoastDown ? "of overrun" : "of drive");
    case Inhibit::kRatio:
      if (!(report.sample.omega_p_rad_s > 0.0)) return "";
      return format("%.3f, end stops %.4g and %.4g",
                    report.sample.omega_s_rad_s / report.sample.omega_p_rad_s,
                    config.variator.ratio_low, config.variator.ratio_overdrive);
    case Inhibit::kCooldown:
      return format("limits %g s and %g m", limits.cooldown_s, limits.cooldown_m);
    case Inhibit::kModel:
      return report.beyond ? beyond_text(report.beyond) : "";
    default:
      return is_of_obstacle(inhibit, report.inhibits) && report.obstacle.what != nullptr
                 ? cause_text(estimator::StopReason::kNone, report.obstacle)
                 : "";
  }
}

std::string figure_of(Fault fault, const SampleReport& report, const Signals& signals) {
  const auto those = [&](ReadingVerdict verdict) {
    return roles_with(
        signals, [&](ReadingVerdict each) { return each == verdict; }, false);
  };
  switch (fault) {
    case Fault::kInputMissing:
      return those(ReadingVerdict::kMissing);
    case Fault::kInputStale:
      return those(ReadingVerdict::kStale);
    case Fault::kInputFrozen:
      return report.frozen ? std::string(role_name(*report.frozen))
                           : those(ReadingVerdict::kFrozen);
    case Fault::kForeignSender:
      return report.foreign_identifier != 0 ? format("0x%X", report.foreign_identifier) : "";
    default:
      return "";
  }
}

std::string figure_of(const Event& event, const Config& config, const SampleReport& report,
                      const Signals& signals) {
  if (event.id == EventId::kInhibit) return figure_of(Inhibit{event.to}, config, report, signals);
  if (event.id == EventId::kFaultRaised) return figure_of(Fault{event.to}, report, signals);
  return "";
}

}  // namespace beltgrip::daemon
