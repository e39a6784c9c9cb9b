#include "daemon/core/observe/event.h"

#include <bit>
#include <cmath>
#include <utility>

#include "can_dbc/text/number_text.h"
#include "daemon/core/experiment/arming.h"
#include "daemon/core/publish/names.h"
#include "daemon/core/reasons/reasons.h"

namespace beltgrip::daemon {

EventLevel level_of(const Event& event) {
  return event.id == EventId::kFaultRaised ? EventLevel::kWarning : EventLevel::kInfo;
}

namespace {

std::string result_text(const ExperimentResult& result) {
  std::string text = "experiment " + std::string(outcome_name(result.outcome)) + ", stop reason " +
                     std::string(stop_reason_name(result.stop_reason));
  if (const std::string cause = why(result); !cause.empty()) text += " (" + cause + ")";
  if (result.peak.kind == estimator::PeakKind::kValue) {
    text += ", mu_max " + fixed_text(result.peak.mu_max, 4) + " +- " +
            fixed_text(result.peak.mu_max_std, 4);
  } else if (has_bound(result)) {
    text += ", mu_max above " + fixed_text(result.peak.mu_max, 4);
  }
  const std::string_view remedy = remedy_of(result);
  return remedy.empty() ? text : text + "; to do: " + std::string(remedy);
}

// What the event itself knows.
std::string fault_figure(const Event& event) {
  if (event.cause.role) return std::string(role_name(*event.cause.role));
  return event.identifier != 0 ? "0x" + hex_text(event.identifier) : "";
}

}  // namespace

std::string text_of(const Event& event, const std::string& figure) {
  switch (event.id) {
    case EventId::kState:
      return "state " + std::string(state_name(State{event.from})) + " -> " +
             std::string(state_name(State{event.to}));
    case EventId::kStop:
      return "MacroSlipStop, reason " + std::string(stop_reason_name(event.reason)) + " (" +
             cause_text(event.reason, event.cause) + "), slip " +
             fixed_text(event.slip_percent, 2) + " %, mu* " + fixed_text(event.mu_star, 4);
    case EventId::kResult:
      return result_text(event.result);
    case EventId::kInhibit:
      return "no experiment: " + reason_text(reason_of(Inhibit{event.to}, figure));
    case EventId::kFaultRaised: {
      const std::string own = fault_figure(event);
      return "fault " + reason_text(reason_of(Fault{event.to}, own.empty() ? figure : own));
    }
    case EventId::kFaultCleared:
      break;
  }
  return "fault " + std::string(kFaults[event.to].name) + " gone";
}

bool LineBudget::take(const Event& event) noexcept {
  if (event.id == EventId::kStop || event.id == EventId::kResult) return true;
  MonoTime& oldest = taken_[count_ % kMost];
  if (count_ >= kMost && event.t - oldest < kSecond) {
    ++left_out_;
    return false;
  }
  oldest = event.t;
  ++count_;
  return true;
}

unsigned LineBudget::left_out(MonoTime t) noexcept {
  if (left_out_ == 0 || t - said_ < kSecond) return 0;
  said_ = t;
  return std::exchange(left_out_, 0U);
}

void EventSink::on_report(const SampleReport& report) noexcept {
  if (report.macro_slip_stop && !stop_) {
    ring_.push({.t = report.t,
                .id = EventId::kStop,
                .reason = report.stop_reason,
                .slip_percent = report.curve.sigma_star_percent,
                .mu_star = report.curve.mu_star,
                .cause = report.stop_cause});
  }
  stop_ = report.macro_slip_stop;
  if (report.new_result) {
    ring_.push({.t = report.t, .id = EventId::kResult, .result = report.result});
  }
  if (report.state != state_) {
    ring_.push({.t = report.t,
                .id = EventId::kState,
                .from = static_cast<std::uint8_t>(state_),
                .to = static_cast<std::uint8_t>(report.state)});
  }
  state_ = report.state;
  for (std::uint32_t changed = report.faults ^ faults_, fault = 0; changed != 0;
       changed >>= 1, ++fault) {
    if ((changed & 1U) == 0) continue;
    const bool raised = (report.faults >> fault & 1U) != 0;
    Event event{.t = report.t,
                .id = raised ? EventId::kFaultRaised : EventId::kFaultCleared,
                .to = static_cast<std::uint8_t>(fault)};
    if (fault == static_cast<std::uint32_t>(Fault::kInputFrozen)) event.cause.role = report.frozen;
    if (fault == static_cast<std::uint32_t>(Fault::kForeignSender)) {
      event.identifier = report.foreign_identifier;
    }
    ring_.push(event);
  }
  faults_ = report.faults;
  look_at_inhibits(report);
}

void EventSink::look_at_inhibits(const SampleReport& report) noexcept {
  const std::uint32_t now = report.in_experiment ? 0U : report.inhibits;
  if (now != inhibits_) inhibits_since_ = report.t;
  inhibits_ = now;
  if (now == 0 && report.in_experiment) inhibit_said_ = 0;
  if (!std::has_single_bit(now) || now == inhibit_said_ ||
      report.t - inhibits_since_ < kInhibitAfter) {
    return;
  }
  inhibit_said_ = now;
  ring_.push({.t = report.t,
              .id = EventId::kInhibit,
              .to = static_cast<std::uint8_t>(std::countr_zero(now))});
}

}  // namespace beltgrip::daemon
