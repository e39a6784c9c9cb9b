// Why an experiment ended, as plain data: what was found, its figure, the limit, and the role where
// there is one. Filled on the real-time thread; cause_text() makes words of it elsewhere.
#pragma once

#include <limits>
#include <optional>
#include <string>
#include <string_view>

#include "daemon/core/config/options/config.h"
#include "estimator/method/slip_curve_estimator.h"

namespace beltgrip::daemon {

struct StopCause {
  const char* what = nullptr;  // a literal; nullptr: no more is known than the reason says
  double figure = std::numeric_limits<double>::quiet_NaN();  // no number: there is none
  double limit = std::numeric_limits<double>::quiet_NaN();
  const char* unit = "";  // a literal, of both
  std::optional<Role> role = std::nullopt;
  // A third figure, said after the limit.
  const char* further = nullptr;
  double further_figure = std::numeric_limits<double>::quiet_NaN();
  const char* further_unit = "";
};

struct Stop {
  estimator::StopReason reason = estimator::StopReason::kNone;
  StopCause cause;
  explicit operator bool() const noexcept { return reason != estimator::StopReason::kNone; }
};

// As in BeltGrip's frames, the journal, the history, `status` and `replay`.
std::string_view stop_reason_name(estimator::StopReason reason);

// What the reason alone says; empty of kNone.
std::string_view stop_reason_words(estimator::StopReason reason);

// "secondary_pressure: stands still 0.21 s, limit 0.15 s". Never empty but with reason kNone.
// Allocates: not on the real-time thread.
std::string cause_text(estimator::StopReason reason, const StopCause& cause);

}  // namespace beltgrip::daemon
