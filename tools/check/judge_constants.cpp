#include "tools/check/judge_constants.h"

#include <algorithm>
#include <cmath>

#include "tools/check/text.h"
#include "tools/check/thresholds.h"

namespace beltgrip::check {

namespace {

double period_of(const std::string& role, const Periods& periods_s) {
  for (std::size_t i = 0; i < periods_s.size(); ++i) {
    if (daemon::role_name(static_cast<daemon::Role>(i)) == role) return periods_s[i];
  }
  return 0.0;
}

}  // namespace

Findings judge_constants(std::span<const calibrate::Finding> measured, const daemon::Config& config,
                         const Periods& periods_s) {
  Findings found;
  // Where nothing shows that the converter is closed, slip in it passes for inertia and delay.
  const bool closed_shows = std::any_of(
      config.roles.begin(), config.roles.end(),
      [](const daemon::RoleBinding& role) { return role.role == daemon::Role::kEngineSpeed; });
  // And a delay that comes with an inertia that was refused is no better.
  const bool inertia_known =
      std::any_of(measured.begin(), measured.end(), [](const calibrate::Finding& each) {
        return each.key == "variator.primary_inertia_kg_m2" && each.value;
      });
  for (const calibrate::Finding& each : measured) {
    if (!each.value) continue;
    const bool by_torque =
        each.key == "delay.engine_torque" || each.key == "variator.primary_inertia_kg_m2";
    if (by_torque && !(closed_shows && inertia_known)) continue;
    const double value = *each.value;
    const double sure = kConstantDeviations * each.std;
    if (each.key.starts_with("delay.")) {
      const std::string role = each.key.substr(6);
      const double told_s = std::max(kDelayTold_s, kDelayToldPeriods * period_of(role, periods_s));
      if (std::abs(value) < std::max(sure, told_s)) continue;
      found.push_back(
          {Weight::kNote, role +
                              format(" tells %.0f ms %s (+- %.0f)", 1e3 * std::abs(value),
                                     value > 0.0 ? "late" : "early", 1e3 * each.std) +
                              ": delay_ms, as beltgrip calibrate writes it"});
    } else if (each.key.starts_with("variator.")) {
      if (each.configured <= 0.0) continue;
      const bool ratio = each.key.starts_with("variator.ratio");
      const double allowed = each.configured * (ratio ? kRatioOff : kInertiaOff);
      if (std::abs(value - each.configured) < std::max(sure, allowed)) continue;
      const bool assumed =
          std::find(config.assumed.begin(), config.assumed.end(), each.key) != config.assumed.end();
      found.push_back(
          {Weight::kDoubt, each.key +
                               format(" reads as %.4g +- %.2g, %s %.4g", value, each.std,
                                      assumed ? "assumed" : "configured", each.configured) +
                               (ratio ? ""
                                      : "; or the torque is read by that factor too small or too "
                                        "large (percent of a reference torque?)")});
    } else if (std::abs(value) > std::max(sure, kZeroTold_Pa)) {
      found.push_back(
          {Weight::kDoubt, each.key + format(" reads %.3g kPa where all stands still: offset, as "
                                             "beltgrip calibrate writes it",
                                             1e-3 * value)});
    }
  }
  return found;
}

}  // namespace beltgrip::check
