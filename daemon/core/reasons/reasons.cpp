#include "daemon/core/reasons/reasons.h"

#include <algorithm>
#include <array>
#include <utility>

#include "can_dbc/text/format.h"
#include "estimator/method/possible_friction.h"
#include "estimator/physics/units.h"

namespace beltgrip::daemon {

namespace {

using estimator::ReadingVerdict;
using estimator::StopReason;

struct InhibitRow {
  Inhibit value;
  Words words;
};
constexpr std::array<InhibitRow, kInhibitCount> kInhibitWords{{
    {Inhibit::kInputs,
     {"a signal of a role is not there, too old, or out of range; or the belt cannot be read: its "
      "torque is near zero or turns round, its ratio moves",
      "nothing where it comes and goes with the pedals; else `beltgrip status can0` shows each "
      "role "
      "with its age; is the right interface, DBC and message named?"}},
    {Inhibit::kFault, {"a fault that forbids requests", "mend the fault"}},
    {Inhibit::kPermission,
     {"`experiment_permitted` is 0", "the controller withholds it; ask it why"}},
    {Inhibit::kPedal,
     {"`coast_down` and the accelerator is pressed",
      "lift the foot; for drive torque `trigger = \"steady\"`"}},
    {Inhibit::kBrake, {"the brake is pressed", "coast without braking"}},
    {Inhibit::kLockup,
     {"the lock-up clutch is open: the engine's torque is not the belt's",
      "warm up, drive faster; is the flag read the right way round (`true_when`)?"}},
    {Inhibit::kRatio,
     {"the speed ratio is not at an end stop",
      "`ratio_low` and `ratio_overdrive`: `beltgrip calibrate` finds them; are the two speeds "
      "swapped?"}},
    {Inhibit::kTorque,
     {"the torque on the belt lies outside its window",
      "coast at another speed; check sign and unit of the torque"}},
    {Inhibit::kSpeed,
     {"the primary shaft turns more slowly than `primary_speed_min_rad_s`",
      "begin at a higher speed"}},
    {Inhibit::kOil, {"the oil is colder than `oil_temperature_min_degC`", "warm up"}},
    {Inhibit::kCooldown,
     {"too little time or distance since the last request", "wait: `cooldown_s`, `cooldown_m`"}},
    {Inhibit::kUnreachable,
     {"the floor of the clamping force lies above the force of the peak",
      "more torque, a lower pressure floor, a lower speed in overdrive; else a lower bound is all "
      "there is"}},
    {Inhibit::kRamp,
     {"the belt cannot cross its peak and be caught inside the slip limits, at the steepest fall "
      "behind it that must be survived (`fall_max_per_percent`) or if something fails at the worst "
      "instant",
      "a faster actuator, less torque, more reserve in the own force; a smaller "
      "`fall_max_per_percent` if the belt is known"}},
    {Inhibit::kTime,
     {"the ramp would last longer than the coast-down or 15 s",
      "a higher `ramp_rate_max_N_per_s`, a flatter road"}},
    {Inhibit::kGrip,
     {"the belt slips under the controller's own force by much of the way to its peak: friction "
      "has fallen",
      "have the belt looked at; the controller's force is too low for it"}},
    {Inhibit::kForce,
     {"the controller's own clamping force is still moving", "wait until it is steady"}},
    {Inhibit::kQuiet,
     {"neither the primary's nor the engine's speed moves often enough that one standing still "
      "would show within 0.6 s",
      "add the role `engine_speed`; take the raw signal with its finest step; a coast-down instead "
      "of steady driving"}},
    {Inhibit::kWait,
     {"at a lower speed there is more room to cross the peak; it begins by itself, while there "
      "is time left for it",
      "nothing"}},
    {Inhibit::kModel,
     {"a quantity lies outside the box in which a term of the model file was learned "
      "(`[learned.NAME]`)",
      "drive inside the box; let `beltgrip diagnose` learn from drives that reach further; or "
      "leave "
      "`[estimator] model` out"}},
}};

struct FaultRow {
  Fault value;
  Words words;
};
constexpr std::array<FaultRow, kFaultCount> kFaultWords{{
    {Fault::kInputMissing,
     {"a required signal has never come",
      "interface, DBC, message; `beltgrip status` names the role"}},
    {Fault::kInputStale,
     {"it came and has stopped",
      "`beltgrip status` names the role; `period_ms` of a role that comes seldom"}},
    {Fault::kInputFrozen,
     {"a value stands still where a live one moves, or takes a course that cannot be",
      "sensor, gateway"}},
    {Fault::kInputRange,
     {"out of the DBC's range, \"not available\", or a spike", "the DBC's range; the sensor"}},
    {Fault::kInputNotFinite, {"a float signal is no number", "the sender"}},
    {Fault::kInputFrame, {"a frame of wrong length or kind", "another version of the DBC?"}},
    {Fault::kTimeStamp, {"a time stamp went backwards", "the adapter's driver"}},
    {Fault::kFramesLost,
     {"the kernel dropped frames", "the machine is too busy; run as the service does"}},
    {Fault::kSampleLate,
     {"a sample was taken late", "the machine is too busy; run as the service does"}},
    {Fault::kBusPassive,
     {"the CAN controller is error passive", "wiring, bit rate, `beltgrip can status can0`"}},
    {Fault::kBusOff,
     {"the CAN controller is bus-off", "wiring, bit rate, `beltgrip can status can0`"}},
    {Fault::kBusDown,
     {"the CAN interface is down or gone", "wiring, bit rate, `beltgrip can status can0`"}},
    {Fault::kForeignSender,
     {"another node sends with BeltGrip's identifiers",
      "a second daemon, or a log that is being played"}},
    {Fault::kSendFailed, {"a frame could not be sent", "a full bus"}},
    {Fault::kFrameRefused,
     {"the transmit gate stopped a frame of our own", "a defect of BeltGrip: please report it"}},
    {Fault::kResultDoubtful,
     {"the last result contradicts the ones before, or itself; or the belt slipped with less "
      "friction than was known, here or in the other direction or end stop",
      "repeat; the lower value counts until this one is measured, after a restart too"}},
    {Fault::kHistoryUnwritten,
     {"the history of experiments cannot be read or written", "disk, rights of the state folder"}},
    {Fault::kInputRate,
     {"a message comes too often or too seldom", "a second sender? the cycle time in the DBC?"}},
    {Fault::kInputProtection,
     {"wrong counter or CRC", "`[protection]`: data id, profile, signals"}},
    {Fault::kClampStuck,
     {"after a request the clamping force did not come back",
      "the controller does not keep its contract; where the force stays at what was asked, a "
      "restart is needed"}},
}};

// What each means alone stands with its name (daemon/core/input/stop_cause.h).
struct StopRow {
  StopReason value;
  std::string_view remedy;
};
constexpr std::array<StopRow, estimator::kStopReasonCount> kStopRemedies{{
    {StopReason::kNone, "hold the conditions for longer"},  // without a bound
    {StopReason::kSlope,
     "no value all the same: its points lie on no one curve, or what they say is no belt's; see "
     "`reason`"},
    {StopReason::kConfidence, ""},
    {StopReason::kSlip, "a late peak; or friction has fallen, see `grip`"},
    {StopReason::kSlipRate,
     "friction falls steeply behind its peak, or the force answers late: `actuator_lag_s`"},
    {StopReason::kSlipEnergy, "lower torque or speed, a late peak"},
    {StopReason::kTime, "a higher `ramp_rate_max_N_per_s`"},
    {StopReason::kForceFloor, "more torque, a lower floor, a lower speed"},
    {StopReason::kEngineSpeed, "begin at a higher speed; is the lock-up closed?"},
    {StopReason::kTorque, "steadier driving"},
    {StopReason::kRatio, "is a speed or the torque's sign wrong, or the ratio off its stop?"},
    {StopReason::kInputs, "the role stands in `reason`; `beltgrip status`"},
    {StopReason::kPermission, "ask the controller why"},
    {StopReason::kDriver, ""},
    {StopReason::kBus, "`beltgrip can status can0`; a foreign sender of 0x6A0 to 0x6A3?"},
    {StopReason::kShutdown, ""},
    {StopReason::kTraceEnd, ""},
    {StopReason::kClampNotFollowed,
     "`actuator_dead_time_s` and `actuator_lag_s`; piston area, spring and centrifugal term; does "
     "the controller obey?"},
    {StopReason::kInputFrozen, "the role stands in `reason`: sensor, gateway"},
    {StopReason::kRoom, "a late peak: lower speed"},
    {StopReason::kLag,
     "measure `actuator_lag_s` at the coldest permitted oil; a quieter pressure, a faster ramp"},
}};

// With a bound the data are good: what lacks is the way to the top.
constexpr Words kEndedBeforeTheTop{
    "it ended before friction came to its top: the clamping force was not lowered far enough",
    "lower the clamping force further before the experiment ends"};
constexpr std::string_view kBoundAtTheTop =
    "a value needs more data, or less noise, around the peak: lower the clamping force more slowly "
    "there";

// Each row at its value's place.
constexpr bool in_order(const auto& rows) {
  for (std::size_t i = 0; i < rows.size(); ++i) {
    if (static_cast<std::size_t>(rows[i].value) != i) return false;
  }
  return true;
}
static_assert(in_order(kInhibitWords) && in_order(kFaultWords) && in_order(kStopRemedies));

// What reads the friction too high or too low, the likeliest first.
std::string why_impossible(double mu) {
  const bool high = mu > estimator::kBeltMost;
  return format("a friction of %.3g is %s than any metal belt has (%.2f to %.2f): ", mu,
                high ? "higher" : "lower", estimator::kBeltLeast, estimator::kBeltMost) +
         (high
              ? "piston area or spring force too small, centrifugal term left out, radius too "
                "small, pressure or torque unit?"
              : "piston area or spring force too large, inertia or sign of the torque, pressure or "
                "torque unit?");
}

std::string why_beyond(const ExperimentResult& result) {
  const double share = static_cast<double>(result.beyond.samples) /
                       static_cast<double>(std::max(result.samples, result.beyond.samples));
  return beyond_text(result.beyond) +
         format(", in %.0f %% of the experiment", estimator::kPercent * share);
}

}  // namespace

const Words& words_of(Inhibit inhibit) {
  return kInhibitWords.at(static_cast<std::size_t>(inhibit)).words;
}
const Words& words_of(Fault fault) { return kFaultWords.at(static_cast<std::size_t>(fault)).words; }
Words words_of(StopReason reason, bool bound) {
  const std::string_view remedy = kStopRemedies.at(static_cast<std::size_t>(reason)).remedy;
  if (reason == StopReason::kNone) {
    return bound ? kEndedBeforeTheTop : Words{"the trigger ended the experiment", remedy};
  }
  const bool at_the_top = bound && reason == StopReason::kSlope;
  return {stop_reason_words(reason), at_the_top ? kBoundAtTheTop : remedy};
}

Reason reason_of(Inhibit inhibit, std::string figure) {
  const Words& words = words_of(inhibit);
  return {std::string(kInhibits[static_cast<std::size_t>(inhibit)].name), std::string(words.means),
          std::move(figure), std::string(words.remedy)};
}
Reason reason_of(Fault fault, std::string figure) {
  const Words& words = words_of(fault);
  return {std::string(kFaults[static_cast<std::size_t>(fault)].name), std::string(words.means),
          std::move(figure), std::string(words.remedy)};
}

std::string reason_text(const Reason& reason) {
  std::string text = reason.name;
  if (!reason.figure.empty()) text += " (" + reason.figure + ")";
  text += ": " + reason.means;
  return reason.remedy.empty() ? text : text + "; to do: " + reason.remedy;
}

bool has_bound(const ExperimentResult& result) {
  return result.outcome == Outcome::kInconclusive &&
         result.peak.kind == estimator::PeakKind::kLowerBound && result.peak.mu_max > 0.0;
}

namespace {

// The channel whose reading is as this verdict says, and since when; empty: none is.
std::string reading_that(ReadingVerdict verdict, const char* does, const ExperimentResult& result) {
  for (std::size_t i = 0; i < result.peak.readings.size(); ++i) {
    const estimator::ReadingStatus& reading = result.peak.readings[i];
    if (reading.verdict != verdict) continue;
    const Duration after = MonoTime::of_ns(reading.since_ns) - result.start;
    return std::string(estimator::kChannels[i]) + " " + does +
           format(", %.2f s after the experiment began", seconds(after));
  }
  return "";
}

}  // namespace

std::string why_no_value(const ExperimentResult& result, const std::string& lost) {
  if (result.peak.impossible) return why_impossible(result.peak.mu_refused);
  if (result.peak.contradictory) {
    const std::string stepped =
        reading_that(ReadingVerdict::kStepped, "went to another level by itself", result);
    if (!stepped.empty()) return "its points lie on no one friction curve: " + stepped;
    return "its points lie on no one friction curve; is the piston area, the spring or the "
           "centrifugal term wrong?";
  }
  if (result.beyond) return why_beyond(result);
  switch (result.stop_reason) {
    case StopReason::kRatio:
      return "speeds and torque do not fit the ratio at the end stop; is a speed or the sign of "
             "the torque wrong, or the ratio off its stop?";
    case StopReason::kInputs:
      if (result.outcome == Outcome::kAborted && !lost.empty()) return lost + " was lost";
      {
        const std::string still = reading_that(ReadingVerdict::kFrozen, "stood still", result);
        return still.empty() ? "an input was lost, stood still, or read what cannot be" : still;
      }
    case StopReason::kTorque:
      return "the torque went to zero or changed its sign";
    default:
      return result.outcome == Outcome::kAborted
                 ? "the experiment was broken off"
                 : "too short, or too little torque or clamp force, or an input that stood still";
  }
}

std::string why(const ExperimentResult& result, const std::string& lost) {
  std::string cause = cause_text(result.stop_reason, result.cause);
  const bool bound = has_bound(result);
  if (cause.empty() && bound) return std::string(words_of(result.stop_reason, bound).means);
  if (cause.empty()) return why_no_value(result, lost);
  const bool known = result.outcome == Outcome::kCompleted || bound;
  if (known || result.outcome == Outcome::kAborted) return cause;
  return why_no_value(result, lost) + " (" + cause + ")";
}

std::string_view remedy_of(const ExperimentResult& result) {
  if (result.outcome == Outcome::kNone || result.outcome == Outcome::kCompleted) return {};
  if (result.peak.contradictory || result.peak.impossible) return {};  // why_no_value() asks for it
  return result.beyond ? words_of(Inhibit::kModel).remedy
                       : words_of(result.stop_reason, has_bound(result)).remedy;
}

}  // namespace beltgrip::daemon
