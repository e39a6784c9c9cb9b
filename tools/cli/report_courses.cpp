#include "tools/cli/report_courses.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "can_dbc/text/format.h"
#include "daemon/core/publish/names.h"
#include "daemon/core/reasons/reasons.h"
#include "estimator/physics/clamp_force.h"
#include "estimator/physics/slip.h"
#include "tools/text/snake_case.h"

namespace beltgrip::cli {

namespace {

constexpr double kNone = std::numeric_limits<double>::quiet_NaN();

// Experiment, then the inhibits, then the faults, a bit each.
constexpr std::size_t kFirstInhibit = 1, kFirstFault = kFirstInhibit + daemon::kInhibitCount;

std::uint64_t standing(const daemon::SampleReport& report) {
  // What would keep another one from beginning while one runs is no hindrance.
  const std::uint32_t inhibits = report.in_experiment ? 0U : report.inhibits;
  return (report.in_experiment ? 1U : 0U) | std::uint64_t{inhibits} << kFirstInhibit |
         std::uint64_t{report.faults} << kFirstFault;
}

report::Lane lane(std::size_t i) {
  using report::LaneKind;
  if (i < kFirstInhibit) return {"experiment", LaneKind::kGoes, {}};
  if (i < kFirstFault) {
    return {std::string(daemon::kInhibits[i - kFirstInhibit].name), LaneKind::kForbids, {}};
  }
  return {"fault " + std::string(daemon::kFaults[i - kFirstFault].name), LaneKind::kFault, {}};
}

const daemon::Words& words(std::size_t i) {
  if (i < kFirstFault) return daemon::words_of(static_cast<daemon::Inhibit>(i - kFirstInhibit));
  return daemon::words_of(static_cast<daemon::Fault>(i - kFirstFault));
}

}  // namespace

ReportCourses::ReportCourses(std::string log, const daemon::Config& config, RunProgress& progress)
    : log_(std::move(log)),
      config_(config),
      progress_(progress),
      period_s_(1.0 / config.estimator.sample_rate_hz) {
  drive_.name = log_;
  drive_.period_s = now_.period_s = period_s_;
}

void ReportCourses::on_report(const daemon::SampleReport& report) noexcept {
  progress_.at(report.t);
  const double t_s = daemon::seconds(report.t.since_origin());
  take_wear(report);
  take_drive_sample(report, t_s);
  take_lanes(report, t_s);
  if (report.in_experiment && report.curve.usable) {
    const estimator::CurveEstimate& curve = report.curve;
    now_.t_s.push_back(t_s);
    now_.mu_star.push_back(curve.mu_star);
    now_.sigma_star_percent.push_back(curve.sigma_star_percent);
    now_.friction_slope_per_percent.push_back(curve.friction_slope);
    now_.slip_variance.push_back(curve.slip_variance);
    now_.clamp_force_N.push_back(curve.clamp_force_N);
    now_.phase.push_back(static_cast<std::size_t>(curve.phase));
    end_stop_ = curve.end_stop;
  }
  if (report.new_result) take_result(report.result);
}

// Away from an end stop the ratio itself changes, and near one it settles for a while: slip is
// known in experiments and where they could begin.
void ReportCourses::take_wear(const daemon::SampleReport& report) {
  using daemon::Inhibit;
  constexpr std::uint32_t kUnknown =
      daemon::inhibit_bit(Inhibit::kInputs) | daemon::inhibit_bit(Inhibit::kPedal) |
      daemon::inhibit_bit(Inhibit::kBrake) | daemon::inhibit_bit(Inhibit::kLockup) |
      daemon::inhibit_bit(Inhibit::kRatio) | daemon::inhibit_bit(Inhibit::kTorque) |
      daemon::inhibit_bit(Inhibit::kSpeed);
  const estimator::CurveEstimate& curve = report.curve;
  slip_known_ = curve.usable && (report.in_experiment || (report.inhibits & kUnknown) == 0);
  if (!curve.usable) return;
  const double more_J = curve.slip_energy_J - curve_energy_J_;
  curve_energy_J_ = curve.slip_energy_J;
  if (!slip_known_) return;
  const estimator::OperatingPoint point =
      operating_point(config_.variator, curve.end_stop, curve.direction);
  const double slip_share = 1e-2 * std::max(0.0, curve.sigma_star_percent);
  const auto add = [&](report::Wear& wear) {
    wear.known_s += period_s_;
    wear.energy_J += more_J >= 0.0 ? more_J : curve.slip_energy_J;  // less: it began anew
    wear.path_m += slip_share * report.sample.omega_p_rad_s * point.primary_radius_m * period_s_;
    wear.slip_most_percent = std::max(wear.slip_most_percent, curve.sigma_star_percent);
  };
  add(drive_.whole);
  if (!report.in_experiment) return;
  add(drive_.in_experiments);
  add(of_this_);
}

void ReportCourses::take_drive_sample(const daemon::SampleReport& report, double t_s) {
  const estimator::VariatorSample& sample = report.sample;
  const estimator::CurveEstimate& curve = report.curve;
  const auto add = [](std::vector<double>& values, bool known, double value) {
    values.push_back(known ? value : kNone);
  };
  drive_.t_s.push_back(t_s);
  add(drive_.primary_speed_rad_s, sample.usable, sample.omega_p_rad_s);
  add(drive_.secondary_speed_rad_s, sample.usable, sample.omega_s_rad_s);
  add(drive_.torque_Nm, sample.usable, sample.torque_Nm);
  add(drive_.belt_torque_Nm, curve.usable, curve.torque_p_Nm);
  const double force_N = estimator::secondary_clamp_force_N(
      config_.variator, sample.secondary_pressure_Pa, sample.omega_s_rad_s);
  add(drive_.clamp_force_N, sample.usable, force_N);
  add(drive_.asked_force_N, report.request_force_N > 0.0, report.request_force_N);
  add(drive_.sigma_star_percent, slip_known_, curve.sigma_star_percent);
  add(drive_.mu_star, slip_known_, curve.mu_star);
  add(drive_.mu_max, last_value_.has_value(), last_value_ ? last_value_->mu_max : kNone);
  drive_.slip_energy_J.push_back(drive_.whole.energy_J);
}

void ReportCourses::take_lanes(const daemon::SampleReport& report, double t_s) {
  const std::uint64_t bits = standing(report);
  for (std::size_t i = 0; i < kLaneCount; ++i) {
    std::optional<double>& since_s = since_s_[i];
    const bool stands = (bits >> i & 1U) != 0;
    if (stands && !since_s) since_s = t_s;
    if (stands || !since_s) continue;
    spans_s_[i].push_back({*since_s, t_s});
    since_s.reset();
  }
}

void ReportCourses::take_result(const daemon::ExperimentResult& result) {
  now_.name = log_ + format(", from %.2f s on", daemon::seconds(result.start.since_origin()));
  if (result.stopped) now_.stop_s = daemon::seconds(result.end.since_origin());
  const bool value = result.outcome == daemon::Outcome::kCompleted;
  const estimator::PeakEstimate& peak = result.peak;
  if (value) {
    now_.peak = {peak.mu_max, peak.ci95_low, peak.ci95_high};
    last_value_ = {now_.name, peak.mu_max, peak.sigma_peak_percent, end_stop_};
  }
  const bool bound = has_bound(result);
  const std::string mu_max = value   ? format("%.4f", peak.mu_max)
                             : bound ? format("at least %.4f", peak.mu_max)
                                     : "";
  now_.verdict = {now_.name,
                  outcome_text(result.outcome) + ", " + reason_text(result.stop_reason),
                  daemon::cause_text(result.stop_reason, result.cause),
                  text::snake_case(daemon::direction_name(result.direction)),
                  text::snake_case(daemon::end_stop_name(result.end_stop)),
                  mu_max,
                  value ? format("%.4f .. %.4f", peak.ci95_low, peak.ci95_high) : "",
                  result.stopped ? format("%.2f", result.sigma_stop_percent) : "",
                  value ? format("%.2f", peak.sigma_peak_percent) : "",
                  format("%.1f", of_this_.slip_most_percent),
                  format("%.0f", of_this_.energy_J),
                  format("%.2f", of_this_.path_m)};
  drive_.results.push_back({daemon::seconds(result.end.since_origin()),
                            mu_max.empty() ? outcome_text(result.outcome) : mu_max});
  experiments_.push_back(std::move(now_));
  now_ = {};
  now_.period_s = period_s_;
  of_this_ = {};
}

// Of a log whose requests were followed; else the pipeline's own stand in its reports.
void ReportCourses::take_requests(const std::vector<daemon::RecordedRequest>& followed) {
  daemon::RecordedRequests requests(followed);
  for (std::size_t i = 0; i < drive_.t_s.size(); ++i) {
    requests.step(daemon::MonoTime::of_ns(std::llround(drive_.t_s[i] * 1e9)));
    if (const double force_N = requests.force_N(); force_N > 0.0) {
      drive_.asked_force_N[i] = force_N;
    }
  }
}

void ReportCourses::finish(const ReplayResult& result) {
  if (result.requests_followed) take_requests(*result.requests_followed);
  const double end_s = drive_.t_s.empty() ? 0.0 : drive_.t_s.back() + period_s_;
  for (std::size_t i = 0; i < kLaneCount; ++i) {
    if (const std::optional<double>& since_s = since_s_[i]) {
      spans_s_[i].push_back({*since_s, end_s});
    }
    if (spans_s_[i].empty() && i >= kFirstInhibit) continue;
    report::Lane stood = lane(i);
    stood.spans_s = std::move(spans_s_[i]);
    if (i >= kFirstInhibit) {
      double sum_s = 0.0;
      for (const report::Interval& span : stood.spans_s) sum_s += span.high - span.low;
      const bool inhibit = i < kFirstFault;
      const std::size_t k = i - kFirstInhibit;
      drive_.reasons.push_back(
          {stood.name, format("%.1f", sum_s), std::to_string(stood.spans_s.size()),
           inhibit ? format("%.1f", result.inhibited_s[k]) : "", std::string(words(i).means),
           inhibit ? result.inhibit_figures[k] : "", std::string(words(i).remedy)});
    } else {
      drive_.experiments_s = stood.spans_s;
    }
    drive_.lanes.push_back(std::move(stood));
  }
}

}  // namespace beltgrip::cli
