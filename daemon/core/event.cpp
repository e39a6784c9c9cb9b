#include "daemon/core/event.h"

#include <array>
#include <bit>
#include <charconv>
#include <cmath>
#include <utility>

#include "daemon/core/arming.h"

namespace beltgrip::daemon {

namespace {

constexpr std::array<std::string_view, kStateCount> kStateNames{
    "Inhibited", "Idle", "Settling", "Ramping", "Releasing", "Evaluating", "Cooldown", "Fault"};
constexpr std::array<std::string_view, 4> kOutcomeNames{"None", "Completed", "Inconclusive",
                                                        "Aborted"};
constexpr std::array<std::string_view, 17> kReasonNames{
    "None",       "Slope",      "Confidence",  "Slip",     "SlipRate", "SlipEnergy",
    "Time",       "ForceFloor", "EngineSpeed", "Torque",   "Ratio",    "Inputs",
    "Permission", "Driver",     "Bus",         "Shutdown", "TraceEnd"};

std::string rounded(double value, int digits) {
  std::array<char, 48> text;
  const auto end = std::to_chars(text.data(), text.data() + text.size(), value,
                                 std::chars_format::fixed, digits);
  return {text.data(), end.ptr};
}

}  // namespace

std::string_view state_name(State state) { return kStateNames[static_cast<std::size_t>(state)]; }
std::string_view outcome_name(Outcome outcome) {
  return kOutcomeNames[static_cast<std::size_t>(outcome)];
}
std::string_view stop_reason_name(estimator::StopReason reason) {
  return kReasonNames[static_cast<std::size_t>(reason)];
}

EventLevel level_of(const Event& event) {
  return event.id == EventId::kFaultRaised ? EventLevel::kWarning : EventLevel::kInfo;
}

std::string text_of(const Event& event) {
  const auto reason = std::string(stop_reason_name(event.reason));
  switch (event.id) {
    case EventId::kState:
      return "state " + std::string(kStateNames[event.from]) + " -> " +
             std::string(kStateNames[event.to]);
    case EventId::kStop:
      return "MacroSlipStop, reason " + reason + ", slip " + rounded(event.first, 2) + " %, mu* " +
             rounded(event.second, 4);
    case EventId::kResult: {
      std::string text =
          "experiment " + std::string(kOutcomeNames[event.to]) + ", stop reason " + reason;
      if (event.kind == estimator::PeakKind::kValue) {
        text += ", mu_max " + rounded(event.first, 4) + " +- " + rounded(event.second, 4);
      } else if (event.kind == estimator::PeakKind::kLowerBound) {
        text += ", mu_max above " + rounded(event.first, 4);
      }
      return text;
    }
    case EventId::kInhibit:
      return "no experiment: " + std::string(kInhibitNames[event.to]);
    case EventId::kFaultRaised:
      return "fault " + std::string(kFaultNames[event.to]);
    case EventId::kFaultCleared:
      break;
  }
  return "fault " + std::string(kFaultNames[event.to]) + " gone";
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
                .first = report.curve.sigma_star_percent,
                .second = report.curve.mu_star});
  }
  stop_ = report.macro_slip_stop;
  if (report.new_result) {
    ring_.push({.t = report.t,
                .id = EventId::kResult,
                .to = static_cast<std::uint8_t>(report.result.outcome),
                .reason = report.result.stop_reason,
                .kind = report.result.peak.kind,
                .first = report.result.peak.mu_max,
                .second = report.result.peak.mu_max_std});
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
    ring_.push({.t = report.t,
                .id = raised ? EventId::kFaultRaised : EventId::kFaultCleared,
                .to = static_cast<std::uint8_t>(fault)});
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
