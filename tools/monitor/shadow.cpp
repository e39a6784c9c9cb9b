#include "tools/monitor/shadow.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "daemon/core/experiment/arming.h"
#include "tools/monitor/shown_unit.h"
#include "tools/reasons/reasons.h"

namespace beltgrip::monitor {

namespace {

using daemon::MonoTime;
using daemon::Role;
using daemon::SignalQuality;

constexpr std::array<const char*, 6> kTrust{"valid", "learning", "frozen",
                                            "stale", "missing",  "unbound"};

std::string format(const char* pattern, auto... arguments) {
  char buffer[160];
  std::snprintf(buffer, sizeof buffer, pattern, arguments...);
  return buffer;
}

std::string trust_of(SignalQuality quality) { return kTrust.at(static_cast<std::size_t>(quality)); }

// The roles that cannot be used, each with why.
std::string roles_in_doubt(const daemon::Pipeline& pipeline) {
  std::string text;
  for (std::size_t i = 0; i < daemon::kRoleCount; ++i) {
    const auto role = static_cast<Role>(i);
    const SignalQuality quality = pipeline.signal(role).quality;
    if (quality == SignalQuality::kValid || quality == SignalQuality::kUnbound) continue;
    text += (text.empty() ? "" : ", ") + std::string(role_name(role)) + " " + trust_of(quality);
  }
  return text;
}

std::string value_text(Role role, double value) {
  const Shown shown = in_shown_unit(role_dimension(role), value);
  return format("%.4g %s", shown.value, shown.unit);
}

std::string figure_of(daemon::Inhibit inhibit, const daemon::Config& config,
                      const daemon::Pipeline& pipeline) {
  using daemon::Inhibit;
  const auto value = [&](Role role) { return pipeline.signal(role).value; };
  const auto seen = [&](Role role) { return pipeline.signal(role).seen; };
  const auto at_least = [&](Role role, double limit) {
    if (!seen(role)) return std::string();
    return value_text(role, value(role)) + ", needs " + value_text(role, limit);
  };
  switch (inhibit) {
    case Inhibit::kInputs:
      return roles_in_doubt(pipeline);
    case Inhibit::kPedal:
      return seen(Role::kAcceleratorPedal)
                 ? value_text(Role::kAcceleratorPedal, value(Role::kAcceleratorPedal))
                 : "";
    case Inhibit::kSpeed:
      return at_least(Role::kPrimarySpeed, config.experiment.primary_speed_min_rad_s);
    case Inhibit::kOil:
      return at_least(Role::kOilTemperature, config.experiment.oil_temperature_min_degC);
    case Inhibit::kTorque: {
      const double torque_Nm = pipeline.report().curve.torque_p_Nm;
      if (!pipeline.report().curve.usable) return "";
      return format("%.1f Nm, needs %g to %g Nm", torque_Nm, config.experiment.torque_min_Nm,
                    config.experiment.torque_max_Nm);
    }
    case Inhibit::kRatio: {
      const double primary = value(Role::kPrimarySpeed);
      if (!seen(Role::kPrimarySpeed) || !seen(Role::kSecondarySpeed) || primary <= 0.0) return "";
      return format("%.3f, end stops %g and %g", value(Role::kSecondarySpeed) / primary,
                    config.variator.ratio_low, config.variator.ratio_overdrive);
    }
    default:
      return "";
  }
}

// What an inhibit means now, with its figure and limit where the inputs tell one.
Reason reason_of(daemon::Inhibit inhibit, const daemon::Config& config,
                 const daemon::Pipeline& pipeline) {
  return {std::string(daemon::kInhibits[static_cast<std::size_t>(inhibit)].name),
          std::string(reasons::words_of(inhibit).means), figure_of(inhibit, config, pipeline)};
}

}  // namespace

Shadow::Shadow(const daemon::Config& config, Sent sent)
    : config_(config),
      pipeline_(config),
      sent_(std::move(sent)),
      period_(
          std::llround(static_cast<double>(daemon::kSecond) / config.estimator.sample_rate_hz)) {}

void Shadow::on_frame(const daemon::RxFrame& frame) {
  begin(frame.t);
  while (next_ < frame.t) sample();
  pipeline_.on_frame(frame);
  if (pipeline_.counters().frames_decoded != decoded_) count_values(frame.t);
  decoded_ = pipeline_.counters().frames_decoded;
}

// The grid of samples begins with the first frame, or the first instant.
void Shadow::begin(MonoTime t) {
  if (!begun_) next_ = t;
  begun_ = true;
}

void Shadow::count_values(MonoTime t) {
  for (std::size_t i = 0; i < daemon::kRoleCount; ++i) {
    const daemon::SignalObservation seen = pipeline_.signal(static_cast<Role>(i));
    if (!seen.seen || seen.t == newest_[i]) continue;
    newest_[i] = seen.t;
    rates_[i].add(t, 1.0);
  }
}

void Shadow::advance(MonoTime now) {
  begin(now);
  while (next_ <= now) sample();
}

void Shadow::sample() {
  if (link_ != link_said_) pipeline_.on_bus_state(link_, next_);
  link_said_ = link_;
  outbox_.size = 0;
  pipeline_.on_sample(next_, outbox_);
  for (std::size_t i = 0; i < outbox_.size; ++i) {
    if (outbox_.bus[i] == 0) sent_(next_, outbox_.frames[i]);
    // A bus confirms what it has taken.
    pipeline_.on_frame({next_, outbox_.frames[i], true, 0, outbox_.bus[i]});
  }
  next_ += period_;
}

void Shadow::show(View& view, MonoTime now) const {
  view.inputs.clear();
  view.inhibits.clear();
  view.inhibits_known = begun_;
  const daemon::SampleReport& report = pipeline_.report();
  view.force_given_N.reset();
  if (report.curve.usable) view.force_given_N = report.curve.clamp_force_N;
  for (std::size_t i = 0; i < daemon::kInhibitCount; ++i) {
    const auto inhibit = static_cast<daemon::Inhibit>(i);
    if ((report.inhibits & daemon::inhibit_bit(inhibit)) == 0) continue;
    view.inhibits.push_back(reason_of(inhibit, config_, pipeline_));
  }
  for (std::size_t i = 0; i < daemon::kRoleCount; ++i) {
    const auto role = static_cast<Role>(i);
    const daemon::SignalObservation seen = pipeline_.signal(role);
    if (seen.quality == SignalQuality::kUnbound) continue;
    InputRow row;
    row.role = role_name(role);
    row.is_flag = role_dimension(role) == can::Dimension::kNone;
    const Shown shown = in_shown_unit(role_dimension(role), seen.value);
    row.unit = shown.unit;
    if (seen.seen) row.value = shown.value;
    row.age_s = seen.seen ? static_cast<double>(now - seen.t) * 1e-9 : 0.0;
    row.rate_Hz = rates_[i].per_second(now);
    row.trust = trust_of(seen.quality);
    row.good = seen.quality == SignalQuality::kValid;
    view.inputs.push_back(std::move(row));
  }
}

}  // namespace beltgrip::monitor
