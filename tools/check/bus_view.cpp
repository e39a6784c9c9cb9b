#include "tools/check/bus_view.h"

#include <algorithm>
#include <bit>
#include <cmath>

#include "daemon/core/experiment/reachability.h"
#include "daemon/core/experiment/stop_of.h"
#include "daemon/core/observe/reasons_now.h"
#include "tools/check/thresholds.h"

namespace beltgrip::check {

using daemon::inhibit_bit;

namespace {

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

daemon::Config with(daemon::Config config, daemon::Control control) {
  config.control = control;
  if (config.trigger != daemon::Trigger::kSteady) config.trigger = daemon::Trigger::kCoastDown;
  return config;
}

constexpr std::uint32_t kDriver =
    inhibit_bit(Inhibit::kPedal) | inhibit_bit(Inhibit::kBrake) | inhibit_bit(Inhibit::kInputs);
constexpr std::uint32_t kClearance = inhibit_bit(Inhibit::kUnreachable) |
                                     inhibit_bit(Inhibit::kRamp) | inhibit_bit(Inhibit::kTime) |
                                     inhibit_bit(Inhibit::kGrip) | inhibit_bit(Inhibit::kForce) |
                                     inhibit_bit(Inhibit::kQuiet) | inhibit_bit(Inhibit::kWait);

}  // namespace

BusView::BusView(const daemon::Config& config, const RoleWatch& watch,
                 const daemon::Pipeline& pipeline, Thinned<Window>& windows, Prospects& prospects)
    : config_(config),
      watch_(watch),
      pipeline_(pipeline),
      windows_(windows),
      prospects_(prospects),
      arming_(with(config, daemon::Control::kCommand)),
      settling_(with(config, daemon::Control::kObserve)) {
  prospects_.judged =
      config.trigger == daemon::Trigger::kCoastDown || config.trigger == daemon::Trigger::kSteady;
}

BusView::~BusView() { end_opportunity(); }

// How long the slowest input of an experiment may be silent (daemon/core/input/input_stage.h).
daemon::Duration BusView::slowest_stale() const {
  double slowest_s = kGapLeast_s;
  for (const RoleCourse& course : watch_.roles()) {
    const Role role = course.binding->role;
    if (role == Role::kOilTemperature || role == Role::kVehicleSpeed || course.frames == 0)
      continue;
    const double period_s = course.span_s / static_cast<double>(course.frames);
    slowest_s = std::max(slowest_s, kGapPeriods * period_s);
  }
  return daemon::Duration::of_s(slowest_s);
}

double BusView::value(Role role) const {
  const daemon::SignalObservation seen = pipeline_.signal(role);
  const bool usable = seen.seen && (seen.status.verdict == estimator::ReadingVerdict::kValid ||
                                    seen.status.verdict == estimator::ReadingVerdict::kLearning ||
                                    seen.status.verdict == estimator::ReadingVerdict::kFrozen);
  return usable ? seen.value : kNaN;
}

void BusView::on_report(const daemon::SampleReport& report) noexcept {
  newest_ = report.t;
  if (!begin_) begin_ = report.t;
  take_window(report);
  if (prospects_.judged) {
    take_arming(report);
  } else if (report.in_experiment && report.curve.usable) {
    prospects_.carried_most = std::max(prospects_.carried_most, report.curve.mu_star);
  }
  if (!prospects_.judged && report.new_result) ++prospects_.experiments;
}

void BusView::take_window(const daemon::SampleReport& report) {
  if (!window_begin_) window_begin_ = report.t;
  ++samples_;
  for (std::size_t i = 0; i < daemon::kRoleCount; ++i) {
    const double now = value(static_cast<Role>(i));
    if (!std::isfinite(now)) continue;
    if (count_[i]++ == 0) first_[i] = now;
    last_[i] = now;
    sum_[i] += now;
  }
  if (report.curve.usable) {
    mu_sum_ += std::abs(report.curve.mu_star);
    slip_sum_percent_ += report.curve.sigma_star_percent;
    ++mu_count_;
  }
  const double length_s = static_cast<double>((report.t - *window_begin_).ns()) * 1e-9;
  if (length_s < kWindow_s) return;
  Window window;
  bool any = false;
  for (std::size_t i = 0; i < daemon::kRoleCount; ++i) {
    const bool whole = count_[i] == samples_;
    any = any || whole;
    window.mean[i] = whole ? sum_[i] / count_[i] : kNaN;
    window.change[i] = whole ? (last_[i] - first_[i]) / length_s : kNaN;
  }
  if (mu_count_ == samples_) {
    window.mu_star = mu_sum_ / samples_;
    window.slip_percent = slip_sum_percent_ / samples_;
  }
  if (any) windows_.add(window);
  window_begin_.reset();
  samples_ = mu_count_ = 0;
  sum_ = {};
  count_ = {};
  mu_sum_ = slip_sum_percent_ = 0.0;
}

daemon::Conditions BusView::conditions() const {
  const auto or_else = [this](Role role, double otherwise) {
    const double now = value(role);
    return std::isfinite(now) ? now : otherwise;
  };
  daemon::Conditions now;
  now.permitted = or_else(Role::kExperimentPermitted, 1.0) > 0.5;
  now.lockup_closed = or_else(Role::kLockupClosed, 1.0) > 0.5;
  now.brake_pressed = or_else(Role::kBrakePressed, 0.0) > 0.5;
  now.accelerator = or_else(Role::kAcceleratorPedal, now.accelerator);
  now.oil_degC = or_else(Role::kOilTemperature, now.oil_degC);
  return now;
}

void BusView::take_arming(const daemon::SampleReport& report) {
  daemon::Arming::Now now;
  now.t = report.t;
  now.usable = report.sample.usable && report.curve.usable;
  now.omega_p_rad_s = report.sample.omega_p_rad_s;
  now.omega_s_rad_s = report.sample.omega_s_rad_s;
  now.torque_Nm = report.curve.torque_p_Nm;
  now.clamp_force_N = report.curve.clamp_force_N;
  now.slip_percent = report.curve.sigma_star_percent;
  if (!held_) stale_ = slowest_stale();
  now.stale = stale_;
  now.conditions = conditions();
  arming_.step(now);
  settling_.step(now);
  const std::uint32_t inhibits = arming_.inhibits();

  // No foot forbids it, and few conditions alone are missing: those are told.
  const std::uint32_t conditions = inhibits & ~kClearance;
  const bool near =
      conditions != 0 && (conditions & kDriver) == 0 && std::popcount(conditions) <= kNearMisses;
  if (!near) {
    missing_ = 0;
  } else if (conditions != missing_) {
    missing_ = conditions;
    missing_since_ = report.t;
    missing_counted_ = false;
  } else if (!missing_counted_ && report.t - missing_since_ >= daemon::Arming::kSettle) {
    missing_counted_ = true;
    for (const auto& each : daemon::kInhibits) {
      if ((missing_ & inhibit_bit(each.value)) == 0) continue;
      ++prospects_.forbidden_by[static_cast<std::size_t>(each.value)];
      note_figure(each.value, inhibits, arming_.obstacle(), report);
    }
  }

  if (!arming_.triggered() || !now.usable) {
    end_opportunity();
    return;
  }
  if (!held_) {
    held_ = true;
    held_since_ = report.t;
    now_ = {};
    best_reach_ = -1.0;
    settled_ = false;
    unclear_samples_ = {};
  }
  const bool low = now.omega_s_rad_s / now.omega_p_rad_s < 1.0;
  const estimator::VariatorParameters& variator = config_.variator;
  daemon::RampPoint point;
  point.torque_Nm = std::abs(now.torque_Nm);
  point.primary_radius_m =
      low ? variator.primary_radius_low_m : variator.primary_radius_overdrive_m;
  point.wedge_cosine = std::cos(variator.half_wedge_angle_rad);
  point.floor_N = arming_.floor_N(now.omega_s_rad_s);
  const double reach = daemon::reachable_mu(point);
  if (reach > best_reach_) {
    best_reach_ = reach;
    now_.torque_Nm = point.torque_Nm;
    now_.floor_N = point.floor_N;
    now_.own_force_N = now.clamp_force_N;
    now_.omega_p_rad_s = now.omega_p_rad_s;
    now_.low = low;
    now_.needed_Nm = config_.experiment.friction_expected / reach * point.torque_Nm;
  }
  if (!settling_.settled()) return;
  settled_ = true;
  if (arming_.cleared()) now_.in_reach = true;
  for (const auto& each : daemon::kInhibits) {
    if ((inhibits & inhibit_bit(each.value)) == 0) continue;
    ++unclear_samples_[static_cast<std::size_t>(each.value)];
    note_figure(each.value, inhibits, arming_.obstacle(), report);
  }
}

// `report`: of a pipeline that holds no experiment back; what does comes from the arming here.
void BusView::note_figure(Inhibit inhibit, std::uint32_t inhibits, const daemon::Obstacle& obstacle,
                          daemon::SampleReport report) {
  std::string& figure = prospects_.figures[static_cast<std::size_t>(inhibit)];
  if (!figure.empty()) return;
  report.inhibits = inhibits;
  report.obstacle = daemon::stop_of(inhibits, obstacle).cause;
  figure = daemon::figure_of(inhibit, config_, report, daemon::signals_of(pipeline_));
}

void BusView::end_opportunity() {
  if (!held_) return;
  held_ = false;
  if (!settled_) return;
  ++prospects_.opportunities;
  now_.begin_s = static_cast<double>((held_since_ - begin_.value_or(held_since_)).ns()) * 1e-9;
  now_.length_s = static_cast<double>((newest_ - held_since_).ns()) * 1e-9;
  // Without the inertia the slip limits cannot be judged: reach alone counts.
  const bool by_reach_alone = config_.variator.primary_inertia_kg_m2 <= 0.0;
  if (by_reach_alone) now_.in_reach = now_.torque_Nm >= now_.needed_Nm;
  if (now_.in_reach) {
    ++prospects_.in_reach;
  } else if (by_reach_alone) {
    ++prospects_.forbidden_by[static_cast<std::size_t>(Inhibit::kUnreachable)];
    note_figure(Inhibit::kUnreachable, inhibit_bit(Inhibit::kUnreachable),
                {now_.floor_N, now_.floor_N * now_.torque_Nm / now_.needed_Nm}, {});
  } else {
    // The one that was in the way for the longest.
    const auto most = std::max_element(unclear_samples_.begin(), unclear_samples_.end());
    if (*most > 0) {
      const auto which = static_cast<std::size_t>(most - unclear_samples_.begin());
      now_.forbidden = std::uint32_t{1} << which;
      ++prospects_.forbidden_by[which];
    }
  }
  const double reach = now_.torque_Nm / now_.needed_Nm;
  const bool better = !prospects_.best || (now_.in_reach && !prospects_.best->in_reach) ||
                      (now_.in_reach == prospects_.best->in_reach &&
                       reach > prospects_.best->torque_Nm / prospects_.best->needed_Nm);
  if (better) prospects_.best = now_;
}

}  // namespace beltgrip::check
