#include "daemon/core/input/stop_cause.h"

#include <array>
#include <cmath>
#include <string_view>

#include "can_dbc/text/number_text.h"
#include "daemon/core/base/named.h"

namespace beltgrip::daemon {

using estimator::StopReason;

namespace {

struct ReasonRow {
  StopReason value;  // wire value
  std::string_view name;
  std::string_view words;  // what the reason alone says
};
constexpr std::array<ReasonRow, estimator::kStopReasonCount> kReasons{
    {{StopReason::kNone, "None", ""},
     {StopReason::kSlope, "Slope", "friction no longer rises with slip"},
     {StopReason::kConfidence, "Confidence", "mu_max is known well enough"},
     {StopReason::kSlip, "Slip", "more slip than allowed, in all or beyond the largest friction"},
     {StopReason::kSlipRate, "SlipRate",
      "slip grew faster than the ramp held it, and friction did not rise"},
     {StopReason::kSlipEnergy, "SlipEnergy",
      "more energy, power or time of fast slip than allowed since friction rose last"},
     {StopReason::kTime, "Time",
      "the request stood for its longest time, or no time was left for it"},
     {StopReason::kForceFloor, "ForceFloor", "the force came to its floor before the peak"},
     {StopReason::kEngineSpeed, "EngineSpeed",
      "the shaft came too near its least speed, or the engine left the primary shaft"},
     {StopReason::kTorque, "Torque",
      "the torque went to zero, changed its sign, moved or left its band"},
     {StopReason::kRatio, "Ratio", "speeds and torque do not fit the ratio at the end stop"},
     {StopReason::kInputs, "Inputs", "an input was lost, or read what cannot be"},
     {StopReason::kPermission, "Permission", "permission withdrawn"},
     {StopReason::kDriver, "Driver", "the driver pressed a pedal"},
     {StopReason::kBus, "Bus", "the CAN bus or BeltGrip's own frames failed"},
     {StopReason::kShutdown, "Shutdown", "the program was stopped"},
     {StopReason::kTraceEnd, "TraceEnd", "the log ended"},
     {StopReason::kClampNotFollowed, "ClampNotFollowed",
      "the clamping force does not follow the request"},
     {StopReason::kInputFrozen, "InputFrozen", "an input stands still where a live one moves"},
     {StopReason::kRoom, "Room", "the slip that is left is too little for the worst case"},
     {StopReason::kLag, "Lag",
      "the clamping force answers later than configured, or did not show that it does not"}}};
static_assert(in_wire_order(kReasons));

const ReasonRow& row_of(StopReason reason) { return kReasons.at(static_cast<std::size_t>(reason)); }

}  // namespace

std::string_view stop_reason_name(StopReason reason) { return row_of(reason).name; }

std::string_view stop_reason_words(StopReason reason) { return row_of(reason).words; }

std::string cause_text(StopReason reason, const StopCause& cause) {
  std::string text;
  if (cause.role) text = std::string(role_name(*cause.role)) + ": ";
  text += cause.what != nullptr ? std::string_view(cause.what) : row_of(reason).words;
  const std::string unit = *cause.unit == '\0' ? "" : std::string(" ") + cause.unit;
  if (std::isfinite(cause.figure)) text += " " + rounded_text(cause.figure) + unit;
  if (std::isfinite(cause.limit)) text += ", limit " + rounded_text(cause.limit) + unit;
  if (cause.further != nullptr && std::isfinite(cause.further_figure)) {
    text += std::string(", ") + cause.further + " " + rounded_text(cause.further_figure) + " " +
            cause.further_unit;
  }
  return text;
}

}  // namespace beltgrip::daemon
