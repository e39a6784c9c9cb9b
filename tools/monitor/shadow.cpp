#include "tools/monitor/shadow.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "daemon/core/observe/reasons_now.h"
#include "tools/monitor/shown_unit.h"

namespace beltgrip::monitor {

namespace {

using daemon::MonoTime;
using daemon::Role;
using estimator::ReadingVerdict;

}  // namespace

Shadow::Shadow(const daemon::Config& config, Sent sent)
    : config_(config),
      pipeline_(config),
      sent_(std::move(sent)),
      period_(daemon::period_of(config.estimator.sample_rate_hz)),
      carried_watch_(config.control == daemon::Control::kCommand),
      carried_(config) {}

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
  if (const daemon::CarriedWindow* window = carried_watch_.step(pipeline_.report())) {
    carried_.take(*window, daemon::seconds(window->end.since_origin()));
  }
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
  view.carried = carried_.bounds();
  const daemon::SampleReport& report = pipeline_.report();
  view.force_given_N.reset();
  if (report.curve.usable) view.force_given_N = report.curve.clamp_force_N;
  daemon::each_inhibit(config_, report, daemon::signals_of(pipeline_),
                       [&](Reason each) { view.inhibits.push_back(std::move(each)); });
  for (std::size_t i = 0; i < daemon::kRoleCount; ++i) {
    const auto role = static_cast<Role>(i);
    const daemon::SignalObservation seen = pipeline_.signal(role);
    if (seen.status.verdict == ReadingVerdict::kUnbound) continue;
    InputRow row;
    row.role = role_name(role);
    row.is_flag = role_dimension(role) == can::Dimension::kNone;
    const Shown shown = in_shown_unit(role_dimension(role), seen.value);
    row.unit = shown.unit;
    if (seen.seen) row.value = shown.value;
    row.age_s = seen.seen ? static_cast<double>((now - seen.t).ns()) * 1e-9 : 0.0;
    row.rate_Hz = rates_[i].per_second(now);
    row.trust = estimator::verdict_text(seen.status.verdict);
    row.trust_s = daemon::seconds(now - MonoTime::of_ns(seen.status.since_ns));
    row.good = seen.status.verdict == ReadingVerdict::kValid;
    view.inputs.push_back(std::move(row));
  }
}

}  // namespace beltgrip::monitor
