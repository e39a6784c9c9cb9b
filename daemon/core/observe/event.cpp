#include "daemon/core/observe/event.h"

#include <array>
#include <bit>
#include <charconv>
#include <cmath>
#include <utility>

#include "daemon/core/experiment/arming.h"
#include "daemon/core/publish/names.h"

namespace beltgrip::daemon {

namespace {

std::string rounded(double value, int digits) {
  std::array<char, 48> text;
  const auto end = std::to_chars(text.data(), text.data() + text.size(), value,
                                 std::chars_format::fixed, digits);
  return {text.data(), end.ptr};
}

std::string hexadecimal(std::uint32_t value) {
  std::array<char, 8> text;
  const auto end = std::to_chars(text.data(), text.data() + text.size(), value, 16);
  std::string out(text.data(), end.ptr);
  for (char& c : out) c = c >= 'a' ? static_cast<char>(c - 'a' + 'A') : c;
  return out;
}

}  // namespace

EventLevel level_of(const Event& event) {
  return event.id == EventId::kFaultRaised ? EventLevel::kWarning : EventLevel::kInfo;
}

std::string text_of(const Event& event) {
  const auto reason = std::string(stop_reason_name(event.reason));
  switch (event.id) {
    case EventId::kState:
      return "state " + std::string(state_name(State{event.from})) + " -> " +
             std::string(state_name(State{event.to}));
    case EventId::kStop:
      return "MacroSlipStop, reason " + reason + " (" + cause_text(event.reason, event.cause) +
             "), slip " + rounded(event.first, 2) + " %, mu* " + rounded(event.second, 4);
    case EventId::kResult: {
      std::string text =
          "experiment " + std::string(outcome_name(Outcome{event.to})) + ", stop reason " + reason;
      const std::string cause = cause_text(event.reason, event.cause);
      if (!cause.empty()) text += " (" + cause + ")";
      if (event.kind == estimator::PeakKind::kValue) {
        text += ", mu_max " + rounded(event.first, 4) + " +- " + rounded(event.second, 4);
      } else if (event.kind == estimator::PeakKind::kLowerBound) {
        text += ", mu_max above " + rounded(event.first, 4);
      }
      return text;
    }
    case EventId::kInhibit:
      return "no experiment: " + std::string(kInhibits[event.to].name);
    case EventId::kFaultRaised:
      return "fault " + std::string(kFaults[event.to].name) +
             (event.cause.role ? " (" + std::string(role_name(*event.cause.role)) + ")" : "") +
             (event.identifier != 0 ? " (0x" + hexadecimal(event.identifier) + ")" : "");
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
                .first = report.curve.sigma_star_percent,
                .second = report.curve.mu_star,
                .cause = report.stop_cause});
  }
  stop_ = report.macro_slip_stop;
  if (report.new_result) {
    ring_.push({.t = report.t,
                .id = EventId::kResult,
                .to = static_cast<std::uint8_t>(report.result.outcome),
                .reason = report.result.stop_reason,
                .kind = report.result.peak.kind,
                .first = report.result.peak.mu_max,
                .second = report.result.peak.mu_max_std,
                .cause = report.result.cause});
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
