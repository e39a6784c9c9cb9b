#include "daemon/core/publish/output_stage.h"

#include <algorithm>
#include <cmath>

namespace beltgrip::daemon {

namespace {

// Two periods of BeltGripClamp.
constexpr Duration kConfirmationMax = 20 * kMillisecond;
constexpr Duration kConfirmationRetry = kSecond;  // then the frame is taken for lost

ClampLimits clamp_limits(const Config& config) {
  constexpr double kRounding_N = 1.0;
  const double floor_N =
      config.variator.secondary_spring_force_N +
      config.variator.secondary_piston_area_m2 * config.experiment.secondary_pressure_floor_Pa;
  return {floor_N - kRounding_N,
          config.estimator.ramp_rate_max_N_per_s * limits::kGateFramePeriod_s + kRounding_N,
          limits::kGateFrames};
}

// Every identifier that may be asked for, once, at the shortest period of its roles.
PollLimits poll_limits(const Config& config) {
  static_assert(PollLimits::kMost >= kRoleCount, "one request a role");
  PollLimits limits;
  if (config.diagnostics != Diagnostics::kPoll) return limits;
  for (const RoleBinding& role : config.roles) {
    if (!role.uds || !role.period_ms) continue;
    const auto period = Duration::of_ms(*role.period_ms);
    const auto end = limits.requests.begin() + static_cast<std::ptrdiff_t>(limits.size);
    const auto same = std::find_if(limits.requests.begin(), end, [&](const auto& each) {
      return each.bus == role.bus && each.id == role.uds->request &&
             each.service == role.uds->service && each.identifier == role.uds->identifier;
    });
    if (same != end) {
      same->period = std::min(same->period, period);
    } else {
      *same = {role.bus, role.uds->request, role.uds->identifier, period, role.uds->service};
      ++limits.size;
    }
  }
  return limits;
}

}  // namespace

OutputStage::OutputStage(const Config& config, Duration sample_period)
    : identifiers_(config.identifiers),
      publisher_(config.identifiers, sample_period),
      gate_(config.identifiers, config.control, clamp_limits(config), poll_limits(config)) {}

void OutputStage::on_frame(const RxFrame& frame, FaultSet& faults) noexcept {
  if (frame.bus != 0 || frame.frame.id.extended) return;
  if (frame.own_echo) {
    if (frame.frame.id.value == identifiers_.clamp) clamp_unconfirmed_ = false;
    return;
  }
  for (std::size_t i = 0; i < kOwnMessageCount; ++i) {
    if (frame.frame.id.value == own_identifier(identifiers_, static_cast<OwnMessage>(i))) {
      faults.raise(Fault::kForeignSender, frame.t);
      foreign_identifier_ = frame.frame.id.value;
    }
  }
}

void OutputStage::ask_again(MonoTime t, const FaultSet& faults) noexcept {
  if (!clamp_unconfirmed_ || t - clamp_sent_ < kConfirmationRetry) return;
  clamp_unconfirmed_ = false;
  if (!faults.has(Fault::kForeignSender)) publisher_.repeat_inactive();
}

void OutputStage::pass(MonoTime t, double acting_force_N, Outbox& outbox,
                       FaultSet& faults) noexcept {
  gate_.see_acting_force(acting_force_N);
  for (std::size_t i = 0; i < wanted_.size; ++i) {
    if (!gate_.permits(wanted_.frames[i], wanted_.bus[i], t)) {
      faults.latch(Fault::kFrameRefused);
      continue;
    }
    outbox.push(wanted_.frames[i], wanted_.bus[i]);
    if (is_clamp(wanted_.frames[i], wanted_.bus[i]) && !clamp_unconfirmed_) {
      clamp_unconfirmed_ = true;
      clamp_sent_ = t;
    }
  }
}

bool OutputStage::unconfirmed(MonoTime t) const noexcept {
  return clamp_unconfirmed_ && t - clamp_sent_ >= kConfirmationMax;
}

void OutputStage::go_on_from(const OutputStage& before) noexcept {
  publisher_.go_on_from(before.publisher_);
  refused_before_ = before.refused();
  clamp_unconfirmed_ = before.clamp_unconfirmed_;
  clamp_sent_ = before.clamp_sent_;
}

}  // namespace beltgrip::daemon
